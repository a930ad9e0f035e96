"""The true ground of a simulated block as a raster, to hold a surface or a volume against."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerotri.rasters.grids import Grid, RasterWriter, crs_of_heights
from aerotri.simulation.placing import Placement
from aerotri.simulation.terrain import Terrain

SURFACE = "surface.tif"
CELL_GSD = 2.0
"""Cell of the raster, in pixels of the mean scale [C]: finer than any surface that is measured in the photographs."""
STORED = {"compress": "deflate", "predictor": 3}
MOST_CELLS = 2000
"""On a side; a larger area has larger cells."""
HEIGHT_ROUNDS = 2
"""In plan the point over a place of the CRS depends on its height, by the curvature of the Earth alone: the first round
leaves less than a micrometre."""


def write_true_surface(path: Path, terrain: Terrain, points: np.ndarray, gsd_m: float, place: Placement | None) -> None:
    """Heights of ground and houses, one a cell, over the area of the object points.

    Parameters
    ----------
    path : GeoTIFF to write. points : (N, 3) m in the plane of the simulation. gsd_m : of the mean scale.
    place : of the block in its CRS, None where it has none.
    """
    corners = points if place is None else place.to_crs(points)
    grid = _grid(corners[:, :2], gsd_m)
    x, y = grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows))
    heights = np.empty((grid.rows, grid.columns))
    for row, northing in enumerate(y.tolist()):
        heights[row] = true_heights(terrain, np.column_stack([x, np.full(len(x), northing)]), place)
    crs = None if place is None else crs_of_heights(place.crs)
    with RasterWriter(path, grid, np.float32, crs, options=STORED) as writer:
        writer.describe("true height, m")
        writer.write(0, 0, heights.astype(np.float32))


def _grid(xy: np.ndarray, gsd_m: float) -> Grid:
    low, high = xy.min(axis=0), xy.max(axis=0)
    cell = max(CELL_GSD * gsd_m, float((high - low).max()) / MOST_CELLS)
    left, bottom = np.floor(low / cell) * cell
    right, top = np.ceil(high / cell) * cell
    rows, columns = round((top - bottom) / cell), round((right - left) / cell)
    return Grid(max(rows, 1), max(columns, 1), float(left), float(top), cell, cell)


def true_heights(terrain: Terrain, xy: np.ndarray, place: Placement | None) -> np.ndarray:
    """(n,) m of ground and houses at (n, 2) of the CRS, or of the plane of the simulation without one."""
    if place is None:
        return terrain.height(xy)
    heights = np.full(len(xy), place.to_crs(np.array([[0.0, 0.0, terrain.base]]))[0, 2])
    for _ in range(HEIGHT_ROUNDS):
        plan = place.from_crs(np.column_stack([xy, heights]))[:, :2]
        heights = place.to_crs(np.column_stack([plan, terrain.height(plan)]))[:, 2]
    return heights
