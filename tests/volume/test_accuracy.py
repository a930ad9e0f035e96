"""σ of a volume: its parts one by one against scatter or closed forms; the full counts run in tools/."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.stats import chi2

from aerotri.rasters import Grid
from aerotri.volume.accuracy import boundary_variance
from aerotri.volume.bases import level
from aerotri.volume.boundary import boundary_of
from aerotri.volume.functionals import triangulated
from aerotri.volume.roughness import (
    Roughness,
    curvature_of_pickets,
    patch_variances,
    roughness_of_cells,
    roughness_of_pickets,
)

RUNS = 10


@pytest.fixture(scope="module")
def proof():
    """The modules of the tool."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parents[2] / "tools"))
        yield importlib.import_module("volume_proof.simulated")


@pytest.fixture(scope="module")
def site(proof):
    return proof.make_site()


@pytest.mark.parametrize("source", ["adjustment", "matching", "boundary"])
def test_a_source_of_error_alone_scatters_by_its_sigma(proof, site, source):
    """Single runs inside 5 σ, all together inside the 99.9 % band of χ²."""
    z = np.array([(r := proof.run(site, seed, frozenset([source]))).error / r.sigma for seed in range(1, RUNS + 1)])
    low, high = chi2.ppf([0.0005, 0.9995], RUNS)
    assert np.abs(z).max() < 5.0
    assert low < np.sum(z**2) < high


def test_all_sources_together(proof, site):
    runs = [proof.run(site, seed) for seed in range(101, 101 + RUNS // 2)]
    low, high = chi2.ppf([0.0005, 0.9995], len(runs))
    assert low < sum((r.error / r.sigma) ** 2 for r in runs) < high
    one = runs[0]
    assert one.sigma == pytest.approx(np.sqrt(sum(v**2 for v in one.parts.values())))


class Slab:
    """A surface of one height."""

    def sample(self, x, y):
        return np.full(len(x), 7.0)


def test_boundary_of_a_slab_by_differences():
    """Corners of an L moved one by one: over a slab of 4 m the volume changes by 4 m times the area swept."""
    corners = np.array([(0, 0), (60, 0), (60, 30), (25, 30), (25, 50), (0, 50)], dtype=float)
    boundary = boundary_of(shapely.Polygon(corners), "L")
    total = 0.0
    for k in range(len(corners)):
        for axis in range(2):
            areas = []
            for sign in (1.0, -1.0):
                moved = corners.copy()
                moved[k, axis] += sign * 0.01
                areas.append(shapely.Polygon(moved).area)
            total += (4.0 * (areas[0] - areas[1]) / 0.02) ** 2
    assert boundary_variance(Slab(), level(3.0), boundary, 0.3) == pytest.approx(0.09 * total, rel=1e-9)
    assert boundary_variance(Slab(), level(3.0), boundary, 0.0) == 0.0


def brownian(xy, exponent, s, rng):
    """Fractional Brownian heights with γ = s²·h^(2H)."""
    at = xy + 1e4
    length = np.linalg.norm(at, axis=1) ** (2 * exponent)
    gap = np.linalg.norm(at[:, None] - at[None], axis=2) ** (2 * exponent)
    covariance = s**2 * (length[:, None] + length - gap)
    covariance = covariance - covariance[:1] - covariance[:, :1] + covariance[0, 0]
    return np.linalg.cholesky(covariance + 1e-9 * np.eye(len(at))) @ rng.normal(size=len(at))


@pytest.mark.parametrize("exponent", [0.3, 0.6])
def test_roughness_is_found_again(exponent):
    """What decides about the volume is γ at the spacing: within a fifth; H within 0.2."""
    rng = np.random.default_rng(11)
    x, y = np.meshgrid(np.arange(28.0) * 10.0, np.arange(28.0) * 10.0)
    regular = np.column_stack([x.ravel(), y.ravel()])
    truth = Roughness(0.05, exponent)
    xy = regular + rng.uniform(-2.0, 2.0, regular.shape)
    trend = 0.1 * xy[:, 0] - 0.05 * xy[:, 1] + 2e-4 * xy[:, 0] ** 2
    found = roughness_of_pickets(np.column_stack([xy, brownian(xy, exponent, 0.05, rng) + trend]), 0.0)
    assert found.exponent == pytest.approx(exponent, abs=0.2)
    assert found.semivariogram(10.0) == pytest.approx(truth.semivariogram(10.0), rel=0.25)
    z = brownian(regular, exponent, 0.05, rng).reshape(28, 28)
    cells = roughness_of_cells(z, Grid(28, 28, 0.0, 280.0, 10.0, 10.0))
    assert cells.exponent == pytest.approx(exponent, abs=0.2)
    assert cells.semivariogram(10.0) == pytest.approx(truth.semivariogram(10.0), rel=0.25)


def test_variance_between_pickets_is_that_of_a_fine_lattice():
    """The variance of the sum over neighbouring triangles against simulated ground, its mean over 36 places each."""
    rng = np.random.default_rng(4)
    x, y = np.meshgrid(np.arange(5.0) * 10.0, np.arange(5.0) * 10.0)
    xy = np.column_stack([x.ravel(), y.ravel()]) + rng.uniform(-2.0, 2.0, (25, 2))
    triangles = triangulated(np.column_stack([xy, np.zeros(25)]))
    corners = xy[triangles]
    apart, together = patch_variances(Roughness(0.1, 0.5), corners, 4)
    assert 1.5 < together / apart < 4.0
    n = 6
    parts = [((3 * i + 1) / (3 * n), (3 * j + 1) / (3 * n)) for i in range(n) for j in range(n - i)]
    parts += [((3 * i + 2) / (3 * n), (3 * j + 2) / (3 * n)) for i in range(n) for j in range(n - i - 1)]
    weights = np.column_stack([parts, 1.0 - np.sum(parts, axis=1)])
    dense = (weights @ corners).reshape(-1, 2)
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    places = np.concatenate([dense, xy])
    of_place = np.concatenate([np.repeat(area / len(weights), len(weights)), np.zeros(len(xy))])
    for k in range(3):
        np.add.at(of_place, len(dense) + triangles[:, k], -area / 3.0)
    gap = np.linalg.norm(places[:, None] - places[None], axis=2)
    exact = -of_place @ (0.01 * gap) @ of_place
    assert together == pytest.approx(exact, rel=0.1)


def test_curvature_is_what_triangles_cut_off():
    """A paraboloid over a circle: triangles lie inside it, a smooth surface through the same pickets hardly."""
    x, y = np.meshgrid(np.arange(-70.0, 71.0, 10.0), np.arange(-70.0, 71.0, 10.0))
    z = 30.0 - 0.005 * (x**2 + y**2)
    boundary = boundary_of(shapely.Point(0, 0).buffer(50.0), "circle")
    found = curvature_of_pickets(np.column_stack([x.ravel(), y.ravel(), z.ravel()]), boundary)
    # the mean of a quadratic over a right-angled triangle is above its corners' by h²/12·(z_xx + z_yy)
    assert found == pytest.approx(0.02 * 100.0 / 12.0 * boundary.area, rel=0.05)
