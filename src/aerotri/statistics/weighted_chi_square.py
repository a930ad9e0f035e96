"""Sums of independent χ² with weights: the distribution of quadratic forms of normal variables."""

from __future__ import annotations

from typing import cast

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr


def weighted_chi_square_exceedance(weights: np.ndarray, freedom: np.ndarray, value: float) -> float:
    """P(Σ weight·χ²_freedom ≥ value), independent χ²; weights of either sign.

    [L: Kuonen 1999; Lugannani and Rice 1980] By the saddle point: within a few percent of the probability also in the
    tails.
    """
    keep = (weights != 0.0) & (freedom > 0.0)
    w, h = np.asarray(weights, float)[keep], np.asarray(freedom, float)[keep]
    if not len(w) or (value <= 0.0 and w.min() > 0.0):
        return 1.0 if value <= 0.0 else 0.0
    if value >= 0.0 and w.max() <= 0.0:
        return 0.0
    size = float(np.sqrt(2.0 * np.sum(h * w**2)))
    w, x = w / size, value / size
    t = _saddle_point(w, h, x)
    left = 1.0 - 2.0 * t * w
    second = 2.0 * np.sum(h * w**2 / left**2)
    if abs(t) * np.sqrt(second) < 1e-4:
        third = 8.0 * np.sum(h * w**3)
        return float(0.5 - third / (6.0 * np.sqrt(2.0 * np.pi)))
    root = np.sign(t) * np.sqrt(max(2.0 * (t * x + 0.5 * np.sum(h * np.log(left))), 0.0))
    beyond = root + np.log(t * np.sqrt(second) / root) / root
    return float(ndtr(-beyond))


def _saddle_point(w: np.ndarray, h: np.ndarray, x: float) -> float:
    """t with K'(t) = x, K the cumulant generating function of Σ w·χ²_h."""
    high = 0.5 / w.max() if w.max() > 0.0 else np.inf
    low = 0.5 / w.min() if w.min() < 0.0 else -np.inf

    def slope(t: float) -> float:
        return float(np.sum(h * w / (1.0 - 2.0 * t * w)) - x)

    # K' grows from one pole to the other, or to 0 where there is none
    a = low * (1.0 - 1e-12) if np.isfinite(low) else -1.0
    b = high * (1.0 - 1e-12) if np.isfinite(high) else 1.0
    while slope(a) > 0.0:
        a *= 2.0
    while slope(b) < 0.0:
        b *= 2.0
    return cast(float, brentq(slope, a, b, xtol=1e-14))
