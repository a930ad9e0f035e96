"""How far neighbouring cells share their noise, and the variance of sums of such cells."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter

from aerotri.conventions import SIGMA_PER_MAD

FEWEST_BLOCKS = 50
"""Blocks of cells at least whose means tell the noise length: its σ is then 10 %; chosen [C]."""
FILLED = 0.5
"""Share of the cells of a block that must be known."""


def robust_sigma(values: np.ndarray) -> float:
    """1.4826 times the median of absolute differences from the median; NaN of nothing."""
    if not len(values):
        return float("nan")
    return float(SIGMA_PER_MAD * np.median(np.abs(values - np.median(values))))


def cells_of_one_noise(noise: np.ndarray) -> float:
    """How many cells share one noise, at least 1, from normalised noise (rows, columns), NaN where not known.

    0 where there are too few blocks to tell.

    [D] The mean of a block of n cells with m of one noise has n/m times less variance than a cell, when n is much
    larger than m. Of squares of 2ᵏ cells the largest that give `FEWEST_BLOCKS` blocks are taken.
    """
    known = np.isfinite(noise)
    spread = robust_sigma(noise[known])
    found, side = 0.0, 2
    while spread > 0.0:
        means, count = _block_means(noise, side)
        if len(means) < FEWEST_BLOCKS:
            break
        found = max(1.0, _whole(float(np.mean(means**2) * np.mean(count)) / spread**2, side))
        side *= 2
    return found


def _whole(cells: float, side: int) -> float:
    """What blocks of this side would show were they endless.

    [D] Noise that is the mean of a square of side L has a correlation that falls linearly to 0 at L, along either axis:
    a block of side b shows L(1 − L/3b) for L.
    """
    share = np.sqrt(cells) / side
    length = 1.5 * (1.0 - np.sqrt(max(1.0 - 4.0 * share / 3.0, 0.0))) * side
    return length**2 if length <= side else cells


def _block_means(values: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Means of the blocks that are filled well enough, and how many cells they have."""
    rows, columns = (n // side for n in values.shape)
    if not rows or not columns:
        return np.zeros(0), np.zeros(0)
    blocks = values[: rows * side, : columns * side].reshape(rows, side, columns, side)
    count = np.isfinite(blocks).sum(axis=(1, 3))
    full = count >= FILLED * side**2
    return np.nansum(blocks, axis=(1, 3))[full] / count[full], count[full]


def variance_of_sum(weighted: np.ndarray, cells: float) -> float:
    """Variance of a sum of cells whose noise is the mean of a square of white noise.

    Parameters
    ----------
    weighted : (rows, columns) weight times σ. cells : in the square of one noise.
    """
    side = max(1, round(float(np.sqrt(cells))))
    together = uniform_filter(np.pad(weighted, side), side, mode="constant") * side
    return float(np.sum(together**2)) * cells / side**2
