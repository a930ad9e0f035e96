"""Tests that correlated differences are noise."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr

from aerotri.quantiles import f_exceedance
from aerotri.results.halves import AgreementTest

RANK = 1e-6
"""Eigenvalue of a correlation matrix, over the largest, below which a combination is taken for one that cannot differ
[C]: beside it what is neglected in linear equations would count."""
DRAWS = 2000
"""Random draws for the largest |z| that noise alone gives [C]: its mean is then known to 2 %."""


def agreement(difference: np.ndarray, covariance: np.ndarray, redundancy: float, alpha: float) -> AgreementTest:
    """The tests that differences (k,) with a covariance matrix (k, k) of any rank are noise.

    Parameters
    ----------
    covariance : σ̂0² included. redundancy : from which σ̂0² is. alpha : probability below which they are not.
    """
    sigma = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    seen = sigma > 1e-9 * sigma.max(initial=0.0)
    if not seen.any():
        return no_test(redundancy, alpha)
    values, vectors = np.linalg.eigh(covariance[np.ix_(seen, seen)] / np.outer(sigma[seen], sigma[seen]))
    kept = values > RANK * values[-1]
    root = vectors[:, kept] * np.sqrt(values[kept])
    return agreement_of_root(difference[seen] / sigma[seen], root, redundancy, alpha)


def agreement_of_root(z: np.ndarray, root: np.ndarray, redundancy: float, alpha: float) -> AgreementTest:
    """As `agreement`, of normalised differences z (k,) whose correlation matrix is root·rootᵀ, root (k, f).

    [L] zᵀR⁺z/f ~ F(f, redundancy), R the correlations and f their rank. The largest |z| by noise alone comes from
    random draws with the same correlations, always the same ones.
    """
    freedom = root.shape[1]
    white = np.linalg.lstsq(root, z, rcond=None)[0]
    statistic = float(white @ white) / freedom
    largest = np.abs(root @ np.random.default_rng(0).normal(size=(freedom, DRAWS))).max(axis=0)
    return AgreementTest(
        statistic=statistic,
        freedom=freedom,
        redundancy=redundancy,
        p_statistic=f_exceedance(statistic, freedom, redundancy),
        rms_z=float(np.sqrt(np.mean(z**2))),
        p_rms=beyond_weighted_sum(float(z @ z), np.linalg.svd(root, compute_uv=False) ** 2, redundancy),
        alpha=alpha,
        max_z=float(np.abs(z).max()),
        expected_max_z=float(largest.mean()),
        usual_max_z=float(np.quantile(largest, 0.95)),
    )


def beyond_weighted_sum(value: float, weight: np.ndarray, redundancy: float) -> float:
    """Probability that Σ weight·χ²₁ over s² exceeds a value, s² ~ χ²/redundancy independent of it.

    [L: saddlepoint approximation, Lugannani and Rice 1980, Kuonen 1999] of Σ weight·χ²₁ − value·s² > 0; its relative
    error in the tail is a few per cent.

    Parameters
    ----------
    weight : (k,) positive.
    """
    if value <= 0.0:
        return 1.0
    weight = weight[weight > 1e-12 * weight.max()]
    share = value / redundancy

    def slope(t: float) -> float:
        return float(np.sum(weight / (1.0 - 2.0 * weight * t)) - value / (1.0 + 2.0 * share * t))

    low, high = -0.5 / share, 0.5 / weight.max()
    t = _root(slope, low * (1.0 - 1e-12), high * (1.0 - 1e-12))
    bend = float(
        np.sum(2.0 * (weight / (1.0 - 2.0 * weight * t)) ** 2) + 2.0 * value * share / (1.0 + 2.0 * share * t) ** 2
    )
    if abs(t) * np.sqrt(bend) < 1e-4:
        # at the mean the approximation is 0/0: its limit, by the skewness
        third = float(np.sum(8.0 * weight**3) - 8.0 * value * share**2)
        return float(np.clip(0.5 - third / (6.0 * np.sqrt(2.0 * np.pi) * bend**1.5), 0.0, 1.0))
    generating = -0.5 * float(np.sum(np.log1p(-2.0 * weight * t))) - 0.5 * redundancy * float(np.log1p(2.0 * share * t))
    w = np.sign(t) * np.sqrt(max(-2.0 * generating, 0.0))
    v = t * np.sqrt(bend)
    return float(np.clip(ndtr(-(w + np.log(v / w) / w)), 0.0, 1.0))


def _root(slope: Callable[[float], float], low: float, high: float) -> float:
    """Where an increasing function is 0, between its poles."""
    return float(cast(float, brentq(slope, low, high, xtol=1e-14 * (high - low))))


def no_test(redundancy: float, alpha: float) -> AgreementTest:
    """Of nothing that could differ."""
    return AgreementTest(0.0, 0, redundancy, 1.0, 0.0, 1.0, alpha, 0.0, 0.0, 0.0)
