"""Control points predicted by an adjustment that did not know them: k-fold cross-validation without adjusting again.

[D] With cofactors Q of the coordinates of a fold and their weights W, the adjustment without them has the differences
(I − Q·W)⁻¹·(x̂ − l) and the cofactors (I − Q·W)⁻¹·Q: exact where the equations are linear, which at the solution they
are to a small part of σ. One solution with as many right sides as the fold has coordinates takes the place of an
adjustment. What was estimated for the whole block (robust weights, covariance of a random field) stays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import solve_sides
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.unknowns import Unknowns
from aerotri.observations.order import ranks_of

UNDETERMINED = 1e-9
"""Redundancy of a combination of coordinates below which nothing else determines it."""


@dataclass(frozen=True, eq=False)
class ControlPrediction:
    """k control points, each as the others and the image points predict it.

    Parameters
    ----------
    point : (k,) index into the block's points.
    difference : (k, 3) m, predicted − given; NaN where a coordinate is not given or not determined by the others.
    sigma : (k, 3) m, of the prediction, σ̂0 included.
    fold : (k,) which were left out together.
    """

    point: np.ndarray
    difference: np.ndarray
    sigma: np.ndarray
    fold: np.ndarray


def control_rows(unknowns: Unknowns) -> np.ndarray:
    """Rows of the points with observed coordinates."""
    return np.flatnonzero((unknowns.prior_weight > 0.0).any(axis=1))


def folds_of(place: np.ndarray, folds: int) -> np.ndarray:
    """(k,) the fold of every control point: as equal as can be, shuffled, always alike.

    Parameters
    ----------
    place : (k,) of the points in an order that does not depend on rows or names.
    """
    count = len(place)
    fold = np.empty(count, dtype=np.int64)
    fold[np.argsort(place)] = np.random.default_rng(0).permutation(count) % max(1, min(folds, count))
    return fold


def predict_control(
    system: NormalSystem, solution: Solution, factor: Factor, sigma0: float, folds: int
) -> ControlPrediction:
    """Every control point from the adjustment without its fold.

    Parameters
    ----------
    factor : undamped, at the solution. folds : how many; no more than there are points.
    """
    u, rows = system.unknowns, control_rows(system.unknowns)
    fold = folds_of(ranks_of(u.block).point[u.points[rows]], folds)
    difference, sigma = np.full((len(rows), 3), np.nan), np.full((len(rows), 3), np.nan)
    for number in range(int(fold.max(initial=-1)) + 1):
        own = np.flatnonzero(fold == number)
        at, axis = np.nonzero(u.prior_weight[rows[own]] > 0.0)
        point = rows[own[at]]
        sides = np.zeros((len(u.points), 3, len(point)))
        sides[point, axis, np.arange(len(point))] = 1.0
        q = solve_sides(system, solution.state, factor, sides, solution.estimator)[2][point, axis]
        root = np.sqrt(u.prior_weight[point, axis])
        whitened = np.eye(len(point)) - root[:, None] * (0.5 * (q + q.T)) * root
        if not len(point) or np.linalg.eigvalsh(whitened)[0] < UNDETERMINED:
            continue
        gap = solution.state.points[point, axis] - u.prior_xyz[point, axis]
        inverse = np.linalg.inv(whitened)
        difference[own[at], axis] = (inverse @ (root * gap)) / root
        # (I − Q·W)⁻¹·Q = W^-½·((I − W^½·Q·W^½)⁻¹ − I)·W^-½
        sigma[own[at], axis] = sigma0 * np.sqrt(np.maximum(np.diagonal(inverse) - 1.0, 0.0)) / root
    return ControlPrediction(u.points[rows], difference, sigma, fold)
