"""Rank defects by name: which unknowns the observations leave free.

Three looks, none of which hangs on rounding. The motions of the whole block are held against every observation that
could notice one. The factor's smallest eigenvalue is estimated; where it is suspect, the weak directions are measured
by the design matrix. Motions of the whole block are named first, what remains by the unknowns that take part in it.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.block_motions import FreeOfObservations, unnoticed_motions, weak_motions
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.null_space import SUSPECT, free_directions, smallest_eigenvalue
from aerotri.adjustment.reduced_equations import NormalEquations
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.sparse_cholesky import Factor, NotPositiveDefiniteError
from aerotri.adjustment.unknowns import State
from aerotri.adjustment.weak_datum import WEAK
from aerotri.conventions import counted

AT_INFINITY = 100.0
"""Distance from the middle of the points, in usual distances, from which a point is as good as at infinity."""
BEYOND_ALL_MEASURE = 1e6
"""The same of the farthest point of a block that ran away, and of columns beside those of a usual photograph."""
WRONG_START = "the start values are too far off for any equations:"
"""Begins the sentence on a block whose equations say nothing where they start."""
SAME = 0.9999
"""Cosine from which a free direction is a motion of the whole block: a motion of a part has the part's share of it."""
SHOWN = 6
"""Names listed in one sentence."""


def checked_factor(
    system: NormalSystem, state: State, equations: NormalEquations, estimator: Estimator, factor: Factor | None = None,
    suspect: bool | None = None, is_sure: bool = False,
) -> tuple[Factor | None, list[str]]:  # fmt: skip
    """The factor of the equations and sentences naming what is free: none where the matrix has full rank.

    Parameters
    ----------
    equations : undamped, at `state`. factor : of them, where there is one already.
    suspect : what `is_suspect` says of the factor, where it was asked already.
    is_sure : the factor shows by itself that nothing is free.

    Returns
    -------
    The factor, valid until the next one, None where there is a defect; and the sentences.
    """
    dead = _dead_columns(system, equations)
    if dead:
        return None, [f"no ray depends on {_listed(dead)}"]
    if is_sure and factor is not None:
        return factor, []
    factor = factor or _factor(system, equations)
    motions = unnoticed_motions(system, state)
    if suspect is None:
        suspect = factor is None or is_suspect(factor, equations)
    if factor is not None and not motions.count and not suspect:
        return factor, []
    if _has_run_away(state, equations) and (plain := _factor(system, equations)) is not None:
        # no measure holds over so many powers of ten; the verdict says what such a result is worth
        return plain, []
    try:
        rest = free_besides(system, state, equations, estimator, motions)
    except NotPositiveDefiniteError:
        return None, [without_digits(system, equations)]
    sentences = _named(system, equations, motions, rest)
    factor = None if sentences else _factor(system, equations)
    return factor, sentences if factor or sentences else ["the normal equations are singular"]


def without_digits(system: NormalSystem, equations: NormalEquations) -> str:
    """A sentence on equations that lost all their digits, with the image point that is farthest off."""
    u, length = system.unknowns, system.residual_lengths(equations)
    if not len(length):
        return "there are no image points to adjust"
    ray = int(np.argmax(np.where(np.isnan(length), np.inf, length)))
    point, image = u.block.image_points.point[u.rays.source[ray]], u.images[u.rays.image[ray]]
    return (
        f"{WRONG_START} point {u.block.points[point]} lies beside or behind photograph {u.block.images.names[image]}, "
        "not in front of it. Check the orientations of this photograph and of the others that the point is measured in"
    )


def _factor(system: NormalSystem, equations: NormalEquations) -> Factor | None:
    try:
        return system.factorise(equations)
    except NotPositiveDefiniteError:
        return None


def is_suspect(factor: Factor, equations: NormalEquations) -> bool:
    """Whether the factor alone leaves open that something is free."""
    return smallest_eigenvalue(factor, equations.diagonal) < SUSPECT


def _has_run_away(state: State, equations: NormalEquations) -> bool:
    """Whether points lie beyond all measure, or in a camera: the block has not kept together, whatever holds it."""
    if not len(state.points):
        return False
    away = np.linalg.norm(state.points - np.median(state.points, axis=0), axis=1)
    of_images = equations.diagonal[: 6 * len(state.centre)].reshape(-1, 6)
    in_a_camera = of_images.max(axis=0) > BEYOND_ALL_MEASURE * np.median(of_images, axis=0)
    return bool(away.max() > BEYOND_ALL_MEASURE * np.quantile(away, 0.25) or in_a_camera.any())


def point_without_rays_enough(system: NormalSystem, state: State, equations: NormalEquations) -> list[str]:
    """A sentence on a point that its own rays do not fix, with the photographs held; empty where there is none.

    A point as good as at infinity is none: rays to it are parallel, and the rest of the block does not need it.
    """
    row, u = equations.undetermined, system.unknowns
    away = np.linalg.norm(state.points - np.median(state.points, axis=0), axis=1)
    if row >= 0 and away[row] > AT_INFINITY * np.median(away):
        return []
    rays = slice(u.rays.start[row], u.rays.start[row + 1]) if row >= 0 else slice(0)
    if not (u.rays.inv_sigma[rays] > 0.0).any():
        return []
    return [f"not determined: point {u.block.points[u.points[row]]}, which has only one ray, or rays that are parallel"]


def _dead_columns(system: NormalSystem, equations: NormalEquations) -> list[str]:
    return [system.unknowns.name_of(int(k)) for k in np.flatnonzero(~(equations.diagonal > 0.0))]


def _listed(names: list[str]) -> str:
    more = len(names) - SHOWN
    return ", ".join(names[:SHOWN]) + (f" and {more} more" if more > 0 else "")


def free_besides(
    system: NormalSystem, state: State, equations: NormalEquations, estimator: Estimator, motions: FreeOfObservations
) -> np.ndarray:
    """(size, k) directions that are free besides motions of the whole block, orthonormal after multiplication by D.

    Motions that something notices, however weakly, are none of them: their σ are large, and `weak_datum` keeps them.
    """
    free = free_directions(system, state, equations, estimator, motions.directions)
    weak = weak_motions(system, state, equations.diagonal, WEAK)
    all_motions = motions.directions if weak is None else np.hstack([motions.directions, weak.reduced])
    moved = np.linalg.qr(all_motions * np.sqrt(equations.diagonal)[:, None])[0]
    _, cosine, turn = np.linalg.svd(moved.T @ free)
    is_motion = np.zeros(len(turn), dtype=bool)
    is_motion[: len(cosine)] = cosine > SAME
    return free @ turn[~is_motion].T


def _named(
    system: NormalSystem, equations: NormalEquations, motions: FreeOfObservations, rest: np.ndarray
) -> list[str]:
    """Sentences for the motions of the whole block, and for what else is in the null space.

    Those unknowns take part in a direction that move most in units of what rays notice, whatever else is known of them.
    """
    sentences = [f"the datum is free in {', '.join(motions.names)}"] if motions.names else []
    seen = np.sqrt(np.maximum(equations.of_rays, 0.0) / equations.diagonal)
    for vector in rest.T[:SHOWN]:
        part = np.abs(vector) * seen
        part = part / part.max() if part.max() > 0.0 else np.abs(vector) / np.abs(vector).max()
        members = [system.unknowns.name_of(int(k)) for k in np.argsort(-part)[:4] if part[k] > 0.3]
        sentences.append("not determined: " + ", ".join(members))
    if rest.shape[1] > SHOWN:
        sentences.append(f"{counted(rest.shape[1] - SHOWN, 'more combination')} of unknowns not determined")
    return sentences
