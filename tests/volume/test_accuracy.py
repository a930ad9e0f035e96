"""σ of a volume: its parts one by one against scatter or closed forms; the full counts run in tools/."""

from __future__ import annotations

import importlib

import numpy as np
import pytest
import shapely
from scipy.spatial import KDTree
from scipy.stats import chi2

from aerotri.rasters.grids import Grid
from aerotri.volume.bases import level
from aerotri.volume.boundary import boundary_of
from aerotri.volume.drawn_edge import boundary_variance
from aerotri.volume.functionals import tin_volume, triangulated
from aerotri.volume.roughness import (
    Roughness,
    ground_between,
    patch_variances,
    roughness_of_cells,
    roughness_of_pickets,
)
from aerotri.volume.triangles import areas, cut_to
from places import PROJECT

RUNS = 10


@pytest.fixture(scope="module")
def proof():
    """The modules of the tool."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(PROJECT / "tools" / "prove"))
        yield importlib.import_module("volume_proof.simulated")


@pytest.fixture(scope="module")
def site(proof):
    return importlib.import_module("volume_proof.sites").make_site("fractal", 14.0, 120.0, 4.0)


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
    """What decides about the volume is γ at the spacing: within a fourth; H within 0.2."""
    rng = np.random.default_rng(11)
    x, y = np.meshgrid(np.arange(28.0) * 10.0, np.arange(28.0) * 10.0)
    regular = np.column_stack([x.ravel(), y.ravel()])
    truth = Roughness(0.05, exponent)
    xy = regular + rng.uniform(-2.0, 2.0, regular.shape)
    trend = 0.1 * xy[:, 0] - 0.05 * xy[:, 1] + 2e-4 * xy[:, 0] ** 2
    z = brownian(xy, exponent, 0.05, rng) + trend
    noise = 0.3 * 0.05 * 10.0**exponent
    noisy = z + rng.normal(0.0, noise, len(z))
    for heights, variance in ((z, 0.0), (noisy, noise**2)):
        found = roughness_of_pickets(np.column_stack([xy, heights]), variance)
        assert found.exponent == pytest.approx(exponent, abs=0.2)
        assert found.covariance(10.0) == pytest.approx(truth.covariance(10.0), rel=0.25)
    z = brownian(regular, exponent, 0.05, rng).reshape(28, 28)
    cells = roughness_of_cells(z, Grid(28, 28, 0.0, 280.0, 10.0, 10.0))
    assert cells.exponent == pytest.approx(exponent, abs=0.2)
    assert cells.covariance(10.0) == pytest.approx(truth.covariance(10.0), rel=0.25)


@pytest.mark.parametrize("exponent", [0.5, 1.5])
def test_variance_between_pickets_is_that_of_a_fine_lattice(exponent):
    """The variance over neighbouring triangles against a contrast over a lattice of 36 places in each."""
    rng = np.random.default_rng(4)
    x, y = np.meshgrid(np.arange(9.0) * 10.0, np.arange(9.0) * 10.0)
    xy = np.column_stack([x.ravel(), y.ravel()]) + rng.uniform(-2.0, 2.0, (81, 2))
    xyz = np.column_stack([xy, np.zeros(81)])
    triangles = triangulated(xyz)
    middle = xy[triangles].mean(axis=1)
    triangles = triangles[np.abs(middle - 40.0).max(axis=1) < 16.0]
    truth, tree = Roughness(0.1, exponent), KDTree(xy)
    apart, together = patch_variances(truth, xyz, triangles, 0.0, tree)
    n = 6
    parts = [((3 * i + 1) / (3 * n), (3 * j + 1) / (3 * n)) for i in range(n) for j in range(n - i)]
    parts += [((3 * i + 2) / (3 * n), (3 * j + 2) / (3 * n)) for i in range(n) for j in range(n - i - 1)]
    weights = np.column_stack([parts, 1.0 - np.sum(parts, axis=1)])
    singles, places, of_place = 0.0, [], []
    for triangle in xy[triangles]:
        area = float(areas(triangle[None])[0])
        dense = weights @ triangle
        near = tree.query(triangle.mean(axis=0), 20)[1]
        kriging = block_weights(truth, dense, xy[near])
        own = np.concatenate([dense, xy[near]]), area * np.r_[np.full(len(dense), 1.0 / len(dense)), -kriging]
        singles += contrast_variance(truth, *own)
        places.append(own[0])
        of_place.append(own[1])
    exact = contrast_variance(truth, np.concatenate(places), np.concatenate(of_place))
    assert apart == pytest.approx(singles, rel=0.08)
    assert together == pytest.approx(exact, rel=0.08)


def contrast_variance(truth, xy, weights):
    """Of Σλz at places (n, 2), pair by pair."""
    gap = np.linalg.norm(xy[:, None] - xy[None], axis=-1)
    return weights @ truth.covariance(gap) @ weights


def block_weights(truth, dense, near):
    """Universal kriging of the mean over places, equation by equation."""

    def terms(p):
        x, y = (p - near.mean(axis=0)).T / 20.0
        return np.column_stack([np.ones(len(p)), x, y, x * x, x * y, y * y])

    k = truth.covariance(np.linalg.norm(near[:, None] - near, axis=2))
    f = terms(near)
    system = np.block([[k, f], [f.T, np.zeros((6, 6))]])
    to = truth.covariance(np.linalg.norm(near[:, None] - dense, axis=2)).mean(axis=1)
    return np.linalg.solve(system, np.r_[to, terms(dense).mean(axis=0)])[: len(near)]


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_curvature_is_what_triangles_cut_off(noise):
    """A paraboloid: the pickets around a triangle give it exactly, whatever noise they are told to have."""
    x, y = np.meshgrid(np.arange(-70.0, 71.0, 10.0), np.arange(-70.0, 71.0, 10.0))
    z = 30.0 - 0.005 * (x**2 + y**2)
    xyz = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    triangles = triangulated(xyz)
    boundary = boundary_of(shapely.box(-50.0, -50.0, 50.0, 50.0), "square")
    pieces = cut_to(boundary.polygon, xyz[triangles][:, :, :2])
    used = triangles[pieces.triangle]
    own = ground_between(Roughness(0.0, 0.6), xyz, used, np.ones(len(used)), noise)
    truth = 30.0 * 1e4 - 0.005 * 2.0 * 100.0 * 2.0 * 50.0**3 / 3.0
    assert own.curvature == pytest.approx(truth - tin_volume(xyz, triangles, boundary)[0], rel=1e-9)
    assert own.variance == 0.0
    # the mean of a quadratic over a right-angled triangle is above its corners' by h²/12·(z_xx + z_yy)
    assert own.curvature == pytest.approx(0.02 * 100.0 / 12.0 * boundary.area, rel=1e-9)


def test_ground_between_pickets_lies_within_its_sigma(proof):
    """Rolling ground and a dump, 8 runs each: what triangles leave out against what is foretold."""
    sites = importlib.import_module("volume_proof.sites")
    for kind, spacing, radius, cell in (("rolling", 12.0, 60.0, 2.0), ("dump", 3.0, 25.0, 0.5)):
        site = sites.make_site(kind, spacing, radius, cell)
        triangles = triangulated(np.column_stack([site.xy, site.xy[:, 0]]))
        pieces = cut_to(site.polygon, site.xy[triangles])
        used = triangles[pieces.triangle]
        share = pieces.area / areas(site.xy[used])
        missed, raw = [], []
        for seed in range(8):
            z, dense = site.heights(np.random.default_rng(seed))
            xyz = np.column_stack([site.xy, z])
            left = float(site.weight @ dense) - tin_volume(xyz, triangles, proof.boundary(site))[0]
            own = ground_between(roughness_of_pickets(xyz, 0.0, np.unique(used)), xyz, used, share, 0.0)
            missed.append((left - own.curvature) / np.sqrt(own.variance))
            raw.append(left / np.sqrt(own.mean_square))
        low, high = chi2.ppf([0.0005, 0.9995], 8)
        assert np.sum(np.square(missed)) < high
        assert low < np.sum(np.square(raw)) < high
