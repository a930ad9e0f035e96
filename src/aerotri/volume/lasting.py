"""What errors of dense matching that do not average out make of the variance of a sum of heights.

[D] With the correlation ρ = exp(−d/ℓ) of two heights at distance d, the sum Σ wᵢ·zᵢ has the variance
σ²·Σᵢⱼ wᵢ·wⱼ·ρ(dᵢⱼ). Heights are put together in squares far smaller than ℓ first; the double sum is then a convolution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import fftconvolve

SQUARES = 4
"""Squares along a correlation length; chosen [C]: variances are then within 3 % of those of single heights."""
REACH = 6.0
"""Correlation lengths beyond which nothing is shared: exp(−6) is a four-hundredth."""
MOST_SQUARES = 4_000_000
"""Of an area; chosen [C]: 100 MB; over larger ones squares are larger, and each is then taken for itself."""


@dataclass(frozen=True)
class Lasting:
    """sigma_m : m, of a height; 0 where there are none. length_m : m, over which their correlation falls to 1/e."""

    sigma_m: float = 0.0
    length_m: float = 0.0


NO_LASTING = Lasting()


def lasting_variance(xy: np.ndarray, weight: np.ndarray, lasting: Lasting) -> float:
    """Variance of the sum of heights at places (n, 2) m with weights (n,): m² times the square of their unit."""
    if not (lasting.sigma_m > 0.0 and lasting.length_m > 0.0 and len(xy)):
        return 0.0
    low, size = xy.min(axis=0), np.ptp(xy, axis=0)
    side = max(lasting.length_m / SQUARES, float(np.sqrt(np.prod(size) / MOST_SQUARES)))
    index = ((xy - low) / side).astype(np.int64)
    shape = index.max(axis=0) + 1
    sums = np.bincount(np.ravel_multi_index(tuple(index.T), tuple(shape)), weight, int(np.prod(shape))).reshape(shape)
    together = fftconvolve(sums, _correlations(side, lasting.length_m), mode="same")
    return max(lasting.sigma_m**2 * float(np.sum(sums * together)), 0.0)


def lasting_variance_of_cells(weight: np.ndarray, cell: tuple[float, float], lasting: Lasting) -> float:
    """The same of the cells of a raster (rows, columns), 0 where a cell does not count; cell : m along x and y."""
    row, column = np.nonzero(weight)
    return lasting_variance(np.column_stack([column * cell[0], row * cell[1]]), weight[row, column], lasting)


def _correlations(side: float, length: float) -> np.ndarray:
    """(k, k) of the means of two squares, by the distance of their middles."""
    reach = int(np.ceil(REACH * length / side))
    at = side * np.arange(-reach, reach + 1)
    # the mean over the two squares: four places of either instead of its middle
    half = side * np.array([-0.25, 0.25])
    apart = (half[:, None] - half[None, :]).ravel()
    rho = np.zeros((len(at), len(at)))
    for dx in apart:
        for dy in apart:
            rho += np.exp(-np.hypot(at[:, None] + dx, at[None, :] + dy) / length)
    return rho / len(apart) ** 2
