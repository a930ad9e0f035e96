"""A camera's tiles, and smooth functions of the pixel sampled on a grid over one tile, never across a seam.

The seams are where the parts of a composed sensor meet: an image error may jump there. Everything else about it is
slow, so that bilinear interpolation between nodes some dozens of pixels apart is exact to thousandths of a pixel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from aerotri.functional_model.additional_parameters.native_frame import native_from_image
from aerotri.functional_model.additional_parameters.ultracam_d import (
    SEAM_COLUMNS,
    SEAM_ROWS,
    SENSOR_SIZE_PX,
    native_pixel_mm,
)
from aerotri.observations import Camera

COARSEST, FINEST = 128, 2
"""px between the nodes of a grid [C]: wider ones save nothing that counts, and below 2 there are as many nodes as
pixels."""
FEWEST_CELLS = 8
"""Cells along the longer side of a region that the search for a spacing begins with."""
TOLERANCE = 0.008
"""How far the function may be from the interpolation between nodes twice as far apart as those in the end: what then
remains is a quarter of it where the function is smooth, a half at a kink."""

OfPixels = Callable[[np.ndarray], np.ndarray]
"""(n, 2) pixel positions (column, row), 0.5 the centre of the first → (n, 2)."""


@dataclass(frozen=True)
class Tile:
    """A rectangle of the image, in pixels from its upper left corner; the outer tiles reach beyond the format.

    Parameters
    ----------
    columns, rows : where it begins and ends, −∞ and ∞ on the edge of the format.
    """

    columns: tuple[float, float]
    rows: tuple[float, float]

    def bounds_mm(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner (2,) mm from the image centre, just inside the tile."""
        half, pixel = np.array(camera.size_px) / 2.0, camera.pixel_mm
        inside = 1e-6 * pixel
        low = np.array([self.columns[0] - half[0], half[1] - self.rows[1]]) * pixel + inside
        high = np.array([self.columns[1] - half[0], half[1] - self.rows[0]]) * pixel - inside
        return low, high


@dataclass(frozen=True, eq=False)
class TileGrid:
    """Values of a function at nodes, bilinear between them.

    Parameters
    ----------
    row, column : pixel whose centre is the first node. step : pixels between nodes.
    nodes : (k, l, 2) by row and column.
    """

    row: int
    column: int
    step: int
    nodes: np.ndarray

    def at(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """(n, 2) at (n,) rows and columns counted from the centre of the first pixel; beyond the nodes it goes on."""
        (i, t), (j, s) = _cell(row - self.row, self.step, 0, self), _cell(column - self.column, self.step, 1, self)
        upper = (1.0 - s) * self.nodes[i, j] + s * self.nodes[i, j + 1]
        lower = (1.0 - s) * self.nodes[i + 1, j] + s * self.nodes[i + 1, j + 1]
        return (1.0 - t) * upper + t * lower

    def bounds(self, rows: tuple[int, int], columns: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Smallest and largest value (2,) that pixels in these rows and columns, first and last, can have."""
        first, _ = _cell(np.array(rows) - self.row, self.step, 0, self)
        left, _ = _cell(np.array(columns) - self.column, self.step, 1, self)
        nodes = self.nodes[first[0] : first[1] + 2, left[0] : left[1] + 2].reshape(-1, 2)
        return nodes.min(axis=0), nodes.max(axis=0)


def _cell(offset: np.ndarray, step: int, axis: int, grid: TileGrid) -> tuple[np.ndarray, np.ndarray]:
    """(n,) first node of the cell, and (n, 1) place in it."""
    at = np.asarray(offset, dtype=float) / step
    first = np.clip(np.floor(at).astype(np.int64), 0, grid.nodes.shape[axis] - 2)
    return first, (at - first)[:, None]


def seams_px(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows, in pixels from the upper left corner, on which the parts of a composed sensor meet; rising."""
    if camera.model == "ultracam_d":
        pixel = native_pixel_mm(camera)
        across = (SEAM_COLUMNS - SENSOR_SIZE_PX[0] / 2.0) * pixel
        along = (SENSOR_SIZE_PX[1] / 2.0 - SEAM_ROWS) * pixel
    elif camera.model == "dmc":
        across = along = np.zeros(1)
    else:
        return np.zeros(0), np.zeros(0)
    turn = native_from_image(camera)
    x, y = (across * turn[0, 0], along * turn[1, 1]) if turn[0, 0] else (along * turn[1, 0], across * turn[0, 1])
    columns, rows = camera.size_px
    return np.sort(x / camera.pixel_mm + columns / 2.0), np.sort(rows / 2.0 - y / camera.pixel_mm)


def tiles_of(camera: Camera) -> list[list[Tile]]:
    """The tiles by row and column, from the upper left."""
    columns, rows = ([-np.inf, *seams.tolist(), np.inf] for seams in seams_px(camera))
    return [[Tile(c, r) for c in pairwise(columns)] for r in pairwise(rows)]


def sample(
    function: OfPixels, rows: tuple[int, int], columns: tuple[int, int], unit: float = 1.0, tolerance: float = TOLERANCE
) -> TileGrid:
    """The function on a grid as wide as it can be.

    Parameters
    ----------
    function : smooth over the region.
    rows, columns : first and last pixel of the region.
    unit : of the function's values, in which the tolerance counts.
    """
    longest = max(rows[1] - rows[0], columns[1] - columns[0], FEWEST_CELLS * FINEST)
    step = min(COARSEST, 1 << int(np.log2(longest / FEWEST_CELLS)))
    grid = _on_nodes(function, rows, columns, step)
    while grid.step > FINEST:
        finer = _on_nodes(function, rows, columns, grid.step // 2)
        row, column = _node_places(finer)
        off = np.abs(grid.at(row, column) - finer.nodes.reshape(-1, 2)).max()
        grid = finer
        if off <= tolerance * unit:
            break
    return grid


def _on_nodes(function: OfPixels, rows: tuple[int, int], columns: tuple[int, int], step: int) -> TileGrid:
    count = [max(-(-(last - first) // step), 1) + 1 for first, last in (rows, columns)]
    empty = TileGrid(rows[0], columns[0], step, np.empty((*count, 2)))
    row, column = _node_places(empty)
    values = function(np.column_stack([column, row]) + 0.5)
    return TileGrid(rows[0], columns[0], step, np.ascontiguousarray(values.reshape(*count, 2)))


def _node_places(grid: TileGrid) -> tuple[np.ndarray, np.ndarray]:
    """(n,) rows and columns of the nodes."""
    row = grid.row + grid.step * np.arange(grid.nodes.shape[0])
    column = grid.column + grid.step * np.arange(grid.nodes.shape[1])
    row, column = np.meshgrid(row, column, indexing="ij")
    return row.ravel().astype(float), column.ravel().astype(float)
