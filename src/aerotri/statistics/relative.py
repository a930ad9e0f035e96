"""σ of the shape of a block: the covariance of what a similarity of the whole leaves.

[L: Baarda 1973; S-transformation] [D] Points and photographs are moved by the seven motions G of a similarity, three
shifts, three rotations and a scale, about the middle of the points. The similarity that takes errors dx of the datum
points away by least squares is A·dx, A = (GᵀDG)⁻¹GᵀD, D choosing the datum points. Left is S·dx, S = I − G·A, so

    S·Q·Sᵀ = Q − G·(A·Q) − (A·Q)ᵀ·Gᵀ + G·(A·Q·Aᵀ)·Gᵀ,

of which each point takes its own rows: seven right sides Q·Aᵀ through the factor are all that is needed beside σ.
A·Q·Aᵀ is the covariance of the similarity itself: how well place, direction and scale of the block are known. The
transformation is that of an inner datum with all seven motions, whichever of them the observations determine; in a free
block it does not matter in which datum Q is.
The model part goes the same way: its columns F become S·F, and noise explains S·(Q − Q·N_0·Q)·Sᵀ of their squares.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from aerotri import of_known
from aerotri.adjustment.datum import motions_of_images, motions_of_points, rig_motions
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import solve_sides
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.unknowns import State, Unknowns
from aerotri.results.adjustment import Adjustment
from aerotri.results.model_part import ModelRoot
from aerotri.results.relative import Neighbours
from aerotri.statistics.cluster_influence import known_part
from aerotri.statistics.cluster_test import NUMBERS_AT_ONCE
from aerotri.statistics.covariance import InnerDatum, inner_datum, is_inner
from aerotri.statistics.model_of_functions import known_root_of
from aerotri.statistics.model_part import positive_part

MOTIONS = 7
ENOUGH_RAYS = 3
"""Rays of a datum point, where enough points have so many: two rays test nothing."""
FEWEST, SHARE = 8, 0.2
"""Points, and share of all, that have rays enough for the others to be left out; chosen [C]: fewer do not span it."""
LOOSE = 5.0
"""Points whose relative σ, or distance from the middle, is so many times the median do not say what the shape is;
chosen [C]."""
BASES = 0.5
"""Distance of neighbouring points in bases [C]: within one stereo model, about the size of what is measured in it."""
ONE_PLACE = 0.02
"""Distance of positions over that of the ground, below which they count as one [C]: a photograph on the same place, or
another camera of a rig, makes no base. Of neighbours at 97 % end lap it is more."""
MOST_PAIRS = 30
"""Pairs of neighbours whose σ is computed, a right side each; chosen [C]: their median is sure to a tenth."""
NEAR = 2.0
"""A pair lies at most so many times as far apart as wanted, and at least the inverse of it [C]."""
FREE = 1e-9
"""Share of a motion that a free motion has at least: less is rounding."""
DEGENERATE = 1e-10
"""Of the largest singular value of the motions, below which points do not show one, as points in a line."""
POINTS_AT_ONCE = 100_000


@dataclass(frozen=True, eq=False)
class Shape:
    """The similarity of a block, and covariances (σ̂0² not included) of what it leaves.

    Parameters
    ----------
    datum : A and Q·Aᵀ, with all seven motions about `middle` (3,) m, in the frame of the adjustment.
    rows : (d,) object points that determine the similarity. inner : the inner datum of Q, None where there is none.
    """

    datum: InnerDatum
    middle: np.ndarray
    rows: np.ndarray
    inner: InnerDatum | None = None


@dataclass(frozen=True, eq=False)
class RelativeCovariances:
    """Total covariances after the similarity, rows as in `Unknowns`, in the frame of the adjustment.

    Parameters
    ----------
    points : (P, 3, 3) m². centres : (n, 3, 3) m². similarity : (7, 7) of the similarity itself, m, rad and scale.
    free : (7,) bool, motions that nothing determines.
    """

    points: np.ndarray
    centres: np.ndarray
    similarity: np.ndarray
    free: np.ndarray
    neighbours: Neighbours | None


def relative_covariances(
    system: NormalSystem, solution: Solution, factor: Factor, sigma0: float,
    q: tuple[np.ndarray, np.ndarray], root: ModelRoot | None = None,
) -> RelativeCovariances | None:  # fmt: skip
    """The covariances of a block after a similarity of the whole; None where no point is known that could tell it.

    Parameters
    ----------
    factor : undamped, at the solution. root : of the model part, None where there is none.
    q : cofactors of points (P, 3, 3) and projection centres (n, 3, 3) in the datum of the block.
    """
    shape = shape_of(system, solution, factor, q[0])
    if shape is None:
        return None
    d = shape.datum
    noise = _left(q[0], d.points, d.q_points, d.both), _left(q[1], d.images[:, :3], d.q_images[:, :3], d.both)
    points, centres, similarity = (sigma0**2 * part for part in (*noise, d.both))
    for part in () if root is None else root.parts:
        model = _model_parts(system, solution, factor, shape, noise, part)
        points, centres, similarity = (a + b for a, b in zip((points, centres, similarity), model, strict=True))
    near = neighbours(system, solution, factor, sigma0, shape, root)
    free = free_of(system.unknowns, shape.middle)
    return RelativeCovariances(points, centres, similarity, free, near)


def local_cofactors(found: Adjustment) -> tuple[np.ndarray, np.ndarray]:
    """Cofactors of points (P, 3, 3) and projection centres (n, 3, 3) of an adjustment, in the datum of its block."""
    u, variance = found.system.unknowns, found.local.outcome.sigma0**2
    points, images = found.local.points.covariance[u.points], found.local.images.covariance[u.images, :3, :3]
    return points / variance, images / variance


def shape_of(system: NormalSystem, solution: Solution, factor: Factor, q_points: np.ndarray) -> Shape | None:
    """The similarity over the points that are as well determined as most; None where no cofactors are known.

    Parameters
    ----------
    q_points : (P, 3, 3) in the datum of the block, NaN where they are not known.
    """
    state, u = solution.state, system.unknowns
    inner = inner_datum(system, state, factor, solution.estimator) if is_inner(system) else None
    rows = _spread_rows(u, state.points)
    rows = rows[np.isfinite(q_points[rows]).all(axis=(1, 2))]
    if not len(rows):
        return None
    shape = _shape_over(system, solution, factor, rows, inner)
    d = shape.datum
    left = np.trace(_left(q_points, d.points, d.q_points, d.both), axis1=1, axis2=2)
    good = rows[left[rows] <= LOOSE**2 * of_known.median(left[rows])]
    if not len(good):
        return None
    return shape if len(good) == len(rows) else _shape_over(system, solution, factor, good, inner)


def _spread_rows(unknowns: Unknowns, points: np.ndarray) -> np.ndarray:
    """Rows of points with rays enough that do not lie far off."""
    rays = np.diff(unknowns.rays.start)
    enough = rays >= ENOUGH_RAYS
    if enough.sum() < max(FEWEST, SHARE * len(rays)):
        enough = rays >= 1
    far = np.linalg.norm(points - of_known.medians(points[enough]), axis=1)
    return np.flatnonzero(enough & (far <= LOOSE * of_known.median(far[enough])))


def _shape_over(
    system: NormalSystem, solution: Solution, factor: Factor, rows: np.ndarray, inner: InnerDatum | None
) -> Shape:
    u, state = system.unknowns, solution.state
    middle = state.points[rows].mean(axis=0)
    images, shared, points = _motions(u, state, middle)
    of_datum = points[rows].reshape(-1, MOTIONS)
    a = np.zeros_like(points)
    size = np.linalg.norm(of_datum, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    # points in a line leave a rotation about it: the pseudo-inverse takes the other six
    inverse = np.linalg.pinv(of_datum / size, rcond=DEGENERATE) / size[:, None]
    a[rows] = inverse.T.reshape(-1, 3, MOTIONS)
    q_images, q_shared, q_points = _solved(system, solution, factor, a, inner)
    both = np.einsum("pia,pib->ab", a, q_points)
    datum = InnerDatum(images, shared, points, q_images, q_shared, q_points, 0.5 * (both + both.T), a)
    return Shape(datum, middle, rows, inner)


def _solved(
    system: NormalSystem, solution: Solution, factor: Factor, sides: np.ndarray, inner: InnerDatum | None,
    rows: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Q times right sides of points (P, 3, k), in the datum of the block: photographs, shared parameters, points.

    Parameters
    ----------
    rows : the points that have sides or are wanted, where these are few; all unless given.
    """
    if inner is None:
        return solve_sides(system, solution.state, factor, sides, solution.estimator, rows=rows)
    sides = sides - inner.conditions @ np.einsum("pid,pik->dk", inner.points, sides)
    return inner.moved(*solve_sides(system, solution.state, factor, sides, solution.estimator))


def _motions(unknowns: Unknowns, state: State, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The motions of photographs (n, 6, 7), shared parameters (s, 7) and points (P, 3, 7) about the middle."""
    points, images = motions_of_points(state.points - middle), motions_of_images(state.centre - middle)
    images[:, 3:] = np.linalg.solve(unknowns.turn(state), images[:, 3:])
    shared = rig_motions(unknowns, state)[0]
    shared[unknowns.kept_columns] = points[unknowns.kept_rows]
    return images, shared, points


def _left(q: np.ndarray, g: np.ndarray, qa: np.ndarray, both: np.ndarray) -> np.ndarray:
    """(k, d, d) of S·Q·Sᵀ, from Q (k, d, d), G and Q·Aᵀ (k, d, 7), and A·Q·Aᵀ."""
    mixed = g @ np.swapaxes(qa, 1, 2)
    return q - mixed - np.swapaxes(mixed, 1, 2) + g @ both @ np.swapaxes(g, 1, 2)


def _model_parts(
    system: NormalSystem, solution: Solution, factor: Factor, shape: Shape, noise: tuple[np.ndarray, np.ndarray],
    root: ModelRoot,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """The model parts of points (P, 3, 3), centres (n, 3, 3) and of the similarity (7, 7), of columns of one cause."""
    d = shape.datum
    motion = _motion_of_root(shape, root)
    points = np.concatenate([part @ np.swapaxes(part, 1, 2) for part in _moved_points(shape, root, motion)])
    centres = root.images[:, :3] - d.images[:, :3] @ motion
    centres, similarity = centres @ np.swapaxes(centres, 1, 2), motion @ motion.T
    if not root.noise > 0.0:
        return points, centres, similarity
    known_images, _, known_points = known_part(system, solution, factor, inner=d)
    known = known_root_of(system, d.q_shared, d.q_points)
    return (
        positive_part(points, root.noise * (noise[0] - known_points)),
        positive_part(centres, root.noise * (noise[1] - known_images[:, :3, :3])),
        positive_part(similarity[None], root.noise * (d.both - known.T @ known)[None])[0],
    )


def _motion_of_root(shape: Shape, root: ModelRoot) -> np.ndarray:
    """(7, k) A·F."""
    rows = shape.rows
    return np.einsum("pid,pik->dk", shape.datum.conditions[rows], root.points[rows], optimize=True)


def _moved_points(shape: Shape, root: ModelRoot, motion: np.ndarray) -> Iterator[np.ndarray]:
    """S·F of the points, some of them after the other: F is large."""
    for first in range(0, len(root.points), POINTS_AT_ONCE):
        own = slice(first, first + POINTS_AT_ONCE)
        yield root.points[own] - shape.datum.points[own] @ motion


def free_of(unknowns: Unknowns, middle: np.ndarray) -> np.ndarray:
    """(7,) bool, motions about the middle that no observation determines."""
    basis = unknowns.motions.basis
    if not unknowns.block.settings.adjustment.is_free or not basis.shape[1]:
        return np.zeros(MOTIONS, dtype=bool)
    about = np.concatenate([motions_of_points(middle[None])[0] @ basis, basis[3:]])
    size = np.abs(about)
    return size.max(axis=1) > FREE * size.max()


def neighbours(
    system: NormalSystem, solution: Solution, factor: Factor, sigma0: float, shape: Shape, root: ModelRoot | None
) -> Neighbours | None:
    """σ of differences of height between points half a base apart, median of some pairs; None without such pairs."""
    state = solution.state
    first, second = neighbouring_pairs(system.unknowns, state, shape.rows)
    if not len(first):
        return None
    at_once = int(np.clip(NUMBERS_AT_ONCE / (3 * len(state.points)), 1, len(first)))
    found = [
        _of_pairs(system, solution, factor, shape, root, (first[k : k + at_once], second[k : k + at_once]))
        for k in range(0, len(first), at_once)
    ]
    noise, model = (np.concatenate(parts, axis=1) for parts in zip(*found, strict=True))
    sigma = np.sqrt(np.maximum(sigma0**2 * noise + model, 0.0))
    apart = np.linalg.norm((state.points[first] - state.points[second])[:, :2], axis=1)
    absolute = float(np.median(sigma[0])) if not free_of(system.unknowns, shape.middle).any() else float("nan")
    return Neighbours(float(np.median(apart)), len(first), absolute, float(np.median(sigma[1])))


def neighbouring_pairs(unknowns: Unknowns, state: State, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of points about half a base apart in plan, spread over the block."""
    centres = _places_of_stations(unknowns, state)
    if len(centres) < 2 or len(rows) < 2:
        return rows[:0], rows[:0]
    wanted = BASES * float(np.median(KDTree(centres).query(centres, k=2)[0][:, 1]))
    plan = state.points[rows, :2]
    order = np.lexsort((plan[:, 1], plan[:, 0]))
    some = order[np.unique(np.linspace(0, len(rows) - 1, min(MOST_PAIRS, len(rows))).astype(int))]
    tree = KDTree(plan)
    partner = np.full(len(some), -1)
    for k, n in enumerate(some.tolist()):
        others = np.array([m for m in tree.query_ball_point(plan[n], NEAR * wanted) if m != n], dtype=np.int64)
        apart = np.linalg.norm(plan[others] - plan[n], axis=1)
        others, apart = others[apart >= wanted / NEAR], apart[apart >= wanted / NEAR]
        if len(others):
            partner[k] = others[np.argmin(np.abs(apart - wanted))]
    there = partner >= 0
    return rows[some[there]], rows[partner[there]]


def _places_of_stations(unknowns: Unknowns, state: State) -> np.ndarray:
    """(k, 2) m, the places photographed from: of a rig one, and one where several photographs were taken at a place."""
    u, leads = unknowns, np.ones(len(state.centre), dtype=bool)
    if u.rigging is not None:
        leads[u.rigging.followers] = False
    if u.ties is not None:
        leads[u.ties.image] = False
    ways = np.linalg.norm(state.points - state.centre[u.rays.image[u.rays.start[:-1]]], axis=1)
    places = state.centre[leads, :2]
    near = KDTree(places).query_pairs(ONE_PLACE * of_known.median(ways), output_type="ndarray")
    kept = np.ones(len(places), dtype=bool)
    for one, other in near[np.argsort(near[:, 0], kind="stable")].tolist():
        kept[other] &= not kept[one]
    return places[kept]


def _of_pairs(
    system: NormalSystem, solution: Solution, factor: Factor, shape: Shape, root: ModelRoot | None,
    pairs: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """(2, k) cofactors and (2, k) m² model parts of differences of Z: as the block stands, and after the similarity."""
    d, (first, second), k = shape.datum, pairs, np.arange(len(pairs[0]))
    sides = np.zeros((len(solution.state.points), 3, len(first)))
    sides[first, 2, k] += 1.0
    sides[second, 2, k] -= 1.0
    observed = np.flatnonzero((system.unknowns.prior_weight > 0.0).any(axis=1))
    rows = np.unique(np.concatenate([first, second, observed]))
    _, shared, points = _solved(system, solution, factor, sides, shape.inner, rows)
    own = points[first, 2, k] - points[second, 2, k]
    g, qa = (part[first, 2] - part[second, 2] for part in (d.points, d.q_points))
    left = own - 2.0 * np.sum(g * qa, axis=1) + np.einsum("ka,ab,kb->k", g, d.both, g)
    cofactor, model = np.stack([own, left]), np.zeros((2, len(first)))
    for part in () if root is None else root.parts:
        of_root = (part.points[first, 2] - part.points[second, 2]).astype(float)
        columns = np.stack([of_root, of_root - g @ _motion_of_root(shape, part)])
        own = np.sum(columns**2, axis=2)
        if part.noise > 0.0:
            known, of_motion = known_root_of(system, shared, points), known_root_of(system, d.q_shared, d.q_points)
            both = np.stack([known, known - of_motion @ g.T])
            own = np.maximum(own - part.noise * (cofactor - np.sum(both**2, axis=1)), 0.0)
        model += own
    return cofactor, model
