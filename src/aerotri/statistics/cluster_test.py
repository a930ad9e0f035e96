"""Whether photographs of one cluster (a strip, a day) share errors: a test along the weakest deformations of a block.

[D] At the solution the scores g_c = A_cᵀPv of clusters c (their rays, and GNSS and INS of their photographs) pull at
the unknowns. Along directions y the pulls are u_c = yᵀg_c. With white noise they have the covariance σ0²·K,

    K_cd = δ_cd·yᵀN_c·y − (N_c·y)ᵀ·Q·(N_d·y),

N_c = A_cᵀPA_c; the second term is what the adjustment itself takes away. So uᵀK⁺u/σ0² is χ² with the rank of K as
degrees of freedom, however few clusters there are. Errors that the rays of a cluster have in common do not average out
within it and enlarge uᵀK⁺u.

The directions are the weakest deformations of the block: of the covariance that clusters give to object points spread
over the block, the eigenvectors of the largest eigenvalues.

Residuals that are not white within a photograph (correlated matching, wrong weights) enlarge the sum for any division.
So it is compared as well with that of random divisions of the photographs into clusters of the same sizes, by the F
test. The scheme "photograph" is a random division itself, and stands for errors that the rays of one photograph share.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from aerotri.adjustment.datum import motions_of_points
from aerotri.adjustment.kernel_records import Directions
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import expand_sides, solve_sides
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.unknowns import State, Unknowns
from aerotri.functional_model.observed_unknowns import Rows
from aerotri.quantiles import chi_square_exceedance, f_exceedance
from aerotri.results.model_part import ClusterTest
from aerotri.statistics import _cluster_kernels as _kernels
from aerotri.statistics.clusters import ALONE, FEWEST, PHOTOGRAPH, Clusters, divided_at_random, to_test

LEVEL = 0.001
"""Probability with which white noise is taken for errors of clusters [C]: Baarda's level of a single test."""
ATTRIBUTED = 0.05
"""Probability with which errors of single photographs are taken for those of a group [C]. That white noise does not
explain them is known by then. The covariance from groups is right for both: taken for those of a group, errors of
photographs only make it less sure."""
DIVISIONS = 3
"""Random divisions of the photographs [C]: their degrees of freedom are three times those of the scheme."""
MODES = 6
"""Deformations looked at [C]: tilts and bends of the whole block; more cost time."""
SAME = 1e-6
"""Eigenvalue of K over the largest below which it is rounding."""
SAMPLE = 12
"""Object points that stand for the shape of the block [C]."""
NUMBERS_AT_ONCE = 2e7
"""Numbers of the right sides that are solved together [C]: 160 MB, of which three copies are made."""
SAMPLED_FROM = 5000
"""Object points among which those of the sample are looked for, where there are twice as many."""
FEWEST_RAYS = 3
"""Rays of a point of the sample, where there are such points."""


@dataclass(frozen=True, eq=False)
class Modes:
    """k directions in the space of the unknowns, and what the photographs do along them.

    Parameters
    ----------
    y : the directions. scores : (n, k) pulls of the photographs. products : (n, k, k) their share of yᵀNy.
    """

    y: Directions
    scores: np.ndarray
    products: np.ndarray


class Settled(Protocol):
    """Where an adjustment ended."""

    @property
    def state(self) -> State: ...

    @property
    def estimator(self) -> Estimator: ...


Squares = Callable[[Clusters], tuple[float, int]]
"""Gives of clusters uᵀ·K⁺·u and the rank of K."""


def weakest_modes(system: NormalSystem, solution: Solution, factor: Factor) -> Modes:
    """The directions of the weakest deformations and the photographs' pulls along them.

    Parameters
    ----------
    factor : undamped, at the solution.

    Raises
    ------
    ValueError
        When there are no `candidates`.
    """
    u = system.unknowns
    rows, rays = candidates(u), np.diff(u.rays.start)
    rows = rows[rays[rows] >= min(FEWEST_RAYS, int(rays[rows].max(initial=0)))]
    rows = rows[thinned(u.block.points[u.points[rows]])]
    rows = rows[spread(solution.state.points[rows, :2])]
    size = 3 * len(rows)
    q, own = np.zeros((size, size)), np.zeros((size, size))
    observed = np.flatnonzero((u.prior_weight > 0.0).any(axis=1) & (u.kept < 0))
    at_observed, at_shared = np.zeros((len(observed), 3, size)), np.zeros((len(u.shared), size))
    wanted = np.union1d(rows, observed)
    at_once = int(np.clip(NUMBERS_AT_ONCE / (3 * len(u.points)), 3, size))
    for first in range(0, size, at_once):
        columns = np.arange(first, min(first + at_once, size))
        sides = np.zeros((len(u.points), 3, len(columns)))
        sides[rows[columns // 3], columns % 3, np.arange(len(columns))] = 1.0
        _, shared, points = solve_sides(system, solution.state, factor, sides, solution.estimator, rows=wanted)
        q[:, columns] = points[rows].reshape(size, -1)
        at_observed[:, :, columns], at_shared[:, columns] = points[observed], shared
    own += np.einsum("pia,pi,pib->ab", at_observed, u.prior_weight[observed], at_observed)
    at_priors = system.priors.root().T @ at_shared
    own += at_priors.T @ at_priors
    estimable = _estimable(system, solution, rows)
    chosen = weakest(estimable @ (0.5 * (q + q.T) - own) @ estimable)
    sides = np.zeros((len(u.points), 3, chosen.shape[1]))
    sides[rows] = chosen.reshape(len(rows), 3, -1)
    # only the sample has sides, so that no other point has to be looked at before the solution
    images, shared, _ = solve_sides(system, solution.state, factor, sides, solution.estimator, rows=rows)
    points = expand_sides(system, solution.state, images, shared, sides, solution.estimator)
    return _with_scores(system, solution, Directions(images, shared, points))


def weakest(covariance: np.ndarray) -> np.ndarray:
    """(size, k) directions of the largest eigenvalues of a covariance, scaled to a variance of 1."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors[:, ::-1][:, :MODES] / np.sqrt(np.maximum(values[::-1][:MODES], 1e-12 * values[-1]))


def _estimable(system: NormalSystem, solution: Solution, rows: np.ndarray) -> np.ndarray:
    """Projection of coordinates of points to what a free block determines: no motion of the whole."""
    free, size = system.unknowns.motions, 3 * len(rows)
    if not system.unknowns.block.settings.adjustment.is_free or not free.count:
        return np.eye(size)
    moved = (motions_of_points(solution.state.points[rows]) @ free.basis).reshape(size, -1)
    moved = moved / np.maximum(np.linalg.norm(moved, axis=0), 1e-300)
    return np.eye(size) - moved @ np.linalg.pinv(moved)


def candidates(unknowns: Unknowns) -> np.ndarray:
    """Rows of the points that may stand for the shape of the block: adjusted, nothing of them held."""
    return np.flatnonzero(~unknowns.point_held.any(axis=1) & (unknowns.kept < 0))


def thinned(names: np.ndarray) -> np.ndarray:
    """Rows of the points, (k,) names, that the sample is taken from: some by their names, whatever their order."""
    if len(names) <= 2 * SAMPLED_FROM:
        return np.arange(len(names))
    return np.lexsort((names, keys(names)))[:SAMPLED_FROM]


def keys(names: np.ndarray) -> np.ndarray:
    """(k,) numbers that names are thinned by."""
    return np.array([zlib.crc32(name.encode()) for name in names.tolist()], dtype=np.int64)


def spread(xy: np.ndarray) -> np.ndarray:
    """Rows of points (k, 2) far from one another in plan, the first in the middle."""
    chosen = [int(np.argmin(np.linalg.norm(xy - np.median(xy, axis=0), axis=1)))]
    apart = np.linalg.norm(xy - xy[chosen[0]], axis=1)
    for _ in range(min(SAMPLE, len(xy)) - 1):
        chosen.append(int(np.argmax(apart)))
        apart = np.minimum(apart, np.linalg.norm(xy - xy[chosen[-1]], axis=1))
    return np.array(chosen)


def _with_scores(system: NormalSystem, solution: Solution, y: Directions) -> Modes:
    return Modes(y, *scores_along(system, solution, y))


def scores_along(system: NormalSystem, solution: Settled, y: Directions) -> tuple[np.ndarray, np.ndarray]:
    """Scores (n, k) and products (n, k, k) of the photographs along directions, see `Modes`."""
    n, k = len(system.unknowns.images), y.images.shape[2]
    parts = [_kernels.Scores(np.zeros((n, k)), np.zeros((n, k, k))) for _ in system.chunks]
    problem = system.problem(solution.state, solution.estimator)
    system.over_chunks(lambda c: _kernels.mode_scores(*system.chunks[c], problem, y, parts[c], system.work()))
    scores, products = (np.sum([part[axis] for part in parts], axis=0) for axis in (0, 1))
    for rows in system.whitened_rows(solution.state):
        own, value = along(rows, y)
        np.add.at(scores, rows.image[own], np.einsum("gkf,gk->gf", value, rows.gap[own]))
        np.add.at(products, rows.image[own], np.einsum("gkf,gkh->gfh", value, value))
    return scores, products


def along(rows: Rows, y: Directions) -> tuple[np.ndarray, np.ndarray]:
    """Which observations belong to a photograph, and what directions y change their predictions by, (g, k, f)."""
    own = rows.image >= 0
    value = rows.by_image[own] @ y.images[rows.image[own]]
    for c in range(rows.columns.shape[1]):
        column = rows.columns[own, c]
        there = column >= 0
        value[there] += rows.by_shared[own][there, :, c, None] * y.shared[column[there]][:, None, :]
    return own, value


def sides_of_clusters(
    system: NormalSystem, solution: Settled, clusters: Clusters, y: Directions
) -> tuple[np.ndarray, np.ndarray]:
    """A_cᵀP·A·y of every cluster and direction with the points eliminated (6·n + s, m·k), and what points take, (m·k)².

    The misclosures in place of A·y where y has no direction.
    """
    u = system.unknowns
    n, s, k = len(u.images), len(u.shared), max(y.images.shape[2], 1)
    size = len(clusters) * k
    parts = [_kernels.Sides(np.zeros((n, 6, size)), np.zeros((s, size)), np.zeros((size, size))) for _ in system.chunks]
    problem, label = system.problem(solution.state, solution.estimator), clusters.label.astype(np.int64)
    system.over_chunks(lambda c: _kernels.cluster_sides(*system.chunks[c], problem, label, y, parts[c], system.work()))
    images, shared, own_products = (np.sum([part[axis] for part in parts], axis=0) for axis in (0, 1, 2))
    for rows in system.whitened_rows(solution.state):
        own, value = along(rows, y)
        if not y.images.shape[2]:
            value = rows.gap[own][:, :, None]
        image = rows.image[own]
        for f in range(k):
            column = label[image] * k + f
            pulls = np.einsum("gkt,gk->gt", rows.by_image[own], value[:, :, f])
            for t in range(6):
                np.add.at(images[:, t], (image, column), pulls[:, t])
            for c in range(rows.columns.shape[1]):
                at, there = rows.columns[own, c], rows.columns[own, c] >= 0
                pull = np.sum(rows.by_shared[own][:, :, c] * value[:, :, f], axis=1)
                np.add.at(shared, (at[there], column[there]), pull[there])
    return np.concatenate([images.reshape(6 * n, size), shared]), own_products


def compare_clusters(
    squares: Squares, clusters: Clusters, centre: np.ndarray, sigma0: float, level: float
) -> ClusterTest:
    """The test of one scheme.

    Parameters
    ----------
    centre : (n, 3) m, of the photographs. level : below which the probability by white noise has to be for the scheme
        to count; ATTRIBUTED that by random divisions.
    """
    reason = untestable(clusters)
    if reason:
        return ClusterTest(clusters.scheme, len(clusters), reason=reason)
    clusters = to_test(clusters, centre)
    m = len(clusters)
    found, freedom = squares(clusters)
    if freedom == 0:
        return ClusterTest(clusters.scheme, m, reason="nothing checks the clusters against one another")
    p_noise, ratio = chi_square_exceedance(found / sigma0**2, freedom), float(np.sqrt(found / freedom)) / sigma0
    if clusters.scheme == PHOTOGRAPH:
        return ClusterTest(clusters.scheme, m, freedom, ratio, p_noise=p_noise, counts=p_noise < level)
    if p_noise >= level:
        # whatever random divisions show, the scheme does not count; they take most of the time
        return ClusterTest(clusters.scheme, m, freedom, ratio, p_noise=p_noise)
    of_random = _by_random_divisions(squares, clusters, centre)
    ratio_random = float(np.sqrt(of_random[0] / of_random[1])) / sigma0
    p_random = f_exceedance((ratio / max(ratio_random, 1.0)) ** 2, freedom, of_random[1])
    counts = p_noise < level and p_random < ATTRIBUTED
    return ClusterTest(clusters.scheme, m, freedom, ratio, ratio_random, p_noise, p_random, counts)


def _by_random_divisions(squares: Squares, clusters: Clusters, centre: np.ndarray) -> tuple[float, int]:
    """Sum of squares and degrees of freedom of random divisions into clusters of the same sizes."""
    rng, total, freedom = np.random.default_rng(len(clusters.label)), 0.0, 0
    for _ in range(DIVISIONS):
        found, own = squares(replace(clusters, label=divided_at_random(centre, clusters.label, rng)))
        total, freedom = total + found, freedom + own
    return total, max(freedom, 1)


def untestable(clusters: Clusters) -> str:
    """Why clusters are too few, or one of them is too large, to estimate a variance from; '' where they are not."""
    m, share = len(clusters), float(np.bincount(clusters.label).max() / len(clusters.label))
    if m < FEWEST:
        return f"{m} clusters leave {m - 1} degrees of freedom, too few to estimate a variance from"
    if share > ALONE:
        return f"one cluster has {100.0 * share:.0f} % of the photographs and holds the block alone"
    return ""


def sum_of_squares(
    system: NormalSystem, solution: Solution, factor: Factor, modes: Modes, clusters: Clusters
) -> tuple[float, int]:
    """uᵀ·K⁺·u and the rank of K."""
    sides, taken = sides_of_clusters(system, solution, clusters, modes.y)
    half = factor.half_solve(sides)
    own, pulls = sums_of_clusters(modes, clusters)
    return squares_of(own - taken - half.T @ half, pulls)


def sums_of_clusters(modes: Modes, clusters: Clusters) -> tuple[np.ndarray, np.ndarray]:
    """Of the photographs of every cluster along the k modes: yᵀN_c·y on the diagonal of (m·k, m·k), yᵀg_c (m·k,)."""
    m, k = len(clusters), modes.scores.shape[1]
    products, pulls = np.zeros((m * k, m * k)), np.zeros((m, k))
    np.add.at(pulls, clusters.label, modes.scores)
    for c in range(m):
        own = slice(c * k, (c + 1) * k)
        products[own, own] = modes.products[clusters.label == c].sum(axis=0)
    return products, pulls.ravel()


def squares_of(covariance: np.ndarray, pulls: np.ndarray) -> tuple[float, int]:
    """uᵀ·K⁺·u and the rank of K from K (k, k) and u (k,)."""
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    there = values > SAME * values[-1]
    squares = (vectors[:, there].T @ pulls) ** 2 / values[there]
    return float(squares.sum()), int(there.sum())
