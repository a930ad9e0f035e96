"""Cloud-optimised GeoTIFFs of surfaces, written whole or part by part."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import FilePath
from aerotri.rasters.grids import NO_DATA, SIGMA, TILE, Grid, transform_of, window_of
from aerotri.rasters.quiet import quietly
from aerotri.rasters.room import raise_full_disk


def write_surface(path: FilePath, z: np.ndarray, sigma: np.ndarray, grid: Grid, crs: Any, text: str) -> None:
    """Write heights and their σ (rows, columns) as the two bands of a cloud-optimised GeoTIFF; NaN is no-data."""
    write_surface_parts(path, [(0, 0, z, sigma)], grid, crs, text)


def write_surface_parts(
    path: FilePath, parts: Iterable[tuple[int, int, np.ndarray, np.ndarray]], grid: Grid, crs: Any, text: str,
    tags: Mapping[str, str] | None = None,
) -> None:  # fmt: skip
    """As `write_surface`, part by part.

    Parameters
    ----------
    parts : first row and column, heights and σ (rows, columns) of each.
    tags : metadata of the file.
    """

    def known() -> Iterable[tuple[int, int, tuple[np.ndarray, ...]]]:
        for row, column, z, sigma in parts:
            both = np.isfinite(z) & np.isfinite(sigma)
            yield row, column, tuple(np.where(both, values, NO_DATA).astype(np.float32) for values in (z, sigma))

    _write_cog(path, known(), grid, crs, (text, f"{SIGMA} of {text}"), np.dtype(np.float32), NO_DATA, tags or {})


def write_raster_parts(
    path: FilePath, parts: Iterable[tuple[int, int, np.ndarray]], grid: Grid, crs: Any, text: str, dtype: np.dtype,
    no_data: float,
) -> None:  # fmt: skip
    """A raster of one band, part by part, as a cloud-optimised GeoTIFF; NaN is no-data."""
    banded = (
        (row, column, (np.where(np.isfinite(values), values, no_data).astype(dtype),)) for row, column, values in parts
    )
    _write_cog(path, banded, grid, crs, (text,), dtype, no_data, {})


def write_bands(
    path: FilePath, bands: Mapping[str, np.ndarray], grid: Grid, crs: Any, tags: Mapping[str, str] | None = None
) -> None:
    """Bands (rows, columns) by what they are, as a cloud-optimised GeoTIFF; NaN is no-data."""
    values = tuple(np.where(np.isfinite(v), v, NO_DATA).astype(np.float32) for v in bands.values())
    _write_cog(path, [(0, 0, values)], grid, crs, tuple(bands), np.dtype(np.float32), NO_DATA, tags or {})


def _write_cog(
    path: FilePath, parts: Iterable[tuple[int, int, tuple[np.ndarray, ...]]], grid: Grid, crs: Any,
    texts: tuple[str, ...], dtype: np.dtype, no_data: float, tags: Mapping[str, str],
) -> None:  # fmt: skip
    import rasterio.shutil

    plain = Path(path).with_name(f"{Path(path).name}.plain")
    made: dict[str, Any] = {"tiled": True, "blockxsize": TILE, "blockysize": TILE, "bigtiff": "IF_SAFER"}
    try:
        with quietly():
            with rasterio.open(
                plain, "w", driver="GTiff", height=grid.rows, width=grid.columns, count=len(texts), dtype=dtype,
                crs=crs, transform=transform_of(grid), nodata=no_data, **made,
            ) as file:  # fmt: skip
                for band, text in enumerate(texts, start=1):
                    file.set_band_description(band, text)
                if tags:
                    file.update_tags(**tags)
                for row, column, bands in parts:
                    window = window_of(column, row, bands[0].shape[1], bands[0].shape[0])
                    for band, values in enumerate(bands, start=1):
                        file.write(values, band, window=window)
            predictor = "YES" if dtype.kind == "f" else "NO"
            rasterio.shutil.copy(plain, path, driver="COG", compress="DEFLATE", predictor=predictor)
    except Exception as error:
        raise_full_disk(plain, error)
        raise
    finally:
        plain.unlink(missing_ok=True)


def make_cloud_optimised(path: Path) -> None:
    """A GeoTIFF that is whole, written anew as a cloud-optimised one: in tiles and with overviews.

    Raises
    ------
    InputError
        When the disk is full.
    """
    import rasterio.shutil

    plain = path.with_name(f"{path.name}.plain")
    path.replace(plain)
    try:
        with quietly():
            rasterio.shutil.copy(plain, path, driver="COG", compress="DEFLATE", predictor="YES")
    except Exception as error:
        raise_full_disk(plain, error)
        raise
    finally:
        plain.unlink(missing_ok=True)
