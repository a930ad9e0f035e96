"""Grey values of photographs, 8 bits, whole levels of resolution, the ones used last kept in memory."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from threading import Lock
from typing import Any

import cv2
import numpy as np

from aerotri.conventions import InputError
from aerotri.rasters.images import open_photograph

KEPT_BYTES = 500_000_000
"""Bytes of grey values kept in memory; chosen [C]: forty photographs of 12 Mpx or five of 86 Mpx, far below the 2 GB
that the whole command may take."""
COLOURS = 3
"""Bands that are averaged to grey, red, green and blue: what follows them is infrared or a mask."""
ROWS_AT_A_TIME = 1024
"""Rows that are read and averaged at a time."""
TAIL_PERCENT = 0.1
"""Share of the pixels of more than 8 bits that may be cut at either end when they are brought to 8 bits; chosen [C]: a
few specular pixels would otherwise leave the ground two dozen grey values."""
MOST_SAMPLED = 1_000_000
"""Pixels of a photograph that its range of grey values is taken of."""


class GreyStore:
    """Photographs by their number, at resolutions of 1, 1/2, 1/4 … of their own.

    Parameters
    ----------
    paths : of the photographs; sizes : (columns, rows) that each must have. most_bytes : kept.
    """

    def __init__(self, paths: Sequence[Path], sizes: Sequence[tuple[int, int]], most_bytes: int = KEPT_BYTES):
        self._paths, self._sizes, self._most = paths, sizes, most_bytes
        self._kept: OrderedDict[tuple[int, int], np.ndarray] = OrderedDict()
        self._lock, self._bytes = Lock(), 0
        self.reads = 0

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process reads the photographs itself."""
        return GreyStore, ([path.absolute() for path in self._paths], self._sizes, self._most)

    @property
    def most_bytes(self) -> int:
        """Bytes that are kept at most."""
        return min(self._most, self._whole)

    @property
    def _whole(self) -> int:
        """Bytes of all photographs, with the levels of each that are smaller."""
        return sum(columns * rows * 4 // 3 for columns, rows in self._sizes)

    def level(self, k: int, level: int) -> np.ndarray:
        """(rows, columns) uint8 of photograph k; its pixels are means of 2^level × 2^level.

        Raises
        ------
        InputError
        """
        with self._lock:
            if (k, level) not in self._kept:
                self._keep((k, level), reduced(self._pixels(k), level))
            self._kept.move_to_end((k, level))
            return self._kept[k, level]

    def _pixels(self, k: int) -> np.ndarray:
        """A photograph in full; kept for its other levels where there is room for all, so that each is read once."""
        if (k, 0) in self._kept:
            return self._kept[k, 0]
        self.reads += 1
        pixels = read_grey(self._paths[k], self._sizes[k])
        if self._whole <= self._most:
            self._keep((k, 0), pixels)
        return pixels

    def _keep(self, key: tuple[int, int], pixels: np.ndarray) -> None:
        if key in self._kept:
            return
        self._kept[key] = pixels
        self._bytes += pixels.nbytes
        while self._bytes > self._most and len(self._kept) > 1:
            self._bytes -= self._kept.popitem(last=False)[1].nbytes


def read_grey(path: Path, size: tuple[int, int]) -> np.ndarray:
    """(rows, columns) uint8, the mean of the colours; more than 8 bits are stretched over their range.

    Raises
    ------
    InputError
        When the file is damaged or of another size.
    """
    with open_photograph(path) as photograph:
        if (photograph.columns, photograph.rows) != tuple(size):
            raise InputError(
                f"is {photograph.columns} × {photograph.rows} pixels large, its camera has {size[0]} × {size[1]}",
                "give the photographs as they were measured", path,
            )  # fmt: skip
        eight = photograph.dtype == np.uint8
        out = np.empty((photograph.rows, photograph.columns), np.uint8 if eight else np.float32)
        for first in range(0, photograph.rows, ROWS_AT_A_TIME):
            last = min(first + ROWS_AT_A_TIME, photograph.rows)
            bands = photograph.read(first, last)
            bands = bands[: COLOURS if len(bands) >= COLOURS else 1]
            if eight:
                out[first:last] = (bands.sum(axis=0, dtype=np.uint16) + len(bands) // 2) // len(bands)
            else:
                out[first:last] = bands.mean(axis=0, dtype=np.float32)
    return out if eight else _stretched(out)


def _stretched(grey: np.ndarray) -> np.ndarray:
    known = np.isfinite(grey)
    if not known.any():
        return np.zeros(grey.shape, np.uint8)
    sample = grey.ravel() if known.all() else grey[known]
    sample = sample[:: len(sample) // MOST_SAMPLED + 1]
    if not known.all():
        grey = np.where(known, grey, np.float32(grey[known].min()))
    low, high = np.percentile(sample, [TAIL_PERCENT, 100.0 - TAIL_PERCENT])
    scaled = grey - np.float32(low)
    scaled *= np.float32(255.0 / (high - low if high > low else 1.0))
    return np.clip(scaled + np.float32(0.5), 0.0, 255.0, out=scaled).astype(np.uint8)


def reduced(pixels: np.ndarray, level: int) -> np.ndarray:
    """The level of a photograph; rows and columns beyond whole squares are left out."""
    if level == 0:
        return pixels
    side = 1 << level
    rows, columns = pixels.shape[0] // side, pixels.shape[1] // side
    return cv2.resize(pixels[: rows * side, : columns * side], (columns, rows), interpolation=cv2.INTER_AREA)
