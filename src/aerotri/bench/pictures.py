"""The pixels of photographs as the page shows them: tiles of a pyramid, and cut-outs in full resolution."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.files.photograph_files import files_of, match_files
from aerotri.observations import Block
from aerotri.rasters.images import Photograph, open_photograph

TILE_PX = 512
"""Side of a tile; chosen [C]: a screen takes a dozen."""
ENDINGS = (".jpg", ".jpeg", ".tif", ".tiff")
MOST_BYTES = 700_000_000
"""Of decoded photographs kept; chosen [C]: four of 45 megapixels in colour."""
DARKEST, BRIGHTEST = 0.5, 99.5
"""Percentiles of photographs of more than 8 bits that are shown black and white."""
OVERVIEW_PX = 1000
QUALITY = 92


class Pictures:
    """Photographs of a block, decoded once and kept as long as there is room.

    Parameters
    ----------
    block : whose photographs they are. folder : where their files are, None where there are none.

    Raises
    ------
    InputError
        When the folder holds none of them.
    """

    def __init__(self, block: Block, folder: Path | None):
        names = block.images.names
        self._paths: dict[int, Path] = {}
        self._sizes = [block.cameras[camera].size_px for camera in block.images.camera]
        self._scanned = set(block.interior_fits)
        self._kept: OrderedDict[int, list[np.ndarray]] = OrderedDict()
        self._stretch: dict[int, tuple[float, float]] = {}
        self._lock = Lock()
        if folder is not None:
            files = files_of(folder, ENDINGS)
            index = match_files(files, names)
            self._paths = {int(row): file for row, file in zip(index, files, strict=True) if row >= 0}
            if not self._paths:
                raise InputError("holds no photograph of the block", f"they are called as {names[0]}", folder)

    def __contains__(self, image: int) -> bool:
        return image in self._paths

    def paths(self) -> dict[int, Path]:
        """Files by row of the block."""
        return dict(self._paths)

    def size(self, image: int) -> tuple[int, int]:
        """Columns and rows of a photograph as its file has them; those of the camera where there is no file.

        Raises
        ------
        InputError
        """
        if image not in self._paths:
            return self._sizes[image]
        with open_photograph(self._paths[image]) as photograph:
            self._check(image, photograph)
            return photograph.columns, photograph.rows

    def tile(self, image: int, level: int, column: int, row: int) -> bytes:
        """A tile as JPEG; level 0 is the photograph, every further one half as large.

        Raises
        ------
        InputError
            When there is no such photograph or tile.
        """
        pyramid = self._pyramid(image)
        if not 0 <= level < len(pyramid):
            raise InputError(f"photograph {image} has no level {level}", "load the page again")
        top, left = row * TILE_PX, column * TILE_PX
        part = pyramid[level][top : top + TILE_PX, left : left + TILE_PX]
        if not part.size:
            raise InputError(f"photograph {image} has no tile {column}, {row}", "load the page again")
        return as_jpeg(part)

    def grey(self, image: int, left: int, top: int, size: int) -> np.ndarray:
        """(rows, columns) float grey values of a square, NaN beyond the edge.

        Raises
        ------
        InputError
        """
        out = np.full((size, size), np.nan)
        pixels, at = self._window(image, left, top, size)
        if pixels.size:
            bands = pixels[:3] if len(pixels) >= 3 else pixels[:1]
            grey = bands.mean(axis=0)
            out[at[1] : at[1] + grey.shape[0], at[0] : at[0] + grey.shape[1]] = grey
        return out

    def cutout(self, image: int, left: int, top: int, size: int) -> bytes:
        """A square around a place as JPEG, grey beyond the edge of the photograph.

        Raises
        ------
        InputError
        """
        pixels, at = self._window(image, left, top, size)
        shown = np.full((size, size, 3), 42, dtype=np.uint8)
        if pixels.size:
            colours = _colours(_eight_bits(pixels, self._limits(image)))
            shown[at[1] : at[1] + colours.shape[0], at[0] : at[0] + colours.shape[1]] = colours
        return as_jpeg(shown)

    def _window(self, image: int, left: int, top: int, size: int) -> tuple[np.ndarray, tuple[int, int]]:
        """Pixels (bands, rows, columns) of a square as far as it lies in the photograph, and where in the square."""
        columns, rows = self._sizes_of_file(image)
        a, b = min(max(left, 0), columns), min(max(top, 0), rows)
        c, d = min(max(left + size, 0), columns), min(max(top + size, 0), rows)
        if c <= a or d <= b:
            return np.zeros((1, 0, 0)), (0, 0)
        with open_photograph(self._path(image)) as photograph:
            self._check(image, photograph)
            return photograph.window(b, a, d - b, c - a), (a - left, b - top)

    def _sizes_of_file(self, image: int) -> tuple[int, int]:
        return self.size(image) if image in self._scanned else self._sizes[image]

    def _path(self, image: int) -> Path:
        if image not in self._paths:
            raise InputError(f"there is no file of photograph {image}", "give the folder of the photographs: --photos")
        return self._paths[image]

    def _check(self, image: int, photograph: Photograph) -> None:
        """Marks lie elsewhere in a photograph of another size; a scan has no size of its own."""
        have, wanted = (photograph.columns, photograph.rows), tuple(self._sizes[image])
        if image not in self._scanned and have != wanted:
            raise InputError(
                f"is {have[0]} × {have[1]} pixels large, its camera has {wanted[0]} × {wanted[1]}",
                "give the photographs as they were measured", photograph.path,
            )  # fmt: skip

    def _limits(self, image: int) -> tuple[float, float]:
        """Grey values shown black and white."""
        if image not in self._stretch:
            with open_photograph(self._path(image)) as photograph:
                self._stretch[image] = _stretch(photograph)
        return self._stretch[image]

    def _pyramid(self, image: int) -> list[np.ndarray]:
        """Levels (rows, columns, 3) of 8 bits, the finest first."""
        with self._lock:
            if image not in self._kept:
                with open_photograph(self._path(image)) as photograph:
                    self._check(image, photograph)
                    limits = self._stretch.setdefault(image, _stretch(photograph))
                    pixels = _colours(_eight_bits(photograph.read(0, photograph.rows), limits))
                self._kept[image] = _levels(pixels)
                while len(self._kept) > 1 and _bytes(self._kept.values()) > MOST_BYTES:
                    self._kept.popitem(last=False)
            self._kept.move_to_end(image)
            return self._kept[image]


def as_jpeg(pixels: np.ndarray) -> bytes:
    """JPEG of (rows, columns, 3) red, green, blue of 8 bits."""
    import cv2

    done, packed = cv2.imencode(".jpg", np.ascontiguousarray(pixels[:, :, ::-1]), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    if not done:
        raise InputError("a picture could not be packed", "load the page again")
    return packed.tobytes()


def _stretch(photograph: Photograph) -> tuple[float, float]:
    if photograph.dtype == np.uint8:
        return 0.0, 255.0
    step = max(photograph.columns, photograph.rows) / OVERVIEW_PX
    small = photograph.reduced(max(int(photograph.rows / step), 1), max(int(photograph.columns / step), 1))
    known = small[np.isfinite(small)] if small.dtype.kind == "f" else small
    low, high = np.percentile(known, [DARKEST, BRIGHTEST]) if known.size else (0.0, 1.0)
    return float(low), float(max(high, low + 1e-9))


def _eight_bits(pixels: np.ndarray, limits: tuple[float, float]) -> np.ndarray:
    if pixels.dtype == np.uint8:
        return pixels
    low, high = limits
    scaled = (np.nan_to_num(pixels.astype(np.float32)) - np.float32(low)) * np.float32(255.0 / (high - low))
    return np.clip(scaled, 0.0, 255.0).astype(np.uint8)


def _colours(bands: np.ndarray) -> np.ndarray:
    """(rows, columns, 3) of (bands, rows, columns): the first three, or the first one as grey."""
    chosen = bands[:3] if len(bands) >= 3 else np.repeat(bands[:1], 3, axis=0)
    return np.moveaxis(chosen, 0, 2)


def _levels(pixels: np.ndarray) -> list[np.ndarray]:
    """A pyramid down to one tile."""
    import cv2

    found = [np.ascontiguousarray(pixels)]
    while max(found[-1].shape[:2]) > TILE_PX:
        rows, columns = found[-1].shape[:2]
        found.append(cv2.resize(found[-1], ((columns + 1) // 2, (rows + 1) // 2), interpolation=cv2.INTER_AREA))
    return found


def _bytes(pyramids: Any) -> int:
    return sum(level.nbytes for pyramid in pyramids for level in pyramid)


def corner_of(place: Sequence[float], size: int) -> tuple[int, int]:
    """Left column and upper row of a square of pixels whose middle is near a place (column, row), px."""
    return int(np.floor(place[0])) - size // 2, int(np.floor(place[1])) - size // 2
