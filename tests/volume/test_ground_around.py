"""What a spline through the boundary leaves out, as the ground around tells it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import shapely
from scipy.spatial.distance import cdist

from aerotri.rasters.grids import Grid
from aerotri.rasters.held import HeldRaster
from aerotri.volume.accuracy import base_left_out
from aerotri.volume.bases import SplineBase, parse_base, quadrature_of
from aerotri.volume.boundary import Boundary, boundary_of
from aerotri.volume.ground_around import GroundAround, covariances, ground_around

CELLS, HALF = 96, 48.0
GRID = Grid(CELLS, CELLS, 1000.0 - HALF, 2000.0 + HALF, 1.0, 1.0)
X, Y = np.meshgrid(GRID.x(np.arange(CELLS)), GRID.y(np.arange(CELLS)))
OUTLINE = boundary_of(shapely.Point(1000.0, 2000.0).buffer(24.0), "circle")


def on(z: np.ndarray, boundary: Boundary = OUTLINE) -> tuple[SplineBase, HeldRaster]:
    surface = HeldRaster(z, GRID, None, "ground")
    base = parse_base("boundary", surface, boundary)
    assert isinstance(base, SplineBase)
    return base, surface


def around(z: np.ndarray, boundary: Boundary = OUTLINE) -> GroundAround:
    base, surface = on(z, boundary)
    found = ground_around(base, boundary, surface)
    assert found is not None
    return found


def left_out(z: np.ndarray, boundary: Boundary = OUTLINE) -> tuple[float, float]:
    base, surface = on(z, boundary)
    found = base_left_out(base, boundary, surface)
    assert found is not None
    return found


def waves(rng: np.random.Generator, length: float) -> np.ndarray:
    angle, phase = rng.uniform(0.0, 2.0 * np.pi, (2, 12))
    number = 2.0 * np.pi / (length * 2.0 ** rng.uniform(-0.5, 0.5, 12))
    x, y = X - 1000.0, Y - 2000.0
    both = zip(number, angle, phase, strict=True)
    return 100.0 + sum(np.cos(k * (x * np.cos(a) + y * np.sin(a)) + p) for k, a, p in both) / np.sqrt(6.0)


def fractal(rng: np.random.Generator) -> np.ndarray:
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(4 * CELLS), np.fft.fftfreq(4 * CELLS)))
    k[0, 0] = np.inf
    z = np.real(np.fft.ifft2(k**-1.5 * np.fft.fft2(rng.normal(size=k.shape))))[:CELLS, :CELLS]
    return 100.0 + z / np.std(z)


def of_spline(z: np.ndarray) -> float:
    """m³, by which the spline is above the ground."""
    base, surface = on(z)
    places, weight = quadrature_of(OUTLINE)
    return float(base.integral @ base.z - weight @ surface.sample(places[:, 0], places[:, 1]))


@pytest.mark.parametrize("ground", [partial(waves, length=50.0), partial(waves, length=120.0), fractal])
def test_errors_of_the_base_are_as_its_sigma_says(ground: Callable[[np.random.Generator], np.ndarray]):
    z = []
    for seed in range(12):
        below = ground(np.random.default_rng([seed, 1]))
        z.append(of_spline(below) / np.sqrt(left_out(below)[1]))
    # chi-square of twelve, 99.9 %: with waves of 120 m a roughness carried inwards gives hundreds
    assert 0.4 < np.sqrt(np.mean(np.square(z))) < 1.7


def test_what_is_expected_is_what_comes_where_the_ground_around_tells_it():
    for seed in range(4):
        below = waves(np.random.default_rng([seed, 2]), 120.0)
        assert left_out(below)[0] == pytest.approx(of_spline(below), abs=0.1 * abs(of_spline(below)) + 5.0)


def test_a_plane_leaves_nothing_out():
    expected, square = left_out(50.0 + 0.125 * (X - 1000.0) - 0.25 * (Y - 2000.0))
    assert abs(expected) < 1e-3 * OUTLINE.area
    assert np.sqrt(square) < 1e-3 * OUTLINE.area
    assert left_out(np.full(X.shape, 100.0)) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_heights_ten_times_as_large_leave_ten_times_as_much():
    below = fractal(np.random.default_rng(3)) - 100.0
    one, ten = left_out(below), left_out(10.0 * below)
    assert ten[0] == pytest.approx(10.0 * one[0], rel=1e-4)
    assert ten[1] == pytest.approx(100.0 * one[1], rel=1e-4)


def test_a_plane_added_changes_nothing():
    below = fractal(np.random.default_rng(4))
    one, tilted = left_out(below), left_out(below + 0.3 * (X - 1000.0) + 20.0)
    assert tilted[0] == pytest.approx(one[0], abs=1e-3 * OUTLINE.area)
    assert tilted[1] == pytest.approx(one[1], rel=1e-2)


def test_kriging_is_that_of_a_plane_with_no_knowledge_beforehand():
    """Each model against the conditional normal distribution with a plane of a very large variance."""
    below = waves(np.random.default_rng(5), 60.0)
    found = around(below)
    base, surface = on(below)
    places, weight = quadrature_of(OUTLINE)
    at = (places - found.middle) / found.size
    ones = [np.column_stack([np.ones(len(a)), a]) for a in (found.places, at)]
    z = surface.sample(*(found.places * found.size + found.middle).T) - found.height
    for model in found.models:
        alone = replace(found, models=(model,))
        expected, square = alone.left_out(places, weight, float(base.integral @ base.z))
        variance = model.covariance(cdist(found.places, found.places)) + model.alone * np.eye(len(z))
        plane = 1e5 * ones[0] @ ones[0].T
        to = (model.covariance(cdist(found.places, at)) + 1e5 * ones[0] @ ones[1].T) @ weight
        own = weight @ (model.covariance(cdist(at, at)) + 1e5 * ones[1] @ ones[1].T) @ weight
        weights = np.linalg.solve(variance + plane, to)
        mean = float(weights @ z)
        off = float(base.integral @ base.z) - found.height * weight.sum() - mean
        assert expected == pytest.approx(off, abs=1e-3 * OUTLINE.area)
        assert square - expected**2 == pytest.approx(model.level * (own - to @ weights), rel=0.05, abs=1.0)


def test_a_neighbour_that_is_measured_as_well_is_no_ground():
    below = 100.0 + 0.02 * np.random.default_rng(6).normal(size=X.shape)
    neighbour = shapely.box(1026.0, 1980.0, 1046.0, 2020.0)
    below = np.where(np.asarray(shapely.contains_xy(neighbour, X, Y)), below + 5.0, below)
    counted = left_out(below)
    apart = left_out(below, replace(OUTLINE, beside=neighbour.buffer(1.0)))
    assert np.sqrt(apart[1]) < 0.2 * np.sqrt(counted[1])


def test_no_ground_outside_says_nothing():
    z = np.where(shapely.contains_xy(OUTLINE.polygon.buffer(1.5), X, Y), 100.0, np.nan)
    base, surface = on(z)
    assert base_left_out(base, OUTLINE, surface) is None


def test_every_covariance_is_one():
    """Of contrasts that no plane moves all variances are positive."""
    places = np.random.default_rng(7).uniform(size=(60, 2))
    left = np.linalg.qr(np.column_stack([np.ones(60), places]), mode="complete").Q[:, 3:]
    for covariance in covariances():
        power = np.linalg.eigvalsh(left.T @ covariance(cdist(places, places)) @ left)
        assert power[0] > -1e-9 * power[-1]
