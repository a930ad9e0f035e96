"""Large images of the ground written window by window, then as cloud-optimised GeoTIFF with overviews."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import InputError, regular_file
from aerotri.rasters.grids import CACHE_BYTES, TILE, Grid, window_of
from aerotri.rasters.quiet import quietly
from aerotri.rasters.room import raise_full_disk

OPAQUE = {"uint8": 255, "uint16": 65535}
"""Of the last band, the mask: what a cell has that a photograph shows; the others have 0."""
COLOURS = 3
"""Bands that are red, green and blue where there are as many."""
LEVEL = 1
"""Of deflate [C]: photographs take 6 % more room than at the usual 6, and two thirds of its time."""
NUMBERS_NO_DATA = -1
"""Of a raster of whole numbers: none."""


@dataclass(frozen=True, eq=False)
class MosaicWriter:
    """A raster of the ground being written; used from one thread."""

    dataset: Any

    def write(self, row: int, column: int, values: np.ndarray) -> None:
        """Write (bands, rows, columns) from a cell on."""
        self.dataset.write(values, window=window_of(column, row, values.shape[2], values.shape[1]))


@contextmanager
def write_mosaic(
    path: Path, grid: Grid, bands: tuple[str, ...], dtype: str, crs: Any, average: bool, cache: int = CACHE_BYTES
) -> Generator[MosaicWriter]:
    """A cloud-optimised GeoTIFF to be filled in any order; it stands there once the block has ended.

    Parameters
    ----------
    bands : descriptions; the last is the mask of colours. average : whether cells are colours with a mask, whose
        overviews are means, or numbers, whose overviews are single cells. cache : bytes of blocks that GDAL keeps.

    Raises
    ------
    InputError
        When the disk is full or cannot be written to.
    """
    import rasterio
    import rasterio.shutil
    from rasterio import Affine
    from rasterio.errors import RasterioError

    plain = path.with_name(f"{path.name}.plain")
    transform = Affine(grid.cell_x, 0.0, grid.left, 0.0, -grid.cell_y, grid.top)
    made: dict[str, Any] = {"tiled": True, "blockxsize": TILE, "blockysize": TILE, "bigtiff": "IF_SAFER"}
    made |= {"interleave": "pixel", "SPARSE_OK": True} | _colours(len(bands)) if average else {"SPARSE_OK": True}
    # the resampling of overviews leaves the edge of what is known as it is; numbers that are the same over large areas
    # need no predictor
    cloud = {"compress": "DEFLATE", "level": LEVEL, "predictor": "YES" if average else "NO", "bigtiff": "IF_SAFER",
             "num_threads": "ALL_CPUS", "overview_resampling": "AVERAGE" if average else "NEAREST"}  # fmt: skip
    try:
        with quietly(), rasterio.Env(GDAL_CACHEMAX=cache):
            with rasterio.open(
                plain, "w", driver="GTiff", height=grid.rows, width=grid.columns, count=len(bands), dtype=dtype,
                crs=crs, transform=transform, nodata=None if average else NUMBERS_NO_DATA, **made,
            ) as file:  # fmt: skip
                file.descriptions = bands
                if average:
                    file.colorinterp = _meaning(len(bands))
                yield MosaicWriter(file)
            rasterio.shutil.copy(plain, path, driver="COG", **cloud)
    except (RasterioError, OSError) as error:
        raise_full_disk(plain, error)
        raise InputError(
            f"cannot be written: {error.__cause__ or error}", "check permissions and free space", path
        ) from error
    finally:
        plain.unlink(missing_ok=True)


def _colours(bands: int) -> dict[str, Any]:
    return {"photometric": "rgb" if bands - 1 >= COLOURS else "minisblack", "alpha": "unspecified"}


def _meaning(bands: int) -> list[Any]:
    from rasterio.enums import ColorInterp

    colours = [ColorInterp.red, ColorInterp.green, ColorInterp.blue] if bands - 1 >= COLOURS else [ColorInterp.gray]
    return [*colours, *[ColorInterp.undefined] * (bands - 1 - len(colours)), ColorInterp.alpha]


def read_mosaic(path: Path, window: tuple[int, int, int, int] | None = None, longest: int = 0) -> np.ndarray:
    """(bands, rows, columns) of a raster.

    Parameters
    ----------
    window : first row and column, rows and columns; all of it where None; 0 beyond its edges.
    longest : cells of the longer side at most, from the overviews; 0: all.
    """
    import rasterio

    with quietly(), rasterio.open(path) as file:
        if window is not None:
            row, column, rows, columns = window
            return file.read(window=window_of(column, row, columns, rows), boundless=True, fill_value=0)
        less = max(1.0, max(file.height, file.width) / longest) if longest else 1.0
        return file.read(out_shape=(file.count, max(int(file.height / less), 1), max(int(file.width / less), 1)))


def read_heights(path: Path, longest: int) -> np.ndarray:
    """(rows, columns) float of the first band, NaN where nothing is known.

    Parameters
    ----------
    longest : cells of the longer side at most, from the overviews.
    """
    import rasterio

    with quietly(), rasterio.open(path) as file:
        less = max(1.0, max(file.height, file.width) / longest)
        shape = max(int(file.height / less), 1), max(int(file.width / less), 1)
        return file.read(1, out_shape=shape, masked=True).astype(float).filled(np.nan)


def bounds_of(path: Path) -> tuple[float, float, float, float]:
    """Outer edges of a raster of any bands: left, bottom, right, top.

    Raises
    ------
    InputError
        When it is no raster, or no north-up one.
    """
    import rasterio
    from rasterio.errors import RasterioError

    if os.path.lexists(path):
        regular_file(path)
    try:
        with quietly(), rasterio.open(path) as file:
            t, bounds = file.transform, file.bounds
    except (RasterioError, OSError) as error:
        raise InputError(f"cannot be read: {error}", "give a GeoTIFF", path) from None
    if t.is_identity or t.b or t.d or t.a <= 0.0 or t.e >= 0.0:
        raise InputError("is turned, mirrored or without georeference", "give a north-up GeoTIFF", path)
    return float(bounds.left), float(bounds.bottom), float(bounds.right), float(bounds.top)


def outlines_of(numbers: np.ndarray, grid: Grid) -> dict[int, list[dict[str, Any]]]:
    """Polygons (GeoJSON) around the cells of every number from 0 on."""
    from rasterio import Affine
    from rasterio.features import shapes

    transform = Affine(grid.cell_x, 0.0, grid.left, 0.0, -grid.cell_y, grid.top)
    out: dict[int, list[dict[str, Any]]] = {}
    for geometry, number in shapes(numbers.astype(np.int32), mask=numbers >= 0, transform=transform):
        out.setdefault(int(number), []).append(geometry)
    return out
