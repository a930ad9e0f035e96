"""Kernels of robust estimation: weight and cost of a ray by the length of its normalised residual."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel, leaf_kernel

NONE, HUBER, DANISH, CAUCHY = 0, 1, 2, 3
"""Codes of the estimators, as solution.npz keeps them."""
DANISH_FLOOR = 1e-4
"""Weight that is left to the longest residual: a point whose rays had none would not be determined."""
ADAPTIVE, ADAPTIVE_STEPS, ADAPTIVE_PER_DECADE, ADAPTIVE_SPREAD = 16, 64, 4.0, 3.0
"""Code of an adaptive estimator: ADAPTIVE + ADAPTIVE_STEPS·k + j, gross errors ADAPTIVE_SPREAD^(k+1) times as spread
as good ones, odds 10^(−j/ADAPTIVE_PER_DECADE). Codes and the limit are all that solution.npz keeps of an estimator."""


@leaf_kernel
def robust_factor(error, estimator, limit):
    """Weight factor w and cost ρ of a ray with normalised length `error`: w = ρ'/(2·error), ρ ≈ error² for short ones.

    The estimators are described in `robust`; the codes from ADAPTIVE on carry the spread and the odds of gross errors.
    """
    if estimator == NONE:
        return 1.0, error * error
    if estimator == HUBER:
        if error > limit:
            return limit / error, 2.0 * limit * error - limit * limit
        return 1.0, error * error
    t = (error / limit) ** 2
    if estimator == DANISH:
        if t > 1.0:
            fade = np.exp(1.0 - t)
            factor = DANISH_FLOOR + (1.0 - DANISH_FLOOR) * fade
            return factor, limit * limit * (1.0 + DANISH_FLOOR * (t - 1.0) + (1.0 - DANISH_FLOOR) * (1.0 - fade))
        return 1.0, error * error
    if estimator == CAUCHY:
        return 1.0 / (1.0 + t), limit * limit * np.log1p(t)
    narrow = 1.0 / ADAPTIVE_SPREAD ** (2.0 * ((estimator - ADAPTIVE) // ADAPTIVE_STEPS) + 2.0)
    odds = 10.0 ** (-((estimator - ADAPTIVE) % ADAPTIVE_STEPS) / ADAPTIVE_PER_DECADE)
    gross = odds * np.exp(0.5 * t * (1.0 - narrow))
    good = 1.0 / (1.0 + gross)
    # −2·ln((exp(−t/2) + odds·exp(−t·narrow/2)) / (1 + odds)), with the larger of the two taken out of the logarithm
    cost = t - 2.0 * np.log1p(gross) if gross < 1e12 else t * narrow - 2.0 * np.log(odds)
    return good + (1.0 - good) * narrow, limit * limit * (cost + 2.0 * np.log1p(odds))


@kernel
def robust_factors(error, estimator, limit, factor, cost):
    """`robust_factor` of m rays; error, factor, cost (m,)."""
    for k in range(len(error)):
        factor[k], cost[k] = robust_factor(error[k], estimator, limit)
