"""Shifts across the base that least squares finds beside those along it: what changes slowly, and what is noise.

Errors of the orientation make shifts across the base (y-parallaxes) that change slowly over an image: a parabola in
column and row follows them. Heights and image errors bend them besides. What scatters about that is noise of the
matching, and tells how much larger it is than its formal σ.
"""

from __future__ import annotations

from math import gcd

import cv2
import numpy as np

from aerotri.conventions import SIGMA_PER_MAD

FEWEST_TELL = 200
"""Shifts of which a parabola and a factor are taken."""
MOST_TELL = 6_000
"""Shifts that are taken, spread over a tile; chosen [C]: medians are then sure to two per cent of a spread."""
SLOW_SIGMA_PX = 1.0
"""By which shifts may change from the middle to the edge of an image; chosen [C]: it holds the parabola only where few
pixels tell anything."""
ROUNDS, ROBUST_SIGMAS = 4, 1.5
"""Of the robust parabola, and σ from which on a shift counts less."""
AROUND_PX = 41
"""Side of the square over which what the parabola leaves is averaged; chosen [C]: several windows wide."""
EVERY = 2
"""Row and column of which that mean is taken: shifts of neighbours come from almost the same window."""
LARGEST_PX, LEAST_PX = 1.0, 0.02
"""In that mean: the largest shift that counts, and σ below which shifts do not count more."""


def parabola_across(across: np.ndarray, variance: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(6,) px, coefficients of 1, x, y, x², xy, y² of the shifts; x and y from −1 to 1 over columns and rows.

    Parameters
    ----------
    across, variance : (rows, columns) px, px². known : (rows, columns) bool.

    Returns
    -------
    Zeros where too few shifts are known.
    """
    chosen = known & (variance > 0.0)
    found = np.zeros(6)
    if np.count_nonzero(chosen) < FEWEST_TELL:
        return found
    at = _spread(chosen)
    v, sigma = across.ravel()[at].astype(float), np.sqrt(variance.ravel()[at].astype(float))
    terms = _terms(at, across.shape)
    found[0] = np.median(v)
    hold = np.diag([0.0, *[SLOW_SIGMA_PX**-2] * 5])
    for _ in range(ROUNDS):
        off = np.abs(v - terms @ found) / sigma
        scale = max(float(np.median(off)) * SIGMA_PER_MAD, 1.0)
        weight = np.minimum(1.0, ROBUST_SIGMAS * scale / np.maximum(off, 1e-12)) / (scale * sigma) ** 2
        weighted = terms.T * weight
        found = np.linalg.solve(weighted @ terms + hold, weighted @ v)
    return found


def scatter_across(across: np.ndarray, variance: np.ndarray, known: np.ndarray, slow: np.ndarray) -> float:
    """By which shifts scatter more than their formal σ, about a parabola (6,) and the mean around; 1 at least."""
    chosen = known & (variance > 0.0)
    if np.count_nonzero(chosen) < FEWEST_TELL:
        return 2.0
    across, variance, chosen = (a[::EVERY, ::EVERY] for a in (across, variance, chosen))
    off = across - _over(slow, known.shape, EVERY)
    usual = chosen & (np.abs(off) < LARGEST_PX)
    weight = np.where(usual, np.float32(1.0) / np.maximum(variance, np.float32(LEAST_PX**2)), np.float32(0.0))
    side = AROUND_PX // EVERY + 1
    total = cv2.boxFilter(weight * np.where(usual, off, np.float32(0.0)), -1, (side, side), normalize=False)
    weights = cv2.boxFilter(weight, -1, (side, side), normalize=False)
    at = _spread(chosen)
    if not len(at):
        return 2.0
    mean = total.ravel()[at] / np.maximum(weights.ravel()[at], 1e-6)
    scaled = np.abs(off.ravel()[at] - mean) / np.sqrt(variance.ravel()[at])
    return max(float(np.median(scaled)) * SIGMA_PER_MAD, 1.0)


def median_across(slow: np.ndarray, known: np.ndarray) -> float:
    """px, of a parabola (6,) over the pixels that are known."""
    at = _spread(known)
    return float(np.median(_terms(at, known.shape) @ slow)) if len(at) else float(slow[0])


def _spread(chosen: np.ndarray) -> np.ndarray:
    """Places of some of the pixels that are chosen, spread over an image."""
    step = np.count_nonzero(chosen) // MOST_TELL + 1
    while gcd(step, chosen.shape[1]) > 1:  # else always the same columns
        step += 1
    return np.flatnonzero(chosen.ravel()[::step]) * step


def _terms(at: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """(n, 6) 1, x, y, x², xy, y² of pixels `at` of an image."""
    row, column = np.divmod(at, shape[1])
    x, y = 2.0 * column / (shape[1] - 1.0) - 1.0, 2.0 * row / (shape[0] - 1.0) - 1.0
    return np.stack([np.ones(len(at)), x, y, x * x, x * y, y * y], axis=1)


def _over(slow: np.ndarray, shape: tuple[int, int], every: int) -> np.ndarray:
    """(rows, columns) float32 px, a parabola over an image of that shape, of every so many rows and columns of it."""
    x, y = np.linspace(-1.0, 1.0, shape[1])[None, ::every], np.linspace(-1.0, 1.0, shape[0])[::every, None]
    along = (slow[0] + x * (slow[1] + x * slow[3])).astype(np.float32)
    down = (y * (slow[2] + y * slow[5])).astype(np.float32)
    return along + down + y.astype(np.float32) * (slow[4] * x).astype(np.float32)
