"""σ of cut and of fill: the statistics of heights above a line, against sampling and surfaces of known volume."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import KDTree

from aerotri.rasters.grids import Grid
from aerotri.rasters.held import HeldRaster
from aerotri.volume.bases import PlaneBase, SurfaceBase, level, nodes_of, parse_base
from aerotri.volume.between_sides import between_on_side, sigma_at_places
from aerotri.volume.boundary import boundary_of
from aerotri.volume.cell_noise import NO_NOISE, CellNoise
from aerotri.volume.counted import Counted, counted_pieces
from aerotri.volume.either_side import Lost, lost_on_either_side
from aerotri.volume.functionals import cell_volume, tin_volume, triangulated
from aerotri.volume.rectified import covariance_above, excess, expected_above, line_of_shared, share_of_variance
from aerotri.volume.regions import base_over, region_of_cells, region_of_pieces
from aerotri.volume.roughness import Roughness, ground_of
from aerotri.volume.triangles import cut_to, prism_sums

SIZE = 80
GRID = Grid(SIZE, SIZE, 0.0, float(SIZE), 1.0, 1.0)
X, Y = np.meshgrid(GRID.x(np.arange(SIZE)), GRID.y(np.arange(SIZE)))
FINE = Grid(104, 104, -2.0, 102.0, 1.0, 1.0)
OUTLINE = boundary_of(shapely.box(10.0, 10.0, 70.0, 70.0), "square")


def test_moments_of_heights_above_a_line():
    """Against sums over a fine sequence of quantiles."""
    from scipy.special import ndtri

    quantiles = ndtri((np.arange(400_000) + 0.5) / 400_000)
    for mean in (-1.5, -0.2, 0.0, 0.7, 3.0):
        above = np.maximum(mean + 0.5 * quantiles, 0.0)
        assert expected_above(mean, 0.5) == pytest.approx(above.mean(), abs=1e-6)
        assert excess(mean, 0.5) == pytest.approx(above.mean() - max(mean, 0.0), abs=1e-6)
        assert share_of_variance(mean / 0.5) == pytest.approx(above.var() / 0.25, abs=1e-4)
    assert expected_above(2.0, 0.0) == 2.0
    assert expected_above(-2.0, 0.0) == 0.0


@pytest.mark.parametrize("rho", [-0.5, 0.3, 0.8])
def test_covariance_of_heights_above_a_line(rho):
    """Against samples of two heights."""
    rng = np.random.default_rng(5)
    first, other = rng.normal(size=(2, 2_000_000))
    other = rho * first + np.sqrt(1.0 - rho**2) * other
    for t in ((0.0, 0.0), (0.8, -0.3), (1.5, 1.0)):
        sampled = np.cov(np.maximum(t[0] + first, 0.0), np.maximum(t[1] + other, 0.0))[0, 1]
        found = covariance_above(np.array(t), np.ones(2), np.array([[1.0, rho], [rho, 1.0]]))[0, 1]
        assert found == pytest.approx(sampled, abs=4e-3)


def test_a_common_error_over_a_slope():
    """A plane through the level: an error e changes the cut by e²/(2·slope) per metre of the line, beyond A·e."""
    z = 0.1 * (X - 40.0)
    line = line_of_shared(z.ravel(), np.ones(z.size), 0.5)
    assert line.moved == pytest.approx(0.5**2 / (2.0 * 0.1) * SIZE, rel=1e-2)
    assert line.spread == pytest.approx(0.5**2 / 0.1 * SIZE, rel=1e-2)


def test_cut_and_fill_add_up_to_the_whole():
    """Weights of both sides are those of all cells; of a TIN as of cells, with their first-order parts."""
    z = 100.0 + 0.1 * (X - 40.0) + 2.0 * np.sin(Y / 9.0)
    surface, base = HeldRaster(z, GRID, None, "waves"), level(100.3)
    whole = cell_volume(surface, OUTLINE, base)
    sides = [cell_volume(surface, OUTLINE, base, None, False, Counted(base, sign)) for sign in (1, -1)]
    assert sum(one.gradient[:, 2].sum() for one in sides) == pytest.approx(whole.gradient[:, 2].sum(), rel=1e-12)
    xyz = np.column_stack([X.ravel(), Y.ravel(), z.ravel()])
    triangles = triangulated(xyz)
    pieces = cut_to(OUTLINE.polygon, xyz[triangles][:, :, :2])
    sums = prism_sums(OUTLINE.polygon, xyz[triangles][:, :, :2], xyz[triangles][:, :, 2] - 100.3)
    for sign, one, k in ((1, sides[0], 0), (-1, sides[1], 1)):
        own = counted_pieces(xyz, triangles, pieces, Counted(base, sign))
        value = tin_volume(xyz, triangles, OUTLINE, base, False, own)[0] - 100.3 * own.area.sum()
        assert sign * value == pytest.approx(sums[k], rel=2e-3)
        assert own.area.sum() == pytest.approx(sums[2 + k], rel=3e-3)
        assert own.area.sum() == pytest.approx(one.gradient[:, 2].sum(), rel=0.02)


def test_noise_adds_to_cut_and_to_fill():
    """Level ground at the base, and a slope through it: what noise adds on average over draws is foretold of each."""
    rng = np.random.default_rng(2)
    sigma = HeldRaster(np.full((SIZE, SIZE), 0.3), GRID, None, "noise")
    for z in (np.zeros((SIZE, SIZE)), 0.05 * (X - 40.0)):
        added, foretold = [], []
        for _ in range(20):
            noisy = z + rng.normal(0.0, 0.3, z.shape)
            surface = HeldRaster(noisy, GRID, None, "noisy")
            region = region_of_cells(surface, OUTLINE, Counted(level(0.0), 1), CellNoise(sigma), 0.0)
            inside = OUTLINE.coverage(GRID)
            added.append(np.sum(inside * (np.maximum(noisy, 0.0) - np.maximum(z, 0.0) - 0.5 * (noisy - z))))
            foretold.append(region.line.noise)
        assert np.mean(foretold) == pytest.approx(np.mean(added), rel=0.2)


def test_ground_between_heights_above_a_level():
    """Fractional Brownian ground known every 10 m: cut and fill over a level come out too small, as foretold."""
    rng = np.random.default_rng(8)
    step, n = 2.0, 41
    x, y = np.meshgrid(np.arange(n) * step, np.arange(n) * step)
    fine = np.column_stack([x.ravel(), y.ravel()])
    known = np.flatnonzero(np.all(np.mod(fine, 10.0) == 0.0, axis=1))
    triangles = triangulated(np.column_stack([fine[known], fine[known, 0] * 0.0]))
    outline = boundary_of(shapely.box(20.0, 20.0, 60.0, 60.0), "square")
    inside = np.all((fine >= 20.0) & (fine <= 60.0), axis=1)
    edge = np.isin(fine[inside], (20.0, 60.0)).sum(axis=1)
    weight = step**2 * 0.5**edge
    roughness = Roughness(0.2, 0.5)
    at = fine + 1e4
    length = np.linalg.norm(at, axis=1)
    gap = np.linalg.norm(at[:, None] - at[None], axis=2)
    covariance = 0.2**2 * (length[:, None] + length - gap)
    covariance = covariance - covariance[:1] - covariance[:, :1] + covariance[0, 0]
    root = np.linalg.cholesky(covariance + 1e-9 * np.eye(len(fine)))
    errors, z2 = [], []
    for _ in range(12):
        z = root @ rng.normal(size=len(fine))
        height = float(np.median(z[inside]))
        xyz = np.column_stack([fine[known], z[known]])
        pieces = cut_to(outline.polygon, xyz[triangles][:, :, :2])
        ground = ground_of(roughness, xyz, triangles[pieces.triangle], np.ones(len(pieces.triangle)), 0.0)
        sums = prism_sums(outline.polygon, xyz[triangles][:, :, :2], xyz[triangles][:, :, 2] - height)
        for sign, k in ((1, 0), (-1, 1)):
            area = np.bincount(pieces.triangle, pieces.area, len(triangles))
            lost = lost_on_either_side(xyz, triangles, area, Counted(level(height), sign), 0.0)
            found = between_on_side(ground, Counted(level(height), sign), lost.ground)
            missed = weight @ np.maximum(sign * (z[inside] - height), 0.0) - sums[k]
            errors.append((missed, found.curvature))
            z2.append((missed - found.curvature) ** 2 / found.variance)
    missed, foretold = np.mean(errors, axis=0)
    assert missed > 0.0
    assert foretold == pytest.approx(missed, rel=0.3)
    assert 0.4 < np.mean(z2) < 2.0
    assert sigma_at_places(ground) == pytest.approx(0.2 * np.sqrt(10.0) * 0.6, rel=0.35)


def test_a_base_over_holes_is_not_counted():
    """The integral of a base that follows from the surface is that over the cells that are known, so that a constant
    and a tilt of all heights leave no volume; with holes and without."""
    z = 100.0 + 0.05 * X + 8.0 * np.exp(-((X - 40.0) ** 2 + (Y - 40.0) ** 2) / 200.0)
    holes = z.copy()
    holes[(np.hypot(X - 30.0, Y - 45.0) < 9.0) | (np.hypot(X - 52.0, Y - 30.0) < 5.0)] = np.nan
    for heights in (z, holes):
        surface = HeldRaster(heights, GRID, None, "pile")
        for text in ("boundary", "plane", "lowest"):
            base = parse_base(text, surface, OUTLINE)
            region = region_of_cells(surface, OUTLINE, Counted(base), NO_NOISE, 0.0)
            assert region.area == pytest.approx(np.sum(OUTLINE.coverage(GRID) * np.isfinite(heights)), rel=1e-12)
            functional = cell_volume(surface, OUTLINE, base_over(base, region), None, False, Counted(base))
            weights = functional.gradient[:, 2]
            assert weights.sum() == pytest.approx(0.0, abs=1e-6 * region.area)
            if text != "lowest":
                assert weights @ functional.xyz[:, 0] == pytest.approx(0.0, abs=1e-3 * region.area)


@pytest.mark.parametrize("text", ["boundary", "plane"])
def test_a_shift_leaves_a_drawn_boundary_its_volume_beside_holes(text):
    """A boundary drawn on a surface with holes moves with it: a shift of all has no part in the volume; a scale has
    three times the volume."""
    z = 100.0 + 0.05 * X + 8.0 * np.exp(-((X - 40.0) ** 2 + (Y - 40.0) ** 2) / 200.0)
    z[(np.hypot(X - 30.0, Y - 45.0) < 9.0) | ((np.abs(X - 52.0) < 4.0) & (np.mod(Y, 7.0) < 3.0))] = np.nan
    surface = HeldRaster(z, GRID, None, "pile")
    base = parse_base(text, surface, OUTLINE)
    region = region_of_cells(surface, OUTLINE, Counted(base), NO_NOISE, 0.0)
    own = base_over(base, region)
    drawn = cell_volume(surface, OUTLINE, own, None, True, Counted(base))
    assert nodes_of(own) is not None
    fixed = cell_volume(surface, OUTLINE, own, None, False, Counted(base))
    shift = np.array([1.0, -2.0, 3.0])
    part = OUTLINE.coverage(GRID) * np.isfinite(z)
    volume = float(np.nansum(part * np.where(part > 0.0, z - base.on_grid(GRID), 0.0)))
    assert abs(np.sum(drawn.gradient @ shift)) < 1e-3 * volume
    assert abs(np.sum(fixed.gradient @ shift)) > 0.02 * volume
    scaled = np.sum(drawn.gradient * (drawn.xyz - [40.0, 40.0, 100.0]))
    assert scaled == pytest.approx(3.0 * volume, rel=0.03)


def test_region_of_triangles_as_of_cells():
    z = 100.0 + 0.1 * (X - 40.0)
    xyz = np.column_stack([X.ravel(), Y.ravel(), z.ravel()])
    triangles, base = triangulated(xyz), level(100.0)
    pieces = cut_to(OUTLINE.polygon, xyz[triangles][:, :, :2])
    counted = Counted(base, 1, 0.2)
    own = counted_pieces(xyz, triangles, pieces, counted)
    tin = region_of_pieces(OUTLINE, xyz, triangles, own, (counted, pieces))
    cells = region_of_cells(HeldRaster(z, GRID, None, "slope"), OUTLINE, counted, NO_NOISE, 0.0)
    assert tin.area == pytest.approx(cells.area, rel=2e-3)
    assert tin.line.moved == pytest.approx(cells.line.moved, rel=0.05)
    np.testing.assert_allclose(tin.weight @ tin.places, cells.weight @ cells.places, rtol=5e-3)
    assert len(KDTree(tin.places).query_pairs(1e-9)) == 0


def _random_tin(heights, seed):
    """Points at chance places over 100 m × 100 m, their triangles, and the areas inside of the middle."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0.0, 100.0, (2500, 2))
    xyz = np.column_stack([xy, heights(*xy.T, rng)])
    triangles = triangulated(xyz)
    pieces = cut_to(shapely.box(10.0, 10.0, 90.0, 90.0), xyz[triangles][:, :, :2])
    return xyz, triangles, np.bincount(pieces.triangle, pieces.area, len(triangles))


def _cut_and_fill(xyz, triangles):
    return prism_sums(shapely.box(10.0, 10.0, 90.0, 90.0), xyz[triangles][:, :, :2], xyz[triangles][:, :, 2])[:2]


@pytest.mark.parametrize("face", [0.0, 2.0])
def test_what_is_lost_at_a_face_is_told(face):
    """A wall, and a steep face, with a level through the middle: straight triangles make a ramp of it, wherever the
    points lie. Heights at the points tell by how much."""

    def heights(x, y, _):
        return np.clip(6.0 * (x + 3.0 * np.sin(y / 7.0) - 50.0) / max(face, 1e-9), -3.0, 3.0)

    x, y = np.meshgrid(*[np.arange(10.05, 90.0, 0.1)] * 2)
    true = 0.5 * np.abs(heights(x, y, None)).mean() * 80.0**2
    lost, told = [], []
    for seed in range(6):
        xyz, triangles, area = _random_tin(heights, seed)
        lost.append(true - 0.5 * sum(_cut_and_fill(xyz, triangles)))
        told.append(lost_on_either_side(xyz, triangles, area, Counted(level(0.0), 1), 0.0).ground)
    assert min(lost) > 0.01 * true
    assert np.mean(told) == pytest.approx(np.mean(lost), rel=0.1)


def test_ground_finer_than_the_points_is_told():
    """Loads as wide as the points stand apart, where bends between neighbours are not those of the ground."""

    def heights(x, y, _):
        return 3.0 * np.cos(2.0 * np.pi * x / 4.0) * np.cos(2.0 * np.pi * y / 5.0)

    x, y = np.meshgrid(*[np.arange(10.05, 90.0, 0.1)] * 2)
    true = 0.5 * np.abs(heights(x, y, None)).mean() * 80.0**2
    lost, told = [], []
    for seed in range(6):
        xyz, triangles, area = _random_tin(heights, seed)
        lost.append(true - 0.5 * sum(_cut_and_fill(xyz, triangles)))
        told.append(lost_on_either_side(xyz, triangles, area, Counted(level(0.0), 1), 0.0).ground)
    assert np.mean(told) == pytest.approx(np.mean(lost), rel=0.1)


def test_a_plane_through_the_base_loses_nothing():
    xyz, triangles, area = _random_tin(lambda x, y, _: 0.1 * (x - 50.0), 3)
    slope = PlaneBase("slope", 0.0, 0.1, 0.05, 50.0, 50.0)
    found = lost_on_either_side(xyz, triangles, area, Counted(slope, 1), 0.0)
    whole = float(area @ np.abs(xyz[triangles][:, :, 1] - 50.0).mean(axis=1))
    assert abs(found.ground) < 1e-9 * whole
    assert found.noise == 0.0
    assert found.above + found.below == pytest.approx(2.0 * found.above, rel=0.1)
    # where nothing is below, the fill loses nothing: the cut loses all that the net volume does
    all_above = lost_on_either_side(xyz, triangles, area, Counted(level(-10.0), 1), 0.0)
    assert all_above.below == pytest.approx(0.0, abs=1e-9 * all_above.above)
    assert all_above.at_least(5.0) == pytest.approx(2.5)
    one_side = lost_on_either_side(xyz, triangles, area, Counted(level(-10.0), 1), 0.0)
    assert abs(one_side.ground) < 1e-9 * whole
    assert lost_on_either_side(xyz, triangles, 0.0 * area, Counted(level(0.0), 1), 0.0) == Lost()


@pytest.mark.parametrize(("slope", "of_base"), [(0.0, 0.0), (0.0, 0.1), (0.02, 0.0), (0.02, 0.1)])
def test_noise_is_taken_off_what_is_lost(slope, of_base):
    """Level ground at the base, and a slope through it, heights of both with noise: nothing is lost between points, and
    what noise adds is told, that of a measured base too. Noise of both signs, so that its first order cancels."""
    told, added = [], []
    x, y = np.meshgrid(*[np.arange(10.25, 90.0, 0.5)] * 2)
    for seed, sign in ((seed, sign) for seed in range(4) for sign in (1.0, -1.0)):
        noise = sign * np.random.default_rng(50 + seed).normal(0.0, of_base, (104, 104))
        base = SurfaceBase("base", HeldRaster(noise, FINE, None, "base"))
        xyz, triangles, area = _random_tin(
            lambda x, y, rng, sign=sign: slope * (x - 50.0) + sign * rng.normal(0.0, 0.1, len(x)), seed
        )
        counted = Counted(base, 1, noise=of_base**2 * 4.0 / 9.0)
        found = lost_on_either_side(xyz, triangles, area, counted, 0.01)
        told.append((found.ground, found.noise))
        h = LinearNDInterpolator(xyz[:, :2], xyz[:, 2])(x, y) - base.heights(x.ravel(), y.ravel()).reshape(x.shape)
        added.append(0.5 * (np.abs(h).mean() - np.abs(slope * (x - 50.0)).mean()) * 80.0**2)
    ground, noise = np.mean(told, axis=0)
    assert abs(ground) < 0.25 * np.mean(added)
    # on level ground at the base the scatter of 50 heights is taken for ground in part
    assert noise == pytest.approx(np.mean(added), rel=0.35 if slope == 0.0 else 0.25)
