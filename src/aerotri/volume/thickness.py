"""The height of a surface over its base, on cells coarse enough to be drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.rasters.grids import Grid

MOST_CELLS = 500
"""A side of the map."""


@dataclass(frozen=True, eq=False)
class ThicknessMap:
    """Thickness (rows, columns) m on a grid coarse enough to be drawn; NaN outside and where not known."""

    grid: Grid
    thickness: np.ndarray


class ThicknessMeans:
    """Collects means of the thickness over so many cells that a map has a few hundred a side.

    Parameters
    ----------
    grid : of the thickness, cell by cell.
    """

    def __init__(self, grid: Grid):
        self._factor = max(1, -(-max(grid.rows, grid.columns) // MOST_CELLS))
        self._grid = grid.coarser(self._factor)
        self._sum = np.zeros((self._grid.rows, self._grid.columns))
        self._count = np.zeros_like(self._sum)

    def add(self, row: int, column: int, values: np.ndarray) -> None:
        """Add a window (rows, columns) m from its upper left cell on; NaN is left out."""
        known = np.isfinite(values)
        i, j = np.nonzero(known)
        at = (row + i) // self._factor, (column + j) // self._factor
        np.add.at(self._sum, at, values[known])
        np.add.at(self._count, at, 1.0)

    def map(self) -> ThicknessMap:
        """The means of all that was added."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return ThicknessMap(self._grid, self._sum / self._count)
