"""Motions of the whole block that nothing notices: held against every observation that could, whatever the factor says.

A block may be moved, turned and scaled without changing a ray; only control, GNSS, INS, conditions and held values can
notice it. Their rows times the seven motions are a small matrix, and its null space is what the datum leaves free, a
rotation about two control points as well as a plain shift. Whether a motion is free depends on where the observations
are and on what they observe, never on their σ: every row counts as much as any other. What is noticed by observations
of large σ alone is weak, not free (`weak_datum`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, eigh
from scipy.sparse import csr_array, diags_array, vstack

from aerotri.adjustment.datum import (
    FOLLOWING,
    FREEDOMS,
    ExtraObservations,
    motions_of_images,
    motions_of_points,
    rig_motions,
)
from aerotri.adjustment.unknowns import State, Unknowns
from aerotri.functional_model.observed_unknowns import Rows

if TYPE_CHECKING:
    from aerotri.adjustment.normal_equations import NormalSystem

NOT_NOTICED = 1e-13
"""Square of the effect, relative to the motion's size, below which nothing notices a motion: squares of rounding lie
below 1e-20, those of control 1 mm off a straight line of 1 km at 1e-12."""

BESIDE_A_CAMERA = 1e3
"""Square of a column's length over the usual one, above which a point lies beside the camera."""
NEAR = 0.25
"""Share of the points that lie at their usual distance, even in a block that ran away."""
WEAK = 1e-8
"""Square of the effect, relative to the motion's size, below which a motion is measured anew without squaring."""
SAME_MOTION = 1e-12
"""Share of the largest size below which a combination of motions is none of its own."""
REAL = 1e-6
"""Share of the largest motion below which only what follows moves, not the block."""
ALONE = 0.999
"""Cosine with the free space from which a motion is free on its own."""
PART = 0.05
"""Share of a combination below which a motion is not named in it."""


@dataclass(frozen=True, eq=False)
class FreeOfObservations:
    """Motions of the whole block that nothing notices.

    Parameters
    ----------
    names : of the free motions and of combinations of them. directions : (size, d) of the reduced unknowns.
    """

    names: tuple[str, ...]
    directions: np.ndarray

    @property
    def count(self) -> int:
        return self.directions.shape[1]


@dataclass(frozen=True, eq=False)
class WeakMotions:
    """Motions of the whole block that observations hardly notice, d of them.

    Parameters
    ----------
    reduced : (size, d) of photographs and shared parameters. points : (P, 3, d). weakest : the smallest λ.
    """

    reduced: np.ndarray
    points: np.ndarray
    weakest: float


@dataclass(frozen=True, eq=False)
class _Motions:
    """The seven motions about the middle of the block: of photographs (n, 6, 7), points (P, 3, 7), shared (s, 7).

    place : (s,) column of a shared parameter that may follow, after the seven motions; −1 of the others.
    seen : (P,), active : (n,) bool, with a ray or, of points, a condition.
    arms : (r, 7) what arms of rigid rigs that are held or observed notice.
    """

    images: np.ndarray
    points: np.ndarray
    shared: np.ndarray
    place: np.ndarray
    seen: np.ndarray
    active: np.ndarray
    arms: np.ndarray

    @property
    def count(self) -> int:
        """Motions and what may follow them."""
        return 7 + int((self.place >= 0).sum())


def unnoticed_motions(system: NormalSystem, state: State) -> FreeOfObservations:
    """What is free of the seven motions and their combinations, shifts and the like following as they may.

    The measure is that of `null_space` over the seven motions alone, with rows of length one and motions of a metre.
    """
    motions = _motions(system.unknowns, state)
    rows, unit = _of_length_one(_rows(system, state, motions), _reach(motions))
    weak = _weak((rows.T @ rows).toarray(), np.eye(motions.count))
    # a second time over the weak ones alone: squares of small numbers, none of them a difference of large ones
    value, turn = _again(rows @ weak, weak.T @ weak)
    names, free = _named(weak @ turn[:, value < NOT_NOTICED])
    return FreeOfObservations(names, _directions(motions, _count(system)) @ (free * unit[:, None]))


def weak_motions(system: NormalSystem, state: State, diagonal: np.ndarray, limit: float) -> WeakMotions | None:
    """The motions of the whole block, with what follows, that are noticed by less than `limit` of their size.

    The measure λ is that of `null_space`: what the observations notice with their σ, over what the rays would.

    Parameters
    ----------
    diagonal : (size,) of the normal matrix before the points are eliminated.
    """
    motions = _motions(system.unknowns, state)
    directions, diagonal = _directions(motions, len(diagonal)), _without_ties(system, state, diagonal)
    size = _size(motions, directions, diagonal)
    unit = 1.0 / np.sqrt(np.maximum(np.diagonal(size), 1e-300))
    effects = _rows(system, state, motions, diagonal)
    size, rows = size * np.outer(unit, unit), csr_array(effects.rows @ diags_array(unit))
    weak = _weak((rows.T @ rows).toarray(), size)
    try:
        value, turn = _again(rows @ weak, weak.T @ size @ weak)
    except LinAlgError:
        # of a block that ran away several motions are one
        return None
    moving = weak @ turn[:, value < limit]
    moving = moving[:, np.linalg.norm(moving[:7], axis=0) > REAL * np.linalg.norm(moving, axis=0)] * unit[:, None]
    if not moving.shape[1]:
        return None
    return WeakMotions(directions @ moving, motions.points @ moving[:7], float(value.min(initial=np.inf)))


def _count(system: NormalSystem) -> int:
    return 6 * len(system.unknowns.images) + len(system.unknowns.shared)


def _again(effect: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squares of the effects over the sizes, ascending, and the combinations that they belong to."""
    return eigh(effect.T @ effect, size) if effect.shape[1] else (np.zeros(0), np.zeros((0, 0)))


def _without_ties(system: NormalSystem, state: State, diagonal: np.ndarray) -> np.ndarray:
    """(size,) the diagonal without the ties of weighted rigs: tight ones outweigh all rays and notice no motion."""
    rows, ties = system.tie_rows(state), system.unknowns.ties
    if rows is None or ties is None:
        return diagonal
    n = len(state.centre)
    squares, squares_shared = np.zeros((n, 6)), np.zeros(len(state.shared))
    ties.add_squares(rows, squares, squares_shared)
    return np.maximum(diagonal - np.concatenate([squares.ravel(), squares_shared]), 0.0)


def _weak(effect: np.ndarray, size: np.ndarray) -> np.ndarray:
    """(7 + a, w) combinations whose effect, over their size, is at most WEAK.

    In a block that ran away, points far beyond all others make several motions one: these are counted once.
    """
    below = (-np.inf, WEAK)
    try:
        return eigh(effect, size, subset_by_value=below)[1]
    except LinAlgError:
        value, vectors = eigh(size)
        there = value > SAME_MOTION * value[-1]
        basis = vectors[:, there] / np.sqrt(value[there])
        return basis @ eigh(basis.T @ effect @ basis, subset_by_value=below)[1]


def _motions(u: Unknowns, state: State) -> _Motions:
    used = (u.rays.inv_sigma[:, 0] > 0.0) | (u.rays.inv_sigma[:, 1] > 0.0)
    seen = (np.add.reduceat(used, u.rays.start[:-1], dtype=np.int64) > 0) | (u.kept >= 0)
    active = np.bincount(u.rays.image[used], minlength=len(u.images)) > 0
    if u.rigging is not None:
        active = np.bincount(u.rigging.lead[active], minlength=len(u.images))[u.rigging.lead] > 0
    middle = np.median(state.points[seen], axis=0) if seen.any() else np.zeros(3)
    points, images = motions_of_points(state.points - middle), motions_of_images(state.centre - middle)
    images[~active] = 0.0
    shared, noticing = rig_motions(u, state)
    shared[u.kept_columns] = points[u.kept_rows]
    follows = np.isin(np.array(u.shared.kinds, dtype=object), FOLLOWING)
    place = np.where(follows, 6 + np.cumsum(follows), -1)
    images[:, 3:] = np.linalg.solve(u.turn(state), images[:, 3:])
    return _Motions(images, points, shared, place, seen, active, noticing)


def _directions(motions: _Motions, size: int) -> np.ndarray:
    """(size, 7 + a) the motions and what may follow, over the reduced unknowns."""
    n = 6 * len(motions.images)
    directions = np.zeros((size, motions.count))
    directions[:n, :7], directions[n:, :7] = motions.images.reshape(n, 7), motions.shared
    follows = np.flatnonzero(motions.place >= 0)
    directions[n + follows, motions.place[follows]] = 1.0
    return directions


def _size(motions: _Motions, directions: np.ndarray, diagonal: np.ndarray) -> np.ndarray:
    """(7 + a, 7 + a) products of the motions in units of the columns' lengths.

    Points enter with the mean length: a ray's partials by the point are those by the centre with the sign changed. They
    are the smaller the farther a point lies, so that one as good as at infinity counts no more than the others.
    """
    n = 6 * len(motions.images)
    of_images = diagonal[:n].reshape(-1, 6)
    # a point that came to lie beside a camera makes columns that say nothing of the block
    usual = np.median(of_images[motions.active], axis=0) if motions.active.any() else np.zeros(6)
    of_images = np.minimum(of_images, BESIDE_A_CAMERA * usual)
    diagonal = np.concatenate([of_images.ravel(), diagonal[n:]])
    size = directions.T @ (diagonal[:, None] * directions)
    seen = motions.points[motions.seen]
    # the column of the scale is where the point lies from the middle
    away = np.linalg.norm(seen[:, :, 6], axis=1)
    nearness = 1.0 / np.maximum(1.0, away / max(np.quantile(away, NEAR), 1e-300)) if len(away) else away
    moved = (seen * nearness[:, None, None]).reshape(-1, 7)
    per_image = of_images[motions.active, :3]
    size[:7, :7] += moved.T @ moved * (per_image.sum() / max(len(moved), 1))
    return size


class _Effects(NamedTuple):
    """What motions do to observations.

    rows : (r, 7 + a). reach : (r, 7) the same summed without signs: rounding of a row is a share of it.
    """

    rows: csr_array
    reach: np.ndarray


def _reach(motions: _Motions) -> np.ndarray:
    """(7 + a,) a shift of 1 m, the turns and the scale that move the points by 1 m in the mean; 1 of what follows."""
    away = np.linalg.norm(motions.points[motions.seen, :, 6], axis=1)
    usual = float(np.median(away)) if len(away) else 1.0
    return np.array([1.0] * 3 + [1.0 / max(usual, 1e-300)] * 4 + [1.0] * (motions.count - 7))


def _of_length_one(effects: _Effects, unit: np.ndarray) -> tuple[csr_array, np.ndarray]:
    """Rows of length one, and (7 + a,) what the columns were multiplied by: motions by `unit`, what follows to one.

    A row counts as long as its parts are before they cancel one another: what is left of one that notices nothing stays
    rounding.
    """
    unit = unit.copy()
    parts = np.abs(effects.reach * unit[:7])
    # a state that ran away has effects whose squares are beyond all numbers
    largest = np.maximum(parts.max(axis=1, initial=0.0), 1e-300)
    length = largest * np.linalg.norm(parts / largest[:, None], axis=1)
    by_length = np.where(length > 0.0, 1.0 / np.maximum(length, 1e-300), 1.0)
    rows = csr_array(diags_array(by_length) @ effects.rows)
    followed = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=0)).ravel())
    unit[7:] = 1.0 / np.maximum(followed[7:], 1e-300)
    rows = csr_array(rows @ diags_array(unit))
    whole = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1)).ravel() + (length == 0.0))
    return csr_array(diags_array(1.0 / np.maximum(whole, 1.0)) @ rows), unit


def _rows(system: NormalSystem, state: State, motions: _Motions, diagonal: np.ndarray | None = None) -> _Effects:
    """Effect of the motions and of what may follow on every observation that could notice it.

    Parameters
    ----------
    diagonal : of the normal matrix, where effects are to be divided by their σ; else every σ is one.
    """
    u, whitened = system.unknowns, diagonal is not None
    parts = [_beside(rows, motions, u.turn(state)) for extra in system.extras for rows in [_of(extra, state, whitened)]]
    observed = np.flatnonzero((motions.place >= 0) & np.isfinite(u.shared.sigma))
    of_follower = np.zeros((len(observed), motions.count))
    of_follower[np.arange(len(observed)), motions.place[observed]] = (
        1.0 / np.array(u.shared.sigma)[observed] if whitened else 1.0
    )
    parts.append(_Effects(csr_array(of_follower), np.zeros((len(observed), 7))))
    of_motions = _direct(u, motions, diagonal)
    beside = np.zeros((len(of_motions), motions.count - 7))
    parts.append(_Effects(csr_array(np.hstack([of_motions, beside])), np.abs(of_motions)))
    return _Effects(csr_array(vstack([part.rows for part in parts])), np.concatenate([part.reach for part in parts]))


def _direct(u: Unknowns, motions: _Motions, diagonal: np.ndarray | None) -> np.ndarray:
    """(·, 7) effect on coordinates of control, on what is held, and on arms of rigs."""
    weight = np.sqrt(u.prior_weight) * motions.seen[:, None]
    known, held = weight > 0.0, u.point_held & motions.seen[:, None]
    strength = np.ones(6)
    if diagonal is not None:
        # a held value notices as much as all the rays of a photograph
        squares = diagonal[: u.eo_free.size].reshape(u.eo_free.shape)
        strength = np.sqrt(np.sum(squares * u.eo_free, axis=0) / np.maximum(u.eo_free.sum(axis=0), 1))
    held_element = ~u.eo_free & motions.active[:, None]
    return np.concatenate(
        [
            (np.ones(known.sum()) if diagonal is None else weight[known])[:, None] * motions.points[known],
            strength[:3].max() * motions.points[held],
            np.where(strength > 0.0, strength, 1.0)[np.nonzero(held_element)[1], None] * motions.images[held_element],
            motions.arms,
        ]
    )


def _of(extra: ExtraObservations, state: State, whitened: bool) -> Rows:
    rows = extra.rows(state.centre, state.rotation, state.shared)
    return rows if whitened else replace(rows, inv_sigma=(rows.inv_sigma > 0.0).astype(float))


def _beside(rows: Rows, motions: _Motions, turn: np.ndarray) -> _Effects:
    """The rows of observations beside image points and control."""
    own = rows.image >= 0
    effect, reach = np.zeros((*rows.gap.shape, 7)), np.zeros((*rows.gap.shape, 7))
    by_image = rows.by_image[own].copy()
    by_image[:, :, 3:] = by_image[:, :, 3:] @ turn[rows.image[own]]
    effect[own] = by_image @ motions.images[rows.image[own]]
    reach[own] = np.abs(by_image) @ np.abs(motions.images[rows.image[own]])
    row = np.arange(rows.gap.size).reshape(rows.gap.shape)
    places, values = [], []
    for c in range(rows.columns.shape[1]):
        there = rows.columns[:, c] >= 0
        column = rows.columns[there, c]
        along = rows.by_shared[there, :, c, None] * motions.shared[column][:, None, :]
        effect[there] += along
        reach[there] += np.abs(along)
        place = np.broadcast_to(motions.place[column][:, None], row[there].shape)
        follows = place >= 0
        places.append(np.stack([row[there][follows], place[follows]]))
        values.append((rows.by_shared[there, :, c] * rows.inv_sigma[there])[follows])
    places.append(np.stack([np.repeat(row.ravel(), 7), np.tile(np.arange(7), row.size)]))
    values.append((effect * rows.inv_sigma[:, :, None]).ravel())
    all_rows = csr_array((np.concatenate(values), tuple(np.concatenate(places, axis=1))), (row.size, motions.count))
    # a photograph without rays of its own goes where its observation wants it
    takes_part = ~own
    takes_part[own] = motions.active[rows.image[own]]
    kept = np.flatnonzero((rows.inv_sigma > 0.0) & takes_part[:, None])
    return _Effects(csr_array(all_rows[kept]), (reach * rows.inv_sigma[:, :, None]).reshape(-1, 7)[kept])


def _named(free: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of the motions within the span of `free` (7 + a, d), and the part of it that moves the block (7 + a, r).

    A combination of motions, such as a rotation about two control points, follows the motions free on their own.
    """
    left, scale, right = np.linalg.svd(free[:7], full_matrices=False)
    real = scale > REAL * scale.max(initial=0.0)
    span, moving = left[:, real], free @ (right[real].T / scale[real])
    alone = np.linalg.norm(span, axis=1) > ALONE
    mixed = span.copy()
    mixed[alone] = 0.0
    combinations, size, _ = np.linalg.svd(mixed, full_matrices=False)
    names = [name for name, free_alone in zip(FREEDOMS, alone, strict=True) if free_alone]
    for column in np.abs(_apart(combinations[:, size > 0.5])).T:
        parts = [name for name, share in zip(FREEDOMS, column / column.max(), strict=True) if share > PART]
        names.append("a combination of " + " and ".join(parts))
    return tuple(names), moving


def _apart(combinations: np.ndarray) -> np.ndarray:
    """The same space (7, d) by columns of which each has a rotation or the scale that the others have not."""
    reduced, left = combinations.T.copy(), list(range(len(combinations.T)))
    for group in ((3, 4, 5, 6), (0, 1, 2)):
        for motion in group:
            if not left:
                break
            best = max(left, key=lambda row: abs(reduced[row, motion]))
            if abs(reduced[best, motion]) < PART:
                continue
            reduced[best] /= reduced[best, motion]
            for row in range(len(reduced)):
                if row != best:
                    reduced[row] -= reduced[row, motion] * reduced[best]
            left.remove(best)
    return reduced.T
