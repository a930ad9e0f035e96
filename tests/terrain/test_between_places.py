"""What is known at some places: spread in plan, linear between them, also where all lie on one line."""

from types import SimpleNamespace

import numpy as np
import pytest

from aerotri.rasters.between_places import between_places, lattice_of, spread_places
from aerotri.terrain import adjustment_part
from aerotri.terrain.adjustment_part import MOST_PLACES, adjustment_variances

EAST, NORTH = 500000.0, 5.4e6


def linear(xy):
    """(n, 2) values that are linear in plan."""
    x, y = xy[:, 0] - EAST, xy[:, 1] - NORTH
    return np.column_stack([2.0 + 0.1 * x - 0.3 * y, 5.0 - 0.2 * x])


def around(points):
    return np.array(points, float) + (EAST, NORTH)


def test_values_are_linear_between_places_and_of_the_nearest_beyond():
    places = around([[0, 0], [10, 0], [0, 10], [10, 10], [5, 4]])
    inside = around(np.random.default_rng(1).uniform(0.0, 10.0, (50, 2)))
    np.testing.assert_allclose(between_places(places, linear(places), inside), linear(inside), atol=1e-8)
    beyond = between_places(places, linear(places), around([[30, 11]]))
    np.testing.assert_array_equal(beyond, linear(places)[3:4])


@pytest.mark.parametrize("direction", [(0.0, 1.0), (1.0, 0.0), (0.6, -0.8)])
@pytest.mark.parametrize("count", [2, 3, 40])
def test_values_are_linear_along_a_line_of_places(direction, count):
    places = around(np.linspace(0.0, 60.0, count)[:, None] * direction)
    place = np.array([0.0, 13.0, 44.5, 60.0])
    # off the line by a metre: as at the foot of the perpendicular
    at = around(place[:, None] * direction + np.array([-direction[1], direction[0]]))
    found = between_places(places, linear(places), at)
    np.testing.assert_allclose(found, linear(around(place[:, None] * direction)), atol=1e-8)
    far = between_places(places, linear(places), around(100.0 * np.array([direction])))
    np.testing.assert_allclose(far, linear(places)[-1:], atol=1e-8)


def test_one_place_tells_all():
    places = around([[3, 4]])
    np.testing.assert_array_equal(between_places(places, np.array([7.0]), around([[0, 0], [50, 1]])), 7.0)


@pytest.mark.parametrize("size", [(500, 500), (20, 500), (300, 1000), (400, 750), (640, 480), (1, 5000), (5000, 1)])
def test_places_of_a_grid_are_spread_over_it(size):
    columns, rows = size
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2) * 2.0
    chosen = spread_places(grid, lattice_of(grid, MOST_PLACES))
    assert 0.8 * MOST_PLACES < len(chosen) <= MOST_PLACES
    for axis, count in enumerate(size):
        # as far apart along both axes
        own = np.unique(grid[chosen, axis])
        apart = max(
            2.0, 2.0 * np.sqrt(columns * rows / MOST_PLACES) if min(size) > 1 else 2.0 * max(size) / MOST_PLACES
        )
        assert len(own) >= min(count, 0.7 * 2.0 * count / apart)
        assert (own[0], own[-1]) == (grid[:, axis].min(), grid[:, axis].max())


@pytest.fixture
def linear_part(monkeypatch):
    """The part of the adjustment is linear in plan; gives the places at which it was asked for."""
    asked = []

    def variances(*given):
        asked.append(given[3][:, :2])
        return np.column_stack([linear(given[3][:, :2]), np.full(len(given[3]), 9.0)])

    monkeypatch.setattr(adjustment_part, "variances_at", variances)
    return asked


def of_pickets(xyz):
    pickets = SimpleNamespace(xyz=xyz, photographs=np.zeros((len(xyz), 2), int))
    return adjustment_variances(None, None, None, pickets)


@pytest.mark.parametrize("count", [1, 2, 3, 60, 4000])
def test_pickets_on_one_line_have_the_part_of_the_adjustment(linear_part, count):
    """The crest of a wall, a road; and fewer pickets than make a surface."""
    xyz = np.column_stack([around(2.0 * np.arange(count)[:, None] * (0.6, 0.8)), np.full(count, 100.0)])
    xyz = np.insert(xyz, 1, np.nan, axis=0)
    found = of_pickets(xyz)
    assert np.isnan(found[1]).all()
    np.testing.assert_allclose(np.delete(found, 1, axis=0)[:, :2], linear(np.delete(xyz, 1, axis=0)), atol=1e-7)
    assert len(linear_part[0]) <= MOST_PLACES


def test_pickets_of_a_full_grid_are_asked_all_over_it(linear_part):
    """500 × 500 pickets row by row: every 500th would be of one column."""
    plan = np.stack(np.meshgrid(np.arange(500.0), np.arange(500.0)), axis=-1).reshape(-1, 2)
    xyz = np.column_stack([around(plan), np.full(len(plan), 100.0)])
    np.testing.assert_allclose(of_pickets(xyz)[:, :2], linear(xyz), atol=1e-6)
    assert np.ptp(linear_part[0], axis=0) == pytest.approx([499.0, 499.0])


def test_no_picket_has_no_part(linear_part):
    assert np.isnan(of_pickets(np.full((3, 3), np.nan))).all()
    assert not linear_part
