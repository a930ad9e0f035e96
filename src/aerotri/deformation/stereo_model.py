"""The deformation of a stereo model: what a point becomes when its photographs are used uncorrected.

[D] The true point P is projected into both photographs, measured where the image errors put it, m = ideal + d(m) inside
the tile of the ideal position, and intersected rigorously with the orientation in use. dX, dY, dZ = wrong − true. With
a rolling shutter the projection is that at the exposure of the row of m; the intersection knows nothing of it.

σ comes from the covariance Q of the additional parameters: with G = (AᵀA)⁻¹Aᵀ of the intersection, A the partials of
its four image coordinates by the point, ∂P/∂p = G·(B − A_o·∂o/∂p), B = ∂d/∂p and o the orientation in use.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from aerotri.deformation.moving_rays import by_motion, exposed
from aerotri.deformation.orientation import Orientation
from aerotri.deformation.photo_errors import PhotoErrors, seams_mm
from aerotri.deformation.restitution import Restitution
from aerotri.functional_model.collinearity import INTERIOR_COLUMNS, RayPartials, linearise, predict

ITERATIONS = 20
"""Steps of an intersection at most [C]: a few reach the tolerance; the others are for rays that hardly meet."""
STEP_TOLERANCE_M = 1e-8
"""Last step of an intersection [C]: 0.01 µm, above the rounding of local coordinates and far below any deformation."""
ROW_STEPS = 3
"""Steps to the row that shows a point in a photograph of a rolling shutter [C]: each leaves about a hundredth."""
FARTHEST_ROW = 1.5
"""Half formats from the middle beyond which a row is taken for that at this distance."""
PIECE = 2048
"""Nodes whose partials by all parameters are held at a time."""


@dataclass(frozen=True, eq=False)
class StereoModel:
    """Two photographs, the first being the left one.

    Parameters
    ----------
    names : of the photographs.
    errors : image errors of each.
    true, used : orientations, two photographs each.
    follows : (2, 9, p) partials of the used orientation by the additional parameters.
    covariance : (p, p).
    """

    names: tuple[str, str]
    errors: tuple[PhotoErrors, PhotoErrors]
    true: Orientation
    used: Orientation
    follows: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, eq=False)
class PointDeformation:
    """The deformation at n points; NaN where not both photographs see a point.

    Parameters
    ----------
    d : (n, 3) m, wrong − true.
    parallax : (n,) mm, the y-parallax that remains, without sign.
    """

    d: np.ndarray
    parallax: np.ndarray


def pair_model(restitution: Restitution, names: tuple[str, str], rows: tuple[int, int]) -> StereoModel:
    """The model of two photographs of a block, by their rows."""
    pair = list(rows)
    left, right = (restitution.errors[restitution.group[row]] for row in pair)
    return StereoModel(
        names,
        (left, right),
        restitution.true.take(pair),
        restitution.used.take(pair),
        restitution.follows[pair],
        restitution.covariance,
    )


def seen_by_both(model: StereoModel, points: np.ndarray) -> np.ndarray:
    """(n,) bool: points (n, 3) m that lie in front of both photographs and on their formats."""
    seen = np.ones(len(points), dtype=bool)
    for k, errors in enumerate(model.errors):
        depth = (points - model.true.centre[k]) @ model.true.rotation[k, :, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            seen &= (depth < 0.0) & errors.inside(ideal(model, k, points))
    return seen


def ideal(model: StereoModel, k: int, points: np.ndarray) -> np.ndarray:
    """(n, 2) mm, ideal position of points (n, 3) m in photograph k; of a rolling shutter in the row that it shows."""
    orientation, xy = model.true, np.zeros((len(points), 2))
    if orientation.scans is None:
        return project(orientation, k, points, xy)
    # rows far beyond the format say no time
    most = FARTHEST_ROW * np.array(model.errors[k].camera.half_format_mm)
    for _ in range(ROW_STEPS):
        xy = project(orientation, k, points, np.clip(np.nan_to_num(xy), -most, most))
    return xy


def project(orientation: Orientation, k: int, points: np.ndarray, at: np.ndarray | None = None) -> np.ndarray:
    """(n, 2) mm, ideal position of points (n, 3) m in photograph k, when rays measured `at` (n, 2) mm are exposed.

    Without `at` all are exposed in the middle of the readout.
    """
    rotation, centre, interior, image = _moved(orientation, k, np.zeros((len(points), 2)) if at is None else at)
    point, row = np.arange(len(points)), np.full(len(points), k, dtype=np.int64)
    return predict(rotation, centre, points, interior, image, point, row, np.zeros((len(points), 2)))


def _moved(orientation: Orientation, k: int, at: np.ndarray):
    """Tables of photograph k as rays measured at (n, 2) mm take them: rotation, centre, interior, row of each ray."""
    rotation, centre, interior = _tables(orientation)
    if orientation.scans is None:
        return rotation, centre, interior, np.full(len(at), k, dtype=np.int64)
    rotation, centre = (np.ascontiguousarray(part) for part in exposed(orientation, k, at))
    return rotation, centre, interior, np.arange(len(at))


def regions(model: StereoModel, points: np.ndarray) -> np.ndarray:
    """(n,) number of the pair of tiles that show each point (n, 3) m, −1 where not both photographs do.

    Within a region the deformation is smooth; it may jump from one to the next.
    """
    seen = seen_by_both(model, points)
    number = np.zeros(len(points), dtype=np.int64)
    for k, errors in enumerate(model.errors):
        xy = ideal(model, k, points[seen])
        for axis, seams in enumerate(seams_mm(errors.camera)):
            number[seen] = (len(seams) + 1) * number[seen] + np.searchsorted(seams, xy[:, axis], side="right")
    return np.where(seen, number, -1)


def deform_points(model: StereoModel, points: np.ndarray) -> PointDeformation:
    """The deformation at true points.

    Parameters
    ----------
    points : (n, 3) m, in the frame of the orientations.
    """
    d, parallax = np.full((len(points), 3), np.nan), np.full(len(points), np.nan)
    seen = np.flatnonzero(seen_by_both(model, points))
    if len(seen):
        true = points[seen]
        wrong, left_over = intersect(model.used, measured(model, true), true)
        d[seen] = wrong - true
        parallax[seen] = np.sqrt(2.0 * np.sum(left_over**2, axis=(0, 2)))
    return PointDeformation(d, parallax)


def measured(model: StereoModel, points: np.ndarray) -> np.ndarray:
    """(2, n, 2) mm, where the erring camera shows true points (n, 3) m."""
    return np.stack([measured_in(model, k, points) for k in range(len(model.errors))])


def measured_in(model: StereoModel, k: int, points: np.ndarray) -> np.ndarray:
    """(n, 2) mm, where camera k shows true points (n, 3) m; the row that is measured says when it is exposed."""
    errors = model.errors[k]
    xy = errors.measured(ideal(model, k, points))
    for _ in range(0 if model.true.scans is None else ROW_STEPS):
        xy = errors.measured(project(model.true, k, points, xy))
    return xy


def intersect(orientation: Orientation, xy: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points from image coordinates in two photographs, by least squares on the collinearity equations.

    Parameters
    ----------
    xy : (2, n, 2) mm, free of image errors. start : (n, 3) m.

    Returns
    -------
    (n, 3) m, and (2, n, 2) mm, image coordinates less those of the point.
    """
    points = start.copy()
    for _ in range(ITERATIONS):
        partials = _linearised(orientation, points)
        gap = xy.reshape(-1, 2) - partials.prediction
        step = np.einsum("nik,nk->ni", _gain(partials), _by_point(gap))
        points += step
        if np.abs(step).max(initial=0.0) < STEP_TOLERANCE_M:
            break
    return points, (xy.reshape(-1, 2) - _linearised(orientation, points).prediction).reshape(xy.shape)


def covariance_of(model: StereoModel, points: np.ndarray) -> np.ndarray:
    """(n, 3, 3) m², of the deformation at true points (n, 3) m; NaN where not both photographs see a point."""
    out = np.full((len(points), 3, 3), np.nan)
    seen = np.flatnonzero(seen_by_both(model, points))
    for rows, partials in partials_by_parameters(model, points[seen]):
        out[seen[rows]] = partials @ model.covariance @ partials.transpose(0, 2, 1)
    return out


def partials_by_parameters(model: StereoModel, points: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
    """Pieces of the points and (k, 3, p) partials of their deformation by the additional parameters.

    Taken at the true point with the orientation in use: what the deformation itself changes in the geometry is left out
    (a relative effect of d over the principal distance), and how the measured position in d follows d (of |∂d/∂x|).
    """
    moved = bool(model.follows.any())
    for first in range(0, len(points), PIECE):
        rows = slice(first, min(first + PIECE, len(points)))
        true = points[rows]
        at = measured(model, true)
        linear = _linearised(model.used, true)
        by_photo = [errors.partials(at[k]) for k, errors in enumerate(model.errors)]
        if model.true.scans is not None:
            by_photo = [b + _by_motion(model, k, true, at[k]) for k, b in enumerate(by_photo)]
        if moved:
            by_used = np.concatenate([linear.by_orientation, linear.by_interior[:, :, :3]], axis=2)
            by_used = by_used.reshape(2, len(true), 2, 9)
            by_photo = [b - by_used[k] @ model.follows[k] for k, b in enumerate(by_photo)]
        yield rows, _gain(linear) @ np.concatenate(by_photo, axis=1)


def _by_motion(model: StereoModel, k: int, points: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(n, 2, p) partials of rays of photograph k measured at (n, 2) mm by the unknowns of its rolling shutter."""
    rotation, centre, interior, image = _moved(model.true, k, at)
    point, row = np.arange(len(points)), np.full(len(points), k, dtype=np.int64)
    rays = linearise(rotation, centre, points, interior, image, point, row, np.zeros((len(points), 2)))
    return by_motion(model.true, k, at, rays, len(model.covariance))


def _tables(orientation: Orientation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    interior = np.zeros((len(orientation), len(INTERIOR_COLUMNS)))
    interior[:, :3] = orientation.interior
    return np.ascontiguousarray(orientation.rotation), np.ascontiguousarray(orientation.centre), interior


def _linearised(orientation: Orientation, points: np.ndarray) -> RayPartials:
    """Rays of both photographs, the left one's first."""
    n = len(points)
    rotation, centre, interior = _tables(orientation)
    image, point = np.repeat(np.arange(2), n), np.tile(np.arange(n), 2)
    return linearise(rotation, centre, points, interior, image, point, image, np.zeros((2 * n, 2)))


def _gain(partials: RayPartials) -> np.ndarray:
    """(n, 3, 4) partials of the intersected point by x', y', x'', y''."""
    a = _by_point(partials.by_point)
    return np.linalg.solve(a.transpose(0, 2, 1) @ a, a.transpose(0, 2, 1))


def _by_point(rays: np.ndarray) -> np.ndarray:
    """(2n, 2, …) of rays as (n, 4, …) of points."""
    n = len(rays) // 2
    both = rays.reshape(2, n, 2, *rays.shape[2:])
    return np.concatenate([both[0], both[1]], axis=1)
