"""What cells of a surface are in pixels, and what is looked for about them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

LAG_PX = 4.0
"""From a cell to the neighbours with which its height is compared: more than half of a window of the matching."""
MIDDLE_STEP = 8
"""Cells from one to the next of which the middle of heights is taken."""


@dataclass(frozen=True)
class CellScale:
    """lag : cells that `LAG_PX` are. pixel : m of height that a pixel of parallax is."""

    lag: int
    pixel: float

    @classmethod
    def of(cls, cell_px: float, pixel: float) -> CellScale:
        """Of cells of so many pixels on the ground."""
        return cls(max(round(LAG_PX / cell_px), 1), pixel)

    @property
    def window(self) -> int:
        """Cells along a side of what a window of the matching covers."""
        return 2 * self.lag + 1

    @property
    def around(self) -> int:
        """Cells along a side of two windows."""
        return 4 * self.lag + 1


def middle_height(z: np.ndarray) -> float:
    """m, a height in the middle of those known, of some of the cells where that is enough."""
    some = z[::MIDDLE_STEP, ::MIDDLE_STEP]
    return float(np.nanmedian(some if np.isfinite(some).any() else z))


def sum_about(values: np.ndarray, side: int) -> np.ndarray:
    """(rows, columns) float32, sum of a square of cells; nothing counts outside."""
    return cv2.boxFilter(values, -1, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)


def square(side: int) -> np.ndarray:
    """Cells about one, for `cv2.dilate` and `cv2.erode`."""
    return np.ones((side, side), np.uint8)
