"""Tests of additional parameters, and which of them should go next (models.md 5, after BLUH).

t = |p|/σ; r = q_ij/√(q_ii·q_jj); total correlation B = 1 − 1/(N_ii·(N⁻¹)_ii), N reduced to the additional parameters.
First goes the worst t below its limit, then of |r| beyond its limit the one with the smaller t, then the worst B [C].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.statistics.covariance import correlations, total_correlations


@dataclass(frozen=True, eq=False)
class ParameterTests:
    """The tests of k additional parameters.

    Parameters
    ----------
    t : (k,). correlation : (k, k) with a diagonal of 0. total : (k,) B.
    """

    t: np.ndarray
    correlation: np.ndarray
    total: np.ndarray

    @classmethod
    def of(cls, value: np.ndarray, cofactor: np.ndarray, sigma0: float) -> ParameterTests:
        """From values (k,) and cofactors (k, k)."""
        sigma = sigma0 * np.sqrt(np.diagonal(cofactor))
        r = correlations(cofactor)
        return cls(np.abs(value) / sigma, r - np.diag(np.diagonal(r)), total_correlations(cofactor))


def worst(tests: ParameterTests, t_limit: float, correlation_limit: float) -> tuple[int, str] | None:
    """The parameter that should go next, and the reason; None where all may stay.

    The reason of a correlation names its partner by '{}' and the number behind it: see `partner`.
    """
    if not len(tests.t):
        return None
    k = int(np.argmin(tests.t))
    if tests.t[k] < t_limit:
        return k, f"t = {tests.t[k]:.2f}, below {t_limit:g}"
    size = np.abs(tests.correlation)
    if size.max() > correlation_limit:
        pair = np.unravel_index(int(np.argmax(size)), size.shape)
        k, other = sorted((int(i) for i in pair), key=lambda i: tests.t[i])
        r = tests.correlation[k, other]
        return k, f"r = {r:+.2f} with {{}}, beyond {correlation_limit:g}; its t = {tests.t[k]:.1f} is the smaller one"
    k = int(np.argmax(tests.total))
    if tests.total[k] > correlation_limit:
        return k, f"total correlation B = {tests.total[k]:.2f}, beyond {correlation_limit:g}"
    return None


def partner(tests: ParameterTests, k: int) -> int:
    """The parameter with which another is most correlated; itself where it is alone."""
    return int(np.argmax(np.abs(tests.correlation[k]))) if len(tests.t) > 1 else k
