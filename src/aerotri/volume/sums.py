"""Volumes of rasters window by window: sums over cells and prisms over triangles between the centres of cells."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from aerotri.rasters.grids import Grid
from aerotri.volume import _kernels
from aerotri.volume.bases import Base, Surface
from aerotri.volume.boundary import Boundary
from aerotri.volume.quantity import Volume
from aerotri.volume.triangles import prism_sums

WINDOW = 1024
"""Cells a side that are in memory at a time."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class Window:
    """Some cells of a surface.

    Parameters
    ----------
    grid : the cells. row, column : of the first one in the surface's grid.
    thickness : (rows, columns) m, surface − base, NaN where not known. part : (rows, columns) share inside.
    """

    grid: Grid
    row: int
    column: int
    thickness: np.ndarray
    part: np.ndarray


@dataclass(frozen=True)
class RasterVolumes:
    """Volumes by both raster methods, and the extremes inside the boundary, m.

    Parameters
    ----------
    lowest, highest : of the thickness. of_surface, of_base : lowest and highest of their heights.
    without_heights_around : m², of the boundary beyond the cells.
    """

    cells: Volume
    prisms: Volume
    lowest: float
    highest: float
    without_heights_around: float
    of_surface: tuple[float, float]
    of_base: tuple[float, float]


def cells_within(grid: Grid, boundary: Boundary) -> tuple[int, int, int, int]:
    """First row and column, number of rows and columns of the cells that the boundary touches."""
    left, bottom, right, top = boundary.polygon.bounds
    first_row, last_row = (int(np.floor(v + 0.5)) for v in (grid.row(top), grid.row(bottom)))
    first_column, last_column = (int(np.floor(v + 0.5)) for v in (grid.column(left), grid.column(right)))
    first_row, first_column = max(first_row - 1, 0), max(first_column - 1, 0)
    last_row, last_column = min(last_row + 1, grid.rows - 1), min(last_column + 1, grid.columns - 1)
    return first_row, first_column, max(last_row - first_row + 1, 0), max(last_column - first_column + 1, 0)


def windows(grid: Grid, boundary: Boundary, size: int = WINDOW) -> Iterator[tuple[int, int, int, int]]:
    """Windows (row, column, rows, columns) over the cells that the boundary touches."""
    row, column, rows, columns = cells_within(grid, boundary)
    for i in range(row, row + rows, size):
        for j in range(column, column + columns, size):
            yield i, j, min(size, row + rows - i), min(size, column + columns - j)


def raster_volumes(
    surface: Surface,
    base: Base,
    boundary: Boundary,
    keep: Callable[[Window], None] | None = None,
    progress: Progress | None = None,
    size: int = WINDOW,
) -> RasterVolumes:
    """Volumes by cells and by prisms, the surface read once, window by window.

    Parameters
    ----------
    keep : takes every window, for a map of the thickness.
    """
    cell_sums, prism = np.zeros(5), np.zeros(5)
    lowest, highest, covered = np.inf, -np.inf, 0.0
    of_surface = of_base = np.inf, -np.inf
    grid = surface.grid
    todo = list(windows(grid, boundary, size))
    for done, (row, column, rows, columns) in enumerate(todo):
        wide = grid.window(row, column, min(rows + 1, grid.rows - row), min(columns + 1, grid.columns - column))
        z = surface.read(row, column, wide.rows, wide.columns).astype(float)
        below = base.on_grid(wide)
        d = z - below
        own = wide.window(0, 0, rows, columns)
        part = boundary.coverage(own)
        thickness = d[:rows, :columns]
        _add_cells(thickness, part, own.cell_x * own.cell_y, cell_sums)
        covered += float(part.sum()) * own.cell_x * own.cell_y
        _add_prisms(d, wide, boundary, prism)
        known = (part > 0.0) & np.isfinite(thickness)
        if known.any():
            lowest, highest = _widest((lowest, highest), thickness[known])
            of_surface = _widest(of_surface, z[:rows, :columns][known])
            of_base = _widest(of_base, below[:rows, :columns][known])
        if keep is not None:
            keep(Window(own, row, column, thickness, part))
        if progress is not None:
            progress(done + 1, len(todo))
    outside = max(boundary.area - covered, 0.0)
    if outside > 1e-9 * boundary.area:
        cell_sums[4] += outside
    missing = boundary.area - prism[2:].sum()
    if missing > 1e-9 * boundary.area:
        prism[4] += missing
    return RasterVolumes(
        Volume.of_sums("grid", cell_sums, "every cell with the height of its centre and its part inside the boundary"),
        Volume.of_sums("prisms", prism, "two triangles between the centres of every four cells, cut by the boundary"),
        lowest, highest, outside, of_surface, of_base,
    )  # fmt: skip


def _widest(extremes: tuple[float, float], values: np.ndarray) -> tuple[float, float]:
    return min(extremes[0], float(values.min())), max(extremes[1], float(values.max()))


def _add_cells(d: np.ndarray, part: np.ndarray, area: float, sums: np.ndarray) -> None:
    known = np.isfinite(d)
    inside, heights = area * part[known], d[known]
    sums[0] += float(inside @ np.maximum(heights, 0.0))
    sums[1] += float(inside @ np.maximum(-heights, 0.0))
    sums[2] += float(inside[heights >= 0.0].sum())
    sums[3] += float(inside[heights < 0.0].sum())
    sums[4] += area * float(part[~known].sum())


def _add_prisms(d: np.ndarray, grid: Grid, boundary: Boundary, sums: np.ndarray) -> None:
    """Add the triangles between the centres of the cells of a window and those one further."""
    if grid.rows < 2 or grid.columns < 2:
        return
    quads = grid.between_centres()
    part = boundary.coverage(quads)
    whole = part >= 1.0 - 1e-12
    _kernels.add_quads(d, whole, 0.5 * grid.cell_x * grid.cell_y, sums)
    row, column = np.nonzero((part > 0.0) & ~whole)
    if not len(row):
        return
    # corners of the two triangles of a quad, rows and columns counted in the window
    steps = np.array([[[0, 0], [0, 1], [1, 1]], [[0, 0], [1, 0], [1, 1]]])
    at = (np.stack([row, column], axis=-1)[:, None, None] + steps).reshape(-1, 3, 2)
    corners = np.stack([grid.x(at[..., 1]), grid.y(at[..., 0])], axis=-1)
    sums += prism_sums(boundary.within(quads.bounds), corners, d[at[..., 0], at[..., 1]])
