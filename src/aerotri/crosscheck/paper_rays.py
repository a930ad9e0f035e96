"""Rays and antennas of the cross-check's own forward model: the papers' equations and their partials.

Partials come from the complex step [L: Squire & Trapp 1998]: f(x + ih) carries f'(x)·h in its imaginary part without
any difference being formed, so they are exact to rounding and there is no second set of formulas to be wrong.
"""

from __future__ import annotations

import numpy as np

from aerotri.crosscheck.paper_patterns import brown, equidistant, forward_lens

STEP = 1e-30
"""Imaginary step of the partials: they need no difference, so it may be so small that its square vanishes [L: Squire
and Trapp 1998]."""
INTERIOR = ("focal_length_mm", "x0_mm", "y0_mm")
BROWN = ("K1", "K2", "K3", "P1", "P2", "b1", "b2")
LENS = ("k1", "k2", "p1", "p2", "k3", "k4", "q1", "q2", "q3", "sx", "sy", "b1", "b2")
ELEMENTS = (*INTERIOR, *(f"brown.{name}" for name in BROWN), *(f"lens.{name}" for name in LENS), "lens.fisheye")
"""What a ray depends on besides pose, point and the linear patterns, in the order of the arrays here; the last is 1 for
a fisheye, else 0."""

SEQUENCE = {"omega-phi-kappa": (0, 1, 2), "phi-omega-kappa": (1, 0, 2)}
"""Axes in the order in which Rᵀ turns a vector, by the order of the angles: x is 0, y 1, z 2."""


def into_camera(vector: list[np.ndarray], angles: np.ndarray, order: str) -> list[np.ndarray]:
    """Coordinates of an object vector in the camera: turned by the angles one axis after the other.

    Parameters
    ----------
    vector : [X, Y, Z], arrays of any common shape. angles : (..., 3) rad, ω φ κ.
    order : 'omega-phi-kappa' (R = Rx·Ry·Rz) or 'phi-omega-kappa' (R = Ry·Rx·Rz).
    """
    for axis in SEQUENCE[order]:
        i, j = (axis + 1) % 3, (axis + 2) % 3
        cos, sin = np.cos(angles[..., axis]), np.sin(angles[..., axis])
        turned = list(vector)
        turned[i] = cos * vector[i] + sin * vector[j]
        turned[j] = cos * vector[j] - sin * vector[i]
        vector = turned
    return vector


def rotation_matrix(angles: np.ndarray, order: str) -> np.ndarray:
    """(n, 3, 3) camera → object."""
    axes = [[np.full(len(angles), float(i == k)) for i in range(3)] for k in range(3)]
    return np.stack([np.stack(into_camera(axis, angles, order), axis=-1) for axis in axes], axis=1)


def angles_of(rotation: np.ndarray, order: str) -> np.ndarray:
    """(n, 3) rad, ω φ κ of rotation matrices (n, 3, 3)."""
    r = rotation
    if order == "omega-phi-kappa":
        omega, kappa = np.arctan2(-r[:, 1, 2], r[:, 2, 2]), np.arctan2(-r[:, 0, 1], r[:, 0, 0])
        phi = np.arctan2(r[:, 0, 2], np.sqrt(r[:, 0, 0] ** 2 + r[:, 0, 1] ** 2))
    else:
        phi, kappa = np.arctan2(r[:, 0, 2], r[:, 2, 2]), np.arctan2(r[:, 1, 0], r[:, 1, 1])
        omega = np.arctan2(-r[:, 1, 2], np.sqrt(r[:, 1, 0] ** 2 + r[:, 1, 1] ** 2))
    return np.stack([omega, phi, kappa], axis=1)


def predict(
    pose: np.ndarray, mount: np.ndarray | None, point: np.ndarray, elements: np.ndarray, xy: np.ndarray, order: str
) -> tuple[np.ndarray, np.ndarray]:
    """Image coordinates (x, y) of rays without the linear patterns: x = −c·u1/u3 + x0 + d, u = Rᵀ(X − X0).

    Parameters
    ----------
    pose : (..., k, 6) X0, Y0, Z0 (m), ω, φ, κ (rad). mount : (k, 3, 3) or None, a constant rotation after the angles.
    point : (k, 3) m. elements : (..., k, 24) by `ELEMENTS`. xy : (k, 2) mm, the measured position.
    """
    u = into_camera([point[:, axis] - pose[..., axis] for axis in range(3)], pose[..., 3:], order)
    if mount is not None:
        u = [u[0] * mount[:, 0, axis] + u[1] * mount[:, 1, axis] + u[2] * mount[:, 2, axis] for axis in range(3)]
    c, x0, y0 = (elements[..., i] for i in range(3))
    round_lens, fisheye = equidistant(*u), elements[..., -1] != 0.0
    a, b = (np.where(fisheye, e, -t / u[2]) for e, t in zip(round_lens, u[:2], strict=True))
    a, b = forward_lens(a, b, *(elements[..., i] for i in range(10, 23)))
    dx, dy = brown(xy[:, 0] - x0, xy[:, 1] - y0, *(elements[..., i] for i in range(3, 10)))
    return c * a + x0 + dx, c * b + y0 + dy


def linearise(
    pose: np.ndarray,
    mount: np.ndarray | None,
    point: np.ndarray,
    elements: np.ndarray,
    xy: np.ndarray,
    order: str,
    active: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Prediction (k, 2) and its partials by pose (k, 2, 6) and by the `active` elements (k, 2, a).

    The partials by the point are those by X0, Y0, Z0 with the other sign.
    """
    count = 6 + len(active)
    poses = np.repeat(pose[None].astype(complex), count, axis=0)
    varied = np.repeat(elements[None].astype(complex), count, axis=0)
    for direction in range(6):
        poses[direction, :, direction] += 1j * STEP
    for direction, element in enumerate(active):
        varied[6 + direction, :, element] += 1j * STEP
    x, y = predict(poses, mount, point, varied, xy, order)
    partials = np.stack([np.imag(x), np.imag(y)], axis=-1) / STEP
    partials = np.moveaxis(partials, 0, -1)
    return np.stack([x[0].real, y[0].real], axis=-1), partials[:, :, :6], partials[:, :, 6:]


def antenna(pose: np.ndarray, mount: np.ndarray | None, lever_arm: np.ndarray, order: str) -> list[np.ndarray]:
    """Antenna position [X, Y, Z] = X0 + R·lever arm; pose (..., g, 6), mount (g, 3, 3) or None, lever arm (3,) m."""
    count = pose.shape[-2]
    v = [np.full(count, lever_arm[axis]) for axis in range(3)]
    if mount is not None:
        v = [mount[:, axis, 0] * v[0] + mount[:, axis, 1] * v[1] + mount[:, axis, 2] * v[2] for axis in range(3)]
    for axis in SEQUENCE[order][::-1]:
        i, j = (axis + 1) % 3, (axis + 2) % 3
        cos, sin = np.cos(pose[..., 3 + axis]), np.sin(pose[..., 3 + axis])
        turned = list(v)
        turned[i] = cos * v[i] - sin * v[j]
        turned[j] = cos * v[j] + sin * v[i]
        v = turned
    return [pose[..., axis] + v[axis] for axis in range(3)]


def linearise_antenna(
    pose: np.ndarray, mount: np.ndarray | None, lever_arm: np.ndarray, order: str
) -> tuple[np.ndarray, np.ndarray]:
    """Antenna positions (g, 3) and their partials by the pose (g, 3, 6)."""
    poses = np.repeat(pose[None].astype(complex), 6, axis=0)
    for direction in range(6):
        poses[direction, :, direction] += 1j * STEP
    position = np.stack(antenna(poses, mount, lever_arm, order), axis=-1)
    return np.real(position[0]), np.moveaxis(np.imag(position), 0, -1) / STEP
