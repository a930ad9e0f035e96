"""Geometry of the four tilted heads of the DMC, in the quadrant x > 0, y > 0 of the virtual image.

[D] R_H = Ry(−sx·16°)·Rx(+sy·11°), head → camera: this order of the angles covers the quadrant with more than 1 mm to
spare. The other three heads are mirror images, so one head serves all: fold a position to (|x|, |y|), compute, mirror
the vector back.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from aerotri.functional_model.rotation import rotation_from_angles

TILT_ACROSS, TILT_ALONG = np.radians(16.0), np.radians(11.0)
"""Tilts of a head, rad: with 16° and 11° the four heads cover the virtual image with 1.2 mm to spare [D]."""
HALF_FORMAT_MM = (7168 * 0.012 / 2.0, 4096 * 0.012 / 2.0)
"""Half the format of a head: 7168 × 4096 px of 12 µm."""


@cache
def head_rotation() -> np.ndarray:
    """(3, 3) head → camera of the head that sees x > 0, y > 0."""
    return rotation_from_angles(np.array([TILT_ALONG, -TILT_ACROSS, 0.0]), "phi-omega-kappa")


def in_head(x: np.ndarray, y: np.ndarray, f: float) -> np.ndarray:
    """(n, 2) mm, position (ξ, η) in the plane of the head of a position (n,) of the virtual image; f for both, mm."""
    u = np.stack([x, y, np.full_like(x, -f)], axis=-1) @ head_rotation()
    return -f * u[:, :2] / u[:, 2:]


def _in_camera(xi_eta: np.ndarray, f: float) -> np.ndarray:
    """(n, 3) direction of (ξ, η) in the camera frame."""
    rotation = head_rotation()
    return xi_eta @ rotation[:, :2].T - f * rotation[:, 2]


def jacobian(xi_eta: np.ndarray, f: float) -> np.ndarray:
    """(n, 2, 2) J_H = ∂(x, y)/∂(ξ, η)."""
    rotation, w = head_rotation(), _in_camera(xi_eta, f)
    third = w[:, 2, None, None]
    return -f * (rotation[:2, :2] / third - w[:, :2, None] * rotation[2, :2] / third**2)


def _jacobian_slope(xi_eta: np.ndarray, f: float) -> np.ndarray:
    """(n, 2, 2, 2) ∂²(x, y)/∂(ξ, η)², the last two axes symmetric."""
    rotation, w = head_rotation(), _in_camera(xi_eta, f)
    third = w[:, 2, None, None, None]
    first, second = rotation[:2, :, None] * rotation[2, None, :2], rotation[2, :2, None] * rotation[2, None, :2]
    mixed = first[:, :2] + first[:, :2].transpose(0, 2, 1)
    return -f * (2.0 * w[:, :2, None, None] * second / third**3 - mixed / third**2)


def carried(
    xi_eta: np.ndarray, f: float, h: np.ndarray, slope: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray | None]:
    """A displacement in the plane of the head as it appears in the virtual image, J_H·h, and its partials.

    Parameters
    ----------
    xi_eta : (n, 2) mm.
    h : (n, 2) mm in the head.
    slope : (n, 2, 2) ∂h/∂(ξ, η), where the partials are wanted.

    Returns
    -------
    (n, 2) mm, and (n, 2, 2) its derivative by x and y or None.
    """
    j = jacobian(xi_eta, f)
    value = np.einsum("nab,nb->na", j, h)
    if slope is None:
        return value, None
    by_head = np.einsum("nabc,nb->nac", _jacobian_slope(xi_eta, f), h) + j @ slope
    return value, by_head @ np.linalg.inv(j)


def turning(xi_eta: np.ndarray, f: float) -> np.ndarray:
    """(n, 2, 3) displacement in the plane of the head per radian of its three rotations."""
    xi, eta = xi_eta.T
    gx = np.stack([xi * eta / f, xi**2 / f + f, -eta], axis=-1)
    gy = np.stack([eta**2 / f + f, xi * eta / f, xi], axis=-1)
    return np.stack([gx, gy], axis=1)


def turning_slope(xi_eta: np.ndarray, f: float) -> np.ndarray:
    """(n, 2, 3, 2) derivative of `turning` by ξ and η."""
    xi, eta = xi_eta.T / f
    slope = np.zeros((len(xi_eta), 2, 3, 2))
    slope[:, 0, 0] = slope[:, 1, 1] = np.stack([eta, xi], axis=-1)
    slope[:, 0, 1, 0], slope[:, 1, 0, 1] = 2.0 * xi, 2.0 * eta
    slope[:, 0, 2, 1], slope[:, 1, 2, 0] = -1.0, 1.0
    return slope
