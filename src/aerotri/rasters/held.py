"""A raster in memory, for what else reads rasters window by window from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Self

import numpy as np

from aerotri.crs_text import heights_of, plan_of, with_heights
from aerotri.rasters.grids import Grid, bilinear
from aerotri.rasters.height_systems import metric_height_system


class HeldRaster:
    """Heights in memory, read as they would be from the file they are written to: with 32 bit.

    Parameters
    ----------
    values : (rows, columns) m, NaN or infinite where not known.
    crs : 'EPSG:n', None for a local one.
    name : stands for that of the file.

    Attributes
    ----------
    grid, crs, path, note, dtype, no_data, options : as of a `MetricReader`; there is nothing to note.
    """

    note = ""
    dtype = np.dtype(np.float32)
    no_data: float | None = None

    def __init__(self, values: np.ndarray, grid: Grid, crs: str | None, name: str):
        self.grid, self.crs, self.path = grid, crs, Path(name)
        heights = values.astype(np.float32)
        self.values, self.options = np.where(np.isinf(heights), np.float32(np.nan), heights), {}

    @property
    def system(self) -> str:
        """The CRS as of `crs_text`, that of the heights in metres as they are; '' where none is stated."""
        stated = self.crs or ""
        heights = heights_of(stated)
        return with_heights(stated, metric_height_system(heights)) if heights else stated

    @property
    def plan(self) -> str:
        """The CRS of X and Y, as of `crs_text`; '' where none is stated."""
        return plan_of(self.system)

    def read(self, row: int, column: int, rows: int, columns: int) -> np.ndarray:
        """A window, (rows, columns) float32; NaN where nothing is known and beyond the edges."""
        top, left = max(row, 0), max(column, 0)
        bottom, right = min(row + rows, self.grid.rows), min(column + columns, self.grid.columns)
        out = np.full((rows, columns), np.nan, np.float32)
        if bottom > top and right > left:
            out[top - row : bottom - row, left - column : right - column] = self.values[top:bottom, left:right]
        return out

    def sample(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n,) bilinear values at places (n,); NaN where one of the four cells is not known."""
        return bilinear(self.read, self.grid, x, y)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        pass
