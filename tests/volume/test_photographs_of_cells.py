"""Which photographs a place of a surface is taken to be measured in: near ones with a base between them."""

from types import SimpleNamespace

import numpy as np
import pytest

from aerotri.deformation.orientation import Orientation
from aerotri.pipeline import adjust_keeping_system
from aerotri.volume import pickets as module
from aerotri.volume.pickets import height_cofactors, pickets_where_seen
from rig_blocks import NADIR, rig_block

HEIGHT, TILT = 100.0, 20.0
SIGMA_MM = 0.005


def turned(degrees):
    """(3, 3) of a camera that looks ahead, along Y."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


@pytest.fixture
def oriented(monkeypatch):
    """Makes a calibration of photographs with centres (n, 3) and tilts (n,) degrees, of one camera."""

    def make(centre, tilt, focal_mm=35.0):
        centre = np.array(centre, float)
        n = len(centre)
        rotation = np.stack([turned(one) for one in tilt])
        interior = np.tile([focal_mm, 0.0, 0.0], (n, 1))
        found = Orientation(centre, rotation, interior)
        monkeypatch.setattr(module, "calibrated_orientation", lambda _: found)
        images = SimpleNamespace(camera=np.zeros(n, int))
        block = SimpleNamespace(cameras=[SimpleNamespace(half_format_mm=(18.0, 12.0))], images=images)
        return SimpleNamespace(frame=None, local=SimpleNamespace(block=block))

    return make


def heads(stations):
    """Of a nadir head and one that is tilted, 5 cm ahead, at stations along Y."""
    return [place for y in stations for place in ((0.0, y, HEIGHT), (0.0, y + 0.05, HEIGHT + 0.02))]


def test_two_heads_of_one_station_are_no_pair(oriented):
    calibration = oriented(heads([0.0, 40.0]), [0.0, TILT] * 2)
    place = np.array([[0.0, 15.0, 0.0]])
    pickets, seen = pickets_where_seen(calibration, place, SIGMA_MM)
    assert seen.all()
    assert pickets.image.tolist() == [1, 2]
    # the normal case of photogrammetry: σZ = σ·h²/(c·b), b half of the height here
    expected = np.sqrt(2.0) * SIGMA_MM * HEIGHT**2 / (35.0 * 40.0)
    assert 0.5 < np.sqrt(height_cofactors(calibration, pickets)[0]) / expected < 2.0


def test_a_place_seen_from_one_station_only_is_not_seen(oriented):
    for apart in (0.05, 0.0):
        centres = [(0.0, 0.0, HEIGHT), (0.0, apart, HEIGHT)]
        calibration = oriented(centres, [0.0, TILT])
        for per_point in (2, np.array([3])):
            pickets, seen = pickets_where_seen(calibration, np.array([[0.0, 15.0, 0.0]]), SIGMA_MM, per_point)
            assert not seen.any()
            assert len(pickets) == 0


def test_photographs_of_a_hovering_drone_count_beside_one_from_elsewhere(oriented):
    """Nine photographs where it hovered, and one from 30 m further on: it is the second, however many are wanted."""
    centres = [(0.0, 0.01 * k, HEIGHT) for k in range(9)] + [(0.0, 30.0, HEIGHT)]
    calibration = oriented(centres, [0.0] * 10)
    place = np.array([[0.0, -0.5, 0.0]] * 3)
    pickets, seen = pickets_where_seen(calibration, place, SIGMA_MM, np.array([2, 4, 8]))
    assert seen.all()
    assert [pickets.image[a:b].tolist() for a, b in zip(pickets.start[:-1], pickets.start[1:], strict=True)] == [
        [0, 9], [0, 9, 1, 2], [0, 9, 1, 2, 3, 4, 5, 6],
    ]  # fmt: skip


def test_a_narrow_lens_keeps_the_pair_of_the_largest_angle(oriented):
    """No two photographs see a place at 3°: the farthest that sees it is taken."""
    apart = HEIGHT * np.tan(np.radians(1.0))
    calibration = oriented([(0.0, k * apart, HEIGHT) for k in range(3)], [0.0] * 3, focal_mm=300.0)
    pickets, seen = pickets_where_seen(calibration, np.array([[0.0, 0.9 * apart, 0.0]]), SIGMA_MM)
    assert seen.all()
    assert pickets.image.tolist() == [1, 0]
    # the next to it is 1° away, as the one that is taken; two strides apart it is 2° and wins
    pickets, _ = pickets_where_seen(calibration, np.array([[0.0, 0.2 * apart, 0.0]]), SIGMA_MM)
    assert pickets.image.tolist() == [0, 2]


def test_heights_of_a_block_with_a_rig_have_a_base():
    """A second head beside the nadir camera, tilted a little: σ of heights by two rays is that of the strip's base."""
    head = {"position_m": [0.0, 0.06, 0.03], "rotation_deg": [15.0, 0.8, 0.5]}
    changes = {"camera": {"nadir": NADIR, "fore": NADIR}, "rig": {"camera": {"fore": head}}}
    calibration = adjust_keeping_system(rig_block(1, cameras=("fore",), **changes)[0])
    places = calibration.result.points.xyz[calibration.local.points.rays >= 5]
    pickets, seen = pickets_where_seen(calibration, places, SIGMA_MM)
    assert seen.mean() > 0.95
    # h = 0.1 m · 25 mm / 4 µm, base 0.3 of a format at least
    height, base = 0.1 * 25.0 / 0.004, 0.3 * 0.1 * 4000
    expected = np.sqrt(2.0) * SIGMA_MM * height**2 / (25.0 * base)
    assert np.median(np.sqrt(height_cofactors(calibration, pickets))) < 1.5 * expected
