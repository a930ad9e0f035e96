"""Quantiles of the distributions that tests use, from scipy.special: scipy.stats takes half a second to import."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc, chndtrinc, fdtrc, gammaincinv, ndtri, stdtr, stdtrit


def normal_quantile(probability: float) -> float:
    """x with P(z ≤ x) = probability for a standard normal z."""
    return float(ndtri(probability))


def chi_square_quantile(probability: ArrayLike, freedom: ArrayLike) -> np.ndarray:
    """x with P(χ² ≤ x) = probability for χ² of `freedom` degrees of freedom, each of any shape."""
    return 2.0 * np.asarray(gammaincinv(0.5 * np.asarray(freedom, float), probability))


def chi_square_exceedance(value: float, freedom: float) -> float:
    """P(χ² ≥ value) for χ² of `freedom` degrees of freedom."""
    return float(chdtrc(freedom, value))


def f_exceedance(value: float, freedom: float, freedom_below: float) -> float:
    """P(F ≥ value) for F of `freedom` over `freedom_below` degrees of freedom."""
    return float(fdtrc(freedom, freedom_below, value))


def student_exceedance(value: float, freedom: float) -> float:
    """P(t ≥ value) for Student's t of `freedom` degrees of freedom."""
    return float(stdtr(freedom, -value))


def student_quantile(probability: float, freedom: float) -> float:
    """x with P(t ≤ x) = probability for Student's t of `freedom` degrees of freedom."""
    return float(stdtrit(freedom, probability))


def noncentrality(freedom: float, alpha: float, power: float) -> float:
    """The δ0² at which χ² of `freedom` degrees of freedom exceeds its quantile of 1 − α with probability `power`."""
    return float(chndtrinc(chi_square_quantile(1.0 - alpha, freedom), freedom, 1.0 - power))
