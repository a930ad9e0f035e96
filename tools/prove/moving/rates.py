"""Tests of many at once."""

from __future__ import annotations

import numpy as np


def holm(p: np.ndarray) -> np.ndarray:
    """Probabilities (k,) that account for there being k tests [L: Holm 1979]."""
    order = np.argsort(p)
    adjusted = np.maximum.accumulate(np.minimum(p[order] * (len(p) - np.arange(len(p))), 1.0))
    out = np.empty(len(p))
    out[order] = adjusted
    return out


def text(p: float) -> str:
    """A probability in a table."""
    return "< 0.0001" if p < 1e-4 else f"{p:.4f}" if p < 0.01 else f"{p:.2f}"
