"""A start that is not the solution: orientations displaced at random, object points intersected anew from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SEED = 20
"""Of the displacements: any will do, a fixed one gives the same run each time."""
CENTRE_M, ANGLE_RAD = 1.0, 1e-3
"""How far the start is off; at close range a centre no more than the angle's effect at the object."""
MIN_INTERSECTION = 1e-5
"""Smallest eigenvalue of an intersection's normal matrix per ray, sin² of half the angle between the rays."""


@dataclass(frozen=True, eq=False)
class Displacement:
    """Random changes of n photographs: centres (n, 3) m, angles (n, 3) rad."""

    centre: np.ndarray
    angles: np.ndarray


def displacement(distance: float, count: int, seed: int = SEED) -> Displacement:
    """Normal changes of 1 m and 1 mrad.

    Parameters
    ----------
    distance : m, typical distance from a photograph to its points.
    """
    rng = np.random.default_rng(seed)
    size = min(CENTRE_M, ANGLE_RAD * distance)
    return Displacement(size * rng.normal(size=(count, 3)), ANGLE_RAD * rng.normal(size=(count, 3)))


def typical_distance(centre: np.ndarray, points: np.ndarray, image: np.ndarray, point: np.ndarray) -> float:
    """m, the median over the rays."""
    return float(np.median(np.linalg.norm(points[point] - centre[image], axis=1)))


def intersect(
    centre: np.ndarray,
    rotation: np.ndarray,
    rays: tuple[np.ndarray, np.ndarray, np.ndarray],
    known: np.ndarray,
    shift: float,
) -> np.ndarray:
    """Object points nearest to their rays.

    Parameters
    ----------
    centre : (n, 3) m; rotation : (n, 3, 3) camera → object.
    rays : image, point (m,) and tangent (m, 2) of the direction in the camera frame.
    known : (P, 3) m, taken with a displacement of `shift` m where the rays meet at too small an angle or behind.
    """
    image, point, tangent = rays
    direction = np.column_stack([tangent, -np.ones(len(tangent))])
    ray = np.einsum("mij,mj->mi", rotation[image], direction)
    ray /= np.linalg.norm(ray, axis=1)[:, None]
    across = np.eye(3) - ray[:, :, None] * ray[:, None, :]
    normal, right = np.zeros((len(known), 3, 3)), np.zeros((len(known), 3))
    np.add.at(normal, point, across)
    np.add.at(right, point, np.einsum("mij,mj->mi", across, centre[image]))
    count = np.bincount(point, minlength=len(known))
    good = np.linalg.eigvalsh(normal)[:, 0] > MIN_INTERSECTION * count
    found = known + shift * np.random.default_rng(SEED).normal(size=known.shape)
    found[good] = np.linalg.solve(normal[good], right[good][:, :, None])[:, :, 0]
    behind = np.einsum("mi,mi->m", found[point] - centre[image], ray) < 0.0
    wrong = np.bincount(point, weights=behind, minlength=len(known)) > 0
    found[wrong] = known[wrong]
    return found


def spread_points(points: np.ndarray, rays: np.ndarray) -> list[tuple[int, int]]:
    """Seven coordinates whose holding fixes a free block's datum: (row, axis) pairs.

    All of the two ends of a long distance, and of the point farthest off their line the axis nearest to the normal of
    the three.

    Parameters
    ----------
    points : (P, 3) m; rays : (P,) rays of each.
    """
    rows = np.flatnonzero(rays >= min(3, int(rays.max())))
    middle = np.median(points[rows], axis=0)
    reach = np.linalg.norm(points[rows] - middle, axis=1)
    rows = rows[reach <= 3.0 * np.median(reach) + 1e-9]
    xyz = points[rows]
    a = int(np.argmax(np.linalg.norm(xyz - middle, axis=1)))
    b = int(np.argmax(np.linalg.norm(xyz - xyz[a], axis=1)))
    normal = np.cross(xyz - xyz[a], xyz[b] - xyz[a])
    c = int(np.argmax(np.linalg.norm(normal, axis=1)))
    ends = [(int(rows[end]), axis) for end in (a, b) for axis in range(3)]
    return [*ends, (int(rows[c]), int(np.argmax(np.abs(normal[c]))))]
