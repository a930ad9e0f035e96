"""Ground of a dense surface without what stands on it, bridged below objects with a σ that grows across.

The simple morphological filter [L: Pingel, Clarke, McBride 2013] on the lowest heights of coarse cells tells where
ground is; the fine cells near that ground are kept as measured. What is left open is bridged by triangles between the
ground around it: below objects that were measured, and across holes that heights surround, not beyond the outline of
the surface. How wrong a bridge is by its distance from the ground is measured on the ground itself: discs of it
are taken out, bridged and compared; a power law leads from their distances to all [D].
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.ndimage import (
    binary_dilation,
    binary_erosion,
    binary_fill_holes,
    distance_transform_edt,
    grey_opening,
    map_coordinates,
)
from scipy.spatial import QhullError

from aerotri.conventions import InputError
from aerotri.memory import refuse_beyond_memory
from aerotri.rasters.grids import Grid
from aerotri.terrain.dense.tile_files import TileWindow
from aerotri.terrain.surface import (
    LEAST_POWER,
    MOST_POWER,
    SMRF_HEIGHT_M,
    SMRF_SCALE,
    SMRF_SLOPE,
    ground_cells,
)

if TYPE_CHECKING:
    from aerotri.terrain.dense.measure import DenseOutcome

COARSE_M = 1.0
"""Cell of the lowest heights, m: that of PDAL's filters.smrf."""
LOW_SLOPE = 5.0
"""Slope beyond which a lone low cell is an error: that of filters.smrf."""
BLUR_CELLS = 3
"""Fine cells beside an object that are no ground: half a window of the matching is two, its smoothing one more."""
BYTES_OF_CELL = 200
"""Of a coarse cell, held as a whole."""
RADII = (1, 2, 4, 8)
"""Of the discs that are taken out to measure bridges, coarse cells."""
FEWEST_BRIDGED = 30
MEASURED_SHARE = 0.5
"""Of the fine cells of a coarse one from which the way from outside ends there; chosen [C]: lone matches by chance on
water or in leaves do not close a bay."""
MEASURED, BRIDGED = 1, 2
"""Where a height of the ground comes from; 0 where there is none."""


@dataclass(frozen=True)
class BridgeLaw:
    """RMS error of a bridge: at_1_m · distance^power, m, from the ground; discs : that were taken out to measure it."""

    at_1_m: float
    power: float
    discs: int

    def sigma(self, distance: np.ndarray) -> np.ndarray:
        """m, at distances, m."""
        return self.at_1_m * np.asarray(distance, float) ** self.power


@dataclass(frozen=True, eq=False)
class GroundTile:
    """Heights, σ of matching and bridge, (rows, columns) m, and where they come from, uint8."""

    z: np.ndarray
    sigma: np.ndarray
    source: np.ndarray


@dataclass(frozen=True, eq=False)
class BareGround:
    """The ground of a surface.

    Parameters
    ----------
    outcome : the surface. widest : m, of an object. lowest : (rows, columns) m, the filter's own ground on the coarse
        grid, without holes; z : the mean ground, bridged, NaN where nothing is known; sigma : m, of matching at the
        nearest ground; away : m, from the ground. law : of bridges.
    beyond : (rows, columns) bool, coarse cells outside the surface and their neighbours.
    """

    outcome: DenseOutcome
    widest: float
    grid: Grid
    lowest: np.ndarray
    z: np.ndarray
    sigma: np.ndarray
    away: np.ndarray
    law: BridgeLaw
    beyond: np.ndarray

    def tiles(self) -> Iterator[tuple[TileWindow, GroundTile]]:
        """The ground of every tile of the surface."""
        for window in self.outcome.windows:
            yield window, self._tile(window)

    def measured(self, window: TileWindow) -> np.ndarray:
        """(rows, columns) bool, cells of a tile that are ground."""
        return _ground_of_tile(self.outcome, window, self.grid, self.lowest)[2]

    def _tile(self, window: TileWindow) -> GroundTile:
        o = self.outcome
        z, sigma, ground = _ground_of_tile(o, window, self.grid, self.lowest)
        grid = o.grid.window(window.row, window.column, window.rows, window.columns)
        bridge, of_rim, away = (_between(self.grid, values, grid) for values in (self.z, self.sigma, self.away))
        away = np.maximum(away, 0.5 * grid.cell_x)
        inside = np.isfinite(z) | ~self._coarse(self.beyond, window)
        open_ = ~ground & np.isfinite(bridge) & inside
        source = np.where(ground, MEASURED, np.where(open_, BRIDGED, 0)).astype(np.uint8)
        height = np.where(ground, z, np.where(open_, bridge, np.nan))
        of_bridge = np.hypot(of_rim, self.law.sigma(away))
        return GroundTile(height, np.where(ground, sigma, np.where(open_, of_bridge, np.nan)), source)

    def _coarse(self, values: np.ndarray, window: TileWindow) -> np.ndarray:
        """Values of the coarse cells that the cells of a tile lie in."""
        step = round(self.grid.cell_x / self.outcome.grid.cell_x)
        row, column = (np.arange(first, first + count) // step for first, count in (
            (window.row, window.rows), (window.column, window.columns)))  # fmt: skip
        return values[np.ix_(row, column)]


def bare_ground(outcome: DenseOutcome, widest: float) -> BareGround:
    """Filter the ground.

    Parameters
    ----------
    widest : m, the widest object that is taken off, and the widest hole inside the surface that is bridged.

    Raises
    ------
    InputError
        When the area is too large for memory.
    """
    o = outcome
    coarse = o.grid.coarser(max(round(COARSE_M / o.grid.cell_x), 1))
    refuse_beyond_memory(
        BYTES_OF_CELL * coarse.rows * coarse.columns, f"the ground of {coarse.rows} × {coarse.columns} cells",
        "give an --area, one part of the block after the other",
    )  # fmt: skip
    lowest, share = _lowest(o, coarse)
    # a fine cell without a height may be outside in a coarse cell that has heights, so the neighbours count as well
    beyond = np.asarray(binary_dilation(outside(share >= MEASURED_SHARE), np.ones((3, 3), bool)), bool)
    lowest = _without_low_errors(lowest, coarse.cell_x)
    kept = ground_cells(lowest, coarse.cell_x, widest=widest)
    lowest = filled(np.where(kept, lowest, np.nan))
    z, sigma = _means(o, coarse, lowest)
    known = np.isfinite(z)
    law = bridge_law(z, coarse.cell_x, widest)
    away = _away(known, coarse.cell_x)
    bridged = np.where(away <= 0.5 * widest, bridged_heights(z), np.nan)
    return BareGround(o, widest, coarse, lowest, np.where(known, z, bridged), filled(sigma), away, law, beyond)


def outside(measured: np.ndarray) -> np.ndarray:
    """(rows, columns) bool, cells from which a way over cells that are not measured leads beyond the border."""
    return ~np.asarray(binary_fill_holes(measured), bool)


def bridged_heights(z: np.ndarray) -> np.ndarray:
    """(rows, columns) m, heights with their holes (NaN) bridged by triangles between the cells around them.

    NaN remains beyond the outline of what is known.
    """
    known = np.isfinite(z)
    rim = known & binary_dilation(~known, np.ones((3, 3), bool))
    rows, columns = np.nonzero(rim)
    if known.all() or len(rows) < 3:
        return z.copy()
    out = z.copy()
    try:
        out[~known] = LinearNDInterpolator(np.column_stack([rows, columns]), z[rim])(np.argwhere(~known))
    except QhullError:  # all on one line
        return z.copy()
    return out


def bridge_law(z: np.ndarray, cell: float, widest: float) -> BridgeLaw:
    """How wrong bridges are by their distance from the ground, from discs of ground that are taken out and bridged.

    Where too little ground is whole, the slope that the filter takes for ground, 15 %, is the error.

    Parameters
    ----------
    z : (rows, columns) m, ground, NaN where it is not known. cell : m.
    """
    known = np.isfinite(z)
    distances, errors, discs = [], [], 0
    for radius in (r for r in RADII if (2 * r + 1) * cell <= max(widest, 3.0 * cell)):
        taken = _discs(known, radius)
        if not taken.any():
            continue
        error = bridged_heights(np.where(taken, np.nan, z)) - z
        told = taken & np.isfinite(error)
        distances.append(_away(known & ~taken, cell)[told])
        errors.append(error[told])
        discs += int(_middles(known, radius).sum())
    if discs < FEWEST_BRIDGED:
        return BridgeLaw(SMRF_SLOPE, 1.0, discs)
    return _power_law(np.concatenate(distances), np.concatenate(errors), discs)


def _power_law(distance: np.ndarray, error: np.ndarray, discs: int) -> BridgeLaw:
    """By least squares through the logarithms of RMS errors at equal distances, weighted by their number."""
    at, place = np.unique(np.round(distance, 6), return_inverse=True)
    count = np.bincount(place)
    rms = np.sqrt(np.maximum(np.bincount(place, error**2) / count, 1e-12))
    x, y, w = np.log(at), np.log(rms), count / count.sum()
    dx, dy = x - w @ x, y - w @ y
    spread = float(w @ dx**2)
    power = float(np.clip(w @ (dx * dy) / spread, LEAST_POWER, MOST_POWER)) if spread > 1e-12 else 1.0
    scale = float(np.sqrt((count @ rms**2) / (count @ at ** (2.0 * power))))
    return BridgeLaw(scale, power, discs)


def _away(known: np.ndarray, cell: float) -> np.ndarray:
    """(rows, columns) m, distance from the nearest known cell."""
    if not known.any():
        return np.full(known.shape, np.inf)
    return np.asarray(distance_transform_edt(~known), float) * cell


def _middles(known: np.ndarray, radius: int) -> np.ndarray:
    """Cells of a lattice about which a disc and the cells around it are known."""
    whole = binary_erosion(known, _disc(radius + 1))
    every = np.zeros(known.shape, bool)
    every[:: 4 * radius, :: 4 * radius] = True
    return whole & every


def _discs(known: np.ndarray, radius: int) -> np.ndarray:
    middles = _middles(known, radius)
    return np.asarray(binary_dilation(middles, _disc(radius)), bool) if middles.any() else middles


def _disc(radius: int) -> np.ndarray:
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    return x * x + y * y <= radius * radius


def _lowest(o: DenseOutcome, coarse: Grid) -> tuple[np.ndarray, np.ndarray]:
    """(rows, columns) m, the lowest height in every coarse cell, NaN where there is none; share of it with heights."""
    count = np.zeros((coarse.rows, coarse.columns))
    out = np.full((coarse.rows, coarse.columns), np.inf)
    step = round(coarse.cell_x / o.grid.cell_x)
    for window, tile in o.files.read_all(list(o.windows)):
        row, column = np.nonzero(np.isfinite(tile.z))
        at = (window.row + row) // step, (window.column + column) // step
        np.minimum.at(out, at, tile.z[row, column])
        np.add.at(count, at, 1.0)
    return np.where(np.isfinite(out), out, np.nan), count / step**2


def _without_low_errors(z: np.ndarray, cell: float) -> np.ndarray:
    """What lies as a lone pit far below its neighbours is taken out."""
    if not np.isfinite(z).any():
        return z
    above = -filled(z)
    return np.where(above - grey_opening(above, footprint=_disc(1)) > LOW_SLOPE * cell, np.nan, z)


def _means(o: DenseOutcome, coarse: Grid, lowest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean height and mean σ of the ground in every coarse cell, m."""
    shape, step = (coarse.rows, coarse.columns), round(coarse.cell_x / o.grid.cell_x)
    count, height, spread = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for window in o.windows:
        z, sigma, ground = _ground_of_tile(o, window, coarse, lowest)
        row, column = np.nonzero(ground)
        at = (window.row + row) // step, (window.column + column) // step
        for total, values in ((count, 1.0), (height, z[row, column]), (spread, sigma[row, column])):
            np.add.at(total, at, values)
    with np.errstate(invalid="ignore"):
        return height / count, spread / count


def _ground_of_tile(
    o: DenseOutcome, window: TileWindow, coarse: Grid, lowest: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights and σ of matching, m, of a tile, and whether each cell is ground."""
    b = BLUR_CELLS
    first = max(window.row - b, 0), max(window.column - b, 0)
    last = min(window.row + window.rows + b, o.grid.rows), min(window.column + window.columns + b, o.grid.columns)
    z, sigma = (np.full((last[0] - first[0], last[1] - first[1]), np.nan) for _ in range(2))
    for other in o.windows:
        top, left = max(other.row, first[0]), max(other.column, first[1])
        end, right = min(other.row + other.rows, last[0]), min(other.column + other.columns, last[1])
        if top >= end or left >= right:
            continue
        tile = o.files.read(other)
        if tile is None:
            raise InputError("was removed while ground was sought", "run the command again", o.files.path(other))
        to = np.s_[top - first[0] : end - first[0], left - first[1] : right - first[1]]
        source = np.s_[top - other.row : end - other.row, left - other.column : right - other.column]
        z[to], sigma[to] = tile.z[source], tile.sigma[source]
    grid = o.grid.window(first[0], first[1], *z.shape)
    known = np.isfinite(z)
    slope = np.hypot(*np.gradient(lowest, coarse.cell_x)) if min(lowest.shape) > 1 else np.zeros(lowest.shape)
    bound = SMRF_HEIGHT_M + SMRF_SCALE * _between(coarse, slope, grid) * coarse.cell_x
    near = known & (np.abs(z - _between(coarse, lowest, grid)) <= bound)
    beside = np.asarray(binary_dilation(known & ~near, _disc(b)), bool)
    ground = near & ~beside
    own = np.s_[window.row - first[0] :, window.column - first[1] :]
    z, sigma, ground = (values[own][: window.rows, : window.columns] for values in (z, sigma, ground))
    return z, sigma, ground


def _between(coarse: Grid, values: np.ndarray, grid: Grid) -> np.ndarray:
    """(rows, columns) of a finer grid, bilinear."""
    row, column = coarse.row(grid.y(np.arange(grid.rows))), coarse.column(grid.x(np.arange(grid.columns)))
    at = np.meshgrid(row, column, indexing="ij")
    return map_coordinates(values, at, order=1, mode="nearest")


def filled(values: np.ndarray) -> np.ndarray:
    """(rows, columns), holes as the nearest known cell; 0 where none is known."""
    known = np.isfinite(values)
    if not known.any():
        return np.zeros(values.shape)
    place = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return values[tuple(np.asarray(place))]
