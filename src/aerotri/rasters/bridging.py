"""Holes of a surface bridged for the picture: heights between those around, where a hole is narrow enough.

[C] A cell without a height is bridged if it lies in the closing of the measured cells by a disc of the width: the
surface does not grow at its border, and wide holes stay. Its height is the mean of measured ones around it, weighted by
their distance (GDAL's interpolation of no-data).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.rasters.grids import Grid, RasterReader


@dataclass(frozen=True, eq=False)
class BridgedReader:
    """A surface with its narrow holes bridged, read window by window.

    Parameters
    ----------
    measured : the surface as it is. width : m, of the widest hole that is bridged.
    """

    measured: RasterReader
    width: float

    @property
    def grid(self) -> Grid:
        return self.measured.grid

    @property
    def path(self) -> Path:
        return self.measured.path

    def read(self, row: int, column: int, rows: int, columns: int) -> np.ndarray:
        """(rows, columns) m; NaN where not known and beyond the edges."""
        half = max(int(np.ceil(0.5 * self.width / min(self.grid.cell_x, self.grid.cell_y))), 1)
        # the disc reaches as far when the holes are closed and once more when heights are sought
        around = 4 * half + 2
        z = self.measured.read(row - around, column - around, rows + 2 * around, columns + 2 * around)
        return bridged(z, half)[around:-around, around:-around]


def bridged(z: np.ndarray, half: int) -> np.ndarray:
    """Heights with holes of at most 2·half cells across filled.

    Parameters
    ----------
    z : (rows, columns) m, NaN where not known.
    """
    import cv2
    from rasterio.fill import fillnodata

    known = np.isfinite(z)
    if known.all() or not known.any():
        return z
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * half + 1, 2 * half + 1))
    closed = cv2.morphologyEx(known.astype(np.uint8), cv2.MORPH_CLOSE, disc) > 0
    hole = closed & ~known
    if not hole.any():
        return z
    # near zero, so that single precision keeps a fraction of a millimetre
    middle = float(np.median(z[known]))
    reduced = np.where(known, z - middle, 0.0).astype(np.float32)
    filled = fillnodata(reduced, mask=known.astype(np.uint8), max_search_distance=2.0 * half + 1.0)
    out = z.copy()
    out[hole] = filled[hole] + middle
    return out
