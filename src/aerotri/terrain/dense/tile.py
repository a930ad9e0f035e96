"""One tile of the surface: its pairs matched one after the other, their heights fused cell by cell."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from aerotri.conventions import SIGMA_PER_MAD
from aerotri.rasters.grids import Grid
from aerotri.terrain.dense import _mesh_kernels as kernels
from aerotri.terrain.dense.cell_scale import CellScale, middle_height
from aerotri.terrain.dense.cell_sigma import cell_sigma
from aerotri.terrain.dense.epipolar import EpipolarGeometry, epipolar_geometry, epipolar_images
from aerotri.terrain.dense.grey_store import GreyStore
from aerotri.terrain.dense.height_range import HeightRange
from aerotri.terrain.dense.pairs import Candidate, Pair, chosen_pairs, noise_correlation, pair_for_holes, possible_pairs
from aerotri.terrain.dense.parallaxes import Parallaxes, parallaxes_of
from aerotri.terrain.dense.place import Place, place_at
from aerotri.terrain.dense.scratch import scratch
from aerotri.terrain.dense.tile_surface import TileSurface, empty_tile, rim_of
from aerotri.terrain.photographs import Photographs

LARGEST_JUMP_PX = 1.5
"""Difference of parallax between neighbouring pixels of one surface; chosen [C]: more is the edge of an object, and a
triangle across it would be a wall that was not measured."""
AGREEING_SIGMAS = 4.0
"""σ of a difference within which heights of two pairs agree."""
AGREEING_PX = 1.0
"""Besides, in pixels of parallax: what two pairs see of rough ground differs by that much."""
LEAST_FILLED = 0.1
"""Of the holes that one more pair shows, the share that it has to fill for another to be tried; chosen [C]: what two
pairs in a row cannot match, water or what trees hide, a third will not."""
SMALLEST_PATCH, PATCH_STEP_PX = 50, 2.0
"""Cells of a patch of surface below which it is taken for chance, and the step, in pixels of parallax, that bounds it;
chosen [C]: five by ten cells, the size of a window of the matching and its neighbours."""
MARGIN_PX = 16.0
"""By which a tile is measured beyond its edge, where steps and patches that reach into it are looked for, and where it
goes over into its neighbour; less than what epipolar images have besides."""
MOST_LAGS = 12
"""Cells up to which the noise of neighbouring cells is looked at for what they share."""
SLOW_CELLS = 2 * MOST_LAGS + 1
"""Side of the square from whose mean the noise of pairs is told; chosen [C]: several windows wide."""
SLOW_ROUNDS = 2
"""Means of what is left, one after the other: at the edge of a pair a mean alone leaves its slope."""
FEWEST_MISFITS = 500
"""Cells measured twice of which the noise of a tile is taken."""
MOST_MISFITS = 50_000
"""That are looked at, spread over the tile."""
LARGEST_FACTOR = 3.0
STEP_UNITS, NO_HEIGHT = 8, -32000
"""Of the whole numbers in which heights are looked through for patches."""


@dataclass(frozen=True)
class TileOptions:
    """level : of resolution. pairs : most of a tile. edge : share of the format not used."""

    level: int
    pairs: int
    edge: float


def measure_tile(
    photographs: Photographs, store: GreyStore, grid: Grid, heights: HeightRange, options: TileOptions
) -> TileSurface:
    """The heights of the cells of a grid.

    Raises
    ------
    InputError
        When a photograph cannot be read.
    """
    nodes, low_z, high_z = heights.within(grid)
    inside, shape = grid, (grid.rows, grid.columns)
    cell_px = grid.cell_x / (float(np.median(photographs.gsd)) * 2**options.level)
    spare = int(np.ceil(MARGIN_PX / cell_px))
    grid = grid.window(-spare, -spare, grid.rows + 2 * spare, grid.columns + 2 * spare)
    z = 0.5 * (low_z + high_z)
    middle = np.array([*nodes.mean(axis=0), float(np.median(z))])
    reach = 0.5 * float(np.hypot(grid.columns * grid.cell_x, grid.rows * grid.cell_y)) + float(np.ptp([low_z, high_z]))
    place = place_at(photographs, middle, reach, options.edge)
    ground, low, high = (place.from_crs(np.column_stack([nodes, h])) for h in (z, low_z, high_z))
    candidates = possible_pairs(place, ground)
    work = _TileMatching(place, store, grid, options.level, (ground, low, high))
    matched = [m for pair in chosen_pairs(candidates, options.pairs) if (m := work.match(pair)) is not None]
    if matched:
        matched += _fill_holes(work, candidates, matched, nodes, inside)
    if not matched:
        return empty_tile(shape)
    used, layers = [m.pair for m in matched], [m.layer for m in matched]
    numbers = np.array([[p.left, p.right] for p in used])
    scale = CellScale.of(cell_px, metres_per_pixel(place, used, options.level))
    shown = sorted({k for p in used for k in (p.left, p.right)}, key=lambda k: _off_nadir(place, k))
    *maps, factor, shared_cells = _fused(place, used, shown, layers, scale)
    z, sigma, members = (a[spare:-spare, spare:-spare].copy() for a in maps)
    across = np.array([m.across for m in matched])
    return TileSurface(
        z + middle[2], sigma, members, np.array(shown), factor, numbers, across, shared_cells, scale.pixel,
        rim_of(maps[0] + middle[2], spare),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Matched:
    """A pair, its heights above the place and their σ, (rows, columns) m, and its shift across the base, px."""

    pair: Pair
    layer: tuple[np.ndarray, np.ndarray]
    across: float


@dataclass(frozen=True, eq=False)
class _TileMatching:
    """How pairs of a tile are matched; heights : places (n, 3) m in q, as expected, lowest and highest."""

    place: Place
    store: GreyStore
    grid: Grid
    level: int
    heights: tuple[np.ndarray, np.ndarray, np.ndarray]

    def match(self, pair: Pair) -> _Matched | None:
        """The heights of a pair; None where its photographs have nothing in common here."""
        geometry = epipolar_geometry(self.place, pair.left, pair.right, self.level, *self.heights)
        if geometry is None:
            return None
        images = epipolar_images(self.place, geometry, self.store)
        if not (images.left_known.any() and images.right_known.any()):
            return None
        found = parallaxes_of(images)
        return _Matched(pair, _heights(self.place, geometry, found, self.grid), found.across)


def _fill_holes(
    work: _TileMatching, candidates: list[Candidate], matched: list[_Matched], nodes: np.ndarray, inside: Grid
) -> list[_Matched]:
    """More pairs, one after the other, where cells have no height that other photographs may show.

    Parameters
    ----------
    nodes : (n, 2) m, X and Y of the places at which the candidates were looked at. inside : the tile without what it
        is measured beyond its edge: holes there are another tile's.
    """
    spare = (work.grid.rows - inside.rows) // 2
    own = slice(spare, spare + inside.rows), slice(spare, spare + inside.columns)
    more: list[_Matched] = []
    tried = [m.pair for m in matched]
    holes = np.all([np.isnan(m.layer[0][own]) for m in matched], axis=0)
    while len(tried) < kernels.MOST_PAIRS:
        found = pair_for_holes(candidates, tried, _holes_at(holes, inside, nodes))
        if found is None:
            break
        pair, hoped = found
        tried.append(pair)
        one = work.match(pair)
        if one is None:
            continue
        left = holes & np.isnan(one.layer[0][own])
        filled = float((holes & ~left).mean())
        if filled > 0.0:
            more.append(one)
        holes = left
        if filled < LEAST_FILLED * hoped:
            break
    return more


def _holes_at(holes: np.ndarray, grid: Grid, nodes: np.ndarray) -> np.ndarray:
    """(n,) share of the cells about nodes (n, 2) m that are holes; 0 outside of the grid, so more inside of it."""
    rows = np.rint((grid.top - nodes[:, 1]) / grid.cell_y - 0.5).astype(int)
    columns = np.rint((nodes[:, 0] - grid.left) / grid.cell_x - 0.5).astype(int)
    inside = (rows >= 0) & (rows < grid.rows) & (columns >= 0) & (columns < grid.columns)
    if not inside.any():
        return np.full(len(nodes), float(holes.mean()))
    side = max(int(np.sqrt(holes.size / inside.sum())), 1)
    share = cv2.boxFilter(holes.astype(np.float32), -1, (side, side))
    out = np.zeros(len(nodes))
    out[inside] = share[rows[inside], columns[inside]] * (len(nodes) / inside.sum())
    return out


def _heights(place: Place, g: EpipolarGeometry, found: Parallaxes, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Heights above the place and σ, (rows, columns) m, of the cells as one pair sees them."""
    # metres of the CRS to columns and rows of the grid, whole at centres of cells
    to_grid = place.to_crs.copy()
    for axis, start, sign in ((0, grid.left - place.origin[0], 1.0), (1, grid.top - place.origin[1], -1.0)):
        to_grid[axis, 0] -= start
        to_grid[axis] *= sign / grid.cell_x
        to_grid[axis, 0] -= 0.5
    rays = kernels.Rays(
        g.f, g.base, g.first, g.known, np.ascontiguousarray(g.centre), np.ascontiguousarray(g.rotation), to_grid,
        place.reach,
    )  # fmt: skip
    place_of, per_pixel = np.split(scratch.take(4, found.value.shape), [3])
    per_pixel = per_pixel[0]
    kernels.place_of_pixels(rays, found.value, place_of, per_pixel)
    z, sigma = (np.full((grid.rows, grid.columns), np.nan) for _ in range(2))
    kernels.lay_mesh(place_of, found.sigma, per_pixel, found.value, LARGEST_JUMP_PX, z, sigma)
    return z, sigma


def metres_per_pixel(place: Place, pairs: list[Pair], level: int) -> float:
    """m of height that a pixel of parallax is, of the median pair."""
    p, found = place.photographs, []
    for pair in pairs:
        far = float(np.linalg.norm(place.centres[pair.left]))
        gsd = far / (p.orientation.interior[pair.left, 0] * p.sensor[pair.left, 2]) * 2**level
        found.append(gsd / (2.0 * np.tan(np.radians(pair.angle) / 2.0)))
    return float(np.median(found))


def _fused(
    place: Place, pairs: list[Pair], photographs: list[int], layers: list[tuple[np.ndarray, np.ndarray]],
    scale: CellScale,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, float]:  # fmt: skip
    """Heights above the place and their σ, m, bits of their photographs, factor of σ, cells of one noise."""
    heights, sigmas = (np.stack(part) for part in zip(*layers, strict=True))
    correlation = noise_correlation(place, pairs)
    bit = {k: 1 << n for n, k in enumerate(photographs)}
    used = np.array([bit[p.left] | bit[p.right] for p in pairs], np.int64)
    shape = heights.shape[1:]
    z, sigma, misfit = (np.full(shape, np.nan) for _ in range(3))
    members = np.zeros(shape, np.int64)
    tolerance = AGREEING_PX * scale.pixel
    kernels.fuse(heights, sigmas, correlation, used, AGREEING_SIGMAS, tolerance, z, sigma, members, misfit)
    level = heights
    if len(pairs) > 1:
        level = _levelled(heights, sigmas, z, tolerance)
        out = (np.empty(shape), np.empty(shape), np.empty(shape, np.int64), misfit)
        kernels.fuse(level, sigmas, correlation, used, AGREEING_SIGMAS, tolerance, *out)
    factor = _factor(misfit)
    patched = _without_patches(z, PATCH_STEP_PX * tolerance)
    z[~patched], sigma[~patched], members[~patched] = np.nan, np.nan, 0
    sigma = cell_sigma(z, sigma * factor, heights, sigmas, scale)
    return z, sigma, members.astype(np.uint64), factor, _shared_cells(level, sigmas)


def _off_nadir(place: Place, k: int) -> float:
    """Tangent of the angle from the vertical at which a photograph sees the place."""
    x, y, z = place.photographs.centres[k] - place.origin
    return float(np.hypot(x, y) / abs(z)) if z else np.inf


def _without_patches(z: np.ndarray, step: float) -> np.ndarray:
    """(rows, columns) whether a height belongs to a patch that is large enough; step : m that bounds a patch."""
    known = np.isfinite(z)
    if not known.any():
        return known
    unit = step / STEP_UNITS
    whole = np.where(known, np.rint((z - middle_height(z)) / unit), NO_HEIGHT)
    held = np.clip(whole, NO_HEIGHT, -NO_HEIGHT).astype(np.int16)
    cv2.filterSpeckles(held, NO_HEIGHT, SMALLEST_PATCH, STEP_UNITS)
    return held != NO_HEIGHT


def _levelled(heights: np.ndarray, sigmas: np.ndarray, z: np.ndarray, tolerance: float) -> np.ndarray:
    """(pairs, rows, columns) m, heights less what a pair is above or below the surface z over many cells.

    That comes from the orientation of the pairs, whose σ the adjustment states: it is no noise of the matching.
    """
    both = zip(heights, sigmas, strict=True)
    return np.stack([h - _slow(h - z, s, AGREEING_SIGMAS * s + tolerance) for h, s in both])


def _slow(difference: np.ndarray, sigma: np.ndarray, most: np.ndarray) -> np.ndarray:
    """(rows, columns) m, weighted mean of the differences about a cell; what is larger than `most` does not count."""
    # OpenCV sums them in double precision
    difference, sigma, most = (a.astype(np.float32) for a in (difference, sigma, most))
    known = np.abs(difference) < most
    weight = np.where(known, sigma, np.float32(np.inf))
    weight = np.float32(1.0) / (weight * weight)
    size = SLOW_CELLS, SLOW_CELLS
    weights = cv2.boxFilter(weight, -1, size, normalize=False) + np.float32(1e-9) * weight.max(initial=1e-20)
    slow = np.zeros(known.shape, np.float32)
    for _ in range(SLOW_ROUNDS):
        left = weight * np.where(known, difference - slow, np.float32(0.0))
        slow += cv2.boxFilter(left, -1, size, normalize=False) / weights
    return slow


def _factor(misfit: np.ndarray) -> float:
    """By which heights of pairs scatter more than their σ say; 1 where too few cells were measured twice."""
    known = np.isfinite(misfit)
    count = np.count_nonzero(known)
    if count < FEWEST_MISFITS:
        return 1.0
    every = max(int(np.sqrt(count / MOST_MISFITS)), 1)  # row and column: neighbours share their noise
    told = misfit[::every, ::every][known[::every, ::every]]
    # the median of chi-square of one degree of freedom is 1 / SIGMA_PER_MAD²; more pairs lie nearer to 1
    return float(np.clip(np.sqrt(np.median(told)) * SIGMA_PER_MAD, 1.0, LARGEST_FACTOR))


def _shared_cells(level: np.ndarray, sigmas: np.ndarray) -> float:
    """Side of the square of cells that have one noise: from how differences of two pairs are alike at neighbours.

    The noise of a sum over many cells is that of cells for themselves times the sum of the correlations over all lags,
    the side of the square being its root.

    Parameters
    ----------
    level, sigmas : (pairs, rows, columns) m, heights of pairs without what differs slowly between them, and their σ.
    """
    if len(level) < 2:
        return np.nan
    both = {(n, m): int(np.isfinite(level[n] + level[m]).sum()) for m in range(len(level)) for n in range(m)}
    n, m = max(both, key=lambda pair: both[pair])
    difference = (level[n] - level[m]) / np.hypot(sigmas[n], sigmas[m])
    known = np.isfinite(difference) & (np.abs(difference) < AGREEING_SIGMAS)
    if known.sum() < FEWEST_MISFITS:
        return np.nan
    d = np.where(known, difference, 0.0)
    variance = float((d**2).sum() / known.sum())
    total = []
    for a, b in ((d, known), (d.T, known.T)):
        sums = 1.0
        for lag in range(1, min(MOST_LAGS, len(a) - 1)):
            pairs = float((b[lag:] & b[:-lag]).sum())
            rho = float((a[lag:] * a[:-lag]).sum()) / max(pairs, 1.0) / max(variance, 1e-12)
            if rho < 0.05:
                break
            sums += 2.0 * rho
        total.append(sums)
    return float(np.sqrt(total[0] * total[1]))
