"""Image errors as tables for kernels: bilinear between nodes over each tile, as fine as a tolerance asks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from aerotri.deformation.photo_errors import PhotoErrors, seams_mm
from aerotri.functional_model._photo_kernels import ErrorTable

FIRST_STEP_MM = 1.0
"""Distance of nodes a table begins with [C]: half of it or less follows most image errors; finer ones follow from the
tolerance."""
MOST_NODES = 1 << 21
"""Of one tile: the table then is as good as it gets."""
MOST_CHECKED = 30_000
"""Cells whose middles are compared with the function, an even choice of them [C]: enough for an error that is smooth;
all would cost more than the table."""
INSIDE_MM = 1e-7
"""By which the nodes on the edge of a tile are moved into it."""


@dataclass(frozen=True, eq=False)
class ErrorTables:
    """Image errors of several groups of photographs.

    Parameters
    ----------
    half : (S, 2) mm. edges : (S, 2, 2) mm, seams. meta : (S, 3, 3, 7). values : (·,) mm. See `ErrorTable`.
    accuracy : mm, largest difference seen between table and function.
    """

    half: np.ndarray
    edges: np.ndarray
    meta: np.ndarray
    values: np.ndarray
    accuracy: float

    @property
    def for_kernels(self) -> ErrorTable:
        """The tables as kernels take them."""
        return ErrorTable(self.half, self.edges, self.meta, self.values)


def error_tables(errors: tuple[PhotoErrors, ...], tolerance: float) -> ErrorTables:
    """Tables of the image errors of groups.

    Parameters
    ----------
    tolerance : mm, by which the table may be off.
    """
    half = np.array([e.camera.half_format_mm for e in errors])
    edges, meta = np.full((len(errors), 2, 2), np.inf), np.zeros((len(errors), 3, 3, 7))
    parts: list[np.ndarray] = []
    offset, accuracy = 0, 0.0
    for s, one in enumerate(errors):
        seams = seams_mm(one.camera)
        for axis in range(2):
            edges[s, axis, : len(seams[axis])] = seams[axis]
        x_sides, y_sides = ([-h, *seam.tolist(), h] for h, seam in zip(half[s], seams, strict=True))
        for i, x_side in enumerate(pairwise(x_sides)):
            for j, y_side in enumerate(pairwise(y_sides)):
                table, off = _tile_table(one.function.of_measured, x_side, y_side, tolerance)
                ny, nx = table.shape[:2]
                per_x, per_y = (nx - 1) / (x_side[1] - x_side[0]), (ny - 1) / (y_side[1] - y_side[0])
                meta[s, i, j] = offset, nx, ny, x_side[0], y_side[0], per_x, per_y
                parts.append(table.astype(np.float32).ravel())
                offset, accuracy = offset + table.size, max(accuracy, off)
    return ErrorTables(half, edges, meta, np.concatenate(parts), accuracy)


def _tile_table(
    function: Callable[[np.ndarray], np.ndarray], x_side: tuple[float, float], y_side: tuple[float, float],
    tolerance: float,
) -> tuple[np.ndarray, float]:  # fmt: skip
    """(ny, nx, 2) mm at the nodes of a tile, and how far the middles of the cells are off."""
    step = FIRST_STEP_MM
    while True:
        nx, ny = (max(int(np.ceil((side[1] - side[0]) / step)), 1) + 1 for side in (x_side, y_side))
        x, y = np.linspace(*x_side, nx), np.linspace(*y_side, ny)
        table = _values(function, x, y, x_side, y_side)
        off = _largest_error(function, table, x, y)
        if off <= tolerance or 4 * nx * ny > MOST_NODES:
            return table, off
        # the error goes with the square of the step where the function is smooth
        step *= max(0.25, min(0.7, 0.9 * np.sqrt(tolerance / off)))


def _values(
    function: Callable[[np.ndarray], np.ndarray],
    x: np.ndarray,
    y: np.ndarray,
    x_side: tuple[float, float],
    y_side: tuple[float, float],
) -> np.ndarray:
    inside_x, inside_y = (
        np.clip(v, side[0] + INSIDE_MM, side[1] - INSIDE_MM) for v, side in ((x, x_side), (y, y_side))
    )
    grid_x, grid_y = np.meshgrid(inside_x, inside_y)
    return function(np.column_stack([grid_x.ravel(), grid_y.ravel()])).reshape(len(y), len(x), 2)


def _largest_error(
    function: Callable[[np.ndarray], np.ndarray], table: np.ndarray, x: np.ndarray, y: np.ndarray
) -> float:
    """Over the middles of the cells, or an even choice of them, and of their edges."""
    every = int(np.ceil(np.sqrt(max(table.shape[0] * table.shape[1] / MOST_CHECKED, 1.0))))
    rows, columns = np.arange(0, len(y) - 1, every), np.arange(0, len(x) - 1, every)
    low_left, low_right = table[np.ix_(rows, columns)], table[np.ix_(rows, columns + 1)]
    high_left, high_right = table[np.ix_(rows + 1, columns)], table[np.ix_(rows + 1, columns + 1)]
    x_middle, y_middle = (x[columns] + x[columns + 1]) / 2.0, (y[rows] + y[rows + 1]) / 2.0
    x_left, y_low = np.maximum(x[columns], x[0] + INSIDE_MM), np.maximum(y[rows], y[0] + INSIDE_MM)
    checks = (
        (x_middle, y_middle, (low_left + low_right + high_left + high_right) / 4.0),
        (x_middle, y_low, (low_left + low_right) / 2.0),
        (x_left, y_middle, (low_left + high_left) / 2.0),
    )
    largest = 0.0
    for at_x, at_y, expected in checks:
        grid_x, grid_y = np.meshgrid(at_x, at_y)
        true = function(np.column_stack([grid_x.ravel(), grid_y.ravel()])).reshape(expected.shape)
        largest = max(largest, float(np.abs(true - expected).max()))
    return largest
