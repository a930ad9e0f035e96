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
STEP_SHARE = 0.38
"""Of a step that is σ of the cells beside it; chosen [C]: between what houses and walls, and what crowns of trees would
have, in rendered scenes (tools/prove/dense_surface.py)."""
LEAST_STEP_PX, LEAST_HIDDEN_PX = 0.9, 0.5
"""Of parallax, from which on heights differ by a step, and where a hole may hide the rest of it; chosen [C]."""
LARGEST_STEP_PX = (np.inf, 2.7, 1.4)
"""Of parallax, that count where one pair, two, three or more agree on a height; chosen [C] on the same scenes: what
several pairs see alike is seldom the height of the other side, but a window across a step blurs it for all of them."""
STEP_SIGMAS = 6.0
"""σ of the noise that a step is larger than: the range of some twenty cells reaches five."""
CONTRADICTED_SIGMAS = 4.0
"""σ of a pair from which on its height contradicts the surface."""
UNKNOWN = np.float32(1e9)
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


def cell_sigma(
    z: np.ndarray, noise: np.ndarray, heights: np.ndarray, sigmas: np.ndarray, scale: CellScale
) -> np.ndarray:
    """(rows, columns) m, σ of the cells of a surface.

    Parameters
    ----------
    z, noise : (rows, columns) m, heights, NaN where there is none, and their σ by the matching.
    heights, sigmas : (pairs, rows, columns) m of which they were fused.
    """
    rough = roughness(z, scale.lag, np.maximum(scale.pixel, np.sqrt(6.0) * STEP_SIGMAS * noise))
    beside = step_sigma(z, noise, others_seen(z, heights, sigmas, scale), scale)
    return np.sqrt((NOISE_SHARE * noise) ** 2 + (ROUGH_SHARE * rough) ** 2 + beside**2)


def middle_height(z: np.ndarray) -> float:
    """m, a height in the middle of those known, of some of the cells where that is enough."""
    some = z[::MIDDLE_STEP, ::MIDDLE_STEP]
    return float(np.nanmedian(some if np.isfinite(some).any() else z))


def roughness(z: np.ndarray, lag: int, step: np.ndarray) -> np.ndarray:
    """(rows, columns) m, σ of a height as second differences over `lag` cells have it, in a square of 3 × 3 cells.

    Parameters
    ----------
    step : (rows, columns) m, second differences beyond which are steps: they do not count.
    """
    square, count = (np.zeros(z.shape, np.float32) for _ in range(2))
    for axis in (0, 1):
        if z.shape[axis] <= 2 * lag:
            continue
        low, middle, high = (
            z[tuple(part if a == axis else slice(None) for a in (0, 1))]
            for part in (slice(None, -2 * lag), slice(lag, -lag), slice(2 * lag, None))
        )
        second = low - 2.0 * middle + high
        inside = tuple(slice(lag, -lag) if a == axis else slice(None) for a in (0, 1))
        told = np.abs(second) <= step[inside]
        # the variance of a second difference is six times that of a height
        square[inside] += np.where(told, second * second / 6.0, 0.0)
        count[inside] += told
    return np.sqrt(np.maximum(_sum(square, 3), 0.0) / np.maximum(_sum(count, 3), 1.0))


@dataclass(frozen=True, eq=False)
class Seen:
    """What pairs saw in the cells, (rows, columns).

    Parameters
    ----------
    highest, lowest : m, of the height of a cell and those of pairs that contradict it or stand alone; −`UNKNOWN` and
        `UNKNOWN` where there is none.
    agreeing : pairs that agree on the height.
    """

    highest: np.ndarray
    lowest: np.ndarray
    agreeing: np.ndarray


def others_seen(z: np.ndarray, heights: np.ndarray, sigmas: np.ndarray, scale: CellScale) -> Seen:
    """What pairs saw besides the heights that count."""
    known = np.isfinite(z)
    highest, lowest = np.where(known, z, -UNKNOWN), np.where(known, z, UNKNOWN)
    agreeing = np.zeros(z.shape, np.uint8)
    for height, sigma in zip(heights, sigmas, strict=True):
        agrees = np.abs(height - z) <= scale.pixel + CONTRADICTED_SIGMAS * sigma
        other = np.isfinite(height) & ~agrees
        np.maximum(highest, height, out=highest, where=other)
        np.minimum(lowest, height, out=lowest, where=other)
        agreeing += agrees
    return Seen(highest, lowest, agreeing)


def step_sigma(z: np.ndarray, noise: np.ndarray, seen: Seen, scale: CellScale) -> np.ndarray:
    """(rows, columns) m, σ of a cell by the step that it lies beside; 0 where there is none.

    A step is almost a pixel of parallax, from the lowest to the highest that any pair saw about a cell. The mean of the
    cells around is taken off first, so that a slope is none. That mean holds a wall some cells away: no step is
    therefore larger than the range of the heights themselves plus the slope over that distance. Beside a hole, which
    may hide the step, half a pixel counts, over twice the distance and without that limit; where, besides, one pair
    alone saw the cell, the whole range of heights there counts.
    """
    known = np.isfinite(z)
    if not known.any():
        return np.zeros(z.shape)
    middle = middle_height(z)
    around = 4 * scale.lag + 1
    mean = _sum(np.where(known, z - middle, 0.0).astype(np.float32), around)
    mean = mean / np.maximum(_sum(known.astype(np.float32), around), 1.0) + middle
    left, whole = ((_less(seen.highest, level), _less(seen.lowest, level)) for level in (mean, middle))
    slope = _slope(np.where(known, z - middle, 0.0).astype(np.float32), known)
    side, far_side = 2 * ((scale.lag + 1) // 2) + 1, 2 * scale.lag + 1
    near = np.minimum(_range(*left, side), _range(*whole, side) + (side - 1) * slope)
    hidden = cv2.erode(known.view(np.uint8), _square(far_side)) == 0
    alone = hidden & (seen.agreeing < 2)
    far = _range(*left, far_side)
    np.maximum(far, _range(*whole, far_side), out=far, where=alone)
    least = STEP_SIGMAS * noise
    next_to = (near > LEAST_STEP_PX * scale.pixel) & (near > least)
    behind = hidden & (far > LEAST_HIDDEN_PX * scale.pixel) & (far > least)
    step = np.maximum(np.where(next_to, near, 0.0), np.where(behind, far, 0.0))
    most = scale.pixel * np.array(LARGEST_STEP_PX)[np.clip(seen.agreeing, 1, len(LARGEST_STEP_PX)) - 1]
    return np.where(known, STEP_SHARE * np.minimum(step, most), 0.0)


def _sum(values: np.ndarray, side: int) -> np.ndarray:
    return cv2.boxFilter(values, -1, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)


def _slope(z: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(rows, columns) float32 m, change of height from cell to cell, along rows and columns together.

    The median of a square of 5 × 5 cells, which a wall does not change.
    """
    total = np.zeros(z.shape, np.float32)
    for axis in (0, 1):
        if z.shape[axis] < 2:
            continue
        ahead, behind = (known[1:], known[:-1]) if axis == 0 else (known[:, 1:], known[:, :-1])
        change = np.abs(np.diff(z, axis=axis)) * (ahead & behind)
        change = np.concatenate([change, np.take(change, [-1], axis)], axis)
        total += cv2.medianBlur(np.ascontiguousarray(change), 5)
    return total


def _less(values: np.ndarray, level: np.ndarray | float) -> np.ndarray:
    """(rows, columns) float32 m above a level; what is not known stays far beyond all heights."""
    return np.where(np.abs(values) < UNKNOWN, values - level, values).astype(np.float32)


def _range(high: np.ndarray, low: np.ndarray, side: int) -> np.ndarray:
    """(rows, columns) from the lowest to the highest of a square."""
    return cv2.dilate(high, _square(side)) - cv2.erode(low, _square(side))


def _square(side: int) -> np.ndarray:
    return np.ones((side, side), np.uint8)
