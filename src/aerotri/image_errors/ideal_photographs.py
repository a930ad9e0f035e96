"""Photographs without systematic image errors: every pixel of the ideal photograph is fetched where it was measured.

Where that is says the map (see `ideal_map`). Every pixel has the weights of its own exact position; between the tiles
nothing is interpolated but the grey values under the kernel.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.adjustment.parallel import thread_count
from aerotri.conventions import FilePath, InputError
from aerotri.image_errors import _kernels
from aerotri.image_errors.ideal_map import IdealMap
from aerotri.observations import Camera
from aerotri.rasters.images import Photograph, create_like, open_photograph
from aerotri.rasters.photograph_settings import COMPRESSION, RESAMPLING, RESAMPLINGS

BAND_BYTES = 24 * 2**20
"""Size of the rows, all bands, resampled at a time."""
TASK_ROWS = 32
"""Rows a thread resamples at a time [C]: enough work for a call, few enough that all threads end together."""
COMPILED_FOR = tuple(np.dtype(kind) for kind in (np.uint8, np.uint16, np.float32, np.float64))
"""Types of pixel that kernels write; others come from the type of the sums, so that less is compiled."""
Report = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class PixelType:
    """What a pixel can hold: smallest and largest value, and the value outside the image."""

    low: float
    high: float
    fill: float
    nodata: float | None = None


def resample(
    source: np.ndarray,
    source_row: int,
    rows: tuple[int, int],
    ideal: IdealMap,
    kind: PixelType,
    method: str = RESAMPLING,
    pool: ThreadPoolExecutor | None = None,
) -> np.ndarray:
    """Rows of the ideal photograph.

    Parameters
    ----------
    source : (bands, k, columns) rows of the measured photograph from `source_row` on, at least those that
        `IdealMap.source_rows` names within the image.
    rows : first and one after the last.
    method : of `photograph_settings.RESAMPLINGS`.
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

    def __init__(
        self, source: np.ndarray, source_row: int, rows: tuple[int, int], ideal: IdealMap, kind: PixelType, method: str
    ):
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
        limits = self.kind.low, self.kind.high, self.kind.fill
        if out.dtype in COMPILED_FOR:
            self._fill(source, out, first, limits)
        else:
            numbers = np.empty(out.shape, source.dtype)
            self._fill(source, numbers, first, limits)
            out[:] = numbers
        if self.kind.nodata is not None:
            invalid = _is(source, self.kind.nodata)
            if invalid.any():
                weight = np.zeros(out.shape, source.dtype)
                self._fill(invalid.astype(source.dtype), weight, first, (-1e9, 1e9, 0.0), whole_numbers=False)
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

    def _fill(
        self,
        source: np.ndarray,
        out: np.ndarray,
        first: int,
        limits: tuple[float, float, float],
        whole_numbers: bool | None = None,
    ) -> None:
        whole_numbers = self.out.dtype.kind in "iu" if whole_numbers is None else whole_numbers
        ideal, rows = self.ideal, slice(first, first + len(out))
        low, _ = ideal.source_rows(first, rows.stop)
        sampling = _kernels.Sampling(
            source, low, np.array(ideal.size), np.array(limits, source.dtype), whole_numbers, self.lanczos,
            np.empty((7, 6), source.dtype), np.empty((3, 6)),
        )  # fmt: skip
        for i, line in enumerate(ideal.tiles):
            if ideal.rows[i].min() >= rows.stop or ideal.rows[i + 1].max() <= first:
                continue
            for j, grid in enumerate(line):
                tile = _kernels.Tile(
                    grid.nodes, np.array([grid.row, grid.column]), grid.step, ideal.columns[j, rows],
                    ideal.columns[j + 1, rows], ideal.rows[i], ideal.rows[i + 1],
                )  # fmt: skip
                _kernels.resample_tile(sampling, out, first, tile)


def _is(pixels: np.ndarray, value: float) -> np.ndarray:
    return np.isnan(pixels) if np.isnan(value) else pixels == value


def ideal_photograph(
    source: FilePath,
    target: FilePath,
    ideal: IdealMap,
    method: str = RESAMPLING,
    compression: str = COMPRESSION,
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
        _check_size(photograph, ideal.camera)
        with create_like(target, photograph, compression) as writer:
            _stream(photograph, writer.write, ideal, method, report)
        return photograph.left_out()


def check_photograph(path: FilePath, camera: Camera) -> None:
    """Whether a file can be opened and is a photograph of a camera.

    Raises
    ------
    InputError
    """
    with open_photograph(path) as photograph:
        _check_size(photograph, camera)


def _check_size(photograph: Photograph, camera: Camera) -> None:
    if (photograph.columns, photograph.rows) != tuple(camera.size_px):
        columns, rows = camera.size_px
        raise InputError(
            f"is {photograph.columns} × {photograph.rows} pixels large, camera '{camera.name}' has {columns} × {rows}",
            "give the photographs as they were measured",
            photograph.path,
        )


def _stream(
    photograph: Photograph,
    write: Callable[[int, np.ndarray], None],
    ideal: IdealMap,
    method: str,
    report: Report | None,
) -> None:
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
        coming: Future[tuple[int, np.ndarray]] = reader.submit(read, bands[0])
        going: Future[None] | None = None
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
