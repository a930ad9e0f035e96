"""Photographs as files, read and written by rows: bit depth, bands, metadata and georeference as they are.

Only TIFF and JPEG are opened, so that a hostile file cannot lead elsewhere. What a damaged file cannot give is an
error that names it: nothing is filled in.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from rasterio._err import CPLE_BaseError
from rasterio.enums import ColorInterp, MaskFlags, Resampling
from rasterio.errors import RasterioError
from rasterio.transform import Affine

from aerotri.conventions import FilePath, InputError, real_path
from aerotri.rasters.grids import window_of
from aerotri.rasters.photograph_settings import COMPRESSION
from aerotri.rasters.quiet import quietly
from aerotri.rasters.room import raise_full_disk

DRIVERS = {b"II*\0": "GTiff", b"MM\0*": "GTiff", b"II+\0": "GTiff", b"MM\0+": "GTiff", b"\xff\xd8\xff": "JPEG"}
"""By the first bytes of a file, TIFF and BigTIFF in both byte orders, and JPEG."""
LOSSLESS = {"lzw", "deflate", "zstd", "lzma", "packbits", "none"}
PREDICTED = {"lzw", "deflate", "zstd"}
TILE_PX = 512
"""Side of the tiles of photographs written; a multiple of 16 as TIFF asks for; smaller ones compress worse, larger ones
are read for nothing."""
SETTINGS: dict[str, Any] = {
    "GDAL_ERROR_ON_LIBJPEG_WARNING": "YES",
    "GDAL_CACHEMAX": 128 << 20,
    "GDAL_TIFF_INTERNAL_MASK": "YES",
}
"""A truncated JPEG is an error, not a grey lower half."""
PIXEL_TYPES = ("uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64")
NOT_CARRIED = ("IMAGE_STRUCTURE", "DERIVED_SUBDATASETS", "RPC", "COLOR_PROFILE", "SUBDATASETS")
"""Domains of metadata that belong to the file, or are written in another way."""


@dataclass(frozen=True, eq=False)
class Photograph:
    """An open photograph.

    Parameters
    ----------
    path : of the file. dataset : of rasterio.
    nbits : bits of a pixel that count, fewer than its type has in some files.
    """

    path: Path
    dataset: Any
    nbits: int

    @property
    def columns(self) -> int:
        return int(self.dataset.width)

    @property
    def rows(self) -> int:
        return int(self.dataset.height)

    @property
    def bands(self) -> int:
        return int(self.dataset.count)

    @property
    def dtype(self) -> np.dtype:
        return np.dtype(self.dataset.dtypes[0])

    @property
    def nodata(self) -> float | None:
        return self.dataset.nodata

    @property
    def range(self) -> tuple[float, float]:
        """Smallest and largest value of a pixel."""
        if self.dtype.kind == "f":
            return -np.inf, np.inf
        info = np.iinfo(self.dtype)
        return float(info.min), float(2**self.nbits - 1 if self.dtype.kind == "u" else info.max)

    def left_out(self) -> tuple[str, ...]:
        """What a copy of the pixels does not carry, in words."""
        with _told(self.path):
            flags, domains = self.dataset.mask_flag_enums, self.dataset.tag_namespaces()
            pages = len(self.dataset.subdatasets) - 1
        masked = any(MaskFlags.per_dataset in band and MaskFlags.alpha not in band for band in flags)
        lost = ["its mask"] if masked else []
        if pages > 0:
            lost.append(f"its {pages} further pages")
        lost += [f"its {domain[4:]} packet" for domain in domains if domain.startswith("xml:")]
        return tuple(lost)

    def read(self, first: int, last: int) -> np.ndarray:
        """(bands, rows, columns) of the rows first … last − 1.

        Raises
        ------
        InputError
        """
        with _told(self.path), rasterio.Env(**SETTINGS):
            return self.dataset.read(window=window_of(0, first, self.columns, last - first))

    def window(self, row: int, column: int, rows: int, columns: int) -> np.ndarray:
        """(bands, rows, columns) from a pixel on.

        Raises
        ------
        InputError
        """
        with _told(self.path), rasterio.Env(**SETTINGS):
            return self.dataset.read(window=window_of(column, row, columns, rows))

    def reduced(self, rows: int, columns: int) -> np.ndarray:
        """(bands, rows, columns) of the whole photograph, each the mean of the pixels it stands for.

        Raises
        ------
        InputError
        """
        with _told(self.path), rasterio.Env(**SETTINGS):
            return self.dataset.read(out_shape=(self.bands, rows, columns), resampling=Resampling.average)


@contextmanager
def open_photograph(path: FilePath) -> Generator[Photograph]:
    """A TIFF or JPEG file to read from.

    Raises
    ------
    InputError
        When it is missing, damaged, or its pixels cannot be interpolated.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError("there is no such file", "give a photograph, TIFF or JPEG", path)
    with _told(path), rasterio.Env(**SETTINGS):
        dataset = rasterio.open(real_path(path), driver=_driver(path))
    with dataset:
        with _told(path):
            bits = _bits(path, dataset)
        yield Photograph(path, dataset, bits)


def _driver(path: Path) -> str:
    with path.open("rb") as file:
        begins = file.read(4)
    for magic, driver in DRIVERS.items():
        if begins.startswith(magic):
            return driver
    raise InputError("is no TIFF and no JPEG", "convert it", path)


def _bits(path: Path, dataset: Any) -> int:
    """Bits of a pixel; refuses what cannot be interpolated."""
    types = sorted(set(dataset.dtypes))
    if len(types) != 1 or types[0] not in PIXEL_TYPES:
        known = ", ".join(PIXEL_TYPES)
        raise InputError(f"has pixels of type {', '.join(types)}", f"convert it to one of {known}", path)
    if ColorInterp.palette in dataset.colorinterp:
        raise InputError("has a colour table, whose numbers cannot be interpolated", "convert it to RGB", path)
    stated = dataset.tags(1, ns="IMAGE_STRUCTURE").get("NBITS", "")
    bits = int(stated) if stated.isdigit() else 8 * np.dtype(types[0]).itemsize
    if bits < 8:
        raise InputError(f"has {bits} bits a pixel", "give the photograph in 8 bits or more", path)
    return bits


@contextmanager
def _told(path: Path) -> Generator[None]:
    """Errors of rasterio as `InputError`s that name the file."""
    try:
        with quietly():
            yield
    except (RasterioError, CPLE_BaseError, OSError, ValueError, UnicodeError, MemoryError, SystemError) as error:
        cause = error.__cause__ or error
        raise InputError(
            f"cannot be read: {str(cause).strip() or type(cause).__name__}", "give a whole TIFF or JPEG file", path
        ) from error


@dataclass(frozen=True, eq=False)
class RowWriter:
    """An image being written, rows from the top."""

    path: Path
    dataset: Any

    def write(self, first: int, pixels: np.ndarray) -> None:
        """Write (bands, rows, columns) from row `first` on."""
        window = window_of(0, first, pixels.shape[2], pixels.shape[1])
        try:
            with rasterio.Env(**SETTINGS):
                self.dataset.write(pixels, window=window)
        except (RasterioError, OSError) as error:
            raise _unwritten(self.path, error) from error


def _unwritten(path: Path, error: BaseException) -> InputError:
    raise_full_disk(path, error)
    return InputError(f"cannot be written: {error.__cause__ or error}", "check permissions and free space", path)


@contextmanager
def create_image(
    path: FilePath, columns: int, rows: int, bands: int, dtype: str, **options: Any
) -> Generator[RowWriter]:
    """A tiled TIFF to write to, rows from the top; the caller sees to its name once it is whole.

    Parameters
    ----------
    options : of the driver, such as compress, and crs and transform.

    Raises
    ------
    InputError
        When it cannot be written, or cannot be read again afterwards.
    """
    path = Path(path)
    tiling: dict[str, Any] = (
        {"tiled": True, "blockxsize": TILE_PX, "blockysize": TILE_PX} if min(columns, rows) >= TILE_PX else {}
    )
    settings: dict[str, Any] = {"bigtiff": "if_safer", "num_threads": "all_cpus", **tiling, **options}
    try:
        with quietly(), rasterio.Env(**SETTINGS):
            with rasterio.open(
                path, "w", driver="GTiff", width=columns, height=rows, count=bands, dtype=dtype, **settings
            ) as dataset:
                yield RowWriter(path, dataset)
            # what the cache could not write is lost in silence
            with rasterio.open(path) as written:
                written.read(window=window_of(0, rows - 1, columns, 1))
    except (RasterioError, OSError) as error:
        raise _unwritten(path, error) from error


@contextmanager
def create_like(path: FilePath, photograph: Photograph, compression: str = COMPRESSION) -> Generator[RowWriter]:
    """A tiled TIFF with everything of a photograph but its pixels.

    Parameters
    ----------
    compression : 'keep', or one of `photograph_settings.COMPRESSIONS`; a lossy one is never kept, DEFLATE stands in.
    """
    source = photograph.dataset
    options = _layout(photograph) | _compression(photograph, compression) | _georeference(source)
    with create_image(
        path, photograph.columns, photograph.rows, photograph.bands, photograph.dtype.name, **options
    ) as writer:
        _carry(source, writer.dataset)
        yield writer


def _layout(photograph: Photograph) -> dict[str, Any]:
    source = photograph.dataset
    structure = source.tags(ns="IMAGE_STRUCTURE")
    options: dict[str, Any] = {"interleave": structure.get("INTERLEAVE", "pixel").lower()}
    if photograph.nbits != 8 * photograph.dtype.itemsize:
        options["nbits"] = photograph.nbits
    if photograph.nodata is not None:
        options["nodata"] = photograph.nodata
    colours = source.colorinterp
    if colours[:3] == (ColorInterp.red, ColorInterp.green, ColorInterp.blue):
        options["photometric"] = "rgb"
    elif colours[:4] == (ColorInterp.cyan, ColorInterp.magenta, ColorInterp.yellow, ColorInterp.black):
        options["photometric"] = "cmyk"
    elif structure.get("MINISWHITE") == "YES":
        options["photometric"] = "miniswhite"
    profile = source.tags(ns="COLOR_PROFILE").get("SOURCE_ICC_PROFILE")
    return options | ({"source_icc_profile": profile} if profile else {})


def _compression(photograph: Photograph, wanted: str) -> dict[str, Any]:
    structure = photograph.dataset.tags(ns="IMAGE_STRUCTURE")
    name = wanted
    if wanted == "keep":
        name = structure.get("COMPRESSION", "none").lower() if photograph.dataset.driver == "GTiff" else "deflate"
        name = name if name in LOSSLESS else "deflate"
    if name == "none":
        return {}
    options: dict[str, Any] = {"compress": name}
    if name in PREDICTED:
        # differences of neighbours: what photographs compress well by
        best = "3" if photograph.dtype.kind == "f" else "2"
        usable = photograph.nbits == 8 * photograph.dtype.itemsize
        options["predictor"] = structure.get("PREDICTOR", best) if wanted == "keep" else best
        options = options if usable else {"compress": name}
    return options


def _georeference(source: Any) -> dict[str, Any]:
    with quietly():
        points, crs_of_points = source.gcps
        options: dict[str, Any] = {"crs": source.crs} if source.crs else {}
        if source.transform != Affine.identity():
            options["transform"] = source.transform
    if points and "transform" not in options:
        options |= {"gcps": points, "crs": crs_of_points}
    return options | ({"rpcs": source.rpcs} if source.rpcs else {})


def _carry(source: Any, target: Any) -> None:
    """Metadata of the file and its bands."""
    for domain in (None, *source.tag_namespaces()):
        if _carried(domain):
            target.update_tags(ns=domain, **source.tags(ns=domain))
    for band in source.indexes:
        for domain in (None, *source.tag_namespaces(band)):
            if _carried(domain):
                target.update_tags(band, ns=domain, **_without_statistics(source.tags(band, ns=domain)))
    target.descriptions = source.descriptions
    target.units = source.units
    if any(scale != 1.0 for scale in source.scales) or any(source.offsets):
        target.scales, target.offsets = source.scales, source.offsets
    if ColorInterp.undefined not in source.colorinterp:
        target.colorinterp = source.colorinterp


def _carried(domain: str | None) -> bool:
    """Whether metadata of a domain can be set again; rasterio cannot write the text of an XML domain."""
    return domain is None or (domain not in NOT_CARRIED and not domain.startswith("xml:"))


def _without_statistics(tags: Mapping[str, str]) -> dict[str, str]:
    """Statistics of the old pixels are none of the new ones."""
    return {key: value for key, value in tags.items() if not key.startswith("STATISTICS_")}


def write_grid(
    path: FilePath,
    values: np.ndarray,
    upper_left: tuple[float, float],
    cell: float,
    bands: tuple[str, ...],
    tags: Mapping[str, str],
) -> None:
    """A raster of numbers over a plane, without a coordinate system.

    Parameters
    ----------
    values : (bands, rows, columns). upper_left : corner of the first cell, y up. cell : size.
    bands : descriptions. tags : what goes with the file.
    """
    transform = Affine(cell, 0.0, upper_left[0], 0.0, -cell, upper_left[1])
    count, rows, columns = values.shape
    with create_image(
        path, columns, rows, count, values.dtype.name, transform=transform, compress="deflate", predictor=3
    ) as writer:
        writer.dataset.descriptions = bands
        writer.dataset.update_tags(**tags)
        writer.write(0, values)
