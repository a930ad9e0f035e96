"""A raster in memory, for what else reads rasters window by window from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Self

import numpy as np

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
    def epsg(self) -> int | None:
        """Code of the CRS, of its plan where it has a height system too; None where it has none."""
        authority, _, codes = (self.crs or "").partition(":")
        code = codes.partition("+")[0]
        return int(code) if authority.upper() == "EPSG" and code.isdigit() else None

    @property
    def crs_code(self) -> str:
        """'EPSG:n', 'EPSG:n+m' where a height system is stated, m in metres as the heights are; '' without a code."""
        heights = (self.crs or "").partition("+")[2]
        up = f"+{metric_height_system(heights)}" if heights.isdigit() else ""
        return "" if self.epsg is None else f"EPSG:{self.epsg}{up}"

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
