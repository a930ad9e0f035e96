"""Windows of photographs in their colours, the photographs used last kept in memory."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from aerotri.conventions import InputError
from aerotri.rasters.images import Photograph, open_photograph

CACHE_BYTES = 400 << 20
"""Of photographs kept in memory [C]: a dozen of 11 megapixels."""
LARGEST_HELD = 192 << 20
"""Bytes of a photograph that is kept whole [C]; of a larger one only windows are read, again and again."""
TYPES = ("uint8", "uint16")
GREEN = 1
"""Band of a colour photograph whose detail is looked at: the sharpest of most sensors."""


class PixelStore:
    """The pixels of photographs of one kind.

    Parameters
    ----------
    paths : of the photographs; sizes : (columns, rows) that each must have.

    Attributes
    ----------
    bands, dtype : of all of them.

    Raises
    ------
    InputError
        When they differ, or are not as large as their cameras.
    """

    def __init__(self, paths: Sequence[Path], sizes: Sequence[tuple[int, int]]):
        self._paths, self._sizes = paths, sizes
        self._keep_none()
        self.bands, self.dtype, self._white = self._kind()
        pixels = sum(columns * rows for columns, rows in sizes)
        self._all_fit = pixels * self.bands * self.dtype.itemsize <= CACHE_BYTES

    def _keep_none(self) -> None:
        self._kept: OrderedDict[int, np.ndarray] = OrderedDict()
        self._lock, self._bytes = Lock(), 0
        self._locks = [Lock() for _ in self._paths]

    def __getstate__(self) -> dict[str, Any]:
        """Another process reads the photographs itself; of which kind they are it is told."""
        own = ("_sizes", "bands", "dtype", "_white", "_all_fit")
        return {name: self.__dict__[name] for name in own} | {"_paths": [path.absolute() for path in self._paths]}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._keep_none()

    @property
    def most_bytes(self) -> int:
        """Bytes of photographs that are kept at most."""
        pixels = sum(columns * rows for columns, rows in self._sizes)
        return min(CACHE_BYTES + LARGEST_HELD, pixels * self.bands * self.dtype.itemsize)

    def _kind(self) -> tuple[int, np.dtype, float]:
        first: tuple[int, np.dtype] | None = None
        bits = 0
        for path, size in zip(self._paths, self._sizes, strict=True):
            with open_photograph(path) as photograph:
                _refuse_other_size(photograph, size)
                kind = photograph.bands, photograph.dtype
                bits = max(bits, photograph.nbits)
            if kind[1].name not in TYPES:
                raise InputError(f"has pixels of type {kind[1].name}", "convert it to 8 or 16 bit", path)
            if first is not None and kind != first:
                raise InputError(
                    f"has {kind[0]} bands of {kind[1].name}, {self._paths[0].name} has {first[0]} of {first[1].name}",
                    "make one orthophoto of photographs of one kind", path,
                )  # fmt: skip
            first = kind
        if first is None:
            raise InputError("there are no photographs", "give the folder that holds them")
        return *first, float(2**bits - 1)

    @property
    def white(self) -> float:
        """Largest value of a pixel."""
        return self._white

    def window(self, k: int, row: int, column: int, last_row: int, last_column: int) -> np.ndarray:
        """(rows, columns, bands) of photograph k; the end is not in it."""
        whole = self._whole(k)
        if whole is not None:
            return whole[row:last_row, column:last_column]
        with open_photograph(self._paths[k]) as photograph:
            return by_pixel(photograph.window(row, column, last_row - row, last_column - column))

    def reduced(self, k: int, times: float) -> np.ndarray:
        """(rows, columns, bands) of the whole photograph k, about so many times smaller; not kept."""
        import cv2

        columns, rows = (max(int(side / max(times, 1.0)), 1) for side in self._sizes[k])
        # where all stay in memory they are read once
        if self._all_fit and (whole := self._whole(k)) is not None:
            parts = (
                cv2.resize(np.ascontiguousarray(whole[:, :, b : b + 4]), (columns, rows), interpolation=cv2.INTER_AREA)
                for b in range(0, self.bands, 4)
            )
            return np.concatenate([part.reshape(rows, columns, -1) for part in parts], axis=2)
        with open_photograph(self._paths[k]) as photograph:
            return by_pixel(photograph.reduced(rows, columns))

    def forget(self, most: int) -> None:
        """Keep no more than so many bytes of photographs, those used last; the others are read again when needed."""
        with self._lock:
            while self._bytes > most and self._kept:
                self._bytes -= self._kept.popitem(last=False)[1].nbytes

    @property
    def detail_band(self) -> int:
        """The band that `detail` looks at."""
        return min(self.bands - 1, GREEN)

    def detail(self, k: int, times: float) -> np.ndarray | None:
        """(rows, columns) float32 mean change between pixels, of twice their size, of the whole photograph k, about so
        many times smaller; None of one that is too large to be held."""
        import cv2

        whole = self._whole(k)
        if whole is None:
            return None
        columns, rows = (max(int(side / max(times, 1.0)), 1) for side in self._sizes[k])
        band = np.ascontiguousarray(whole[:, :, self.detail_band])
        half = cv2.resize(band, (max(band.shape[1] // 2, 1), max(band.shape[0] // 2, 1)), interpolation=cv2.INTER_AREA)
        change = np.abs(cv2.Laplacian(half, cv2.CV_32F))
        return cv2.resize(change, (columns, rows), interpolation=cv2.INTER_AREA)

    def _whole(self, k: int) -> np.ndarray | None:
        columns, rows = self._sizes[k]
        if rows * columns * self.bands * self.dtype.itemsize > LARGEST_HELD:
            return None
        # one thread reads a photograph, others that want the same one wait
        with self._locks[k]:
            with self._lock:
                if k in self._kept:
                    self._kept.move_to_end(k)
                    return self._kept[k]
            with open_photograph(self._paths[k]) as photograph:
                found = by_pixel(photograph.read(0, rows))
            with self._lock:
                self._kept[k] = found
                self._bytes += found.nbytes
                while self._bytes > CACHE_BYTES and len(self._kept) > 1:
                    self._bytes -= self._kept.popitem(last=False)[1].nbytes
            return found


def by_pixel(bands: np.ndarray) -> np.ndarray:
    """(rows, columns, bands) of (bands, rows, columns)."""
    import cv2

    if len(bands) == 1:
        return bands[0][:, :, None]
    if len(bands) <= 4:
        return cv2.merge([np.ascontiguousarray(band) for band in bands])
    return np.ascontiguousarray(np.moveaxis(bands, 0, -1))


def _refuse_other_size(photograph: Photograph, size: tuple[int, int]) -> None:
    if (photograph.columns, photograph.rows) != tuple(size):
        raise InputError(
            f"is {photograph.columns} × {photograph.rows} pixels large, its camera has {size[0]} × {size[1]}",
            "give the photographs as they were measured", photograph.path,
        )  # fmt: skip
