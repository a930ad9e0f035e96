"""What the adjustment adds to the variance of a surface, which its cells share, at some places and linear between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.rasters.between_places import between_places
from aerotri.rasters.grids import Grid
from aerotri.results.adjustment import Adjustment
from aerotri.terrain.adjustment_part import ELEMENTS, both_covariances_at
from aerotri.terrain.photographs import Photographs

NODES = 60
"""Along a side of the grid that is interpolated once."""


@dataclass(frozen=True, eq=False)
class SharedPart:
    """Covariances on a coarse grid: (rows, columns, 6) m² as `ELEMENTS`, on x rising and y falling.

    `relative` (rows, columns) m² is the variance of Z after a similarity of the whole surface.
    """

    x: np.ndarray
    y: np.ndarray
    covariance: np.ndarray
    relative: np.ndarray

    def over(self, grid: Grid) -> np.ndarray:
        """(rows, columns) m, σ of Z of the cells of a grid, bilinear."""
        return np.sqrt(self.covariances(grid, slice(2, 3))[:, :, 0])

    def relative_over(self, grid: Grid) -> np.ndarray:
        """(rows, columns) m, as `over` after a similarity of the whole surface."""
        return np.sqrt(self._bilinear(grid, self.relative[:, :, None])[:, :, 0])

    def covariances(self, grid: Grid, chosen: slice = slice(None)) -> np.ndarray:
        """(rows, columns, k) m² of the cells of a grid, bilinear; which of the six may be chosen."""
        return self._bilinear(grid, self.covariance[:, :, chosen])

    def _bilinear(self, grid: Grid, v: np.ndarray) -> np.ndarray:
        column = np.interp(grid.x(np.arange(grid.columns)), self.x, np.arange(len(self.x)))
        row = np.interp(-grid.y(np.arange(grid.rows)), -self.y, np.arange(len(self.y)))
        i, j = np.minimum(row.astype(int), len(self.y) - 2), np.minimum(column.astype(int), len(self.x) - 2)
        s, t = (row - i)[:, None, None], (column - j)[None, :, None]
        a, b, c, d = v[np.ix_(i, j)], v[np.ix_(i, j + 1)], v[np.ix_(i + 1, j)], v[np.ix_(i + 1, j + 1)]
        return (1 - s) * ((1 - t) * a + t * b) + s * ((1 - t) * c + t * d)


def shared_part(
    calibration: Adjustment,
    photographs: Photographs,
    rows: np.ndarray,
    places: np.ndarray,
    measured: list[np.ndarray],
) -> SharedPart:
    """Of the surface through places (n, 3) m in the CRS.

    Parameters
    ----------
    rows : photographs of the block. measured : into them, of every place, those that measured it.
    """
    chosen = np.full((len(places), max(map(len, measured))), -1)
    for n, own in enumerate(measured):
        chosen[n, : len(own)] = own
    covariance, relative = both_covariances_at(calibration, photographs.restitution, rows, places, chosen)
    seven = np.column_stack([covariance[:, *ELEMENTS], relative[:, 2, 2]])
    low, high = places[:, :2].min(axis=0), places[:, :2].max(axis=0)
    high = np.maximum(high, low + 1e-3)
    x, y = np.linspace(low[0], high[0], NODES), np.linspace(high[1], low[1], NODES)
    nodes = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    laid = between_places(places[:, :2], seven, nodes).reshape(NODES, NODES, 7)
    return SharedPart(x, y, laid[:, :, :6], laid[:, :, 6])
