"""What a spline through the boundary leaves out of the ground below, by the ground around."""

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
from aerotri.volume.accuracy import spline_variance
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


def sigma(z: np.ndarray, boundary: Boundary = OUTLINE) -> float:
    """m³."""
    base, surface = on(z, boundary)
    found = spline_variance(base, boundary, surface)
    assert found is not None
    return float(np.sqrt(found))


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
        z.append(of_spline(below) / sigma(below))
    # chi-square of twelve, 99.9 %: with waves of 120 m a roughness carried inwards gives hundreds
    assert 0.4 < np.sqrt(np.mean(np.square(z))) < 1.7


def test_a_plane_leaves_nothing_out():
    assert sigma(50.0 + 0.125 * (X - 1000.0) - 0.25 * (Y - 2000.0)) < 1e-3 * OUTLINE.area
    assert sigma(np.full(X.shape, 100.0)) < 1e-6


def test_heights_ten_times_as_large_leave_ten_times_as_much():
    below = fractal(np.random.default_rng(3)) - 100.0
    assert sigma(10.0 * below) == pytest.approx(10.0 * sigma(below), rel=1e-4)


def test_a_plane_added_changes_nothing():
    below = fractal(np.random.default_rng(4))
    assert sigma(below + 0.3 * (X - 1000.0) + 20.0) == pytest.approx(sigma(below), rel=1e-2)


def test_the_foot_of_what_is_measured_is_no_ground():
    below = 100.0 + 0.02 * np.random.default_rng(8).normal(size=X.shape)
    foot = 0.5 * np.exp(-((np.hypot(X - 1000.0, Y - 2000.0) - 24.0).clip(0.0) ** 2))
    assert sigma(below + foot) == pytest.approx(sigma(below), rel=0.1)


def test_variance_is_that_of_a_covariance():
    """Of the only probable one, summed pair by pair."""
    found = GroundAround(20.0, (replace(around(fractal(np.random.default_rng(5))).models[0], probability=1.0),))
    model, base = found.models[0], on(fractal(np.random.default_rng(5)))[0]
    weights = np.concatenate([[OUTLINE.area], -base.integral])
    xy = np.concatenate([[[1000.0, 2000.0]], base.xy])
    total = sum(
        model.level * one * other * float(model.covariance(np.array([np.hypot(*(a - b)) / 20.0]))[0])
        for one, a in zip(weights, xy, strict=True)
        for other, b in zip(weights, xy, strict=True)
    )
    assert found.contrast_variance(xy, weights) == pytest.approx(total, rel=1e-6)


def test_a_neighbour_that_is_measured_as_well_is_no_ground():
    below = 100.0 + 0.02 * np.random.default_rng(6).normal(size=X.shape)
    neighbour = shapely.box(1026.0, 1980.0, 1046.0, 2020.0)
    below = np.where(np.asarray(shapely.contains_xy(neighbour, X, Y)), below + 5.0, below)
    assert sigma(below, replace(OUTLINE, beside=neighbour.buffer(1.0))) < 0.2 * sigma(below)


def test_a_surface_that_ends_near_the_boundary_is_judged_by_what_there_is():
    below = fractal(np.random.default_rng(9))
    near = np.where(shapely.contains_xy(OUTLINE.polygon.buffer(4.0), X, Y), below, np.nan)
    assert 0.2 * sigma(below) < sigma(near) < 5.0 * sigma(below)


def test_no_ground_outside_says_nothing():
    z = np.where(shapely.contains_xy(OUTLINE.polygon.buffer(1.2), X, Y), 100.0, np.nan)
    base, surface = on(z)
    assert spline_variance(base, OUTLINE, surface) is None


def test_every_covariance_is_one():
    """Of contrasts that no plane moves all variances are positive."""
    places = np.random.default_rng(7).uniform(size=(60, 2))
    left = np.linalg.qr(np.column_stack([np.ones(60), places]), mode="complete").Q[:, 3:]
    for covariance in covariances():
        power = np.linalg.eigvalsh(left.T @ covariance(cdist(places, places)) @ left)
        assert power[0] > -1e-9 * power[-1]
