"""Errors that few clusters of photographs have: a random field a cluster, its size from the residuals.

A variance of four strips has three degrees of freedom and says little. But the residuals of a strip show its errors
over the whole format. [D] Cluster c has the image errors s_c = B·p_c, p_c its nodes over the format with the covariance
σ_s²·R, R = exp(−ρ/ℓ) or exp(−ρ²/2ℓ²), dx and dy apart, and each camera of a rig its own. ℓ is a share of the half
diagonal of each camera's own format [C]: a lens, a sensor and a pressure plate are made for their format, so that their
errors have as many waves over a small format as over a large one. σ_s is one length in mm for all cameras. The scores
h = BᵀPv have the covariance

    σ0²·K + σ_s²·K·R·K,   K = BᵀPB − BᵀPA·Q·AᵀPB,

from which σ_s, ℓ and the form follow by restricted maximum likelihood. What a camera has in common in all clusters is
eliminated beforehand: it does not move. The unknowns get from the fields the covariance F·Fᵀ, F = Q·AᵀPB·(σ_s²·R)^½.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.kernel_records import Problem
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import expand_sides
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.observations.block import Camera
from aerotri.results.model_part import ClusterTest, ModelRoot
from aerotri.statistics import _field_kernels as _kernels
from aerotri.statistics.cluster_test import NUMBERS_AT_ONCE, SAME, Settled
from aerotri.statistics.clusters import Clusters, divided_at_random
from aerotri.statistics.covariance import InnerDatum

NODES = (7, 5)
"""Nodes along the longer and the shorter side of the format [C]: what orientation cannot take up is finer than a third
of the format; finer than a sixth it does not bend a block."""
LENGTHS = (0.2, 0.4, 0.8, 1.6, 3.2)
"""Correlation lengths looked at, in half diagonals of each camera's format."""
LONGEST_SMOOTH = 0.8
"""The longest of them for exp(−ρ²/2ℓ²) [C]: longer ones are nearly polynomials of second order, which orientation and
lens take up. Their size would be an extrapolation from the little that the residuals keep of them."""
FORMS = tuple(
    (smooth, length) for smooth in (False, True) for length in LENGTHS if length <= LONGEST_SMOOTH or not smooth
)
"""Forms and correlation lengths looked at."""
SIZES = np.geomspace(1e-2, 1e2, 161)
"""σ_s looked at, in σ of an image coordinate."""
NOISE = np.geomspace(1.0, 10.0, 16)
"""Noise of the scores looked at, in σ0."""
SEEN = 1e-4
"""Eigenvalue of K over the largest below which the unknowns take up a pattern nearly whole; chosen [C]: what the
residuals show of it is magnified more than a hundredfold."""
AGREEING = 0.9
"""Share of the gain that the patterns seen well have with a field of their own, down to which they agree with another;
chosen [C]: 0.98 and more on a real flight, −3 to 0.86 where single patterns called for errors of millimetres."""
KEPT = 1e-3
"""Share of the largest eigenvalue of R below which a pattern is left out: together a hundredth of the variance."""
DIVISIONS = 3
"""Random divisions that a scheme is compared with."""


@dataclass(frozen=True, eq=False)
class Field:
    """The field of every cluster.

    Parameters
    ----------
    sigma : mm. length : mm, in the largest format. smooth : whether R is exp(−ρ²/2ℓ²).
    gain : twice the logarithm of the likelihood with the field over that without.
    ratio : RMS of the scores along the patterns of the field, over that of white noise.
    freedom : patterns of K that count.
    root : (c, nodes, k) of σ_s²·R of every camera of the block, the same for cameras of one format.
    """

    sigma: float
    length: float
    smooth: bool
    gain: float
    ratio: float
    freedom: int
    root: np.ndarray


@dataclass(frozen=True, eq=False)
class FieldEquations:
    """What the rays say of the nodes of all clusters: sides (6n + s, k), normals K (k, k) and scores h (k,).

    camera : (m,) in the block, of the parts, the photographs of one cluster and one camera, whose nodes they are.
    """

    nodes: _kernels.Nodes
    camera: np.ndarray
    sides: np.ndarray
    normals: np.ndarray
    scores: np.ndarray


def compare_field(
    fitted: Callable[[Clusters], Field], clusters: Clusters, centre: np.ndarray, level: float
) -> tuple[ClusterTest, Field]:
    """The test of one scheme by its fields, against white noise and against random divisions.

    Parameters
    ----------
    fitted : gives the field that fits clusters best. centre : (n, 3) m, of the photographs.
    level : below which both probabilities have to be.
    """
    field = fitted(clusters)
    # two unknowns, σ_s and ℓ: of white noise the gain is below χ² with two degrees of freedom
    p_noise, ratio_random, p_random = float(np.exp(-0.5 * field.gain)), float("nan"), float("nan")
    if p_noise < level and len(clusters) > 1:
        rng = np.random.default_rng(len(clusters.label))
        others: list[Field] = []
        for _ in range(DIVISIONS):
            others.append(fitted(replace(clusters, label=divided_at_random(centre, clusters.label, rng))))
        best = max(others, key=lambda other: other.gain)
        ratio_random = best.ratio
        p_random = float(np.exp(-0.5 * max(field.gain - best.gain, 0.0)))
    counts = p_noise < level and not p_random >= level
    test = ClusterTest(
        clusters.scheme, len(clusters), field.freedom, field.ratio, ratio_random, p_noise, p_random, counts,
        field_um=1e3 * field.sigma, field_mm=field.length,
    )  # fmt: skip
    return test, field


def root_of_field(
    system: NormalSystem, solution: Solution, factor: Factor, clusters: Clusters, field: Field,
    inner: InnerDatum | None = None,
) -> tuple[ModelRoot, np.ndarray]:  # fmt: skip
    """The columns F of the fields, see above, and F·Fᵀ of the points (P, 3, 3); in the inner datum if there is one."""
    u = system.unknowns
    equations = field_equations(system, solution, factor, clusters)
    root = field.root[equations.camera]
    x = factor.solve(of_patterns(equations.sides, root))
    images, shared = x[: 6 * len(u.images)].reshape(len(u.images), 6, -1), x[6 * len(u.images) :]
    images = images * u.eo_free[:, :, None]
    points, squares = np.empty((len(u.points), 3, x.shape[1]), np.float32), np.zeros((len(u.points), 3, 3))
    for own, columns in columns_of_points(system, solution, equations.nodes, root, x):
        points[:, :, own] = columns
        squares += columns @ np.swapaxes(columns, 1, 2)
    if inner is not None:
        images, shared, points = inner.moved(images, shared, points)
        squares = points @ np.swapaxes(points, 1, 2)
    return ModelRoot(images, shared, points.astype(np.float32, copy=False), 0.0), squares


def of_patterns(sides: np.ndarray, root: np.ndarray) -> np.ndarray:
    """(6n + s, ·) sides of the patterns, root (m, nodes, k) of the parts, from those of the nodes of all of them."""
    m, nodes, k = root.shape
    apart = sides.reshape(len(sides), m, 2, nodes)
    out = np.empty((len(sides), m, 2, k))
    for own in alike(root):
        by_node = apart[:, own].reshape(len(sides), -1, nodes)
        out[:, own] = (by_node @ np.asfortranarray(root[own[0]])).reshape(len(sides), -1, 2, k)
    return out.reshape(len(sides), -1)


def columns_of_points(
    system: NormalSystem, solution: Settled, nodes: _kernels.Nodes, root: np.ndarray, x: np.ndarray
) -> Iterator[tuple[slice, np.ndarray]]:
    """Some columns after others and the solutions of the points (P, 3, ·), from all of `of_patterns`, x (6n + s, ·).

    Parameters
    ----------
    root : (m, nodes, k) of the parts.
    """
    u, k = system.unknowns, root.shape[2]
    n, count = len(u.images), len(u.points)
    m, problem = x.shape[1] // (2 * k), system.problem(solution.state, solution.estimator)
    at_once = max(int(NUMBERS_AT_ONCE / (6 * max(count, 1) * k)), 1)
    for first in range(0, m, at_once):
        parts = slice(first, min(first + at_once, m))
        own = slice(2 * k * parts.start, 2 * k * parts.stop)
        sides = _point_sides(system, problem, nodes, root, parts)
        images, shared = np.ascontiguousarray(x[: 6 * n, own]).reshape(n, 6, -1), np.ascontiguousarray(x[6 * n :, own])
        yield own, expand_sides(system, solution.state, images, shared, sides, solution.estimator)


def _point_sides(
    system: NormalSystem, problem: Problem, nodes: _kernels.Nodes, root: np.ndarray, parts: slice
) -> np.ndarray:
    """A_pᵀP·B·R (P, 3, ·) of some parts; rays of others have no weight."""
    u = system.unknowns
    inside = (nodes.label >= parts.start) & (nodes.label < parts.stop)
    share = np.where(inside[u.rays.image][:, None], nodes.weight, 0.0)
    here = nodes._replace(weight=share, label=np.where(inside, nodes.label - parts.start, 0))
    own = np.ascontiguousarray(root[parts])
    sides = np.zeros((len(u.points), 3, 2 * root.shape[2] * len(own)))

    def chunk(c: int) -> None:
        _kernels.field_point_sides(*system.chunks[c], problem, here, own, sides, system.work())

    system.over_chunks(chunk)
    return sides


def field_equations(system: NormalSystem, solution: Solution, factor: Factor, clusters: Clusters) -> FieldEquations:
    """The rays over the nodes of all clusters, photographs, shared parameters and points eliminated."""
    u = system.unknowns
    label, camera = by_camera(clusters, u.block.images.camera[u.images])
    nodes = nodes_of(system, label)
    sides, own, scores = field_sums(system, solution, nodes, camera)
    half = factor.half_solve(sides)
    normals = own - half.T @ half
    return FieldEquations(nodes, camera, sides, 0.5 * (normals + normals.T), scores)


def field_sums(
    system: NormalSystem, solution: Settled, nodes: _kernels.Nodes, camera: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """AᵀPB (6n + s, k) and BᵀPB (k, k) with the points eliminated, and BᵀPv (k,).

    Parameters
    ----------
    camera : (m,) of the parts of `FieldEquations`.
    """
    u = system.unknowns
    n, s, k = len(u.images), len(u.shared), 2 * len(camera) * nodes.count
    parts = [
        _kernels.FieldSums(
            np.zeros((n, 6, k)), np.zeros((s, k)), np.zeros((k, k)), np.zeros(k), np.full(k, -1, np.int64)
        )
        for _ in system.chunks
    ]
    problem = system.problem(solution.state, solution.estimator)
    system.over_chunks(lambda c: _kernels.field_sides(*system.chunks[c], problem, nodes, parts[c], system.work()))
    images, shared, own, scores = (np.sum([part[axis] for part in parts], axis=0) for axis in range(4))
    return np.concatenate([images.reshape(6 * n, k), shared]), own, scores


def by_camera(clusters: Clusters, camera: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Clusters divided by camera, (n,): (n,) number of every photograph's part, (m,) camera of every part."""
    pairs, label = np.unique(np.column_stack([clusters.label, camera]), axis=0, return_inverse=True)
    return label.ravel().astype(np.int64), pairs[:, 1]


def nodes_of(system: NormalSystem, label: np.ndarray) -> _kernels.Nodes:
    """The rays among the nodes of their photograph's format, photographs with labels (n,)."""
    u, block = system.unknowns, system.unknowns.block
    camera = block.images.camera[u.images][u.rays.image]
    half, counts = half_formats(block.cameras)[camera], node_counts(block.cameras)[camera]
    return _kernels.Nodes(*nodes_at(u.rays.xy, half, counts), label, NODES[0] * NODES[1])


def nodes_at(xy: np.ndarray, half: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(r, 4) nodes about image places (r, 2) mm and their bilinear weights.

    Parameters
    ----------
    half : (r, 2) mm, half the format. counts : (r, 2) nodes along x and y.
    """
    at = np.clip(0.5 * (xy / half + 1.0), 0.0, 1.0) * (counts - 1)
    low, along_y = np.minimum(at.astype(np.int64), counts - 2), counts[:, 1:]
    x, y = (at - low).T
    corners = np.concatenate([0 * along_y, 0 * along_y + 1, along_y, along_y + 1], axis=1)
    node = low[:, :1] * along_y + low[:, 1:] + corners
    weight = np.column_stack([(1.0 - x) * (1.0 - y), (1.0 - x) * y, x * (1.0 - y), x * y])
    return node, weight


def node_counts(cameras: Sequence[Camera]) -> np.ndarray:
    """(c, 2) nodes along x and y of every camera."""
    half = half_formats(cameras)
    return np.where(half[:, :1] >= half[:, 1:], NODES, NODES[::-1])


def half_formats(cameras: Sequence[Camera]) -> np.ndarray:
    """(c, 2) mm, half the formats."""
    return np.array([camera.half_format_mm for camera in cameras])


def largest_half_diagonal(cameras: Sequence[Camera]) -> float:
    """Half the diagonal of the largest format, mm."""
    return max(camera.r_max_mm for camera in cameras)


def correlations(cameras: Sequence[Camera], share: float, smooth: bool) -> np.ndarray:
    """(c, nodes, nodes) R of every camera for ℓ as a share of the half diagonal of its format."""
    return np.stack([_correlations(camera, share * camera.r_max_mm, smooth) for camera in cameras])


def _correlations(camera: Camera, length: float, smooth: bool) -> np.ndarray:
    """(nodes, nodes) R of a camera for ℓ in mm."""
    counts = node_counts([camera])[0]
    axes = [half * np.linspace(-1.0, 1.0, k) for half, k in zip(camera.half_format_mm, counts, strict=True)]
    xy = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    squares = np.sum((xy[:, None] - xy) ** 2, axis=2) / length**2
    return np.exp(-0.5 * squares) if smooth else np.exp(-np.sqrt(squares))


def alike(matrices: np.ndarray) -> list[np.ndarray]:
    """The numbers of those of (m, ·, ·) matrices that are equal, for every different one."""
    _, number = np.unique(matrices.reshape(len(matrices), -1), axis=0, return_inverse=True)
    return [np.flatnonzero(number.ravel() == k) for k in range(int(number.max(initial=-1)) + 1)]


def spread_of_fields(root: np.ndarray, r: np.ndarray) -> np.ndarray:
    """(q, q) rootᵀ·R·root with R of every part in either component.

    Parameters
    ----------
    root : (2·m·nodes, q) of K. r : (m, nodes, nodes) R of the parts.
    """
    m, nodes, _ = r.shape
    apart = root.reshape(m, 2, nodes, -1)
    sums = []
    for own in alike(r):
        spread = apart[own].reshape(2 * len(own), nodes, -1)
        sums.append(np.einsum("cip,ij,cjq->pq", spread, r[own[0]], spread, optimize=True))
    return np.sum(sums, axis=0)


def roots_of_fields(prior: np.ndarray) -> np.ndarray:
    """(c, nodes, k) roots of σ_s²·R (c, nodes, nodes), patterns of little size left out.

    Of formats of different shape one may need fewer patterns than another; all have as many as the one with most.
    """
    power, patterns = np.linalg.eigh(prior)
    first = int(np.min(np.argmax(power > KEPT * power[:, -1:], axis=1)))
    return patterns[:, :, first:] * np.sqrt(np.maximum(power[:, None, first:], 0.0))


def fitted_field(system: NormalSystem, solution: Solution, factor: Factor, sigma0: float, clusters: Clusters) -> Field:
    """The field of clusters with the greatest restricted likelihood.

    Parameters
    ----------
    factor : undamped, at the solution.
    """
    found, u = field_equations(system, solution, factor, clusters), system.unknowns
    unit = float(np.median(1.0 / u.rays.inv_sigma))
    return fit_field(found.normals, found.scores, found.camera, len(clusters) > 1, u.block.cameras, unit, sigma0)


def fit_field(
    normals: np.ndarray, scores: np.ndarray, camera: np.ndarray, several: bool, cameras: Sequence[Camera], unit: float,
    sigma0: float,
) -> Field:  # fmt: skip
    """The field with the greatest restricted likelihood.

    Patterns that the unknowns take up nearly whole say little of a field, and much of what the equations do not hold:
    image errors finer than the nodes, and where the iterations ended. A field that only they call for would be many
    times too large. Where it explains the other patterns much worse than what fits these best, they alone count.

    Parameters
    ----------
    normals (k, k), scores (k,), camera (m,) : as in `FieldEquations`. several : whether there are several clusters.
    unit : mm, median σ of an image coordinate.
    """
    if several:
        normals, scores = _without_common(normals, scores, camera)
    values, vectors = np.linalg.eigh(normals)
    shown, seen = (_patterns(values, vectors, scores / sigma0, share) for share in (SAME, SEEN))
    sizes = (unit * SIZES) ** 2
    best, of_seen = (_most_likely(patterns, seen, camera, cameras, sizes, sigma0) for patterns in (shown, seen))
    along = _along_field(seen, best.correlations[camera], sigma0)
    under = _gains(*along, np.array([best.variance]))[0]
    if under < AGREEING * of_seen.gain:
        shown, best = seen, of_seen
    return Field(
        float(np.sqrt(best.variance)), largest_half_diagonal(cameras) * best.length, best.smooth, max(best.gain, 0.0),
        best.ratio, len(shown.scores), roots_of_fields(best.variance * best.correlations),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Patterns:
    """K^½ (k, q) along its eigenvectors, and the scores along them, whitened by white noise (q,)."""

    root: np.ndarray
    scores: np.ndarray


@dataclass(frozen=True, eq=False)
class _Fit:
    """A form, its size mm², its R (c, nodes, nodes), and what it gains."""

    gain: float
    variance: float
    length: float
    smooth: bool
    ratio: float
    correlations: np.ndarray


def _patterns(values: np.ndarray, vectors: np.ndarray, scores: np.ndarray, share: float) -> _Patterns:
    """Those whose eigenvalue of K is above a share of the largest; scores over σ0."""
    there = values > share * values[-1]
    size = np.sqrt(values[there])
    return _Patterns(vectors[:, there] * size, vectors[:, there].T @ scores / size)


def _most_likely(
    shown: _Patterns, seen: _Patterns, camera: np.ndarray, cameras: Sequence[Camera], sizes: np.ndarray, sigma0: float
) -> _Fit:
    """The form and size with the greatest likelihood of those that the patterns seen well allow."""
    best = None
    for smooth, length in FORMS:
        r = correlations(cameras, length, smooth)
        power, squares = _along_field(shown, r[camera], sigma0)
        largest = allowed(*_along_field(seen, r[camera], sigma0))
        gains = _gains(power, squares, sizes[sizes <= max(largest, sizes[0])])
        k, ratio = int(np.argmax(gains)), float(np.sqrt(np.sum(power * squares) / np.sum(power)))
        if best is None or gains[k] > best.gain:
            best = _Fit(float(gains[k]), float(sizes[k]), length, smooth, ratio, r)
    assert best is not None
    return best


def _along_field(shown: _Patterns, r: np.ndarray, sigma0: float) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues λ of K^½·R·K^½/σ0² (1/mm²), and the squares of the scores along their patterns, whitened."""
    power, patterns = np.linalg.eigh(spread_of_fields(shown.root, r) / sigma0**2)
    return np.maximum(power, 0.0), (patterns.T @ shown.scores) ** 2


def allowed(power: np.ndarray, squares: np.ndarray) -> float:
    """The largest σ_s² that the residuals allow, mm².

    [D] Of a field the squares of the scores have the expectation n·τ² + σ_s²·Σλ. A likelihood may ask for more where
    the patterns that the unknowns take up nearly whole call for it: these have little of Σλ.

    Parameters
    ----------
    power : (n,) λ. squares : (n,).
    """
    return max(float(np.sum(squares)), float(len(squares))) / max(float(np.sum(power)), 1e-300)


def _gains(power: np.ndarray, squares: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Twice the logarithm of the likelihood over that of noise alone by size (mm²), the noise τ of the scores unknown.

    Errors that single photographs or neighbouring rays share enlarge the scores of all patterns alike [L: Kish 1965,
    the design effect]. They are noise here, τ ≥ 1 times σ0.
    """
    noise = NOISE[:, None] ** 2
    alone = -np.sum(squares / noise + np.log(noise), axis=1)
    variance = noise[:, :, None] + sizes[None, :, None] * power
    return np.max(-np.sum(squares / variance + np.log(variance), axis=2), axis=0) - np.max(alone)


def _without_common(normals: np.ndarray, scores: np.ndarray, camera: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """K and h with a field that every camera has in all clusters eliminated."""
    size = len(scores) // len(camera)
    same = np.kron(camera[:, None] == np.unique(camera), np.eye(size))
    mixed = normals @ same
    gain = np.linalg.pinv(same.T @ mixed, rcond=1e-9, hermitian=True)
    rest = normals - mixed @ gain @ mixed.T
    return 0.5 * (rest + rest.T), scores - mixed @ (gain @ (same.T @ scores))
