"""Colours of the cells of a surface, each from one photograph that measured it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from aerotri.rasters.images import open_photograph
from aerotri.terrain.dense.place import place_at
from aerotri.terrain.ortho.pixels import TYPES, PixelStore
from aerotri.terrain.photographs import Photographs

WHITE = 65535
"""Largest value of a colour, as LAS has it."""


class Colours:
    """Red, green and blue of places that photographs show.

    Parameters
    ----------
    photographs : oriented. paths : their files. cell : m, side of what one colour stands for.

    Raises
    ------
    InputError
        When a photograph cannot be read.
    """

    def __init__(self, photographs: Photographs, paths: Sequence[Path], cell: float):
        self._photographs, self._cell = photographs, cell
        self._stores: dict[tuple[int, str], PixelStore] = {}
        self._at: list[tuple[PixelStore, int] | None] = [None] * len(paths)
        rows: dict[tuple[int, str], list[int]] = {}
        for k, path in enumerate(paths):
            with open_photograph(path) as photograph:
                kind = photograph.bands, photograph.dtype.name
            if kind[1] in TYPES:
                rows.setdefault(kind, []).append(k)
        sizes = np.rint(2.0 * photographs.sensor[:, :2]).astype(int)
        for members in rows.values():
            store = PixelStore([paths[k] for k in members], [(int(sizes[k, 0]), int(sizes[k, 1])) for k in members])
            for n, k in enumerate(members):
                self._at[k] = store, n

    def of(self, xyz: np.ndarray, shown_by: np.ndarray) -> np.ndarray:
        """(n, 3) uint16 of places (n, 3) m of the CRS, near each other; 0 where the photograph has no colours.

        Parameters
        ----------
        shown_by : (n,) photographs.
        """
        out = np.zeros((len(xyz), 3), np.uint16)
        if not len(xyz):
            return out
        reach = float(np.ptp(xyz, axis=0).max()) + 1.0
        place = place_at(self._photographs, xyz.mean(axis=0), reach, 0.0)
        for k in np.unique(shown_by[shown_by >= 0]).tolist():
            chosen = shown_by == k
            pixel = place.project(k, place.from_crs(xyz[chosen]))
            held = self._at[k]
            if held is not None:
                out[chosen] = self._sampled(k, held[0], held[1], pixel)
        return out

    def _sampled(self, k: int, store: PixelStore, n: int, pixel: np.ndarray) -> np.ndarray:
        """(n, 3) uint16, means over a cell about places (n, 2) column, row, px."""
        columns, rows = (2.0 * self._photographs.sensor[k, :2]).tolist()
        pixel = np.clip(np.nan_to_num(pixel, nan=0.0) - 0.5, 0.0, [columns - 1.0, rows - 1.0])
        side = max(round(self._cell / float(self._photographs.gsd[k])), 1)
        column, row = (np.maximum(np.floor(pixel.min(axis=0)).astype(int) - side, 0)).tolist()
        last_column, last_row = (np.ceil(pixel.max(axis=0)).astype(int) + side + 1).tolist()
        window = store.window(n, row, column, min(last_row, int(rows)), min(last_column, int(columns)))
        window = window[:, :, :3] if window.shape[2] >= 3 else np.repeat(window[:, :, :1], 3, axis=2)
        mean = cv2.blur(np.ascontiguousarray(window), (side, side), borderType=cv2.BORDER_REPLICATE)
        at = [pixel[:, 1] - row, pixel[:, 0] - column]
        bands = [map_coordinates(mean[:, :, b], at, np.float32, order=1, mode="nearest") for b in range(3)]
        return np.clip(np.column_stack(bands) * (WHITE / store.white) + 0.5, 0, WHITE).astype(np.uint16)
