"""The covariance of the difference of two adjustments that share control and other observations, but no image point.

[D] With x̂_i = N_i⁻¹(A_iᵀP_i·l_i + R_iᵀ·c), R_i the whitened rows of the observations c that both adjustments have
(coordinates of control points, observed interior orientation and parameters, the prior of a random field, conditions
between points) and everything else independent,

    Cov(x̂₁ − x̂₂)/σ0² = Q₁ + Q₂ − K₁K₂ᵀ − K₂K₁ᵀ,   K_i = N_i⁻¹·R_iᵀ,

K_i whitened likewise (with P_c: K_i = N_i⁻¹·C_iᵀP_c and K₁Σ_cK₂ᵀ). Functions F of the unknowns need as many right sides
as F has rows, R_i·N_i⁻¹·Fᵀ among what they give; no covariance matrix of all points is formed.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from aerotri.adjustment.point_sides import solve_sides
from aerotri.functional_model.constraints import ConstraintObservations
from aerotri.strategies.half_adjustment import Half

COLUMNS_AT_ONCE = 48
"""Right sides solved together [C]: more need more memory, three numbers of each for every point."""


@dataclass(frozen=True, eq=False)
class SharedRows:
    """Whitened rows R of the observations that two halves share, in the unknowns of one half: a on coordinates of
    points, then b on shared parameters.

    Parameters
    ----------
    point, axis : (a,) row of the half's points and coordinate. root : (a,) 1/σ. matrix : (b, s).
    """

    point: np.ndarray
    axis: np.ndarray
    root: np.ndarray
    matrix: np.ndarray

    @property
    def count(self) -> int:
        return len(self.point) + len(self.matrix)

    def of(self, points: np.ndarray, shared: np.ndarray) -> np.ndarray:
        """(a + b, k) R·x of solutions x: points (P, 3, k), shared parameters (s, k)."""
        return np.concatenate([self.root[:, None] * points[self.point, self.axis], self.matrix @ shared])

    def sides(self, n_points: int, first: int, last: int) -> tuple[np.ndarray, np.ndarray]:
        """Rows first..last of R as right sides: of points (P, 3, k) and shared parameters (s, k)."""
        a, k = len(self.point), last - first
        points, shared = np.zeros((n_points, 3, k)), np.zeros((self.matrix.shape[1], k))
        own = np.arange(first, min(last, a))
        points[self.point[own], self.axis[own], own - first] = self.root[own]
        others = np.arange(max(first, a), last)
        shared[:, others - first] = self.matrix[others - a].T
        return points, shared


def shared_rows(first: Half, second: Half) -> tuple[SharedRows, SharedRows]:
    """The observations that both halves have, in the same order.

    One on a point that a condition ties in one half alone is left out: without its cross term the variance of the
    difference is too large rather than too small.
    """
    of_each = [_observed(half) for half in (first, second)]
    on_points, on_shared = [], []
    for key in of_each[0]:
        kinds = {isinstance(one[key], tuple) for one in of_each if key in one}
        if key in of_each[1] and len(kinds) == 1:
            (on_points if kinds == {True} else on_shared).append(key)
    one, two = (
        _rows(len(half.unknowns.shared), [own[key] for key in on_points], [own[key] for key in on_shared])
        for half, own in zip((first, second), of_each, strict=True)
    )
    return one, two


_Observed = dict[Hashable, "tuple[int, int, float] | np.ndarray"]


def _observed(half: Half) -> _Observed:
    """Observations beside image points and photographs by what they are: (row, axis, 1/σ) of a point, or a row R."""
    u, system = half.unknowns, half.system
    shared, s = u.shared, len(u.shared)
    out: _Observed = {}
    rows, axes = np.nonzero(u.prior_weight > 0.0)
    for row, axis in zip(rows.tolist(), axes.tolist(), strict=True):
        root, key = float(np.sqrt(u.prior_weight[row, axis])), ("point", int(u.points[row]), axis)
        out[key] = (row, axis, root) if u.kept[row] < 0 else _unit(s, int(u.kept[row]) + axis, root)
    for k in range(s):
        if np.isfinite(shared.sigma[k]) and shared.kinds[k] != "point":
            out["shared", shared.names[k], shared.groups[k]] = _unit(s, k, 1.0 / shared.sigma[k])
    for number, field in enumerate(system.priors.joint):
        root = field.root().T
        group = shared.groups[field.columns[0]]
        for k, line in enumerate(root):
            row = np.zeros(s)
            row[field.columns] = line
            out["field", group, number, k] = row
    for extra, found in zip(system.extras, system.whitened_rows(half.solution.state), strict=True):
        if not isinstance(extra, ConstraintObservations):
            continue
        seen: dict[Hashable, int] = {}
        for g in range(len(found.gap)):
            label = str(found.labels[g])
            for component in range(found.gap.shape[1]):
                number = seen[label] = seen.get(label, -1) + 1
                row, there = np.zeros(s), found.columns[g] >= 0
                np.add.at(row, found.columns[g][there], found.by_shared[g, component, there])
                out["condition", label, number] = row
    return out


def _unit(s: int, column: int, value: float) -> np.ndarray:
    row = np.zeros(s)
    row[column] = value
    return row


def _rows(s: int, on_points: list[Any], on_shared: list[Any]) -> SharedRows:
    point, axis, root = zip(*on_points, strict=True) if on_points else ((), (), ())
    return SharedRows(
        np.array(point, dtype=np.int64), np.array(axis, dtype=np.int64), np.array(root, dtype=float),
        np.array(on_shared, dtype=float).reshape(len(on_shared), s),
    )  # fmt: skip


class Functions(Protocol):
    """Linear functions of the coordinates of P points."""

    @property
    def count(self) -> int: ...

    def of(self, values: np.ndarray) -> np.ndarray:
        """(count, k) of values (P, 3, k)."""
        ...

    def sides(self, first: int, last: int) -> np.ndarray:
        """(P, 3, last − first) partials of functions first..last."""
        ...


@dataclass(frozen=True, eq=False)
class HalfPair:
    """Two halves with the points in common.

    Parameters
    ----------
    halves, shared : of each. rows : of the common points in the unknowns of each, (P,).
    """

    halves: tuple[Half, Half]
    shared: tuple[SharedRows, SharedRows]
    rows: tuple[np.ndarray, np.ndarray]

    @property
    def n_points(self) -> int:
        return len(self.rows[0])

    def solutions(self, which: int, sides: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Q·b of one half for right sides b (P, 3, k) on the common points: at those points, and R·Q·b (a + b, k)."""
        half = self.halves[which]
        u = half.unknowns
        right = np.zeros((len(u.points), 3, sides.shape[2]))
        right[self.rows[which]] = sides
        _, shared, points = solve_sides(half.system, half.solution.state, half.factor, right, half.solution.estimator)
        return points[self.rows[which]], self.shared[which].of(points, shared)

    def responses(self, which: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """K = Q·Rᵀ of one half, some columns at a time: at the common points (P, 3, k) and shared parameters (s, k)."""
        half, shared = self.halves[which], self.shared[which]
        n = len(half.unknowns.points)
        for first in range(0, shared.count, COLUMNS_AT_ONCE):
            sides, of_shared = shared.sides(n, first, min(first + COLUMNS_AT_ONCE, shared.count))
            _, found, points = solve_sides(
                half.system, half.solution.state, half.factor, sides, half.solution.estimator, of_shared
            )
            yield points[self.rows[which]], found

    def cofactors_of(self, functions: Functions) -> np.ndarray:
        """(k, k) cofactors of the difference of functions of the common points."""
        parts = []
        for which in (0, 1):
            q, response = np.zeros((functions.count,) * 2), np.zeros((self.shared[which].count, functions.count))
            for first in range(0, functions.count, COLUMNS_AT_ONCE):
                last = min(first + COLUMNS_AT_ONCE, functions.count)
                points, at_shared = self.solutions(which, functions.sides(first, last))
                q[:, first:last], response[:, first:last] = functions.of(points), at_shared
            parts.append((q, response))
        (q_one, r_one), (q_two, r_two) = parts
        both = q_one + q_two - r_one.T @ r_two - r_two.T @ r_one
        return 0.5 * (both + both.T)


@dataclass(frozen=True, eq=False)
class PairCofactors:
    """Cofactors of the differences, one by one.

    Parameters
    ----------
    points : (P, 3, 3) of the common points. transformed : (P, 3, 3) after a transformation with seven parameters.
    shared : (s₁, s₂) cross terms K₁K₂ᵀ of the shared parameters.
    """

    points: np.ndarray
    transformed: np.ndarray
    shared: np.ndarray


def pair_cofactors(pair: HalfPair, motions: np.ndarray, solver: np.ndarray) -> PairCofactors:
    """Cofactors of the differences of all common points, and the cross terms of the shared parameters.

    Parameters
    ----------
    motions : (P, 3, 7) G. solver : (7, P, 3) A, the motions that fit differences; SCSᵀ with S = I − G·A.
    """
    points = sum(half.q.points[rows] for half, rows in zip(pair.halves, pair.rows, strict=True))
    by_solver = sum(pair.solutions(which, solver.transpose(1, 2, 0))[0] for which in (0, 1))
    points, by_solver = np.asarray(points).copy(), np.asarray(by_solver).copy()
    s_one, s_two = (len(half.unknowns.shared) for half in pair.halves)
    shared = np.zeros((s_one, s_two))
    for (one, of_one), (two, of_two) in zip(pair.responses(0), pair.responses(1), strict=True):
        mixed = np.einsum("pik,pjk->pij", one, two)
        points -= mixed + np.swapaxes(mixed, 1, 2)
        by_solver -= np.einsum("pik,mk->pim", one, np.einsum("mpi,pik->mk", solver, two))
        by_solver -= np.einsum("pik,mk->pim", two, np.einsum("mpi,pik->mk", solver, one))
        shared += of_one @ of_two.T
    both = np.einsum("mpi,pin->mn", solver, by_solver)
    cross = np.einsum("pim,pjm->pij", motions, by_solver)
    moved = np.einsum("pim,mn,pjn->pij", motions, 0.5 * (both + both.T), motions)
    return PairCofactors(points, points - cross - np.swapaxes(cross, 1, 2) + moved, shared)
