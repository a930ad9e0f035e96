"""What each cluster of photographs does to every unknown, and the covariance that follows whatever its rays share.

[L] Clustered covariance (Liang and Zeger, Biometrika 73, 1986): Q·(Σ_c g_c·g_cᵀ)·Q with the scores g_c = A_cᵀPv of the
clusters. Residuals are smaller than errors, the more so the more a cluster determines alone. Bell and McCaffrey (Survey
Methodology 28, 2002) multiply them by (I − H_cc)^(−½), H_cc = P^½·A_c·Q·A_cᵀ·P^½, which makes the covariance of white
noise right however few the clusters are; leaving the cluster out (the delete-a-group jackknife) is the power −1, right
for many clusters and much too large where a few hold the block.
[D] In the space of the unknowns Q·A_cᵀP^½·(I − t·H_cc)⁻¹·P^½v = (N − t·N_c)⁻¹·g_c: the adjustment with the weights of
the cluster lowered to 1 − t, one step from the solution. Two of them make the power −½,

    (1 − h)^(−½) ≈ a + b/(1 − t·h),   t = 0.9, a = 0.493, b = 0.507,

within 3 % for h up to 0.92; beyond, where the cluster is nearly alone, it grows to 5.6 and no further. Lowered weights
keep the rank of the equations, so that no cluster is too important and photographs and points of the cluster itself
have their change too.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from aerotri.adjustment.datum import ExtraObservations
from aerotri.adjustment.kernel_records import Directions, Problem
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import expand_sides, solve_sides
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.functional_model.observed_unknowns import Rows
from aerotri.statistics import _cluster_kernels as _kernels
from aerotri.statistics.cluster_test import NUMBERS_AT_ONCE, Settled, sides_of_clusters
from aerotri.statistics.clusters import Clusters, order_by_place
from aerotri.statistics.covariance import InnerDatum

LOWERED, PLAIN_SHARE = 0.9, 0.493
"""t and a of the power −½, see above."""
MOST_COLUMNS = 48
"""Columns of the root of what is known beforehand; of more, so many random sums stand for all."""


@dataclass(frozen=True, eq=False)
class _Lowered:
    """Observations beside the image points, those of some photographs ((n,) bool) with lower weights."""

    observed: ExtraObservations
    inside: np.ndarray
    weight: float

    @property
    def count(self) -> int:
        return self.observed.count

    def rows(self, centre: np.ndarray, rotation: np.ndarray, shared: np.ndarray) -> Rows:
        rows = self.observed.rows(centre, rotation, shared)
        own = (rows.image >= 0) & self.inside[np.maximum(rows.image, 0)]
        return replace(rows, inv_sigma=rows.inv_sigma * np.where(own, np.sqrt(self.weight), 1.0)[:, None])


def influences(
    system: NormalSystem, solution: Solution, factor: Factor, clusters: Clusters, lowered: float = LOWERED,
    plain_share: float = PLAIN_SHARE,
) -> Iterator[Directions]:  # fmt: skip
    """Q·A_cᵀP^½·(I − H_cc)^(−½)·P^½v of one cluster after the other: images (n, 6), shared (s,), points (P, 3).

    Parameters
    ----------
    factor : undamped, at the solution; invalid afterwards.
    lowered, plain_share : t and a. lowered near 1 with plain_share = 0 leaves the cluster out: x̂ − x̂_(c).
    """
    plain = _plain_changes(system, solution, factor, clusters)
    for c in range(len(clusters)):
        images, shared, points = _with_lower_weights(system, solution, clusters.label == c, lowered)
        whole = plain.images[:, :, c], plain.shared[:, c], plain.points[:, :, c]
        rest = 1.0 - plain_share
        yield Directions(*(plain_share * a + rest * b for a, b in zip(whole, (images, shared, points), strict=True)))


def _plain_changes(system: NormalSystem, solution: Solution, factor: Factor, clusters: Clusters) -> Directions:
    """Q·g_c of every cluster: images (n, 6, m), shared (s, m), points (P, 3, m)."""
    x = factor.solve(plain_sides(system, solution, clusters))
    return plain_changes(system, solution, clusters, x)


def plain_sides(system: NormalSystem, solution: Settled, clusters: Clusters) -> np.ndarray:
    """The scores g_c with the points eliminated, (6·n + s, m)."""
    u = system.unknowns
    nothing = Directions(np.zeros((len(u.images), 6, 0)), np.zeros((len(u.shared), 0)), np.zeros((len(u.points), 3, 0)))
    return sides_of_clusters(system, solution, clusters, nothing)[0]


def plain_changes(system: NormalSystem, solution: Settled, clusters: Clusters, x: np.ndarray) -> Directions:
    """Q·g_c of every cluster from that of photographs and shared parameters, x (6·n + s, m)."""
    u, m = system.unknowns, len(clusters)
    n, count = len(u.images), len(u.points)
    images, shared, points = x[: 6 * n].reshape(n, 6, m) * u.eo_free[:, :, None], x[6 * n :], np.empty((count, 3, m))
    label, problem = clusters.label.astype(np.int64), system.problem(solution.state, solution.estimator)
    at_once = int(np.clip(NUMBERS_AT_ONCE / (3 * max(count, 1)), 1, m))
    for first in range(0, m, at_once):
        own = slice(first, min(first + at_once, m))
        sides = np.zeros((count, 3, own.stop - first))
        system.over_chunks(partial(_pull, system, problem, label, first, sides))
        of_images, of_shared = (np.ascontiguousarray(part[..., own]) for part in (images, shared))
        points[:, :, own] = expand_sides(system, solution.state, of_images, of_shared, sides, solution.estimator)
    return Directions(images, shared, points)


def _pull(
    system: NormalSystem, problem: Problem, label: np.ndarray, first_label: int, sides: np.ndarray, chunk: int
) -> None:
    _kernels.point_pulls(*system.chunks[chunk], problem, label, first_label, sides, system.work())


def _with_lower_weights(
    system: NormalSystem, solution: Solution, inside: np.ndarray, t: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(N − t·N_c)⁻¹·g_c of photographs (n, 6), shared parameters (s,) and points (P, 3).

    Robust weights stay as they are. AᵀPv = 0 at the solution, so that the right side with lower weights is −t·g_c.
    """
    u, other = system.unknowns, copy(system)
    weight = solution.equations.weight * np.where(inside[u.rays.image], 1.0 - t, 1.0)
    rays = replace(u.rays, inv_sigma=u.rays.inv_sigma * np.sqrt(weight)[:, None])
    other.unknowns = replace(u, rays=rays)
    other.extras = tuple(_Lowered(extra, inside, 1.0 - t) for extra in system.extras)
    equations = other.assemble(solution.state, 0.0, LEAST_SQUARES)
    x = other.factorise(equations).solve(equations.right)
    step = other.back_substitute(solution.state, x, 0.0, LEAST_SQUARES)
    points = step.points.copy()
    points[u.kept_rows] = step.shared[u.kept_columns]
    return -step.images * u.eo_free / t, -step.shared / t, -points / t


def known_part(
    system: NormalSystem, solution: Solution, factor: Factor, most: int = MOST_COLUMNS, inner: InnerDatum | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Q·N_0·Q of photographs (n, 6, 6), shared parameters (s, s) and points (P, 3, 3).

    N_0 are the observations that belong to no photograph: control, weighted parameters, random fields. It is a sum over
    columns r of its root; of more than `most` columns that many random sums with signs stand for all [L: Hutchinson].

    Parameters
    ----------
    factor : undamped, at the solution. inner : the inner datum, None where there is none.
    """
    u = system.unknowns
    n, s, count = len(u.images), len(u.shared), len(u.points)
    rows, axes = np.nonzero((u.prior_weight > 0.0) & (u.kept < 0)[:, None])
    # the random sums below are to be the same for any order of the points
    order = order_by_place(solution.state.points[rows])
    rows, axes = rows[order], axes[order]
    root = system.priors.root()
    of_points, mix = np.sqrt(u.prior_weight[rows, axes]), mixed_columns(len(rows) + root.shape[1], most)
    images, shared, points = np.zeros((n, 6, 6)), np.zeros((s, s)), np.zeros((count, 3, 3))
    at_once = int(np.clip(NUMBERS_AT_ONCE / (3 * max(count, 1)), 1, max(mix.shape[1], 1)))
    for first in range(0, mix.shape[1], at_once):
        part = mix[:, first : first + at_once]
        sides = np.zeros((count, 3, part.shape[1]))
        sides[rows, axes] = of_points[:, None] * part[: len(rows)]
        found = solve_sides(system, solution.state, factor, sides, solution.estimator, root @ part[len(rows) :])
        of_images, of_shared, at_points = found if inner is None else inner.moved(*found)
        images += of_images @ np.swapaxes(of_images, 1, 2)
        shared += of_shared @ of_shared.T
        points += at_points @ np.swapaxes(at_points, 1, 2)
    return images * (u.eo_free[:, :, None] & u.eo_free[:, None, :]), shared, points


def mixed_columns(size: int, most: int = MOST_COLUMNS) -> np.ndarray:
    """(size, k) sums over `size` columns of a root: the columns themselves, or random sums with signs of many."""
    if size <= most:
        return np.eye(size)
    return np.random.default_rng(size).choice([-1.0, 1.0], (size, most)) / np.sqrt(most)
