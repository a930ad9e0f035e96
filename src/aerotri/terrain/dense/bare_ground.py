"""Ground of a dense surface without what stands on it, bridged below objects with a σ that grows across.

The simple morphological filter [L: Pingel, Clarke, McBride 2013] on the lowest heights of coarse cells tells where
ground is; the fine cells near that ground are kept as measured. What is left open is bridged by triangles between the
ground around it: below objects that were measured, and across holes that heights surround, not beyond the outline of
the surface. The coarse cells are worked through block by block; of the whole area is held only which of them were
measured, since a way from outside may lead through all of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import (
    binary_dilation,
    binary_fill_holes,
    distance_transform_edt,
    grey_opening,
    map_coordinates,
)

from aerotri.conventions import InputError
from aerotri.memory import refuse_beyond_memory
from aerotri.rasters.grids import Grid
from aerotri.terrain.dense.bridging import (
    BridgeLaw,
    DiscErrors,
    away_from,
    bridge_law,
    bridged_heights,
    disc,
    disc_errors,
)
from aerotri.terrain.dense.ground_blocks import Block, BlockFiles, ground_blocks, part
from aerotri.terrain.dense.tile_files import TileWindow
from aerotri.terrain.surface import SMRF_HEIGHT_M, SMRF_SCALE, ground_cells

if TYPE_CHECKING:
    from aerotri.terrain.dense.measure import DenseOutcome

COARSE_M = 1.0
"""Cell of the lowest heights, m: that of PDAL's filters.smrf."""
LOW_SLOPE = 5.0
"""Slope beyond which a lone low cell is an error: that of filters.smrf."""
BLUR_CELLS = 3
"""Fine cells beside an object that are no ground: half a window of the matching is two, its smoothing one more."""
BYTES_OF_CELL = 6
"""Of a coarse cell, held as a whole: whether it was measured, and what the way from outside is sought with."""
BYTES_OF_BLOCK_CELL = 400
"""Of a coarse cell of the block that is worked on; most are triangles across the discs that are taken out."""
MEASURED_SHARE = 0.5
"""Of the fine cells of a coarse one from which the way from outside ends there; chosen [C]: lone matches by chance on
water or in leaves do not close a bay."""
MEASURED, BRIDGED = 1, 2
"""Where a height of the ground comes from; 0 where there is none."""


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
    outcome : the surface. widest : m, of an object. grid : of the coarse cells.
    blocks : of every tile. files : of a block: lowest, m, the filter's own ground, without holes; z, m, the mean
        ground, bridged, NaN where nothing is known; sigma, m, of matching at the nearest ground; away, m, from the
        ground.
    law : of bridges. beyond : (rows, columns) bool, coarse cells outside the surface and their neighbours.
    """

    outcome: DenseOutcome
    widest: float
    grid: Grid
    blocks: dict[TileWindow, Block]
    files: BlockFiles
    law: BridgeLaw
    beyond: np.ndarray

    def tiles(self) -> Iterator[tuple[TileWindow, GroundTile]]:
        """The ground of every tile of the surface."""
        for window in self.outcome.windows:
            yield window, self._tile(window)

    def measured(self, window: TileWindow) -> np.ndarray:
        """(rows, columns) bool, cells of a tile that are ground."""
        return self._found(window)[0][2]

    def _found(self, window: TileWindow) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray], TileWindow, np.ndarray]:
        """As `_ground_of_tile`, the coarse cells about the tile, and what is known of them."""
        block = self.blocks[window]
        about = _about(window, self.grid, self.outcome.grid, block)
        cells = self.files.read(block, about)
        return _ground_of_tile(self.outcome, window, block, self.grid, about, cells["lowest"]), about, cells

    def _tile(self, window: TileWindow) -> GroundTile:
        (z, sigma, ground), about, cells = self._found(window)
        grid = self.outcome.grid.window(window.row, window.column, window.rows, window.columns)
        bridge, of_rim, away = (
            _between(self.grid, about, cells[name], self.outcome.grid, window) for name in ("z", "sigma", "away")
        )
        away = np.maximum(away, 0.5 * grid.cell_x)
        inside = np.isfinite(z) | ~self._coarse(self.beyond, window)
        open_ = ~ground & np.isfinite(bridge) & inside
        source = np.where(ground, MEASURED, np.where(open_, BRIDGED, 0)).astype(np.uint8)
        height = np.where(ground, z, np.where(open_, bridge, np.nan))
        of_bridge = np.hypot(of_rim, self.law.sigma(away))
        return GroundTile(height, np.where(ground, sigma, np.where(open_, of_bridge, np.nan)), source)

    def _coarse(self, values: np.ndarray, window: TileWindow) -> np.ndarray:
        """Values of the coarse cells that the cells of a tile lie in."""
        step = _step(self.grid, self.outcome.grid)
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
    blocks = ground_blocks(o.windows, coarse, _step(coarse, o.grid), widest)
    of_block = max(block.wide.rows * block.wide.columns for block in blocks)
    refuse_beyond_memory(
        BYTES_OF_CELL * coarse.rows * coarse.columns + BYTES_OF_BLOCK_CELL * of_block,
        f"the ground of {coarse.rows} × {coarse.columns} cells",
        "give an --area, one part of the block after the other",
    )  # fmt: skip
    measured, errors, files = np.zeros((coarse.rows, coarse.columns), bool), [], BlockFiles()
    for block in blocks:
        lowest, share = _lowest(o, block, coarse)
        own = part(block.own, block.wide)
        measured[part(block.own, TileWindow(0, 0, *measured.shape))] = share[own] >= MEASURED_SHARE
        errors.append(_worked_out(o, block, coarse, lowest, widest, files))
    # a fine cell without a height may be outside in a coarse cell that has heights, so the neighbours count as well
    beyond = np.asarray(binary_dilation(outside(measured), np.ones((3, 3), bool)), bool)
    of_tile = {window: block for block in blocks for window in block.tiles}
    return BareGround(o, widest, coarse, of_tile, files, bridge_law(errors), beyond)


def _worked_out(
    o: DenseOutcome, block: Block, coarse: Grid, lowest: np.ndarray, widest: float, files: BlockFiles
) -> DiscErrors:
    """Write what is known of the coarse cells of a block, from their lowest heights; the errors of its bridges."""
    cell, first = coarse.cell_x, (block.wide.row, block.wide.column)
    lowest = _without_low_errors(lowest, cell)
    lowest = filled(np.where(ground_cells(lowest, cell, widest=widest), lowest, np.nan))
    z, sigma = _means(o, block, coarse, lowest)
    known = np.isfinite(z)
    away = away_from(known, cell)
    bridged = np.where(known, z, np.where(away <= 0.5 * widest, bridged_heights(z, first), np.nan))
    files.write(block, lowest=lowest, z=bridged, sigma=filled(sigma), away=away)
    return disc_errors(z, cell, widest, first, block.own_cells())


def outside(measured: np.ndarray) -> np.ndarray:
    """(rows, columns) bool, cells from which a way over cells that are not measured leads beyond the border."""
    return ~np.asarray(binary_fill_holes(measured), bool)


def _step(coarse: Grid, fine: Grid) -> int:
    """Fine cells a side of a coarse one."""
    return round(coarse.cell_x / fine.cell_x)


def _fine(wide: TileWindow, step: int, grid: Grid) -> TileWindow:
    """The fine cells of coarse ones."""
    row, column = wide.row * step, wide.column * step
    end, right = min((wide.row + wide.rows) * step, grid.rows), min((wide.column + wide.columns) * step, grid.columns)
    return TileWindow(row, column, end - row, right - column)


def _lowest(o: DenseOutcome, block: Block, coarse: Grid) -> tuple[np.ndarray, np.ndarray]:
    """(rows, columns) m, the lowest height in every coarse cell, NaN where there is none; share of it with heights."""
    shape, step = (block.wide.rows, block.wide.columns), _step(coarse, o.grid)
    count, out, fine = np.zeros(shape), np.full(shape, np.inf), _fine(block.wide, step, o.grid)
    for window, tile in o.files.read_all(list(block.near)):
        rows, columns = part(fine, window)
        row, column = np.nonzero(np.isfinite(tile.z[rows, columns]))
        row, column = row + rows.start, column + columns.start
        at = (window.row + row) // step - block.wide.row, (window.column + column) // step - block.wide.column
        np.minimum.at(out, at, tile.z[row, column])
        np.add.at(count, at, 1.0)
    return np.where(np.isfinite(out), out, np.nan), count / step**2


def _without_low_errors(z: np.ndarray, cell: float) -> np.ndarray:
    """What lies as a lone pit far below its neighbours is taken out."""
    if not np.isfinite(z).any():
        return z
    above = -filled(z)
    return np.where(above - grey_opening(above, footprint=disc(1)) > LOW_SLOPE * cell, np.nan, z)


def _means(o: DenseOutcome, block: Block, coarse: Grid, lowest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean height and mean σ of the ground in every coarse cell of a block, m."""
    shape, step = lowest.shape, _step(coarse, o.grid)
    count, height, spread = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    fine = _fine(block.wide, step, o.grid)
    for tile in block.near:
        rows, columns = part(tile, fine)
        window = TileWindow(
            fine.row + rows.start, fine.column + columns.start, rows.stop - rows.start, columns.stop - columns.start
        )
        about = _about(window, coarse, o.grid, block)
        z, sigma, ground = _ground_of_tile(o, window, block, coarse, about, lowest[part(about, block.wide)])
        row, column = np.nonzero(ground)
        at = (window.row + row) // step - block.wide.row, (window.column + column) // step - block.wide.column
        for total, values in ((count, 1.0), (height, z[row, column]), (spread, sigma[row, column])):
            np.add.at(total, at, values)
    with np.errstate(invalid="ignore"):
        return height / count, spread / count


def _about(window: TileWindow, coarse: Grid, fine: Grid, block: Block) -> TileWindow:
    """The coarse cells that the slope about a tile and what lies beside it depends on."""
    step, wide = _step(coarse, fine), block.wide
    first = [(start - BLUR_CELLS) // step - 2 for start in (window.row, window.column)]
    ends = window.row + window.rows, window.column + window.columns
    last = [(end + BLUR_CELLS - 1) // step + 3 for end in ends]
    row, column = max(first[0], wide.row), max(first[1], wide.column)
    end, right = min(last[0], wide.row + wide.rows), min(last[1], wide.column + wide.columns)
    return TileWindow(row, column, end - row, right - column)


def _ground_of_tile(
    o: DenseOutcome, window: TileWindow, block: Block, coarse: Grid, about: TileWindow, lowest: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights and σ of matching, m, of a tile, and whether each cell is ground.

    Parameters
    ----------
    lowest : (rows, columns) m, of the coarse cells `about` the tile.
    """
    b = BLUR_CELLS
    row, column = max(window.row - b, 0), max(window.column - b, 0)
    end, right = min(window.row + window.rows + b, o.grid.rows), min(window.column + window.columns + b, o.grid.columns)
    wide = TileWindow(row, column, end - row, right - column)
    z, sigma = _heights(o, wide, block.near)
    known = np.isfinite(z)
    slope = np.hypot(*np.gradient(lowest, coarse.cell_x)) if min(lowest.shape) > 1 else np.zeros(lowest.shape)
    bound = SMRF_HEIGHT_M + SMRF_SCALE * _between(coarse, about, slope, o.grid, wide) * coarse.cell_x
    near = known & (np.abs(z - _between(coarse, about, lowest, o.grid, wide)) <= bound)
    beside = np.asarray(binary_dilation(known & ~near, disc(b)), bool)
    own = part(window, wide)
    return z[own], sigma[own], (near & ~beside)[own]


def _heights(o: DenseOutcome, window: TileWindow, near: tuple[TileWindow, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Heights and σ of matching, m, of a window of the fine cells, from the tiles that meet it."""
    z, sigma = (np.full((window.rows, window.columns), np.nan) for _ in range(2))
    for other in near:
        to, source = part(other, window), part(window, other)
        if any(side.start >= side.stop for side in to):
            continue
        tile = o.files.read_joined(other)
        if tile is None:
            raise InputError("was removed while ground was sought", "run the command again", o.files.path(other))
        z[to], sigma[to] = tile.z[source], tile.sigma[source]
    return z, sigma


def _between(coarse: Grid, about: TileWindow, values: np.ndarray, fine: Grid, window: TileWindow) -> np.ndarray:
    """(rows, columns) of a window of the fine cells, bilinear between values of the coarse cells `about` it."""
    grid = fine.window(window.row, window.column, window.rows, window.columns)
    row, column = coarse.row(grid.y(np.arange(grid.rows))), coarse.column(grid.x(np.arange(grid.columns)))
    at = np.meshgrid(row - about.row, column - about.column, indexing="ij")
    return map_coordinates(values, at, order=1, mode="nearest")


def filled(values: np.ndarray) -> np.ndarray:
    """(rows, columns), holes as the nearest known cell; 0 where none is known."""
    known = np.isfinite(values)
    if not known.any():
        return np.zeros(values.shape)
    place = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return values[tuple(np.asarray(place))]
