"""Which reading of a rotation is right: object points are intersected with each, and the image points decide."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import brown, lens
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Block, Camera
from aerotri.observations.block import BROWN_NAMES

WEAKEST = 1e-6
"""Smallest eigenvalue of the intersection's normal matrix per ray: rays that meet under 0.1° say nothing of a point."""
CLEAR = 0.5
"""The right reading has a median residual less than this part of any other's."""
FEWEST = 4
"""Rays to intersected points without which nothing is settled."""
SAMPLE = 20000
"""Object points of which the fit of start values is stated where there are more [C]: the median of their rays is known
to a per cent."""


@dataclass(frozen=True, eq=False)
class Reprojection:
    """How image points fit orientations, the object points intersected from them.

    Parameters
    ----------
    points : (N, 3) m, NaN where rays do not meet.
    residual_px : (m,) distance of measured and predicted position in pixels, NaN where there is no point.
    offset_px : (m, 2) measured less predicted position in x and y, pixels; NaN likewise, and behind the photograph.
    """

    points: np.ndarray
    residual_px: np.ndarray
    offset_px: np.ndarray

    @property
    def count(self) -> int:
        """Rays with a residual."""
        return int(np.isfinite(self.residual_px).sum())

    @property
    def median_px(self) -> float:
        """NaN without residuals."""
        return float(np.nanmedian(self.residual_px)) if self.count else float("nan")


def ideal_tangents(block: Block) -> np.ndarray:
    """(m, 2) directions −u/w of the image points, freed of the principal point and the lens their camera states."""
    rays = block.image_points
    tangent = np.empty_like(rays.xy)
    of_camera = block.images.camera[rays.image]
    for number, camera in enumerate(block.cameras):
        own = of_camera == number
        tangent[own] = _tangents(camera, rays.xy[own])
    return tangent


def _tangents(camera: Camera, xy: np.ndarray) -> np.ndarray:
    bar = xy - np.array(camera.principal_point_mm)
    values = np.array([camera.brown[name].value if name in camera.brown else 0.0 for name in BROWN_NAMES])
    distorted = (bar - brown.image_error(bar[:, 0], bar[:, 1], values)) / camera.focal_length_mm
    # a lens of impossible values has no ideal direction: the residual is then not known
    return lens.undistort(distorted, lens.vector_of(camera))


def reproject(block: Block, centre: np.ndarray, rotation: np.ndarray) -> Reprojection:
    """Intersect all points from given orientations and compare.

    Parameters
    ----------
    block : its image points and cameras.
    centre : (n, 3) m; rotation : (n, 3, 3), NaN for photographs without orientation.
    """
    rays, tangent = block.image_points, ideal_tangents(block)
    known = np.asarray(np.isfinite(centre).all(axis=1) & np.isfinite(rotation).all(axis=(1, 2)))
    residual = np.full(len(rays), np.nan)
    if not known.any() or not len(rays):
        return Reprojection(np.full((len(block.points), 3), np.nan), residual, np.full((len(rays), 2), np.nan))
    origin = centre[known].mean(axis=0)
    use = np.flatnonzero(known[rays.image])
    image, point = rays.image[use], rays.point[use]
    reduced = centre[image] - origin
    points = _intersected(reduced, rotation[image], tangent[use], point, len(block.points))
    u = np.einsum("mji,mj->mi", rotation[image], points[point] - reduced)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        off = tangent[use] + u[:, :2] / u[:, 2:]
    scale = np.array([camera.focal_length_mm / camera.pixel_mm for camera in block.cameras])
    off *= scale[block.images.camera[image]][:, None]
    found = np.linalg.norm(off, axis=1)
    # a point behind the camera fits no image
    residual[use] = np.where(u[:, 2] < 0.0, found, np.where(np.isnan(u[:, 2]), np.nan, np.inf))
    offset = np.full((len(rays), 2), np.nan)
    offset[use] = np.where(u[:, 2:] < 0.0, off, np.nan)
    return Reprojection(points + origin, residual, offset)


def _intersected(
    centre: np.ndarray, rotation: np.ndarray, tangent: np.ndarray, point: np.ndarray, count: int
) -> np.ndarray:
    """(N, 3) points nearest to their rays in space, NaN where fewer than two rays meet under a real angle."""
    direction = np.einsum("mij,mj->mi", rotation, np.column_stack([tangent, -np.ones(len(tangent))]))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    across = np.eye(3) - direction[:, :, None] * direction[:, None, :]
    right = np.einsum("mij,mj->mi", across, centre)
    normal_sum, right_sum = np.zeros((count, 3, 3)), np.zeros((count, 3))
    for i in range(3):
        right_sum[:, i] = np.bincount(point, weights=right[:, i], minlength=count)
        for j in range(3):
            normal_sum[:, i, j] = np.bincount(point, weights=across[:, i, j], minlength=count)
    rays = np.bincount(point, minlength=count)
    finite = np.isfinite(normal_sum).all(axis=(1, 2)) & np.isfinite(right_sum).all(axis=1)
    there = np.flatnonzero((rays > 1) & finite)
    weakest = np.linalg.eigvalsh(normal_sum[there])[:, 0]
    there = there[weakest > WEAKEST * rays[there]]
    points = np.full((count, 3), np.nan)
    points[there] = np.linalg.solve(normal_sum[there], right_sum[there][:, :, None])[:, :, 0]
    return points


def settle(block: Block, centre: np.ndarray, choices: dict[str, np.ndarray], remedy: str) -> tuple[str, str]:
    """The reading of the rotations that the image points confirm.

    Parameters
    ----------
    block : image points and cameras; centre : (n, 3) m.
    choices : rotations (n, 3, 3) by the name of the reading, two or more.
    remedy : how the user can state it.

    Returns
    -------
    name : of the reading.
    message : how it was settled.

    Raises
    ------
    InputError
        When there are too few rays, or none of the readings is clearly better than the others.
    """
    found = {name: reproject(block, centre, rotation) for name, rotation in choices.items()}
    if min(result.count for result in found.values()) < FEWEST:
        raise InputError(
            f"the rotations may be {' or '.join(choices)}: too few points are measured in several photographs to tell",
            remedy,
        )
    median = {name: result.median_px for name, result in found.items()}
    best, second = sorted(median, key=lambda name: median[name])[:2]
    told = ", ".join(
        f"{name} " + (f"{median[name]:.3g} px" if np.isfinite(median[name]) else "has the points behind the camera")
        for name in sorted(median, key=lambda name: median[name])
    )
    if not median[best] < CLEAR * median[second]:
        raise InputError(
            f"the rotations may be read in several ways, and none fits the image points clearly better ({told})", remedy
        )
    return best, f"rotations are {best}, by the median residual of the image points: {told}"


def sample_of_points(block: Block, most: int = SAMPLE) -> np.ndarray:
    """Rays (indices) of a sample of the object points, spread evenly over the rays; every photograph takes part.

    All rays where there are no more than `most` points; up to one point more for every photograph.
    """
    rays = block.image_points
    if len(block.points) <= most:
        return np.arange(len(rays))
    chosen = np.zeros(len(block.points), bool)
    chosen[rays.point[np.linspace(0, len(rays) - 1, most).astype(np.int64)]] = True
    first = np.full(len(block.images), -1)
    first[rays.image[::-1]] = np.arange(len(rays))[::-1]
    chosen[rays.point[first[first >= 0]]] = True
    return np.flatnonzero(chosen[rays.point])


def residuals_at_start(block: Block) -> Reprojection:
    """How image points fit the start values of a block in local coordinates."""
    rotation = rotation_from_angles(block.images.angles, block.rotation)
    return reproject(block, block.images.centre, rotation)


def control_at_start(block: Block) -> np.ndarray:
    """(k,) residuals in pixels of the image points of fully known control and check points at the start values."""
    rays, control = block.image_points, block.control
    known = np.full((len(block.points), 3), np.nan)
    known[control.point] = control.xyz
    rotation = rotation_from_angles(block.images.angles, block.rotation)
    u = np.einsum("mji,mj->mi", rotation[rays.image], known[rays.point] - block.images.centre[rays.image])
    own = np.isfinite(u).all(axis=1) & (u[:, 2] < 0.0)
    scale = np.array([camera.focal_length_mm / camera.pixel_mm for camera in block.cameras])
    off = ideal_tangents(block)[own] + u[own, :2] / u[own, 2:]
    return np.linalg.norm(off, axis=1) * scale[block.images.camera[rays.image[own]]]
