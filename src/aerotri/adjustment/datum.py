"""The datum: what fixes the frame, which directions stay free, and the inner (free network) datum.

A free block may be moved, turned and scaled without changing a residual; self-calibration adds no further freedom, and
GNSS, INS and conditions take some of it away. Minimal datum: as many well-spread coordinates as are free are held.
Inner datum: the same solution, moved by a similarity so that GᵀdX = 0 over the datum points, dX counted from the start
values; covariances follow by the S-transformation [L: Baarda 1973; Teunissen 1985].
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy.linalg import qr
from scipy.spatial import ConvexHull, QhullError

from aerotri.adjustment.unknowns import FreeMotions, State, Step, Unknowns
from aerotri.functional_model.observed_unknowns import CentreObservations, Rows
from aerotri.functional_model.rotation import cross_matrix, exponential

FREEDOMS = ("X", "Y", "Z", "ω", "φ", "κ", "scale")
FOLLOWING = ("gnss", "ins", "constraint")
"""Kinds of shared parameters that may move with the whole block."""
NOTICED = 1e-7
"""Share of the largest effect below which an observation does not notice a motion."""


class ExtraObservations(Protocol):
    """Observations beside the image points: they linearise themselves."""

    @property
    def count(self) -> int: ...

    def rows(self, centre: np.ndarray, rotation: np.ndarray, shared: np.ndarray) -> Rows: ...


def spread_points(points: np.ndarray, rays: np.ndarray) -> tuple[int, int, int]:
    """Three well-measured points far apart: the ends of the longest distance, and the one farthest off their line.

    Parameters
    ----------
    points : (P, 3) m; rays : (P,) rays of each.
    """
    good = np.flatnonzero(rays >= min(3, rays.max()))
    off_centre = np.linalg.norm(points[good] - np.median(points[good], axis=0), axis=1)
    good = good[off_centre <= 3.0 * np.median(off_centre) + 1e-9]
    xyz = points[good]
    first = int(np.argmax(np.linalg.norm(xyz - xyz.mean(axis=0), axis=1)))
    second = int(np.argmax(np.linalg.norm(xyz - xyz[first], axis=1)))
    line = (xyz[second] - xyz[first]) / max(float(np.linalg.norm(xyz[second] - xyz[first])), 1e-300)
    off = np.linalg.norm(np.cross(xyz - xyz[first], line), axis=1)
    return int(good[first]), int(good[second]), int(good[int(np.argmax(off))])


def minimal_coordinates(unknowns: Unknowns, state: State) -> list[tuple[int, int]]:
    """The coordinates that fix what is free, as (row of the point, axis) pairs: of three points far apart.

    Of the nine coordinates those are held that the free motions move most independently (pivoting); in a block without
    further observations seven.
    """
    rays = np.where(unknowns.kept < 0, np.diff(unknowns.rays.start), 0)
    rows = np.array(spread_points(state.points, rays))
    moved = (motions_of_points(state.points[rows]) @ unknowns.motions.basis).reshape(9, -1)
    moved = moved / np.maximum(np.linalg.norm(moved, axis=0), 1e-300)
    pivots = np.asarray(qr(moved.T, pivoting=True, mode="r")[-1], dtype=np.int64)
    return [(int(rows[k // 3]), int(k % 3)) for k in sorted(pivots[: unknowns.motions.count].tolist())]


def free_motions(unknowns: Unknowns, extras: Sequence[ExtraObservations], state: State) -> FreeMotions:
    """Which of the seven motions no observation beside the image points notices.

    Shifts, drifts, boresight and the conditions' own unknowns move along where that hides a motion; a distance takes
    the scale away, a plumb line two rotations, GNSS without shifts all seven.
    """
    s = len(unknowns.shared)
    g_shared = np.zeros((s, 7))
    g_shared[unknowns.kept_columns] = motions_of_points(state.points)[unknowns.kept_rows]
    arms, noticing = rig_motions(unknowns, state)
    g_shared += arms
    along = [k for k in range(s) if unknowns.shared.kinds[k] in FOLLOWING and np.isinf(unknowns.shared.sigma[k])]
    g_images = motions_of_images(state.centre)
    noticed = [np.concatenate([noticing, np.zeros((len(noticing), len(along)))], axis=1)]
    for extra in extras:
        rows = extra.rows(state.centre, state.rotation, state.shared)
        of_shared = np.zeros((*rows.gap.shape, s))
        for c in range(rows.columns.shape[1]):
            there = np.flatnonzero(rows.columns[:, c] >= 0)
            of_shared[there, :, rows.columns[there, c]] += rows.by_shared[there, :, c]
        motion = of_shared @ g_shared
        own = rows.image >= 0
        motion[own] += rows.by_image[own] @ g_images[rows.image[own]]
        both = np.concatenate([motion, of_shared[:, :, along]], axis=2)
        noticed.append(both[rows.inv_sigma > 0.0])
    matrix = np.concatenate(noticed)
    size = max(float(np.abs(state.points - state.points.mean(axis=0)).max()), 1.0)
    unit = np.concatenate([np.ones(3), np.full(4, 1.0 / size), np.ones(len(along))])
    norm = np.linalg.norm(matrix * unit, axis=0)
    unit[7:] /= np.maximum(norm[7:], 1e-300)
    _, values, vectors = np.linalg.svd(np.vstack([matrix * unit, np.zeros((7 + len(along), 7 + len(along)))]))
    null = vectors[values < NOTICED * max(values.max(), 1e-300)].T * unit[:, None]
    left, scale, right = np.linalg.svd(null[:7] / unit[:7, None], full_matrices=False)
    real = scale > NOTICED
    combined = right[real].T / scale[real]
    shared = g_shared @ (left[:, real] * unit[:7, None])
    shared[along] += null[7:] @ combined
    return FreeMotions(left[:, real] * unit[:7, None], shared)


def rig_motions(unknowns: Unknowns, state: State) -> tuple[np.ndarray, np.ndarray]:
    """What the seven motions do to the mountings on rigid rigs and to readout times, and what notices them there.

    A rig is turned and moved as a whole; with the scale of the block its arms grow. An arm that is held or observed
    gives the block its scale.

    Returns
    -------
    (s, 7) motions of the shared parameters, and (r, 7) rows of arms that are held, over 1 m, or observed, over σ.
    """
    moved, rows = np.zeros((len(unknowns.shared), 7)), [np.zeros((0, 7))]
    if unknowns.scanning is not None:
        # velocities stand still while a block is scaled: a free readout time grows with it
        readout = unknowns.scanning.columns[:, 0]
        free = [k for k in np.unique(readout[readout >= 0]).tolist() if np.isinf(unknowns.shared.sigma[k])]
        moved[free, 6] = state.shared[free]
    mountings = unknowns.mountings
    if mountings is not None:
        columns, arm = mountings.columns[:, :3].ravel(), mountings.values(state.shared)[:, :3].ravel()
        free = columns >= 0
        moved[columns[free], 6] = arm[free]
        sigma = np.ones(len(columns))
        sigma[free] = np.array(unknowns.shared.sigma)[columns[free]]
        row = np.zeros((len(columns), 7))
        row[:, 6] = arm / sigma
        rows.append(row[arm / sigma != 0.0])
    return moved, np.concatenate(rows)


def motions_of_points(points: np.ndarray) -> np.ndarray:
    """G of object points (P, 3, 7): translations, rotations about the axes of the origin, scale."""
    g = np.zeros((len(points), 3, 7))
    g[:, :, :3] = np.eye(3)
    g[:, :, 3:6] = -cross_matrix(points)
    g[:, :, 6] = points
    return g


def motions_of_images(centre: np.ndarray) -> np.ndarray:
    """G of the photographs (n, 6, 7): the centre moves like a point, the attitude turns with the rotation."""
    g = np.zeros((len(centre), 6, 7))
    g[:, :3] = motions_of_points(centre)
    g[:, 3:, 3:6] = np.eye(3)
    return g


def datum_rows(unknowns: Unknowns) -> np.ndarray:
    """Rows of the points that carry an inner datum."""
    wanted = unknowns.block.settings.adjustment.datum_points
    if not wanted:
        return np.arange(len(unknowns.points))
    names = unknowns.block.points[unknowns.points]
    return np.flatnonzero(np.isin(names.astype(str), np.array(wanted, dtype=str)))


def without_motion(unknowns: Unknowns, state: State, step: Step) -> Step:
    """A free block's step, freed of the motion of the whole: each iteration then turns and scales as little as it can.

    Which coordinates are held decides how far a linear step is from the truth; far points would swing the block about.
    They count less the farther they lie.
    """
    distance = np.linalg.norm(state.points - np.median(state.points, axis=0), axis=1)
    weight = 1.0 / np.maximum(1.0, distance / max(np.median(distance), 1e-12)) ** 2
    g = motions_of_points(state.points)
    weighted = (g * weight[:, None, None]).reshape(-1, 7)
    free = unknowns.motions
    kept, columns = unknowns.kept_rows, unknowns.kept_columns
    points = step.points.copy()
    points[kept] = step.shared[columns]
    g, weighted = g @ free.basis, weighted @ free.basis
    motion = np.linalg.solve(weighted.T @ g.reshape(-1, free.count), weighted.T @ points.ravel())
    points -= g @ motion
    points[kept] = 0.0
    images = step.images - motions_of_images(state.centre) @ free.basis @ motion
    return Step(images, step.shared - free.shared @ motion, points)


def restore_datum(unknowns: Unknowns, state: State, reference: np.ndarray) -> State:
    """The state of a free block moved by a similarity into its datum.

    Minimal: the held coordinates get their values of `reference` again. Inner: Gᵀ(X − reference) = 0 over the datum
    points.

    Parameters
    ----------
    reference : (P, 3) m, local start values.
    """
    datum = np.zeros(state.points.shape, dtype=bool)
    if not unknowns.motions.count:
        return state
    if unknowns.block.settings.adjustment.datum == "inner":
        datum[datum_rows(unknowns)] = True
    else:
        datum = unknowns.point_held
    for _ in range(20):
        g = motions_of_points(state.points)[datum] @ unknowns.motions.basis
        share = np.linalg.lstsq(g, (reference - state.points)[datum], rcond=None)[0]
        motion = unknowns.motions.basis @ share
        turn, scale = exponential(motion[3:6]), 1.0 + motion[6]
        state = State(
            centre=scale * state.centre @ turn.T + motion[:3],
            rotation=turn @ state.rotation,
            points=scale * state.points @ turn.T + motion[:3],
            shared=state.shared + unknowns.motions.shared @ share,
        )
        state.shared[unknowns.kept_columns] = state.points[unknowns.kept_rows]
        state = unknowns.with_followers(state)
        if np.abs(g @ share).max(initial=0.0) < 1e-9:
            break
    return state


def observes_centres(extras: Sequence[ExtraObservations]) -> bool:
    """Whether projection centres were observed."""
    return any(isinstance(extra, CentreObservations) for extra in extras)


def nothing_holds(unknowns: Unknowns, extras: Sequence[ExtraObservations]) -> bool:
    """Whether nothing observed or held ties the block to the object frame."""
    held = not unknowns.eo_free.all() or unknowns.point_held.any()
    return not held and not observes_centres(extras) and not (unknowns.prior_weight > 0.0).any()


def control_share(unknowns: Unknowns, state: State) -> float:
    """Area of the convex hull of the height control over that of the object points, in plan; 0 below three points."""
    control = state.points[unknowns.given[:, 2], :2]
    try:
        return float(ConvexHull(control).volume / ConvexHull(state.points[:, :2]).volume)
    except (QhullError, ValueError):
        return 0.0
