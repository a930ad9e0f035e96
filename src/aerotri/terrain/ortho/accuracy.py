"""How exactly a detail lies in an orthophoto: standard deviations of the plan position, cell by coarse cell.

[D] The cell at (X, Y) shows what the ray of its photograph through (X, Y, Z) meets, Z the height of the surface. With
t = (dX, dY)/dZ along the ray and s = (∂Z/∂X, ∂Z/∂Y) of the ground, a height that is h too high and errors dx of
orientation, camera and additional parameters move a detail by

    d = K·(t·h − G·(∂π/∂x)·dx),   K = (I − t·sᵀ)⁻¹,

G the inverse of the partials of the image position by X and Y. An error of the measured image position, in which the
detail is pointed at, moves it by K·G·σ. Of another surface h is independent of dx. One that was measured with the same
orientation has moved by e = J_e·dx, as points that are intersected do: h = e_Z − s·(e_X, e_Y) + n, n the noise of
matching. Then dx counts once, with its joint covariance: a turn or a shift of the block moves surface and detail
alike, and an error of the height that comes from the ray of the photograph itself cancels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from aerotri.rasters.grids import Grid
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.image_sigma import image_sigma_of_cameras
from aerotri.terrain.adjustment_part import plan_covariances, plan_of_images, shown_covariances
from aerotri.terrain.dense.pairs import WEAKEST_ANGLE
from aerotri.terrain.ortho.candidates import Candidates
from aerotri.terrain.ortho.seams import Choice
from aerotri.terrain.photographs import Photographs

PLACES, FEWEST_OF_PHOTOGRAPH = 400, 3
"""Coarse cells in which the part of the adjustment is computed, the others interpolated, and how many of every
photograph at least; chosen [C]: it changes slowly within a photograph."""
STEEPEST = 1.0
"""Slope of the ground that counts at most [C]: walls are steeper, and an orthophoto does not show them."""
FLATTEST = 0.5
"""Of 1 − s·t, which is 0 where the ray runs along the slope [C]."""
LEAST_NOISE = 0.25
"""Of σ of a height is noise at least, where the part of the adjustment is taken off it [C]: that part is known for the
photographs that see a cell, not for those that measured it."""


class Reader(Protocol):
    """What a raster gives at places (n,) m near one another; NaN where it is not known."""

    def sample(self, x: np.ndarray, y: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class HeightSigma:
    """What is known of the errors of a surface.

    Parameters
    ----------
    total : σ of its heights; None where it has none. noise : σ of matching alone; None where not known apart.
    same : whether it was measured with the adjustment of the photographs.
    """

    total: Reader | None = None
    noise: Reader | None = None
    same: bool = False


@dataclass(frozen=True, eq=False)
class PlanAccuracy:
    """σ of X and Y, root mean square of both, of coarse cells (r, c) m; NaN where there is no photograph.

    Parameters
    ----------
    surface : part of the surface, without that of a common adjustment; None: its σ is not known.
    orientation : part of the adjustment, with what it does to the surface where that was measured with it.
    image : the part of a measured image position. total : all of them. tangent : tan ν.
    same : whether surface and photographs have one adjustment. relative : as total, the adjustment after a
        similarity of the whole orthophoto; None where the surface has another adjustment, which does not move along.
    """

    surface: np.ndarray | None
    orientation: np.ndarray
    image: np.ndarray
    total: np.ndarray
    tangent: np.ndarray
    same: bool = False
    relative: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class ShownCells:
    """Coarse cells that are shown: (n, 3) m their middles, (n,) photographs, (n, 2) t and s, (n, m) photographs that
    see them, −1 for none."""

    xyz: np.ndarray
    number: np.ndarray
    along: np.ndarray
    slope: np.ndarray
    seen_by: np.ndarray

    @cached_property
    def spread(self) -> np.ndarray:
        """(n, 2, 2) K."""
        flat = np.maximum(1.0 - np.sum(self.along * self.slope, axis=1), FLATTEST)
        return np.eye(2) + self.along[:, :, None] * self.slope[:, None, :] / flat[:, None, None]


def plan_accuracy(
    calibration: Adjustment, photographs: Photographs, candidates: Candidates, choice: Choice, heights: HeightSigma
) -> PlanAccuracy:
    """The accuracy of an orthophoto.

    Parameters
    ----------
    heights : σ of the surface, and where they come from.
    """
    i, j = np.nonzero(choice.number >= 0)
    cells = _cells(photographs, candidates, choice, i, j)
    spread = cells.spread
    image = _image_part(calibration, photographs, cells)
    by_adjustment = _adjustment_part(calibration, photographs, cells, heights.same)
    orientation, surface = np.sqrt(by_adjustment.shown), None
    noise = _noise(heights, cells.xyz, by_adjustment.of_height)
    if noise is not None:
        surface = noise * np.linalg.norm(np.einsum("nab,nb->na", spread, cells.along), axis=1) / np.sqrt(2.0)
    others = image**2 + (0.0 if surface is None else surface**2)
    total, left = np.sqrt(orientation**2 + others), by_adjustment.relative

    def laid(values: np.ndarray) -> np.ndarray:
        out = np.full(choice.number.shape, np.nan)
        out[i, j] = values
        return out

    return PlanAccuracy(
        None if surface is None else laid(surface), laid(orientation), laid(image), laid(total),
        laid(np.linalg.norm(cells.along, axis=1)), by_adjustment.of_height is not None,
        None if left is None else laid(np.sqrt(left + others)),
    )  # fmt: skip


def _cells(
    photographs: Photographs, candidates: Candidates, choice: Choice, i: np.ndarray, j: np.ndarray
) -> ShownCells:
    grid, number = candidates.grid, choice.number[i, j]
    xyz = np.column_stack([grid.x(j), grid.y(i), candidates.z[i, j]])
    ray = xyz - photographs.centres[number]
    slope = slopes(candidates.z, grid)[i, j]
    return ShownCells(xyz, number, ray[:, :2] / ray[:, 2:], slope, candidates.found[:, i, j].T)


def slopes(z: np.ndarray, grid: Grid) -> np.ndarray:
    """(r, c, 2) ∂Z/∂X and ∂Z/∂Y of heights (r, c) m, `STEEPEST` at most; 0 where a neighbour is not known.

    Of the slopes to either side the smaller one, 0 where they have different signs: a roof has no slope at its eaves.
    """
    out = np.zeros((*z.shape, 2))
    for axis, cell in ((1, grid.cell_x), (0, -grid.cell_y)):
        step = np.moveaxis(np.diff(z, axis=axis), axis, 0) / cell
        before, after = step[:-1], step[1:]
        least = np.where(before * after > 0.0, np.sign(before) * np.minimum(np.abs(before), np.abs(after)), 0.0)
        np.moveaxis(out[:, :, 1 - axis], axis, 0)[1:-1] = np.clip(least, -STEEPEST, STEEPEST)
    return out


def _image_part(calibration: Adjustment, photographs: Photographs, cells: ShownCells) -> np.ndarray:
    """(n,) m, root mean square of K·G·σ over X and Y, σ of an image coordinate of the camera of each photograph."""
    sigma = image_sigma_of_cameras(calibration)[calibration.local.block.images.camera[photographs.rows]]
    of_unit = plan_of_images(calibration, photographs.restitution, photographs.rows, cells.xyz, cells.number)
    shown = np.einsum("nai,nij,naj->n", cells.spread, of_unit, cells.spread, optimize=True)
    return sigma[cells.number] * np.sqrt(0.5 * shown)


@dataclass(frozen=True, eq=False)
class ByAdjustment:
    """What the adjustment does to n cells, variances in m².

    Parameters
    ----------
    shown : (n,) mean of X and Y of what they show. of_height : (n,) of Z; None where the surface is not of the same
        adjustment. relative : (n,) as `shown`, after a similarity of all; None likewise.
    """

    shown: np.ndarray
    of_height: np.ndarray | None = None
    relative: np.ndarray | None = None


def _adjustment_part(calibration: Adjustment, photographs: Photographs, cells: ShownCells, same: bool) -> ByAdjustment:
    """The part of the adjustment, of a surface of the same adjustment or of another.

    Where no cell is seen by two photographs from different places, nothing is known of how the surface moves.
    """
    twice = _seen_with_a_base(photographs, cells) if same else np.zeros(len(cells.xyz), bool)
    same = same and bool(twice.any())
    some = _some(cells.number, twice if same else np.ones(len(twice), bool))
    xyz, number = cells.xyz[some], cells.number[some]
    given = calibration, photographs.restitution, photographs.rows, xyz, number
    near = _nearest(xyz, number, cells)
    spread = cells.spread
    if not same:
        shown = np.einsum("nai,nij,naj->na", spread, plan_covariances(*given)[near], spread, optimize=True)
        return ByAdjustment(shown.mean(axis=1))
    both, left = (found[near] for found in shown_covariances(*given, cells.seen_by[some]))
    shown, relative = (shown_variances(cells, found).mean(axis=1) for found in (both, left))
    return ByAdjustment(shown, both[:, 5, 5], relative)


def _seen_with_a_base(photographs: Photographs, cells: ShownCells) -> np.ndarray:
    """(n,) bool, whether another photograph sees a cell under an angle with the ray of the first of them."""
    out = np.zeros(len(cells.xyz), bool)
    least = np.cos(np.radians(WEAKEST_ANGLE))
    for other in cells.seen_by.T[1:]:
        two = np.flatnonzero((other >= 0) & (cells.seen_by[:, 0] >= 0) & ~out)
        one, ray = (photographs.centres[k[two]] - cells.xyz[two] for k in (cells.seen_by[:, 0], other))
        size = np.linalg.norm(one, axis=1) * np.linalg.norm(ray, axis=1)
        out[two] = np.einsum("na,na->n", one, ray) <= least * size
    return out


def shown_variances(cells: ShownCells, both: np.ndarray) -> np.ndarray:
    """(n, 2) m² of X and Y of details on ground that was measured with the same adjustment.

    Parameters
    ----------
    both : (n, 6, 6) m², as of `shown_covariances`.
    """
    # d = K·(J_p + t·e_Z − t·(s·e_XY)): of the first two rows, and of X and Y of the surface
    by = np.zeros((len(cells.xyz), 2, 6))
    by[:, :, :2] = cells.spread
    by[:, :, 3:5] = -np.einsum("nab,nb,nc->nac", cells.spread, cells.along, cells.slope)
    return np.einsum("nai,nij,naj->na", by, both, by, optimize=True)


def _some(number: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """Some of the cells, of every photograph a few, by chance, so that no pattern of strips meets one of cells."""
    order = np.random.default_rng(0).permutation(np.flatnonzero(usable))
    by_photograph = order[np.argsort(number[order], kind="stable")]
    _, first, count = np.unique(number[by_photograph], return_index=True, return_counts=True)
    place = np.arange(len(by_photograph)) - np.repeat(first, count)
    wanted = np.maximum(np.repeat(count, count) * PLACES / len(order), FEWEST_OF_PHOTOGRAPH)
    return by_photograph[place < wanted]


def _nearest(xyz: np.ndarray, number: np.ndarray, cells: ShownCells) -> np.ndarray:
    """(n,) for every cell the nearest of some places (k, 3), of its own photograph where that has one."""
    from scipy.spatial import KDTree

    # photographs as layers, so far apart that another one is only taken where there is none of the own
    middle = cells.xyz[:, :2].min(axis=0)
    apart = 10.0 * float(np.ptp(cells.xyz[:, :2], axis=0).max()) + 1.0
    layers, own = np.unique(number, return_inverse=True)
    known = np.isin(cells.number, layers)
    out = np.empty(len(cells.xyz), np.int64)
    flat, wanted = xyz[:, :2] - middle, cells.xyz[:, :2] - middle
    at = np.searchsorted(layers, cells.number[known])
    tree = KDTree(np.column_stack([flat, apart * own.ravel()]))
    out[known] = tree.query(np.column_stack([wanted[known], apart * at]))[1]
    if not known.all():
        out[~known] = KDTree(flat).query(wanted[~known])[1]
    return out


def _noise(heights: HeightSigma, xyz: np.ndarray, of_height: np.ndarray | None) -> np.ndarray | None:
    """(n,) m, σ of the heights that the adjustment does not explain; None where there is none.

    Parameters
    ----------
    of_height : (n,) m², what the adjustment does to the heights; None: they come from elsewhere.
    """
    if of_height is not None and heights.noise is not None:
        return _near(heights.noise, xyz)
    if heights.total is None:
        return None
    total = _near(heights.total, xyz)
    return total if of_height is None else np.sqrt(np.maximum(total**2 - of_height, (LEAST_NOISE * total) ** 2))


def _near(sigma: Reader, xyz: np.ndarray) -> np.ndarray:
    """(n,) σ of the surface at places, row by row of the coarse grid so that little is read at a time."""
    out = np.full(len(xyz), np.nan)
    starts = np.flatnonzero(np.append(True, np.diff(xyz[:, 1]) != 0.0))
    for first, last in zip(starts, np.append(starts[1:], len(xyz)), strict=True):
        out[first:last] = sigma.sample(xyz[first:last, 0], xyz[first:last, 1])
    return out
