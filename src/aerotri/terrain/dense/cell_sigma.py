"""σ of the cells of a fused surface: noise of the matching, roughness, steps, and the edge."""

from __future__ import annotations

import cv2
import numpy as np

from aerotri.terrain.dense.cell_scale import CellScale, square, sum_about
from aerotri.terrain.dense.steps import STEP_SIGMAS, others_seen, step_sigma

NOISE_SHARE, ROUGH_SHARE = 0.77, 0.62
"""Of the σ of the matching, and of the scatter of heights about their neighbours, that are σ of a cell; chosen [C]: the
errors of two draws of rendered scenes are .93 to 1.1 times their σ with them, on smooth, noisy and rough ground alike
(tools/prove/dense_surface.py)."""
EDGE_PX = 0.07
"""σ of parallax that cells at the edge of a surface, or of a hole, have besides; chosen [C] with the others: their
windows see in part what could not be matched."""


def cell_sigma(
    z: np.ndarray, noise: np.ndarray, heights: np.ndarray, sigmas: np.ndarray, scale: CellScale
) -> np.ndarray:
    """(rows, columns) m, σ of the cells of a surface.

    Parameters
    ----------
    z, noise : (rows, columns) m, heights, NaN where there is none, and their σ by the matching.
    heights, sigmas : (pairs, rows, columns) m of which they were fused.
    """
    rough = roughness(z, scale, np.maximum(scale.pixel, np.sqrt(6.0) * STEP_SIGMAS * noise))
    beside = step_sigma(z, noise, others_seen(z, heights, sigmas, scale), scale)
    edge = EDGE_PX * scale.pixel * at_edge(z)
    return np.sqrt((NOISE_SHARE * noise) ** 2 + (ROUGH_SHARE * rough) ** 2 + beside**2 + edge**2)


def at_edge(z: np.ndarray) -> np.ndarray:
    """(rows, columns) whether one of the eight neighbours of a cell has no height; what lies outside does not count."""
    return cv2.erode(np.isfinite(z).view(np.uint8), square(3)) == 0


def roughness(z: np.ndarray, scale: CellScale, step: np.ndarray) -> np.ndarray:
    """(rows, columns) m, σ of a height as second differences over `scale.lag` have it, in a square of 3 × 3 cells.

    Ground that is evenly curved is not rough: the mean of the second differences over two windows of the matching is
    taken off.

    Parameters
    ----------
    step : (rows, columns) m, second differences beyond which are steps: they do not count.
    """
    squares, count = (np.zeros(z.shape, np.float32) for _ in range(2))
    lag = scale.lag
    for axis in (0, 1):
        if z.shape[axis] <= 2 * lag:
            continue
        low, middle, high = (
            z[tuple(part if a == axis else slice(None) for a in (0, 1))]
            for part in (slice(None, -2 * lag), slice(lag, -lag), slice(2 * lag, None))
        )
        second = (low - 2.0 * middle + high).astype(np.float32)
        inside = tuple(slice(lag, -lag) if a == axis else slice(None) for a in (0, 1))
        told = np.abs(second) <= step[inside]
        second = np.where(told, second - _evenly_curved(second, told, scale.around), 0.0)
        # the variance of a second difference is six times that of a height
        squares[inside] += second * second / 6.0
        count[inside] += told
    return np.sqrt(np.maximum(sum_about(squares, 3), 0.0) / np.maximum(sum_about(count, 3), 1.0))


def _evenly_curved(second: np.ndarray, told: np.ndarray, side: int) -> np.ndarray:
    """(rows, columns) float32 m, mean of second differences over a square; 0 where one of them is a step or not known.

    A step bends the heights about it: the mean would take off what windows of the matching made of it.
    """
    mean = sum_about(np.where(told, second, np.float32(0.0)), side)
    mean /= np.maximum(sum_about(told.astype(np.float32), side), 1.0)
    return np.where(cv2.erode(told.view(np.uint8), square(side)) > 0, mean, np.float32(0.0))
