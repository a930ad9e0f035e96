"""Residuals over their own standard deviations."""

from __future__ import annotations

import numpy as np

MIN_REDUNDANCY = 1e-6
"""Redundancy number below which an observation is not controlled by others, and has no test."""


def normalised_residuals(v: np.ndarray, sigma: np.ndarray, r: np.ndarray) -> np.ndarray:
    """w = −v/(σ·√r), σ a priori; NaN where r is practically zero.

    Parameters
    ----------
    v, sigma : residual and its a-priori σ in one unit. r : redundancy number. Any common shape.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(r > MIN_REDUNDANCY, -v / (sigma * np.sqrt(np.maximum(r, 0.0))), np.nan)
