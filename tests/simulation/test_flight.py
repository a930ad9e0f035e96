"""The geometry of the flight: overlaps, scale, directions."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.simulation import simulate
from aerotri.simulation.camera_spec import CameraSpec
from aerotri.simulation.cameras import block_camera
from aerotri.simulation.flight import flying_height, plan_flight
from aerotri.simulation.presets import PRESETS
from aerotri.simulation.spec import FlightSpec

AXES = {"+x": (1.0, 0.0), "-x": (-1.0, 0.0), "+y": (0.0, 1.0), "-y": (0.0, -1.0)}


def camera(preset, **changes):
    return block_camera(preset, CameraSpec.model_validate({"preset": preset, **changes}))


def fly(cam, *, ground=0.0, **keys):
    return plan_flight(FlightSpec.model_validate(keys), [cam], ground, np.random.default_rng(1))


def footprint_polygon(cam, centre, kappa):
    """Corners on the ground of a vertical photograph, h = Z0, by plane geometry."""
    half = np.array(cam.half_format_mm) * centre[2] / cam.focal_length_mm
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    turn = np.array([[np.cos(kappa), -np.sin(kappa)], [np.sin(kappa), np.cos(kappa)]])
    return centre[:2] + corners @ turn.T


def shared_length(a, b, direction):
    """Length that two sets of corners share along a direction, and the length of the first."""
    p, q = a @ direction, b @ direction
    return min(p.max(), q.max()) - max(p.min(), q.min()), np.ptp(p)


@pytest.mark.parametrize("heading", [0.0, 37.0, 90.0, 200.0])
@pytest.mark.parametrize("preset", list(PRESETS))
def test_end_lap_and_side_lap_are_reached(preset, heading):
    cam = camera(preset)
    flown, _ = fly(cam, gsd_m=0.1, strips=3, images_per_strip=4, end_lap=0.8, side_lap=0.35, heading_deg=heading)
    h = np.radians(heading)
    along, across = np.array([np.sin(h), np.cos(h)]), np.array([np.cos(h), -np.sin(h)])
    ground = [footprint_polygon(cam, c, k) for c, k in zip(flown.centre, flown.angles[:, 2], strict=True)]
    for i in (0, 1, 2, 4, 5):
        shared, length = shared_length(ground[i], ground[i + 1], along)
        assert shared / length == pytest.approx(0.8, rel=0.01)
    shared, width = shared_length(ground[0], ground[7], across)
    assert shared / width == pytest.approx(0.35, rel=0.01)


# [P] Spreckels et al. figures 16-20 as worked out in the models: base in the image and h/b
@pytest.mark.parametrize(
    ("preset", "end_lap", "base_mm", "h_over_b"),
    [
        ("ultracam_d", 0.663, 22.75, 4.46),
        ("ultracam_d", 0.495, 34.09, 2.97),
        ("ultracam_d", 0.84, 10.80, 9.39),
        ("dmc", 0.63, 34.10, 3.52),
        ("rmk_top_15", 0.61, 89.70, 1.71),
    ],
)
def test_height_base_ratio(preset, end_lap, base_mm, h_over_b):
    cam = camera(preset)
    flown, _ = fly(cam, height_m=1000.0, strips=1, images_per_strip=2, end_lap=end_lap)
    base = np.linalg.norm(flown.centre[1] - flown.centre[0])
    assert round(base * cam.focal_length_mm / 1000.0, 2) == base_mm
    assert round(1000.0 / base, 2) == h_over_b


def test_gsd_gives_the_height_and_the_height_the_gsd():
    cam = camera("ultracam_d")
    flown, _ = fly(cam, ground=252.0, gsd_m=0.09, strips=1, images_per_strip=2)
    assert flown.centre[:, 2] == pytest.approx(252.0 + 0.09 * 101.4 / 0.009)
    spec = FlightSpec.model_validate({"height_m": 1019.0, "strips": 1, "images_per_strip": 2})
    # [P] DSK-Saar: 1271 m less 252 m of ground is image scale 1 : 10046
    assert flying_height(spec, cam) / 0.1014 == pytest.approx(10046, rel=5e-4)


@pytest.mark.parametrize("axis", list(AXES))
def test_the_flight_axis_points_along_the_flight_and_strips_alternate(axis):
    cam = camera("p1", flight_axis=axis)
    flown, _ = fly(cam, gsd_m=0.05, strips=2, images_per_strip=5, heading_deg=60.0)
    rotation = rotation_from_angles(flown.angles)
    pointing = rotation @ np.array([*AXES[axis], 0.0])
    for strip, sign in (("1", 1.0), ("2", -1.0)):
        own = np.flatnonzero(flown.strip == strip)
        step = np.diff(flown.centre[own], axis=0)
        direction = step / np.linalg.norm(step, axis=1)[:, None]
        heading = sign * np.array([np.sin(np.radians(60.0)), np.cos(np.radians(60.0)), 0.0])
        np.testing.assert_allclose(direction, np.tile(heading, (4, 1)), atol=1e-12)
        np.testing.assert_allclose(pointing[own], np.tile(heading, (5, 1)), atol=1e-12)
        assert (np.diff(flown.time[own]) > 0).all()
    turned = (flown.angles[5, 2] - flown.angles[0, 2]) % (2 * np.pi)
    assert turned == pytest.approx(np.pi)


def test_without_alternation_all_strips_have_one_kappa():
    flown, _ = fly(camera("p1"), gsd_m=0.05, strips=3, images_per_strip=3, alternating=False)
    assert np.ptp(flown.angles[:, 2]) == 0.0


def test_an_area_is_covered_by_models_and_strips():
    cam = camera("ultracam_d")
    flown, frame = fly(cam, gsd_m=0.1, area_m=[4000.0, 3000.0], end_lap=0.6, side_lap=0.3, heading_deg=0.0)
    # heading north: along is Y
    assert flown.centre[:, 1].min() <= -2000.0
    assert flown.centre[:, 1].max() >= 2000.0
    assert frame.footprint == pytest.approx([750.0, 1150.0])
    reach = flown.centre[:, 0].max() + 575.0
    assert 1500.0 <= reach < 1500.0 + 805.0
    assert len(np.unique(flown.strip)) == 4


def test_cross_strips_and_days():
    flown, frame = fly(
        camera("ultracam_d"),
        gsd_m=0.1,
        strips=4,
        images_per_strip=6,
        days=2,
        cross_strips=[{"position": 0.0}, {"position": 0.5, "images": 5, "day": 1}],
    )
    own = flown.strip == "C1"
    assert np.ptp(flown.centre[own, 0]) == pytest.approx(0.0, abs=1e-9)
    assert flown.centre[own][0, 0] == pytest.approx(-frame.half_axes[0])
    # heading east: across runs south, and the photographs of the cross strip reach the outer strip axes
    assert flown.centre[own, 1].max() >= frame.half_axes[1]
    assert (np.diff(flown.centre[own, 1]) < 0).all()
    assert np.sum(flown.strip == "C2") == 5
    days = dict(zip(flown.strip.tolist(), flown.day.tolist(), strict=True))
    assert days == {"1": "1", "2": "1", "3": "2", "4": "2", "C1": "2", "C2": "1"}


def test_cameras_share_the_strips(small_spec):
    spec = small_spec(camera={"second": {"preset": "dmc"}}, flight={"strips": 4})
    block, _ = simulate(spec, 1)
    used = {strip: int(c) for strip, c in zip(block.images.strip, block.images.camera, strict=True)}
    assert used == {"1": 0, "2": 0, "3": 1, "4": 1}
    # each its own base at the same height
    assert np.sum(block.images.strip == "1") != np.sum(block.images.strip == "3")


def test_deviations_from_the_plan_have_their_sigma():
    cam = camera("ultracam_d")
    flown, frame = fly(
        cam,
        gsd_m=0.1,
        strips=20,
        images_per_strip=50,
        heading_deg=30.0,
        attitude_sigma_deg=[0.5, 1.0, 2.0],
        position_sigma_m=[10.0, 5.0, 2.0],
    )
    moved = flown.centre - flown.planned_centre
    own_axes = np.column_stack([moved[:, :2] @ frame.axes.T, moved[:, 2]])
    # χ² of 1000 values: 4.2 % is three σ
    assert own_axes.std(axis=0) == pytest.approx([10.0, 5.0, 2.0], rel=0.07)
    assert np.degrees(flown.angles[:, :2]).std(axis=0) == pytest.approx([0.5, 1.0], rel=0.07)


def test_an_unknown_camera_is_named(small_spec):
    with pytest.raises(InputError, match=r"flight\.cameras.*nobody"):
        simulate(small_spec(flight={"cameras": ["nobody"]}), 1)
