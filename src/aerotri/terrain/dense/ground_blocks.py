"""Blocks of coarse cells that the ground of a surface is worked through in, so that memory does not grow with it."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from pathlib import Path

import numpy as np

from aerotri.rasters.grids import Grid
from aerotri.terrain.dense.tile_files import TileWindow

BLOCK_CELLS = 1000
"""Coarse cells of a side; chosen [C]: 400 bytes of each are 0.5 GB with the margin, which adds a quarter to the work
where the widest object is 18 m and cells 1 m."""
REACH = 3.0
"""Margin of a block, in widest objects; chosen [C]: the opening by the largest disc reaches one, the nearest ground and
the nearest height below an object or across a hole that is bridged half of one each, triangles one more."""
REACH_CELLS = 8
"""Margin besides: low errors, slopes, cells beside objects, and discs whole round about."""
KEPT = np.dtype([(name, np.float64) for name in ("lowest", "z", "sigma", "away")])
"""Of a coarse cell."""


@dataclass(frozen=True)
class Block:
    """A part of the coarse cells.

    Parameters
    ----------
    own : cells that are counted in this block. wide : that it is worked out from, and known on.
    tiles : windows of fine cells whose middle lies in its own part. near : that meet the wide one.
    """

    own: TileWindow
    wide: TileWindow
    tiles: tuple[TileWindow, ...]
    near: tuple[TileWindow, ...]

    def own_cells(self) -> np.ndarray:
        """(rows, columns) bool, cells of the wide window that are its own."""
        inside = np.zeros((self.wide.rows, self.wide.columns), bool)
        inside[part(self.own, self.wide)] = True
        return inside


def ground_blocks(tiles: Sequence[TileWindow], coarse: Grid, step: int, widest: float) -> list[Block]:
    """The blocks of a grid.

    Parameters
    ----------
    tiles : of the fine cells. coarse : the grid; step : fine cells a side of its cells. widest : m, of an object.
    """
    sides = np.array([[w.row, w.column, w.rows, w.columns] for w in tiles]).reshape(-1, 4)
    block_of = (sides[:, :2] + sides[:, 2:] // 2) // step // BLOCK_CELLS
    # first and last coarse cells of tiles
    first, last = sides[:, :2] // step, -(-(sides[:, :2] + sides[:, 2:]) // step)
    size, margin = np.array([coarse.rows, coarse.columns]), int(np.ceil(REACH * widest / coarse.cell_x)) + REACH_CELLS
    found = []
    for place in np.ndindex(*(-(-size // BLOCK_CELLS))):
        low = BLOCK_CELLS * np.array(place)
        high = np.minimum(low + BLOCK_CELLS, size)
        mine = (block_of == place).all(axis=1)
        start = np.maximum(np.vstack([first[mine], low]).min(axis=0) - margin, 0)
        end = np.minimum(np.vstack([last[mine], high]).max(axis=0) + margin, size)
        near = ((first < end) & (last > start)).all(axis=1)
        own_tiles, others = (tuple(compress(tiles, which)) for which in (mine, near))
        found.append(Block(_window(low, high), _window(start, end), own_tiles, others))
    return found


def _window(first: np.ndarray, last: np.ndarray) -> TileWindow:
    return TileWindow(*map(int, first), *map(int, last - first))


def part(of: TileWindow, inside: TileWindow) -> tuple[slice, slice]:
    """Where the cells that two windows share lie in the second one."""
    row, column = of.row - inside.row, of.column - inside.column
    return (
        slice(max(row, 0), max(min(row + of.rows, inside.rows), 0)),
        slice(max(column, 0), max(min(column + of.columns, inside.columns), 0)),
    )


class BlockFiles:
    """What is known of coarse cells, block by block, in a temporary folder (TMPDIR) that goes with this object."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="aerotri-"))
        weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)

    def write(self, block: Block, **values: np.ndarray) -> None:
        """Values (rows, columns) of the wide window, by the names of KEPT."""
        cells = np.empty((block.wide.rows, block.wide.columns), KEPT)
        for name, of_cells in values.items():
            cells[name] = of_cells
        np.save(self._path(block), cells)

    def read(self, block: Block, window: TileWindow) -> np.ndarray:
        """(rows, columns) of KEPT, coarse cells of a window inside the wide one."""
        return np.array(np.load(self._path(block), mmap_mode="r")[part(window, block.wide)])

    def _path(self, block: Block) -> Path:
        return self.folder / f"{block.own.row}_{block.own.column}.npy"
