"""Rotations in both angle orders, their partials by the angles, and small rotations about the object axes.

R turns camera coordinates into object coordinates (see `conventions`). Inside the adjustment a rotation is improved by
a vector δ in object axes, R ← exp([δ]×)·R, which has no singular attitude; angles appear only at the two ends.
"""

from __future__ import annotations

import numpy as np

OMEGA_PHI_KAPPA = "omega-phi-kappa"


def _axis_rotation(axis: int, angle: np.ndarray) -> np.ndarray:
    angle = np.asarray(angle, dtype=float)
    matrix = np.zeros((*angle.shape, 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    cos, sin = np.cos(angle), np.sin(angle)
    matrix[..., axis, axis] = 1.0
    matrix[..., i, i] = cos
    matrix[..., j, j] = cos
    matrix[..., i, j] = -sin
    matrix[..., j, i] = sin
    return matrix


def rotation_from_angles(angles: np.ndarray, order: str = OMEGA_PHI_KAPPA) -> np.ndarray:
    """Rotation matrices of (ω, φ, κ).

    Parameters
    ----------
    angles : (..., 3) rad, always in the sequence ω, φ, κ.
    order : 'omega-phi-kappa' (R = Rx·Ry·Rz) or 'phi-omega-kappa' (R = Ry·Rx·Rz).

    Returns
    -------
    (..., 3, 3), camera axes in the object frame as columns.
    """
    angles = np.asarray(angles, dtype=float)
    about_x, about_y, about_z = (_axis_rotation(axis, angles[..., axis]) for axis in range(3))
    first, second = (about_x, about_y) if order == OMEGA_PHI_KAPPA else (about_y, about_x)
    return first @ second @ about_z


def angles_from_rotation(rotation: np.ndarray, order: str = OMEGA_PHI_KAPPA) -> np.ndarray:
    """(ω, φ, κ) of rotation matrices; the middle angle lies in [−π/2, π/2].

    κ is taken once the first angle is undone: where the middle one is ±90° the first may be any, and together they are
    right all the same.

    Parameters
    ----------
    rotation : (..., 3, 3).

    Returns
    -------
    (..., 3) rad in the sequence ω, φ, κ.
    """
    r = np.asarray(rotation, dtype=float)
    if order == OMEGA_PHI_KAPPA:
        omega = np.arctan2(-r[..., 1, 2], r[..., 2, 2])
        phi = np.arctan2(r[..., 0, 2], np.hypot(r[..., 1, 2], r[..., 2, 2]))
        cos, sin = np.cos(omega), np.sin(omega)
        kappa = np.arctan2(cos * r[..., 1, 0] + sin * r[..., 2, 0], cos * r[..., 1, 1] + sin * r[..., 2, 1])
    else:
        omega = np.arctan2(-r[..., 1, 2], np.hypot(r[..., 0, 2], r[..., 2, 2]))
        phi = np.arctan2(r[..., 0, 2], r[..., 2, 2])
        cos, sin = np.cos(phi), np.sin(phi)
        kappa = np.arctan2(sin * r[..., 2, 1] - cos * r[..., 0, 1], cos * r[..., 0, 0] - sin * r[..., 2, 0])
    return np.stack([omega, phi, kappa], axis=-1)


def small_rotation_per_angle(angles: np.ndarray, order: str = OMEGA_PHI_KAPPA) -> np.ndarray:
    """E with δ = E·(dω, dφ, dκ): the axes of the three rotations in the object frame, as columns.

    Parameters
    ----------
    angles : (..., 3) rad.

    Returns
    -------
    (..., 3, 3). Singular where the middle angle is ±90°.
    """
    angles = np.asarray(angles, dtype=float)
    about_x, about_y = _axis_rotation(0, angles[..., 0]), _axis_rotation(1, angles[..., 1])
    e = np.zeros((*angles.shape[:-1], 3, 3))
    if order == OMEGA_PHI_KAPPA:
        e[..., 0, 0] = 1.0
        e[..., :, 1] = about_x[..., :, 1]
        e[..., :, 2] = (about_x @ about_y)[..., :, 2]
    else:
        e[..., :, 0] = about_y[..., :, 0]
        e[..., 1, 1] = 1.0
        e[..., :, 2] = (about_y @ about_x)[..., :, 2]
    return e


def cross_matrix(vector: np.ndarray) -> np.ndarray:
    """[v]× with [v]×·w = v × w; (..., 3) → (..., 3, 3)."""
    v = np.asarray(vector, dtype=float)
    matrix = np.zeros((*v.shape[:-1], 3, 3))
    matrix[..., 0, 1], matrix[..., 0, 2] = -v[..., 2], v[..., 1]
    matrix[..., 1, 0], matrix[..., 1, 2] = v[..., 2], -v[..., 0]
    matrix[..., 2, 0], matrix[..., 2, 1] = -v[..., 1], v[..., 0]
    return matrix


def exponential(delta: np.ndarray) -> np.ndarray:
    """exp([δ]×) by Rodrigues' formula; (..., 3) rad → (..., 3, 3)."""
    delta = np.asarray(delta, dtype=float)
    angle_sq = np.sum(delta * delta, axis=-1)[..., None, None]
    angle = np.sqrt(angle_sq)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 1.0 - angle_sq / 6.0, np.sin(safe) / safe)
    b = np.where(small, 0.5 - angle_sq / 24.0, (1.0 - np.cos(safe)) / safe**2)
    k = cross_matrix(delta)
    return np.eye(3) + a * k + b * (k @ k)


def logarithm(rotation: np.ndarray) -> np.ndarray:
    """δ with exp([δ]×) = R, |δ| ≤ π; (..., 3, 3) → (..., 3) rad.

    By way of the quaternion of largest component, which keeps full accuracy at every angle.
    """
    r = np.asarray(rotation, dtype=float)
    trace = np.trace(r, axis1=-2, axis2=-1)
    diagonal = np.stack([r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]], axis=-1)
    four = np.concatenate([(1.0 + trace)[..., None], 1.0 + 2.0 * diagonal - trace[..., None]], axis=-1)
    largest = np.argmax(four, axis=-1)
    cyc = np.stack([r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]], axis=-1)
    candidates = np.zeros((*r.shape[:-2], 4, 4))
    candidates[..., 0, 0] = four[..., 0]
    candidates[..., 0, 1:] = cyc
    for i in range(3):
        candidates[..., i + 1, 0] = cyc[..., i]
        for j in range(3):
            candidates[..., i + 1, j + 1] = four[..., i + 1] if i == j else r[..., i, j] + r[..., j, i]
    q = np.take_along_axis(candidates, largest[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    q = np.where(q[..., :1] < 0.0, -q, q)
    norm = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(norm, q[..., :1])
    factor = np.where(norm < 1e-8, 2.0, angle / np.where(norm < 1e-8, 1.0, norm))
    return factor * q[..., 1:]
