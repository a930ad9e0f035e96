"""Curvature learnt from the steps themselves, where Gauss-Newton's own misjudges it.

The normal matrix leaves out the residuals times the second derivatives of the observation equations. That is of no
account where the unknowns are well determined. Where photographs hang together by few rays at small angles it can
exceed the matrix itself along single directions: whole steps then swing to and fro past the minimum, or fall far short
of it, as re-weighted steps do too. How the gradient changed along the last steps tells the curvature there. It corrects
the solution with the factor of the normal matrix, in the manner of limited-memory BFGS.
[L: Nocedal, Updating quasi-Newton matrices with limited storage, Mathematics of Computation 35, 1980]
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.sparse_cholesky import Factor

MOST_SECANTS = 20
"""Steps remembered: limited-memory BFGS uses 3 to 20 [L: Nocedal and Wright, Numerical Optimization, 7.2]; older ones
describe a curvature that has changed."""
LEAST_CURVATURE = 0.1
"""Curvature along a step, over that of the normal matrix, below which nothing is learnt from it: it may be a slope
that bends away, or rounding."""


class Secants:
    """Steps of photographs and shared parameters, and how the gradient changed along them; points at their minimum."""

    def __init__(self) -> None:
        self._pairs: list[tuple[np.ndarray, np.ndarray]] = []

    def __len__(self) -> int:
        return len(self._pairs)

    def forget(self) -> None:
        self._pairs = []

    def learn(self, step: np.ndarray, before: np.ndarray, after: np.ndarray) -> bool:
        """Keep a step (6·n + s,) with the right sides, −½ gradient, before and after it; whether it tells anything."""
        change = before - after
        curvature = float(step @ change)
        if not np.isfinite(curvature) or curvature <= LEAST_CURVATURE * abs(float(step @ before)):
            return False
        self._pairs = [*self._pairs[1 - MOST_SECANTS :], (step, change)]
        return True

    def solve(self, factor: Factor, right: np.ndarray) -> np.ndarray:
        """The step (6·n + s,) from a right side."""
        q, shares = right.copy(), []
        for step, change in reversed(self._pairs):
            shares.append(float(step @ q) / float(step @ change))
            q -= shares[-1] * change
        x = factor.solve(q)
        for (step, change), share in zip(self._pairs, reversed(shares), strict=True):
            x += (share - float(change @ x) / float(step @ change)) * step
        return x
