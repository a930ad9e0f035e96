"""The end of an adjustment with Huber's estimator: points that are still on their way.

Re-weighting converges linearly, and where gross errors contradict each other a point takes far more steps than the
photographs. The adjustment ends when these stand (`stopping`); then each point goes on by itself.
"""

from __future__ import annotations

from dataclasses import replace

from aerotri.adjustment import _robust_kernels, _settling_kernels
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.unknowns import State

SETTLED = 1e-3
"""Share of its σ within which a point has settled; chosen [C]: a tenth of what photographs may still move by."""
MOST_STEPS = 1000
"""Of a point, at most; chosen [C]: a contraction of .99 needs 700 from a σ to that share of it."""


def needs_settling(estimator: Estimator) -> bool:
    """Whether points are led on. The other robust estimators have local minima, and points without any."""
    return estimator.code == _robust_kernels.HUBER


def settled_points(system: NormalSystem, state: State, estimator: Estimator, variance: float) -> State:
    """The state with every point where its rays want it, the photographs held.

    Parameters
    ----------
    variance : σ̂0².
    """
    settled, limit = replace(state, points=state.points.copy()), SETTLED**2 * variance
    system.over_points(
        system.problem(settled, estimator),
        lambda first, last, problem, work: _settling_kernels.settle_points(
            first, last, problem, MOST_STEPS, limit, work
        ),
    )
    return settled
