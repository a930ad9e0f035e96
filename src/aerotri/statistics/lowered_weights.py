"""Solutions of (N − t·N_c)·x_c = g_c of all clusters of photographs c at once, with the factor of N alone.

What `cluster_influence` factorises anew for every cluster, for a block whose factor stands in many places: the points
are eliminated with lowered weights, and N⁻¹ of the rest is applied as often as needed, to one right side a cluster. [L]
Conjugate gradients with the preconditioner N (Hestenes and Stiefel 1952), in the form that takes its two products at
one time (Chronopoulos and Gear 1989). [D] The eigenvalues of N⁻¹·(N − t·N_c), with the points eliminated from both, are
between 1 − t and 1, whatever the block: with t = 0.9 the error falls to 0.52 of itself in every turn at least.

A part of a block has its own unknowns, and those that it shares. Solutions (x, p, z, q below) are the same in all parts
that share an unknown; right sides (r, s, w) are what the rays of the part contribute, and add up over the parts. So
products of a right side and a solution add up as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.kernel_records import Directions
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import expand_sides
from aerotri.statistics import _lowered_kernels as _kernels
from aerotri.statistics.cluster_test import Settled

SMALL = 1e-11
"""Of what is left of the right side, in the norm of N⁻¹, below which nothing is changed any more [C]."""
MOST_TURNS = 60
"""Turns at most [C]: by the bound 40 lead to SMALL."""


@dataclass(frozen=True, eq=False)
class Turn:
    """Where the solutions stand after a turn, (6·n + s, m) each: photographs, and shared parameters below.

    Parameters
    ----------
    x : solutions. p, s : directions, and (N − t·N_c)·p. q : N⁻¹·s. r : what is left of the right sides. z : N⁻¹·r.
    w : t·N_c·z.
    """

    x: np.ndarray
    p: np.ndarray
    q: np.ndarray
    z: np.ndarray
    r: np.ndarray
    s: np.ndarray
    w: np.ndarray

    def stacked(self) -> np.ndarray:
        """(7, 6·n + s, m) in the order above, for a file."""
        return np.stack([self.x, self.p, self.q, self.z, self.r, self.s, self.w])

    def with_pulled(self, w: np.ndarray) -> Turn:
        """With t·N_c·z."""
        return replace(self, w=w)


@dataclass(frozen=True, eq=False)
class Lengths:
    """How far to go along the directions, of the m clusters; 0 of those that have arrived.

    Parameters
    ----------
    gamma : rᵀN⁻¹r. first : the same before the first turn. alpha : length. beta : share of the last direction.
    """

    gamma: np.ndarray
    first: np.ndarray
    alpha: np.ndarray
    beta: np.ndarray

    @property
    def arrived(self) -> bool:
        """Whether all have."""
        return not self.alpha.any()


def lowered_sides(
    system: NormalSystem, solution: Settled, label: np.ndarray, m: int, t: float, y: np.ndarray | None = None
) -> np.ndarray:
    """t·N_c·y_c of all m clusters with the points eliminated, (6·n + s, m), from y (6·n + s, m).

    Without y the scores g_c, with the points eliminated from N − t·N_c. Of the other observations those of one
    photograph each are in N_c; those without a photograph, and what ties the cameras of a rig, keep their weights.

    Parameters
    ----------
    label : (n,) cluster of every photograph.
    """
    u = system.unknowns
    n, s = 6 * len(u.images), len(u.shared)
    along, problem = (
        _apart(np.zeros((n + s, 0)) if y is None else y, n),
        system.problem(solution.state, solution.estimator),
    )
    parts = [np.zeros((n + s, m)) for _ in system.chunks]

    def chunk(k: int) -> None:
        _kernels.lowered_sides(*system.chunks[k], problem, label, t, along, _apart(parts[k], n), system.work())

    system.over_chunks(chunk)
    out = np.sum(parts, axis=0)
    whole = _apart(out, n)
    for rows in system.whitened_rows(solution.state):
        own = np.flatnonzero(rows.image >= 0)
        image, c = rows.image[own], label[rows.image[own]]
        value = rows.gap[own]
        if y is not None:
            value = t * np.einsum("gkt,gt->gk", rows.by_image[own], along.images[image, :, c])
            for column, there, by in _shared_of(rows.columns[own], rows.by_shared[own]):
                value[there] += t * by * along.shared[column, c[there], None]
        pulls = np.einsum("gkt,gk->gt", rows.by_image[own], value)
        for k in range(6):
            np.add.at(whole.images[:, k], (image, c), pulls[:, k])
        for column, there, by in _shared_of(rows.columns[own], rows.by_shared[own]):
            np.add.at(whole.shared, (column, c[there]), np.sum(by * value[there], axis=1))
    return out


def with_points(system: NormalSystem, solution: Settled, label: np.ndarray, t: float, x: np.ndarray) -> Directions:
    """The solutions x (6·n + s, m) of (N − t·N_c)·x_c = g_c with those of the points."""
    n, m = 6 * len(system.unknowns.images), x.shape[1]
    images, shared = np.ascontiguousarray(x[:n]).reshape(-1, 6, m), np.ascontiguousarray(x[n:])
    nothing = np.zeros((len(system.unknowns.points), 3, m))
    found = Directions(
        images, shared, expand_sides(system, solution.state, images, shared, nothing, solution.estimator)
    )
    problem = system.problem(solution.state, solution.estimator)
    system.over_chunks(lambda k: _kernels.lowered_points(*system.chunks[k], problem, label, t, found, system.work()))
    return found


def _apart(values: np.ndarray, n: int) -> Directions:
    """(n + s, m) of photographs and shared parameters as `Directions` without points: views."""
    return Directions(values[:n].reshape(n // 6, 6, -1), values[n:], np.zeros((0, 3, values.shape[1])))


def first_turn(scores: np.ndarray, back: np.ndarray, pulled: np.ndarray) -> Turn:
    """Before the first turn: scores g_c, back N⁻¹·g_c, pulled t·N_c·N⁻¹·g_c."""
    nothing = np.zeros_like(scores)
    return Turn(nothing, nothing, nothing, back, scores, nothing, pulled)


def next_turn(turn: Turn, back: np.ndarray, at: Lengths) -> Turn:
    """A turn further, without t·N_c·z there.

    Parameters
    ----------
    back : N⁻¹·w of the turn before.
    """
    p, s = turn.z + at.beta * turn.p, turn.r - turn.w + at.beta * turn.s
    q = turn.z - back + at.beta * turn.q
    return replace(
        turn, x=turn.x + at.alpha * p, p=p, q=q, z=turn.z - at.alpha * q, r=turn.r - at.alpha * s, s=s
    )  # fmt: skip


def products(turn: Turn) -> np.ndarray:
    """(2, m) rᵀz and zᵀ(N − t·N_c)z of a part."""
    gamma = np.sum(turn.r * turn.z, axis=0)
    return np.stack([gamma, gamma - np.sum(turn.w * turn.z, axis=0)])


def lengths(of_parts: np.ndarray, before: Lengths | None) -> Lengths:
    """How far to go from what the products (2, m) of all parts together are."""
    gamma, curvature = of_parts
    first = gamma if before is None else before.first
    beta = np.zeros_like(gamma)
    if before is not None:
        beta = _ratio(gamma, before.gamma)
        curvature = curvature - _ratio(beta * gamma, before.alpha)
    # what is no number goes on, so that it is not taken for an end
    goes_on = ~(gamma <= SMALL**2 * first)
    if before is not None:
        goes_on &= before.alpha != 0.0
    return Lengths(gamma, first, np.where(goes_on, _ratio(gamma, curvature), 0.0), np.where(goes_on, beta, 0.0))


def _ratio(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0.0)


def _shared_of(columns: np.ndarray, by_shared: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Of observations (g, ·): shared parameter, which observations have one there, and their partials (·, k)."""
    return [(columns[there, c], there, by_shared[there, :, c])
            for c in range(columns.shape[1]) for there in [np.flatnonzero(columns[:, c] >= 0)]]  # fmt: skip
