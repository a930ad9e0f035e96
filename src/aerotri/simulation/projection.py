"""Which photograph sees which point, and where: ideal and measured image positions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from aerotri.functional_model.additional_parameters.lens import distort
from aerotri.functional_model.rotation import exponential, rotation_from_angles
from aerotri.observations import Camera

Field = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""An image error d: (n,) x, (n,) y in mm → (n, 2) mm."""

SCAN_STEPS = 4
"""Steps to the row in which a ray is exposed [C]: each shrinks the error to some hundredths."""
STEEPEST = 1.4  # rad off the vertical up to which a footprint is searched


@dataclass(frozen=True, eq=False)
class TrueCamera:
    """What the camera really is.

    Parameters
    ----------
    nominal : the camera as the block states it.
    focal_length, x0, y0 : mm.
    lens : (14,) forward lens, in the order of `lens.COLUMNS`.
    scan : (2,) s per mm: a ray at (x, y) is exposed scan·(x, y) after the middle of the readout; 0 for all rows at
        once.
    """

    nominal: Camera
    focal_length: float
    x0: float
    y0: float
    lens: np.ndarray
    scan: np.ndarray


@dataclass(frozen=True, eq=False)
class Motion:
    """Of n photographs while they are read: velocity (n, 3) m/s, object frame; spin (n, 3) rad/s, camera frame."""

    velocity: np.ndarray
    spin: np.ndarray


@dataclass(frozen=True, eq=False)
class Photographs:
    """True orientation of n photographs: centre (n, 3) m, rotation (n, 3, 3), camera (n,) index into cameras.

    motion : while they are read; None without rolling shutters.
    """

    centre: np.ndarray
    rotation: np.ndarray
    camera: np.ndarray
    cameras: tuple[TrueCamera, ...]
    motion: Motion | None = None

    @classmethod
    def of(
        cls, centre: np.ndarray, angles: np.ndarray, order: str, camera: np.ndarray, cameras: Sequence[TrueCamera],
        motion: Motion | None = None,
    ) -> Photographs:  # fmt: skip
        return cls(centre, rotation_from_angles(angles, order), camera, tuple(cameras), motion)

    def during_readout(self, image: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Centres (m, 3) and rotations (m, 3, 3) when the rows of positions `at` (m, 2) mm are exposed."""
        centre, rotation = self.centre[image], self.rotation[image]
        if self.motion is None:
            return centre, rotation
        scan = np.array([camera.scan for camera in self.cameras])[self.camera[image]]
        since = np.sum(scan * np.nan_to_num(at), axis=1)[:, None]
        turn = exponential(self.motion.spin[image] * since)
        return centre + self.motion.velocity[image] * since, rotation @ turn


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays, m of them: image and point (m,) index, xy (m, 2) mm."""

    image: np.ndarray
    point: np.ndarray
    xy: np.ndarray

    def __len__(self) -> int:
        return len(self.image)

    def take(self, which: np.ndarray) -> Rays:
        """The rays of an index or mask."""
        return Rays(self.image[which], self.point[which], self.xy[which])


def project(
    photographs: Photographs, points: np.ndarray, image: np.ndarray, point: np.ndarray, at: np.ndarray | None = None
) -> np.ndarray:
    """Ideal image positions of rays; NaN behind the camera.

    u = Rᵀ(X − X0), x = −c·u1/u3 + x0, y alike; a forward lens acts on the tangents before.

    Parameters
    ----------
    points : (N, 3) m.
    image, point : (m,) index.
    at : (m, 2) mm, positions whose rows say when rays are exposed; the ideal ones unless given.

    Returns
    -------
    (m, 2) mm.
    """
    found = _projected(photographs, points[point], image, np.zeros((len(image), 2)) if at is None else at)
    for _ in range(SCAN_STEPS if at is None and photographs.motion is not None else 0):
        found = _projected(photographs, points[point], image, found)
    return found


def measured_rays(
    photographs: Photographs, points: np.ndarray, ideal: Rays, field: Field
) -> tuple[np.ndarray, np.ndarray]:
    """As `measured_positions` of rays; with a rolling shutter the row that is measured says when a ray is exposed."""
    measured, solved = measured_positions(ideal.xy, field)
    for _ in range(SCAN_STEPS if photographs.motion is not None else 0):
        there = project(photographs, points, ideal.image, ideal.point, measured)
        measured, solved = measured_positions(there, field)
    return measured, solved


def _projected(photographs: Photographs, xyz: np.ndarray, image: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(m, 2) mm of points (m, 3), exposed as the rows of positions `at` (m, 2) are."""
    centre, rotation = photographs.during_readout(image, at)
    u = np.einsum("mji,mj->mi", rotation, xyz - centre)
    depth = np.where(u[:, 2] < 0.0, -u[:, 2], np.nan)
    a, b = u[:, 0] / depth, u[:, 1] / depth
    xy = np.empty((len(image), 2))
    for k, camera in enumerate(photographs.cameras):
        own = np.flatnonzero(photographs.camera[image] == k)
        directions = np.stack([a[own], b[own]], axis=1)
        if camera.lens.any():
            directions = distort(a[own], b[own], camera.lens)
        xy[own] = camera.focal_length * directions + np.array([camera.x0, camera.y0])
    return xy


def visible_rays(photographs: Photographs, points: np.ndarray, reach_mm: Sequence[float]) -> Rays:
    """All rays whose ideal position lies inside the format enlarged by `reach_mm` (per camera, may be negative).

    Candidates come from a KD-tree over the plan: the points within the largest footprint of each photograph.
    """
    if len(points) == 0:
        return Rays(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2)))
    tree = KDTree(points[:, :2])
    half = np.array([c.nominal.half_format_mm for c in photographs.cameras])
    limit = half + np.asarray(reach_mm, dtype=float)[:, None]
    tangent = _largest_tangent(photographs, limit)
    off_vertical = np.arccos(np.clip(photographs.rotation[:, 2, 2], -1.0, 1.0))
    angle = np.minimum(np.arctan(tangent)[photographs.camera] + off_vertical, STEEPEST)
    radius = np.tan(angle) * np.maximum(photographs.centre[:, 2] - points[:, 2].min(), 0.0) * 1.001
    found = tree.query_ball_point(photographs.centre[:, :2], radius)
    image = np.repeat(np.arange(len(found)), [len(f) for f in found])
    point = np.concatenate([np.sort(np.array(f, dtype=np.int64)) for f in found])
    xy = project(photographs, points, image, point)
    inside = np.all(np.abs(xy) <= limit[photographs.camera[image]], axis=1)
    return Rays(image, point, xy).take(inside)


def _largest_tangent(photographs: Photographs, limit: np.ndarray) -> np.ndarray:
    """(c,) tangent of the steepest ray a camera records; a lens that pulls inwards sees further than c says."""
    tangent = (np.hypot(*limit.T) + 0.1) / np.array([c.focal_length for c in photographs.cameras])
    for k, camera in enumerate(photographs.cameras):
        if camera.nominal.is_fisheye:
            tangent[k] = np.tan(min(tangent[k], STEEPEST))
        if camera.lens.any():
            tangent[k] *= 1.3
    return tangent


def measured_positions(ideal: np.ndarray, field: Field, tolerance_mm: float = 1e-12) -> tuple[np.ndarray, np.ndarray]:
    """Solve m = ideal + d(m) by fixed point, d evaluated at the measured position.

    The iteration begins with d at the ideal position, so a point keeps to the tile it ideally lies in as long as that
    tile records it. Where a seam opens a gap no tile records the point: such a ray does not converge and is none.

    Parameters
    ----------
    ideal : (m, 2) mm.
    field : the image error.

    Returns
    -------
    (m, 2) mm and (m,) bool whether the position is a solution.
    """
    measured = ideal.copy()
    active = np.arange(len(ideal))
    for _ in range(60):
        new = ideal[active] + field(measured[active, 0], measured[active, 1])
        change = np.abs(new - measured[active]).max(axis=1, initial=0.0)
        measured[active] = new
        active = active[change > tolerance_mm]
        if len(active) == 0:
            break
    solved = np.ones(len(ideal), bool)
    solved[active] = False
    return measured, solved


def inside_format(xy: np.ndarray, camera: Camera, margin_px: float) -> np.ndarray:
    """(m,) bool: inside the format less a margin."""
    return np.all(np.abs(xy) <= np.array(camera.half_format_mm) - margin_px * camera.pixel_mm, axis=1)
