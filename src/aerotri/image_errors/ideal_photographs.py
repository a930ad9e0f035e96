"""Photographs without systematic image errors: every pixel of the ideal photograph is fetched where it was measured.

[D] An ideal position is found at m = ideal + d(m), the fixed point within one tile. Which tile records an ideal
position follows from where m lies: in an overlap, where two do, the tile of the ideal position; in a gap, where none
does, the nearer one. Between the tiles nothing is interpolated but the grey values under the kernel. The displacement
is sampled on a grid inside each tile (see `tile_grid`), every pixel has its own exact weights.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from aerotri.adjustment.parallel import thread_count
from aerotri.conventions import InputError, mm_from_px, px_from_mm
from aerotri.image_errors import _kernels
from aerotri.image_errors.error_function import ErrorFunction
from aerotri.image_errors.tile_grid import TileGrid, sample, seams_px, tiles_of
from aerotri.observations import Camera
from aerotri.rasters_images import Photograph, create_like, open_photograph

RESAMPLINGS = ("bicubic", "lanczos")
BAND_BYTES = 24 * 2**20
"""Size of the rows, all bands, resampled at a time."""
TASK_ROWS = 32
REACH_GRID = (33, 25)
SWITCH_ITERATIONS = 12
Report = Callable[[float], None]
Read = Callable[[int, int], np.ndarray]


@dataclass(frozen=True, eq=False)
class IdealMap:
    """Where the pixels of an ideal photograph lie in the measured one.

    Parameters
    ----------
    camera : its size_px is that of both photographs.
    tiles : by tile row and column, the displacement (column, row) in px, source less ideal position.
    columns : (tile columns + 1, rows) first column of every tile, and the end of the last one, by row.
    rows : (tile rows + 1, columns) first row of every tile, and the end of the last one, by column.
    is_identity : whether nothing moves.
    """

    camera: Camera
    tiles: tuple[tuple[TileGrid, ...], ...]
    columns: np.ndarray
    rows: np.ndarray
    is_identity: bool

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.camera.size_px[1], self.camera.size_px[0]

    def source_rows(self, first: int, last: int) -> tuple[int, int]:
        """Rows of the source, first and one after the last, that the output rows first … last − 1 may touch.

        They reach beyond the image where the kernel does.
        """
        least, most = 0.0, 0.0
        for row in self.tiles:
            for grid in row:
                low, high = grid.bounds((first, last), (0, self.size[1]))
                least, most = min(least, float(low[1])), max(most, float(high[1]))
        low = min(max(int(np.floor(first + least)), -1), self.size[0])
        high = max(min(int(np.floor(last - 1 + most)), self.size[0] - 1), -1)
        return low - _kernels.PAD + 1, max(high, low) + _kernels.PAD + 1


@dataclass(frozen=True, eq=False)
class PixelType:
    """What a pixel can hold: smallest and largest value, and the value outside the image."""

    low: float
    high: float
    fill: float
    nodata: float | None = None


def ideal_map(errors: ErrorFunction) -> IdealMap:
    """The map of a group of photographs.

    Raises
    ------
    InputError
        When the image errors fold the image over.
    """
    camera = errors.camera
    tiles = tiles_of(camera)
    seam_columns, seam_rows = (seams - 0.5 for seams in seams_px(camera))
    margin = _margin(errors)
    column_ranges = _ranges(seam_columns, camera.size_px[0], margin)
    row_ranges = _ranges(seam_rows, camera.size_px[1], margin)
    grids = []
    for tile_row, rows in zip(tiles, row_ranges, strict=True):
        line = []
        for tile, columns in zip(tile_row, column_ranges, strict=True):
            line.append(sample(_displacement(errors, tile.bounds_mm(camera)), rows, columns))
        grids.append(tuple(line))
    turned = tuple(zip(*grids, strict=True))
    columns, rows = camera.size_px
    return IdealMap(
        camera=camera,
        tiles=tuple(grids),
        columns=_switches(grids, seam_columns, seam_rows, rows, columns, 0),
        rows=_switches(turned, seam_rows, seam_columns, columns, rows, 1),
        is_identity=errors.is_zero,
    )


def _margin(errors: ErrorFunction) -> int:
    """Pixels by which a tile may record what ideally lies beyond its seams."""
    half = np.array(errors.camera.half_format_mm)
    x, y = (np.linspace(-1.0, 1.0, n) * h for n, h in zip(REACH_GRID, half, strict=True))
    nodes = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return int(np.ceil(1.5 * np.abs(errors.measured(nodes) - nodes).max() / errors.camera.pixel_mm)) + 2


def _ranges(seams: np.ndarray, count: int, margin: int) -> list[tuple[int, int]]:
    """First and last pixel of the tiles between seams, and the margin beyond them, within the format."""
    edges = [-np.inf, *seams.tolist(), np.inf]
    return [(int(max(low - margin, 0)), int(min(high + margin, count - 1))) for low, high in pairwise(edges)]


def _displacement(errors: ErrorFunction, within: tuple[np.ndarray, np.ndarray]):
    size, pixel = errors.camera.size_px, errors.camera.pixel_mm

    def of_pixels(column_row: np.ndarray) -> np.ndarray:
        measured = errors.measured(mm_from_px(column_row, size, pixel), within)
        return px_from_mm(measured, size, pixel) - column_row

    return of_pixels


def _switches(grids, seams: np.ndarray, cross_seams: np.ndarray, count: int, last: int, axis: int) -> np.ndarray:
    """(tiles + 1, count) where one tile ends and the next begins, for every row (axis 0: columns) or column (axis 1).

    Parameters
    ----------
    grids : [tile across the seams' direction][tile along]. last : end of the last tile.
    """
    position = np.arange(count)
    across = np.searchsorted(cross_seams, position, side="right")
    places = np.zeros((len(seams) + 2, count), dtype=np.int64)
    places[-1] = last
    for k, seam in enumerate(seams, start=1):
        for line in np.unique(across):
            own = across == line
            place = _switch(grids[line][k - 1], grids[line][k], seam, position[own], axis)
            places[k, own] = np.clip(np.ceil(place), 0, last)
    return np.maximum.accumulate(places, axis=0)


def _switch(one: TileGrid, other: TileGrid, seam: float, position: np.ndarray, axis: int) -> np.ndarray:
    """(n,) ideal place at which the source passes from one tile to the other."""
    reached = []
    for grid in (one, other):
        place = np.full(len(position), seam)
        for _ in range(SWITCH_ITERATIONS):
            at = (position, place) if axis == 0 else (place, position)
            place = seam - grid.at(*at)[:, axis]
        reached.append(place)
    ends, begins = reached
    return np.where(begins <= ends, np.clip(seam, begins, ends), (begins + ends) / 2.0)


def resample(
    source: np.ndarray,
    source_row: int,
    rows: tuple[int, int],
    ideal: IdealMap,
    kind: PixelType,
    method: str = "bicubic",
    pool: ThreadPoolExecutor | None = None,
) -> np.ndarray:
    """Rows of the ideal photograph.

    Parameters
    ----------
    source : (bands, k, columns) rows of the measured photograph from `source_row` on, at least those that
        `IdealMap.source_rows` names within the image.
    rows : first and one after the last.
    method : of `RESAMPLINGS`.
    pool : threads to work in; the pixels do not depend on it.

    Returns
    -------
    (bands, rows, columns) of the type of the source.
    """
    tasks = _Tasks(source, source_row, rows, ideal, kind, method)
    list((map if pool is None else pool.map)(tasks, range(tasks.count)))
    return tasks.out


class _Tasks:
    """The work on some rows in pieces that may run at the same time."""

    def __init__(self, source, source_row, rows, ideal: IdealMap, kind: PixelType, method: str):
        self.source, self.source_row = source, source_row
        self.ideal, self.kind, self.lanczos, self.first = ideal, kind, method == "lanczos", rows[0]
        self.out = np.empty((len(source), rows[1] - rows[0], ideal.size[1]), source.dtype)
        self.pieces = -(-self.out.shape[1] // TASK_ROWS)
        self.count = self.pieces * len(source)

    def __call__(self, k: int) -> None:
        band, piece = divmod(k, self.pieces)
        out = self.out[band, piece * TASK_ROWS : (piece + 1) * TASK_ROWS]
        first = self.first + piece * TASK_ROWS
        source = self._padded(band, self.ideal.source_rows(first, first + len(out)))
        self._fill(source, out, first, (self.kind.low, self.kind.high, self.kind.fill))
        if self.kind.nodata is not None:
            invalid = _is(source, self.kind.nodata)
            if invalid.any():
                weight = np.zeros(out.shape, source.dtype)
                self._fill(invalid.astype(source.dtype), weight, first, (0.0, 1.0, 0.0))
                out[np.abs(weight) > 1e-6] = self.kind.nodata

    def _padded(self, band: int, rows: tuple[int, int]) -> np.ndarray:
        """Source rows in the type of the sums, the pixels on the border of the image repeated beyond it."""
        wide, pad = self.out.dtype.itemsize > 2 and self.out.dtype != np.float32, _kernels.PAD
        number = np.clip(np.arange(*rows), 0, self.ideal.size[0] - 1) - self.source_row
        padded = np.empty((len(number), self.ideal.size[1] + 2 * pad), np.float64 if wide else np.float32)
        if len(number) == number[-1] - number[0] + 1:
            padded[:, pad:-pad] = self.source[band, number[0] : number[-1] + 1]
        else:
            padded[:, pad:-pad] = self.source[band, number]
        padded[:, :pad], padded[:, -pad:] = padded[:, pad, None], padded[:, -pad - 1, None]
        return padded

    def _fill(self, source: np.ndarray, out: np.ndarray, first: int, limits: tuple[float, float, float]) -> None:
        ideal, rows = self.ideal, slice(first, first + len(out))
        limit, weights, scratch = np.array(limits, source.dtype), np.empty((7, 6), source.dtype), np.empty((3, 6))
        low, _ = ideal.source_rows(first, rows.stop)
        for i, line in enumerate(ideal.tiles):
            if ideal.rows[i].min() >= rows.stop or ideal.rows[i + 1].max() <= first:
                continue
            for j, grid in enumerate(line):
                _kernels.resample_tile(
                    source, low, out, first, grid.nodes, np.array([grid.row, grid.column]), grid.step,
                    ideal.columns[j, rows], ideal.columns[j + 1, rows], ideal.rows[i], ideal.rows[i + 1],
                    np.array(ideal.size), limit, weights, scratch, out.dtype.kind in "iu", self.lanczos,
                )  # fmt: skip


def _is(pixels: np.ndarray, value: float) -> np.ndarray:
    return np.isnan(pixels) if np.isnan(value) else pixels == value


def ideal_photograph(
    source: str | os.PathLike,
    target: str | os.PathLike,
    ideal: IdealMap,
    method: str = "bicubic",
    compression: str = "keep",
    report: Report | None = None,
) -> tuple[str, ...]:
    """Resample one file into another, by rows: memory does not depend on its size.

    Bit depth, bands, metadata and georeference are kept. Pixels whose source lies outside the photograph get its nodata
    value, or 0. Where there is nothing to correct the pixels are copied.

    Parameters
    ----------
    target : written in place; who needs it whole or not at all passes a temporary name.
    report : called with the share that is done.

    Returns
    -------
    What of the photograph could not be carried over, in words.

    Raises
    ------
    InputError
        When the source is damaged or not a photograph of this camera.
    """
    if method not in RESAMPLINGS:
        raise InputError(f"'{method}' is no resampling", f"choose {' or '.join(RESAMPLINGS)}")
    with open_photograph(source) as photograph:
        _check_size(photograph, ideal)
        with create_like(target, photograph, compression) as writer:
            _stream(photograph, writer.write, ideal, method, report)
        return photograph.left_out()


def _check_size(photograph: Photograph, ideal: IdealMap) -> None:
    if (photograph.rows, photograph.columns) != ideal.size:
        raise InputError(
            f"is {photograph.columns} × {photograph.rows} pixels large, camera '{ideal.camera.name}' has "
            f"{ideal.size[1]} × {ideal.size[0]}",
            "give the photographs as they were measured",
            photograph.path,
        )


def _stream(photograph: Photograph, write, ideal: IdealMap, method: str, report: Report | None) -> None:
    """Reading ahead, resampling in threads and writing behind, a few rows at a time."""
    low, high = photograph.range
    nodata = photograph.nodata
    kind = PixelType(low, high, 0.0 if nodata is None else nodata, nodata)
    row_bytes = photograph.bands * photograph.columns * photograph.dtype.itemsize
    many = max(min(BAND_BYTES // row_bytes // TASK_ROWS, 16), 1) * TASK_ROWS
    bands = [(first, min(first + many, photograph.rows)) for first in range(0, photograph.rows, many)]

    def read(rows: tuple[int, int]) -> tuple[int, np.ndarray]:
        first, last = rows if ideal.is_identity else ideal.source_rows(*rows)
        first, last = max(min(first, photograph.rows - 1), 0), max(min(last, photograph.rows), 1)
        return first, photograph.read(first, last)

    with ThreadPoolExecutor(1) as reader, ThreadPoolExecutor(1) as writer, ThreadPoolExecutor(thread_count()) as pool:
        coming: Future = reader.submit(read, bands[0])
        going: Future | None = None
        for number, rows in enumerate(bands):
            first, pixels = coming.result()
            if number + 1 < len(bands):
                coming = reader.submit(read, bands[number + 1])
            if not ideal.is_identity:
                pixels = resample(pixels, first, rows, ideal, kind, method, pool)
            if going is not None:
                going.result()
            going = writer.submit(write, rows[0], pixels)
            if report is not None:
                report(rows[1] / photograph.rows)
        if going is not None:
            going.result()


def name_of(path: Path) -> str:
    """Name of the ideal photograph of a file."""
    return path.stem + (path.suffix if path.suffix.lower() in (".tif", ".tiff") else ".tif")
