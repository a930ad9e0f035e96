"""Between which heights the surface is looked for, place by place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt, maximum_filter, median_filter, minimum_filter

from aerotri.rasters.grids import Grid
from aerotri.terrain.prior import Prior

MOST_PLACES = 2500
"""Of a tile; chosen [C]: fifty by fifty, far finer than a plane and two bounds need."""
SPARE_PX = 2.0
"""Pixels of parallax of a coarse level by which heights may lie beyond those found there and next to them."""
HOLE_CELLS = 15
"""Cells around a hole whose lowest and highest bound it; chosen [C]: a hole of a coarse level is water or shadow, whose
shore tells its height."""


@dataclass(frozen=True, eq=False)
class HeightRange:
    """Lowest and highest height (rows, columns) m on the cells of a grid."""

    grid: Grid
    low: np.ndarray
    high: np.ndarray

    def within(self, grid: Grid) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(n, 2) places all over a grid, (n,) lowest and (n,) highest heights there."""
        rows, columns = self._cells_of(grid)
        step = max(int(np.ceil(np.sqrt(len(rows) * len(columns) / MOST_PLACES))), 1)
        low, high = self.low[np.ix_(rows, columns)], self.high[np.ix_(rows, columns)]
        if step > 1:
            low, high = minimum_filter(low, step)[::step, ::step], maximum_filter(high, step)[::step, ::step]
            rows, columns = rows[::step], columns[::step]
        x, y = np.meshgrid(self.grid.x(columns), self.grid.y(rows))
        return np.column_stack([x.ravel(), y.ravel()]), low.ravel(), high.ravel()

    def _cells_of(self, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns that a grid covers, one more on each side."""
        left, bottom, right, top = grid.bounds
        first, last = int(np.floor(self.grid.row(top))), int(np.ceil(self.grid.row(bottom)))
        rows = np.arange(min(max(first, 0), self.grid.rows - 1), min(max(last, 0), self.grid.rows - 1) + 1)
        first, last = int(np.floor(self.grid.column(left))), int(np.ceil(self.grid.column(right)))
        columns = np.arange(min(max(first, 0), self.grid.columns - 1), min(max(last, 0), self.grid.columns - 1) + 1)
        return rows, columns


def range_of_prior(prior: Prior) -> HeightRange:
    """That of a surface through known points."""
    grid = Grid.of_nodes(prior.x, prior.y[::-1])
    return HeightRange(grid, (prior.z - prior.spare)[::-1], (prior.z + prior.spare)[::-1])


def range_of_surface(grid: Grid, z: np.ndarray, per_pixel: float) -> HeightRange:
    """About a coarse surface (rows, columns) m, NaN its holes.

    Parameters
    ----------
    per_pixel : m of height that a pixel of parallax of its level is.
    """
    known = np.isfinite(z)
    place = distance_transform_edt(~known, return_distances=False, return_indices=True)
    filled = median_filter(z[tuple(np.asarray(place))], 5)
    low, high = minimum_filter(filled, 3), maximum_filter(filled, 3)
    wide_low, wide_high = minimum_filter(filled, HOLE_CELLS), maximum_filter(filled, HOLE_CELLS)
    spare = SPARE_PX * per_pixel
    return HeightRange(grid, np.where(known, low, wide_low) - spare, np.where(known, high, wide_high) + spare)
