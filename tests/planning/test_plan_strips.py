"""Strips over an area: rays, overlaps and GSD against an independent computation."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from aerotri.conventions import InputError
from aerotri.planning.cameras import camera_of_plan
from aerotri.planning.flight import plan_strips
from aerotri.planning.ground import level_ground
from aerotri.planning.options import PlanOptions
from planned_flights import FIELD, area_of, hill

SIZE, FOCAL = np.array([8192, 5460]) * 4.4e-3, 35.0


def footprints(flight):
    """For each exposure the function whether it sees places: plain similar triangles, without rotation matrices."""
    for (x, y, z), heading in zip(flight.centre, flight.heading, strict=True):
        ahead = np.array([np.sin(heading), np.cos(heading)])
        aside = np.array([np.cos(heading), -np.sin(heading)])

        def sees(places, at=(x, y), above=z, ahead=ahead, aside=aside):
            d, depth = places[:, :2] - at, above - places[:, 2]
            along, across = FOCAL * (d @ ahead) / depth, FOCAL * (d @ aside) / depth
            # the axis +y of this camera, 5460 pixels, points along the flight
            return (np.abs(along) <= SIZE[1] / 2) & (np.abs(across) <= SIZE[0] / 2)

        yield sees


@pytest.mark.parametrize("mode", ["constant", "follow"])
@pytest.mark.parametrize("ground", [level_ground(100.0), hill()], ids=["plain", "hill"])
@pytest.mark.parametrize("direction", [None, 20.0, 90.0])
def test_every_place_is_seen(mode, ground, direction):
    options = PlanOptions(gsd=0.012, height_mode=mode, rays=4, direction=direction)
    area = area_of()
    flight, seen = plan_strips(area, ground, camera_of_plan("p1", False), options)
    rng = np.random.default_rng(1)
    xy = rng.uniform([0, 0], [160, 150], size=(4000, 2))
    places = ground.on(xy[shapely.contains_xy(area.polygon, xy[:, 0], xy[:, 1])])
    count = np.sum([sees(places) for sees in footprints(flight)], axis=0)
    assert count.min() >= 4
    assert seen.rays.min() >= 4


@pytest.mark.parametrize("mode", ["constant", "follow"])
def test_overlaps_hold_on_the_hill(mode):
    options = PlanOptions(gsd=0.012, height_mode=mode, forward_overlap=0.75, side_overlap=0.55)
    ground = hill()
    camera = camera_of_plan("p1", False)
    flight, seen = plan_strips(area_of(), ground, camera, options)
    assert seen.forward >= 0.75 - 1e-9
    assert seen.side >= 0.55 - 1e-9
    places = ground.on(area_of().cells(3000))
    for own in flight.strips:
        base = np.linalg.norm(flight.centre[own[1]] - flight.centre[own[0]])
        ahead = np.array([np.sin(flight.heading[own[0]]), np.cos(flight.heading[own[0]])])
        aside = (places[:, :2] - flight.centre[own[0], :2]) @ np.array([ahead[1], -ahead[0]])
        depth = flight.centre[own[0], 2] - places[:, 2]
        below = np.abs(aside) <= SIZE[0] / 2 / FOCAL * depth
        length = SIZE[1] / FOCAL * depth[below].min()
        assert 1.0 - base / length >= 0.75 - 1e-9


def test_follow_keeps_gsd_nearer_than_constant():
    ramp = hill(40.0)
    spans = []
    for mode in ("constant", "follow"):
        options = PlanOptions(gsd=0.02, height_mode=mode, direction=0.0)
        low, high = plan_strips(area_of(), ramp, camera_of_plan("p1", False), options)[1].gsd
        spans.append(high - low)
    level = plan_strips(area_of(), level_ground(5.0), camera_of_plan("p1", False), PlanOptions(gsd=0.02))[1]
    assert level.gsd == pytest.approx((0.02, 0.02))
    assert spans[0] > 0.0
    assert spans[1] < 1.3 * spans[0]


def test_direction_is_along_the_longest_side():
    area = area_of("POLYGON ((0 0, 300 300, 260 340, -40 40, 0 0))")
    flight, _ = plan_strips(area, level_ground(0.0), camera_of_plan("p1", False), PlanOptions(gsd=0.02))
    assert np.degrees(flight.axis) == pytest.approx(45.0)


def test_cross_strips_cross():
    options = PlanOptions(gsd=0.02, cross_strips=2)
    flight, _ = plan_strips(area_of(), level_ground(100.0), camera_of_plan("p1", False), options)
    turned = np.degrees(flight.heading[flight.is_cross] - flight.axis) % 180.0
    assert turned == pytest.approx(np.full(len(turned), 90.0))
    assert set(flight.strip[flight.is_cross].tolist()) == {"C1", "C2"}
    for own in flight.strips:
        steps = np.diff(flight.centre[own, :2], axis=0)
        flown = np.arctan2(steps[:, 0], steps[:, 1])
        assert np.cos(flown - flight.heading[own[0]]) == pytest.approx(np.ones(len(flown)))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"gsd": 0.0}, "gsd"), ({"gsd": -1.0}, "gsd"), ({"gsd": float("nan")}, "gsd"),
        ({"forward_overlap": 0.99}, "forward overlap"), ({"side_overlap": -0.1}, "side overlap"),
        ({"height_mode": "high"}, "height mode"), ({"rays": 1}, "height"), ({"speed": 0.0}, "speed"),
        ({"gsd": 1e-5}, "photographs, more than"), ({"most_photographs": 10}, "photographs, more than"),
        ({"rays": 30, "forward_overlap": 0.3, "side_overlap": 0.1}, "30 are asked for"),
        ({"self_calibration": "auto"}, "auto"),
    ],
)  # fmt: skip
def test_what_is_not_possible_is_refused(changed, message):
    from planned_flights import planned

    with pytest.raises(InputError, match=message):
        planned(PlanOptions(**{"gsd": 0.02, **changed}), text=FIELD)


def test_high_ground_is_refused():
    with pytest.raises(InputError, match="ground rises"):
        plan_strips(area_of(), hill(200.0), camera_of_plan("p1", False), PlanOptions(gsd=0.012))
