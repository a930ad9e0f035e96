"""Solutions of (N − t·N_c)·x_c = g_c of all clusters of photographs c at once, with the factor of N alone.

What `cluster_influence` factorises anew for every cluster, for a block whose factor stands in many places: N⁻¹ is
applied as often as needed, to one right side a cluster. [L] Conjugate gradients with the preconditioner N (Hestenes and
Stiefel 1952), in the form that takes its two products at one time (Chronopoulos and Gear 1989). [D] The eigenvalues of
N⁻¹·(N − t·N_c) are between 1 − t and 1, whatever the block: with t = 0.9 the error halves in every turn at least, and
after 36 of them it is below 1e-10.

A part of a block has its own unknowns, and those that it shares. Solutions (x, p, z, q below) are the same in all parts
that share an unknown; right sides (r, s, w) are what the rays of the part contribute, and add up over the parts. So
products of a right side and a solution add up as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.kernel_records import Directions
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import expand_sides, reduced_sides
from aerotri.statistics import _cluster_kernels as _kernels
from aerotri.statistics.cluster_test import Settled

SMALL = 1e-11
"""Of what is left of the right side, in the norm of N⁻¹, below which nothing is changed any more [C]."""
MOST_TURNS = 60
"""Turns at most [C]: by the bound 40 lead to SMALL."""


@dataclass(frozen=True, eq=False)
class Turn:
    """Where the solutions stand after a turn, (u, m) each: photographs, shared parameters and points one below another.

    Parameters
    ----------
    x : solutions. p, s : directions, and (N − t·N_c)·p. q : N⁻¹·s. r : what is left of the right sides. z : N⁻¹·r.
    w : N_c·z.
    """

    x: np.ndarray
    p: np.ndarray
    q: np.ndarray
    z: np.ndarray
    r: np.ndarray
    s: np.ndarray
    w: np.ndarray

    def stacked(self) -> np.ndarray:
        """(7, u, m) in the order above, for a file."""
        return np.stack([self.x, self.p, self.q, self.z, self.r, self.s, self.w])

    def with_pulled(self, w: np.ndarray) -> Turn:
        """With N_c·z."""
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


def pulls_of_clusters(
    system: NormalSystem, solution: Settled, label: np.ndarray, m: int, y: np.ndarray | None = None
) -> np.ndarray:
    """N_c·y_c of all m clusters, (u, m), from y (u, m); the scores g_c without y.

    Parameters
    ----------
    label : (n,) cluster of every photograph.
    """
    u = system.unknowns
    n, s = 6 * len(u.images), len(u.shared)
    out = np.zeros((n + s + 3 * len(u.points), m))
    along = split(out[:, :0] if y is None else y, n, s)
    whole, problem = split(out, n, s), system.problem(solution.state, solution.estimator)
    parts = [whole._replace(images=np.zeros_like(whole.images), shared=np.zeros_like(whole.shared))
             for _ in system.chunks]  # fmt: skip
    system.over_chunks(lambda c: _kernels.own_pulls(*system.chunks[c], problem, label, along, parts[c], system.work()))
    for part in parts:
        whole.images[:] += part.images
        whole.shared[:] += part.shared
    for rows in system.whitened_rows(solution.state):
        own = np.flatnonzero(rows.image >= 0)
        image, c = rows.image[own], label[rows.image[own]]
        value = rows.gap[own]
        if y is not None:
            value = np.einsum("gkt,gt->gk", rows.by_image[own], along.images[image, :, c])
            for column, there, by in _shared_of(rows.columns[own], rows.by_shared[own]):
                value[there] += by * along.shared[column, c[there], None]
        pulls = np.einsum("gkt,gk->gt", rows.by_image[own], value)
        for k in range(6):
            np.add.at(whole.images[:, k], (image, c), pulls[:, k])
        for column, there, by in _shared_of(rows.columns[own], rows.by_shared[own]):
            np.add.at(whole.shared, (column, c[there]), np.sum(by * value[there], axis=1))
    return out


def split(values: np.ndarray, n: int, s: int) -> Directions:
    """(n + s + 3·P, m) as `Directions`: views."""
    images, points = values[:n].reshape(n // 6, 6, -1), values[n + s :].reshape((len(values) - n - s) // 3, 3, -1)
    return Directions(images, values[n : n + s], points)


def reduced(system: NormalSystem, solution: Settled, sides: np.ndarray) -> np.ndarray:
    """(6·n + s, m) what right sides (u, m) leave once the points are eliminated."""
    points = sides[-3 * len(system.unknowns.points) :].reshape(len(system.unknowns.points), 3, -1)
    return sides[: -points[..., 0].size] + reduced_sides(system, solution.state, points, solution.estimator)


def expanded(system: NormalSystem, solution: Settled, x: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """(u, m) solutions of everything from those of photographs and shared parameters, x (6·n + s, m).

    Parameters
    ----------
    sides : (u, m) right sides.
    """
    n, m = 6 * len(system.unknowns.images), x.shape[1]
    images, shared = np.ascontiguousarray(x[:n]).reshape(-1, 6, m), np.ascontiguousarray(x[n:])
    of_points = sides[len(x) :].reshape(-1, 3, m)
    points = expand_sides(system, solution.state, images, shared, of_points, solution.estimator)
    return np.concatenate([images.reshape(n, m), shared, points.reshape(-1, m)])


def first_turn(scores: np.ndarray, plain: np.ndarray, pulled: np.ndarray) -> Turn:
    """Before the first turn: scores g_c, plain N⁻¹·g_c, pulled N_c·N⁻¹·g_c."""
    nothing = np.zeros_like(scores)
    return Turn(nothing, nothing, nothing, plain, scores, nothing, pulled)


def next_turn(turn: Turn, back: np.ndarray, at: Lengths, t: float) -> Turn:
    """A turn further, without N_c·z there.

    Parameters
    ----------
    back : N⁻¹·w of the turn before.
    """
    p, s = turn.z + at.beta * turn.p, turn.r - t * turn.w + at.beta * turn.s
    q = turn.z - t * back + at.beta * turn.q
    return replace(
        turn, x=turn.x + at.alpha * p, p=p, q=q, z=turn.z - at.alpha * q, r=turn.r - at.alpha * s, s=s
    )  # fmt: skip


def products(turn: Turn, t: float) -> np.ndarray:
    """(2, m) rᵀz and zᵀ(N − t·N_c)z of a part."""
    gamma = np.sum(turn.r * turn.z, axis=0)
    return np.stack([gamma, gamma - t * np.sum(turn.w * turn.z, axis=0)])


def lengths(of_parts: np.ndarray, before: Lengths | None) -> Lengths:
    """How far to go from what the products (2, m) of all parts together are."""
    gamma, curvature = of_parts
    first = gamma if before is None else before.first
    beta = np.zeros_like(gamma)
    if before is not None:
        beta = _ratio(gamma, before.gamma)
        curvature = curvature - _ratio(beta * gamma, before.alpha)
    goes_on = gamma > SMALL**2 * first
    if before is not None:
        goes_on &= before.alpha != 0.0
    return Lengths(gamma, first, np.where(goes_on, _ratio(gamma, curvature), 0.0), np.where(goes_on, beta, 0.0))


def _ratio(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0.0)


def _shared_of(columns: np.ndarray, by_shared: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Of observations (g, ·): shared parameter, which observations have one there, and their partials (·, k)."""
    return [(columns[there, c], there, by_shared[there, :, c])
            for c in range(columns.shape[1]) for there in [np.flatnonzero(columns[:, c] >= 0)]]  # fmt: skip
