"""When an adjustment has converged: the next step would change no unknown by a share of its standard deviation.

|dx_i|/σ_i ≤ √(dxᵀN dx)/σ̂0 for all i: the decrement dxᵀN dx alone is asked for.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.steps import Place, Trial

STEP_TOLERANCE = 1e-5
"""Share of σ that the next step of least squares may still change an unknown by: no printed digit shows it."""

SURE_CONTRACTION = 1e-2
"""Contraction that the next step is credited with at most: the first steps contract faster than the last."""

ROBUST_COST_TOLERANCE = 1e-4
"""Relative change of the cost within which robust estimation stands still."""

ROBUST_STEP_TOLERANCE = 1e-2
"""Share of σ within which robust estimation ends. Re-weighting converges linearly, and its weights are uncertain by far
more than this."""

EARLY_STEP_TOLERANCE = 0.3
"""The same of the estimators on the way to the last one, which only has to start near its minimum."""

BENT_STEP_TOLERANCE = 0.03
"""Share of σ within which robust estimation ends where whole steps led uphill: points that their rays hardly fix go on
moving there, and what they leave in the right side hides less."""

ROUNDING = 1e-13
"""Decrement over cost that is rounding: some hundred units in the last place."""


def is_settled(at: Place, step: Trial, redundancy: int, robust_tolerance: float | None, last_decrement: float) -> bool:
    """Whether the step just taken from `at` was the last that matters.

    The decrement of the next step is predicted from how the last pair of undamped steps contracted. Re-weighting
    converges linearly, and a point whose two rays contradict each other creeps along a flat valley for ever: robust,
    the orientations and shared parameters have to stand, and the cost. Points go on alone then (`settled_points`).

    Parameters
    ----------
    robust_tolerance : share of σ for a robust estimator, None for least squares.
    last_decrement : of the step before, inf where there was no undamped one.
    """
    if robust_tolerance is not None:
        variance = max(step.equations.cost, 1e-30) / max(redundancy, 1)
        rounding = at.equations.rounding
        still = abs(at.equations.cost - step.equations.cost) <= ROBUST_COST_TOLERANCE * at.equations.cost + rounding
        return still and step.decrement - at.equations.point_decrement <= robust_tolerance**2 * variance + rounding
    contraction = min(1.0, max(SURE_CONTRACTION, abs(step.decrement) / last_decrement))
    if not np.isfinite(last_decrement):
        contraction = 1.0
    equations = step.equations
    return is_negligible(abs(step.decrement) * contraction, equations.cost, redundancy, equations.rounding)


def is_negligible(decrement: float, cost: float, redundancy: int, rounding: float) -> bool:
    """Whether a step of this decrement changes no unknown by STEP_TOLERANCE of its σ, or drowns in rounding.

    σ is that of the residuals, whatever σ are stated: with stated ones that are far too large the residuals tell when
    nothing changes any more. Without residuals it is 0, and rounding alone is left.

    Parameters
    ----------
    rounding : what the cost is uncertain by, see `normal_equations.RightSide`.
    """
    in_sigma = STEP_TOLERANCE**2 * max(cost, 1e-30) / max(redundancy, 1)
    return decrement <= in_sigma or decrement <= ROUNDING * cost + rounding
