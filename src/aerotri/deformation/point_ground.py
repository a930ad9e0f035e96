"""The ground as the adjusted points show it: a coarse grid of heights, for footprints of photographs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

NEIGHBOURS = 5
"""Points whose median is the height of a node [C]: two wrong ones among them do no harm."""
MOST_NODES = 160_000
"""Nodes at most [C]: 400 × 400, some seconds for any number of points."""
KEPT = (0.005, 0.995)
"""Quantiles of X and Y within which the nodes lie [C]: single points far off do not stretch the grid."""


@dataclass(frozen=True, eq=False)
class PointGround:
    """Heights at the nodes of a grid; between them bilinear, outside as at its edge.

    Parameters
    ----------
    corner : (2,) m, X and Y of the first node. cell : m between nodes. z : (rows, columns) m, Y rising with the rows.
    """

    corner: np.ndarray
    cell: float
    z: np.ndarray

    def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Heights, m, at places of any shape, m."""
        rows, columns = self.z.shape
        column = np.clip((x - self.corner[0]) / self.cell, 0.0, columns - 1.0)
        row = np.clip((y - self.corner[1]) / self.cell, 0.0, rows - 1.0)
        j = np.minimum(column.astype(np.int64), max(columns - 2, 0))
        i = np.minimum(row.astype(np.int64), max(rows - 2, 0))
        right, up = np.minimum(j + 1, columns - 1), np.minimum(i + 1, rows - 1)
        u, v = column - j, row - i
        below = self.z[i, j] * (1.0 - u) + self.z[i, right] * u
        above = self.z[up, j] * (1.0 - u) + self.z[up, right] * u
        return below * (1.0 - v) + above * v


def ground_of_points(xyz: np.ndarray) -> PointGround | None:
    """The ground through object points (n, 3) m, NaN where one was not adjusted; None where none was.

    A node has the median height of the points nearest to it; nodes are as far apart as points are on average.
    """
    from scipy.spatial import KDTree

    known = xyz[np.isfinite(xyz).all(axis=1)]
    if not len(known):
        return None
    low, high = np.quantile(known[:, :2], KEPT, axis=0)
    size = high - low
    cell = max(float(np.sqrt(size.prod() / min(len(known), MOST_NODES))), float(size.max()) / np.sqrt(MOST_NODES))
    cell = cell if cell > 0.0 else 1.0
    columns, rows = (np.ceil(size / cell) + 1.0).astype(np.int64)
    x, y = np.meshgrid(low[0] + cell * np.arange(columns), low[1] + cell * np.arange(rows))
    nearest = KDTree(known[:, :2]).query(np.column_stack([x.ravel(), y.ravel()]), min(NEIGHBOURS, len(known)))[1]
    z = np.median(known[nearest.reshape(x.size, -1), 2], axis=1)
    return PointGround(low, cell, z.reshape(x.shape))
