"""σ of the cells of a fused surface: noise of the matching, roughness, steps, and pairs that contradict.

A cell beside a step may have the height of the other side, and low steps are blurred over a window. Neither shows in
the images that were matched: what they leave is small on the wrong side too. It shows in the heights themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

NOISE_SHARE, ROUGH_SHARE = 0.81, 0.65
"""Of the σ of the matching, and of the scatter of heights about their neighbours, that are σ of a cell; chosen [C]: the
two that make errors of rendered scenes most likely, on smooth, noisy and rough ground alike
(tools/prove/dense_surface.py)."""
LAG_PX = 4.0
"""From a cell to the neighbours with which its height is compared: more than half of a window of the matching."""
STEP_SHARE = 0.2
"""Of a step that is σ of the cells beside it, besides what they are rough by; chosen [C] with the other two."""
STEP_SIGMAS = 6.0
"""σ of the noise that a step is larger than: the range of some twenty cells reaches five."""
CONTRADICTED_SHARE, CONTRADICTED_SIGMAS = 0.25, 4.0
"""Of the distance to the height of a pair that contradicts, and σ of that pair from which on it does; chosen [C]."""
UNKNOWN = 1e9


@dataclass(frozen=True)
class CellScale:
    """lag : cells that `LAG_PX` are. pixel : m of height that a pixel of parallax is."""

    lag: int
    pixel: float

    @classmethod
    def of(cls, cell_px: float, pixel: float) -> CellScale:
        """Of cells of so many pixels on the ground."""
        return cls(max(round(LAG_PX / cell_px), 1), pixel)


def cell_sigma(
    z: np.ndarray, noise: np.ndarray, heights: np.ndarray, sigmas: np.ndarray, scale: CellScale
) -> np.ndarray:
    """(rows, columns) m, σ of the cells of a surface.

    Parameters
    ----------
    z, noise : (rows, columns) m, heights, NaN where there is none, and their σ by the matching.
    heights, sigmas : (pairs, rows, columns) m of which they were fused.
    """
    of_noise = np.hypot(NOISE_SHARE * noise, ROUGH_SHARE * roughness(z, scale.lag))
    of_place = np.hypot(
        STEP_SHARE * step(z, noise, scale), CONTRADICTED_SHARE * contradiction(z, heights, sigmas, scale)
    )
    return np.hypot(of_noise, of_place)


def roughness(z: np.ndarray, lag: int) -> np.ndarray:
    """(rows, columns) m, σ of a height as second differences over `lag` cells have it, in a square of 3 × 3 cells."""
    square, count = (np.zeros(z.shape, np.float32) for _ in range(2))
    for axis in (0, 1):
        if z.shape[axis] <= 2 * lag:
            continue
        low, middle, high = (
            z[tuple(part if a == axis else slice(None) for a in (0, 1))]
            for part in (slice(None, -2 * lag), slice(lag, -lag), slice(2 * lag, None))
        )
        second = low - 2.0 * middle + high
        known = np.isfinite(second)
        inside = tuple(slice(lag, -lag) if a == axis else slice(None) for a in (0, 1))
        # the variance of a second difference is six times that of a height
        square[inside] += np.where(known, second * second / 6.0, 0.0)
        count[inside] += known
    return np.sqrt(np.maximum(_sum(square, 3), 0.0) / np.maximum(_sum(count, 3), 1.0))


def step(z: np.ndarray, noise: np.ndarray, scale: CellScale) -> np.ndarray:
    """(rows, columns) m, the step in the surface that a cell lies beside; 0 elsewhere.

    A step is more than a pixel of parallax. It is looked for in what heights leave their mean by, so that a slope is
    none. Beside a hole it may be hidden: there half a pixel counts, and it is looked for farther off.
    """
    known = np.isfinite(z)
    if not known.any():
        return np.zeros(z.shape)
    off = np.where(known, z - np.nanmedian(z), 0.0).astype(np.float32)
    around = 4 * scale.lag + 1
    off -= _sum(off, around) / np.maximum(_sum(known.astype(np.float32), around), 1.0)
    near, far = (_range(off, known, side) for side in (2 * ((scale.lag + 1) // 2) + 1, 2 * scale.lag + 1))
    beside_hole = cv2.erode(known.view(np.uint8), _square(2 * scale.lag + 1)) == 0
    least = STEP_SIGMAS * noise
    found = np.where((near > scale.pixel) & (near > least), near, 0.0)
    hidden = beside_hole & (far > 0.5 * scale.pixel) & (far > least)
    return np.where(known, np.maximum(found, np.where(hidden, far, 0.0)), 0.0)


def contradiction(z: np.ndarray, heights: np.ndarray, sigmas: np.ndarray, scale: CellScale) -> np.ndarray:
    """(rows, columns) m, distance of the farthest height of a pair that does not agree; 0 where all do."""
    found = np.zeros(z.shape)
    for height, sigma in zip(heights, sigmas, strict=True):
        off = np.abs(height - z)
        np.maximum(found, off, out=found, where=off > scale.pixel + CONTRADICTED_SIGMAS * sigma)
    return found


def _sum(values: np.ndarray, side: int) -> np.ndarray:
    return cv2.boxFilter(values, -1, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)


def _range(values: np.ndarray, known: np.ndarray, side: int) -> np.ndarray:
    """(rows, columns) from the lowest to the highest of a square."""
    low = cv2.erode(np.where(known, values, np.float32(UNKNOWN)), _square(side))
    return cv2.dilate(np.where(known, values, np.float32(-UNKNOWN)), _square(side)) - low


def _square(side: int) -> np.ndarray:
    return np.ones((side, side), np.uint8)
