"""The datum: what fixes the frame, which directions stay free, and the inner (free network) datum.

A free block may be moved, turned and scaled without changing a residual; self-calibration adds no further freedom.
Minimal datum: the best-spread coordinates of three points are held. Inner datum: the same solution, moved by a
similarity so that GᵀdX = 0 over the datum points, dX counted from the start values; covariances follow by the
S-transformation [L: Baarda 1973; Teunissen 1985].
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from aerotri.adjustment.unknowns import State, Step, Unknowns
from aerotri.functional_model.rotation import cross_matrix, exponential

if TYPE_CHECKING:
    from aerotri.adjustment.normal_equations import NormalSystem

FREEDOMS = ("X", "Y", "Z", "ω", "φ", "κ", "scale")


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
    line = (xyz[second] - xyz[first]) / np.linalg.norm(xyz[second] - xyz[first])
    off = np.linalg.norm(np.cross(xyz - xyz[first], line), axis=1)
    return int(good[first]), int(good[second]), int(good[int(np.argmax(off))])


def minimal_coordinates(unknowns: Unknowns, state: State) -> list[tuple[int, int]]:
    """Seven coordinates that fix the datum: (row of the point, axis) pairs.

    X, Y, Z of both ends of the longest distance, and of the third point the axis nearest to the normal of their plane.
    """
    rays = np.where(unknowns.kept < 0, np.diff(unknowns.rays.start), 0)
    a, b, c = spread_points(state.points, rays)
    normal = np.cross(state.points[b] - state.points[a], state.points[c] - state.points[a])
    axis = int(np.argmax(np.abs(normal)))
    return [(a, 0), (a, 1), (a, 2), (b, 0), (b, 1), (b, 2), (c, axis)]


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
    kept, columns = unknowns.kept_rows, unknowns.kept_columns
    points, shared = step.points.copy(), step.shared.copy()
    points[kept] = shared[columns]
    motion = np.linalg.solve(weighted.T @ g.reshape(-1, 7), weighted.T @ points.ravel())
    points -= g @ motion
    shared[columns] = points[kept]
    points[kept] = 0.0
    return Step(step.images - motions_of_images(state.centre) @ motion, shared, points)


def restore_datum(unknowns: Unknowns, state: State, reference: np.ndarray) -> State:
    """The state of a free block moved by a similarity into its datum.

    Minimal: the held coordinates get their values of `reference` again. Inner: Gᵀ(X − reference) = 0 over the datum
    points.

    Parameters
    ----------
    reference : (P, 3) m, local start values.
    """
    datum = np.zeros(state.points.shape, dtype=bool)
    if unknowns.block.settings.adjustment.datum == "inner":
        datum[datum_rows(unknowns)] = True
    else:
        datum = unknowns.point_held
    for _ in range(20):
        g = motions_of_points(state.points)[datum]
        motion = np.linalg.lstsq(g, (reference - state.points)[datum], rcond=None)[0]
        turn, scale = exponential(motion[3:6]), 1.0 + motion[6]
        state = State(
            centre=scale * state.centre @ turn.T + motion[:3],
            rotation=turn @ state.rotation,
            points=scale * state.points @ turn.T + motion[:3],
            shared=state.shared.copy(),
        )
        state.shared[unknowns.kept_columns] = state.points[unknowns.kept_rows]
        if np.abs(g @ motion).max() < 1e-9:
            break
    return state


def nothing_holds(system: NormalSystem) -> bool:
    """Whether nothing observed or held ties the block to the object frame."""
    u = system.unknowns
    held = not u.eo_free.all() or u.point_held.any()
    return not held and not system.observes_centres and not (u.prior_weight > 0.0).any()


def control_share(unknowns: Unknowns, state: State) -> float:
    """Area of the convex hull of the height control over that of the object points, in plan; 0 below three points."""
    control = state.points[unknowns.prior_weight[:, 2] > 0.0, :2]
    try:
        return float(ConvexHull(control).volume / ConvexHull(state.points[:, :2]).volume)
    except (QhullError, ValueError):
        return 0.0
