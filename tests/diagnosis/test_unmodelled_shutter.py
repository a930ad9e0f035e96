"""A rolling shutter of a camera that states none is found, and none is found where there is none."""

from dataclasses import replace

import numpy as np
import pytest

import aerotri
import wrong_blocks
from aerotri.diagnosis.unmodelled_shutter import of_unmodelled_shutter
from aerotri.observations import Prior
from aerotri.observations.rolling_shutter import RollingShutter
from aerotri.pipeline import adjust_keeping_system
from aerotri.results.unmodelled_shutter import CHANCE, SUSPECTED
from aerotri.simulation import parse_spec, simulate

WORDS = "as by a rolling shutter"
CORNERS = {"positions": [[0.05, 0.05], [0.05, 0.95], [0.95, 0.05], [0.95, 0.95], [0.5, 0.5]],
           "sigma_m": [0.02, 0.02, 0.03], "check_points": 0}  # fmt: skip


def drone(seed, readout_ms=0.0, **flight):
    """A block with GNSS of 3 cm, flown at 10 m/s, whose camera states no readout time."""
    spec = wrong_blocks.SPEC | wrong_blocks.DRONE
    camera = spec["camera"]["cam"] | {
        "rolling_shutter": {"readout_ms": readout_ms, "stated": {"value": 0.0, "fixed": True}}
    }
    changes = {
        "camera": {"cam": camera}, "control": CORNERS,
        "flight": spec["flight"] | {"speed_m_s": 10.0, "images_per_strip": 6} | flight,
        "start_values": {"kind": "perturbed", "position_sigma_m": 0.1, "angle_sigma_deg": 0.05},
    }  # fmt: skip
    block, _ = simulate(parse_spec(spec | changes), seed)
    return replace(block, cameras=tuple(replace(one, rolling_shutter=None) for one in block.cameras))


def found_in(block):
    return adjust_keeping_system(block).local.unmodelled_shutter


def without_times(block):
    """Neither times nor names of strips: only the order of the exposures."""
    gnss, images = block.gnss_ins, block.images
    gnss = replace(gnss, time=np.full(len(gnss), np.nan))
    return replace(block, gnss_ins=gnss, images=replace(images, strip=np.full(len(images), "", dtype=object)))


def test_a_rolling_shutter_is_said_with_what_to_write():
    result = aerotri.adjust(drone(2, readout_ms=15.0))
    assert result.verdict != "accepted"
    reason = next(reason for reason in result.reasons if WORDS in reason)
    assert "[camera.cam.rolling_shutter]" in reason


@pytest.mark.parametrize("change", [lambda block: block, without_times])
def test_its_way(change):
    """15 ms at 10 m/s are 0.15 m."""
    found = found_in(change(drone(3, readout_ms=15.0)))
    assert found.counts
    assert found.row_direction == "down"
    assert abs(abs(found.way_m) - 0.15) < 4.0 * found.sigma_m + 0.02
    assert found.sigma_m < 0.03
    assert found.moves_sigma > 1.0


def test_where_it_is_modelled_there_is_none_to_find():
    block = drone(2, readout_ms=15.0)
    modelled = tuple(replace(camera, rolling_shutter=RollingShutter(test="off")) for camera in block.cameras)
    result = adjust_keeping_system(replace(block, cameras=modelled)).local
    assert result.unmodelled_shutter is None
    assert not any(WORDS in reason for reason in result.outcome.reasons)


def strips_of_two(block, shutter, spoil=lambda block: block):
    """Every second strip by camera a, which states its shutter and whose image points are spoilt; the others by b."""
    camera = block.cameras[0]
    of_b = np.unique(block.images.strip, return_inverse=True)[1] % 2
    rays = block.image_points
    xy = np.where(of_b[rays.image][:, None] == 1, rays.xy, spoil(block).image_points.xy)
    cameras = (replace(camera, name="a", rolling_shutter=shutter), replace(camera, name="b"))
    images = replace(block.images, camera=of_b)
    return replace(block, cameras=cameras, images=images, image_points=replace(rays, xy=xy))


@pytest.mark.parametrize("readout", [Prior(), Prior(30.0, fixed=True)])
def test_the_shutter_of_another_camera_stays_as_it_is_stated(readout):
    """Neither tested itself, be it an unknown, nor replaced by one at the usual speed."""
    block = drone(2)
    block = replace(block, gnss_ins=replace(block.gnss_ins, time=np.full(len(block.gnss_ins), np.nan)))
    shutter = RollingShutter(readout, speed_m_s=10.0, test="off")
    found = found_in(strips_of_two(block, shutter, wrong_blocks.rolling_shutter(0.3)))
    assert found.camera == "b"
    assert found.p > CHANCE


def test_its_way_beside_a_stated_shutter():
    found = found_in(strips_of_two(drone(2, readout_ms=15.0), RollingShutter(Prior(15.0, fixed=True), test="off")))
    assert (found.camera, found.counts) == ("b", True)
    assert abs(abs(found.way_m) - 0.15) < 4.0 * found.sigma_m


def test_cameras_without_one():
    """Probabilities are spread evenly between 0 and 1."""
    p = np.array([found_in(drone(seed)).p for seed in range(10, 18)])
    assert 0.1 < np.median(p) < 0.9
    assert p.min() > CHANCE


def test_an_affinity_that_explains_it_as_well_is_said():
    local = adjust_keeping_system(drone(2)).local
    found = replace(local.unmodelled_shutter, p=1e-9, moves_sigma=2.0)
    for p_beside, said in ((0.5, True), (float("nan"), True), (1e-6, False)):
        one = replace(local, unmodelled_shutter=replace(found, p_beside=p_beside))
        assert ("affinity" in of_unmodelled_shutter(one)[0].reason) == said


def test_what_may_be_chance_is_told_without_a_doubt():
    local = adjust_keeping_system(drone(2)).local
    found = replace(local.unmodelled_shutter, p=0.5 * (CHANCE + SUSPECTED), moves_sigma=2.0)
    said = of_unmodelled_shutter(replace(local, unmodelled_shutter=found))
    assert [(one.level, one.grade) for one in said] == [("attention", "accepted")]


def test_another_direction_of_the_rows_is_told():
    local = adjust_keeping_system(drone(2)).local
    found = replace(local.unmodelled_shutter, p=1e-9, moves_sigma=2.0)
    for direction, words in (
        ("right", 'rolling_shutter] with row_direction = "right" in'),
        ("down", "shutter] in block"),
    ):
        one = replace(local, unmodelled_shutter=replace(found, row_direction=direction))
        assert words in of_unmodelled_shutter(one)[0].reason


def test_film_has_none():
    block = drone(2)
    marks = {"1": (-6.0, 0.0), "2": (6.0, 0.0)}
    assert found_in(replace(block, cameras=tuple(replace(one, fiducials=marks) for one in block.cameras))) is None


@pytest.mark.parametrize("datum", ["minimal", "inner"])
def test_gross_errors_of_the_points_that_hold_the_datum(datum):
    """These keep their rays: without them the test would have no datum."""
    block = drone(2)
    nothing = np.full((len(block.gnss_ins), 3), np.nan)
    block = replace(block, gnss_ins=replace(block.gnss_ins, xyz=nothing, sigma=nothing))
    adjustment = replace(block.settings.adjustment, datum=datum, datum_fixed=())
    block = replace(block, settings=replace(block.settings, adjustment=adjustment))
    unknowns = adjust_keeping_system(block).system.unknowns
    held = unknowns.points[unknowns.point_held.any(axis=1)]
    wrong = np.isin(block.image_points.point, held)
    xy = block.image_points.xy.copy()
    xy[wrong] += np.random.default_rng(1).normal(0.0, 0.03, (wrong.sum(), 2))
    found = found_in(replace(block, image_points=replace(block.image_points, xy=xy)))
    assert found is not None
