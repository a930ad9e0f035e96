"""How many independent differences the check points are worth: neighbours share the errors of control and camera.

[D] Σd² of n differences with covariance C has the mean tr C and the variance 2·tr C², like a scaled χ² of
ν = (tr C)²/tr C² degrees of freedom. With equal variances ν = n/(1 + (n − 1)·ρ²), ρ² the mean square of their
correlations: one difference where all err together, n where each errs alone.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import solve_sides
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.results.adjusted_block import AdjustedBlock

SAMPLE = 20
"""Check points whose correlations stand for those of all."""
COLUMNS_AT_ONCE = 12
"""Right sides solved together, of three a check point [C]: limits the memory, a row of each for every unknown."""


def check_freedom(system: NormalSystem, solution: Solution, factor: Factor, adjusted: AdjustedBlock) -> np.ndarray:
    """(3,) degrees of freedom of the check points' X, Y and Z.

    Parameters
    ----------
    factor : undamped, at the solution. adjusted : in the frame of `system`, with its check points.
    """
    check, u = adjusted.check, system.unknowns
    n = np.isfinite(check.difference).sum(axis=0)
    row = np.full(len(u.block.points), -1)
    row[u.points] = np.arange(len(u.points))
    rows = row[check.point]
    chosen = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), SAMPLE)).round().astype(int))
    q = _cofactors_between(system, solution, factor, rows[chosen])
    given = {int(point): k for k, point in enumerate(adjusted.block.control.point)}
    sigma = adjusted.block.control.sigma[[given[int(point)] for point in check.point[chosen]]]
    freedom = n.astype(float)
    for axis in range(3):
        known = np.isfinite(check.difference[chosen, axis])
        c = adjusted.outcome.sigma0**2 * q[axis][np.ix_(known, known)] + np.diag(sigma[known, axis] ** 2)
        m = len(c)
        if m > 1:
            squared = c**2 / np.outer(np.diagonal(c), np.diagonal(c))
            mean = (squared.sum() - m) / (m * (m - 1))
            freedom[axis] = n[axis] / (1.0 + (n[axis] - 1) * mean)
    return freedom


def _cofactors_between(system: NormalSystem, solution: Solution, factor: Factor, rows: np.ndarray) -> np.ndarray:
    """(3, m, m) cofactors between points, of X with X, Y with Y and Z with Z."""
    m = len(rows)
    q = np.zeros((3, m, m))
    columns = [(k, axis) for k in range(m) for axis in range(3)]
    for first in range(0, len(columns), COLUMNS_AT_ONCE):
        own = columns[first : first + COLUMNS_AT_ONCE]
        sides = np.zeros((len(system.unknowns.points), 3, len(own)))
        for column, (k, axis) in enumerate(own):
            sides[rows[k], axis, column] = 1.0
        points = solve_sides(system, solution.state, factor, sides, solution.estimator)[2]
        for column, (k, axis) in enumerate(own):
            q[axis, :, k] = points[rows, axis, column]
    return 0.5 * (q + np.swapaxes(q, 1, 2))
