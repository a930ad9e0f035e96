"""The vector x of the independent adjustment: where things stand in it, its start, what is held."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.crosscheck.paper_block import PaperBlock
from aerotri.crosscheck.paper_rays import angles_of, rotation_matrix
from aerotri.crosscheck.start import displacement, intersect, spread_points, typical_distance

QUARTER_ABOUT_X = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""A quarter turn about x: it takes a middle angle of ±90°, where the other two cannot be told apart, to where they
can."""
STEEP_COSINE = 0.3
"""Cosine of the middle angle below which the turn is put before it [C]: within 17° of ±90°. The angles are
differentiable beyond, but the nearer they are, the worse is the condition."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Places in x: `poses` (n, 6), `shared` (s,), `points` (P, 3).

    Parameters
    ----------
    active : elements of `paper_rays.ELEMENTS` that some setup estimates.
    mount : (n, 3, 3) constant rotation after the angles of each photograph, None where no photograph needs one.
    free : (N,) bool.
    """

    poses: np.ndarray
    shared: np.ndarray
    points: np.ndarray
    active: np.ndarray
    mount: np.ndarray | None
    free: np.ndarray


@dataclass(frozen=True, eq=False)
class KnownSolution:
    """The solution to be checked, for the datum and as the place that the start is displaced from.

    Parameters
    ----------
    centre : (n, 3) m local; angles : (n, 3) rad; points : (P, 3) m local; rows as in the `PaperBlock`.
    held_poses : (n, 6) bool, elements that the block's datum holds.
    datum_free : whether seven coordinates have to be held.
    """

    centre: np.ndarray
    angles: np.ndarray
    points: np.ndarray
    held_poses: np.ndarray
    datum_free: bool


def lay_out(paper: PaperBlock, known: KnownSolution) -> tuple[Layout, np.ndarray]:
    """The layout and a start away from the known solution.

    Additional parameters start from the block's own values. A free datum is fixed by holding seven point coordinates at
    the known values: any such choice gives the same block.
    """
    n, s, p = len(paper.images), len(paper.shared.names), len(paper.points)
    poses, shared = np.arange(6 * n).reshape(n, 6), 6 * n + np.arange(s)
    points = 6 * n + s + np.arange(3 * p).reshape(p, 3)
    mount, angles = _mounts(known, paper.order)
    free = np.ones(6 * n + s + 3 * p, dtype=bool)
    free[poses[known.held_poses]] = False
    free[shared] = paper.shared.free
    active = np.flatnonzero(paper.shared.free[paper.rays.elements].any(axis=0))
    layout = Layout(poses, shared, points, active, mount, free)
    distance = typical_distance(known.centre, known.points, paper.rays.image, paper.rays.point)
    moved = displacement(distance, n)
    start = np.zeros(len(free))
    start[poses[:, :3]] = known.centre + np.where(known.held_poses[:, :3], 0.0, moved.centre)
    start[poses[:, 3:]] = angles + np.where(known.held_poses[:, 3:], 0.0, moved.angles)
    start[shared] = paper.shared.start
    start[points] = np.where(paper.point_held, paper.point_value, _start_points(paper, layout, start, known, distance))
    free[points[paper.point_held]] = False
    if known.datum_free:
        for row, axis in spread_points(known.points, np.bincount(paper.rays.point, minlength=p)):
            free[points[row, axis]] = False
            start[points[row, axis]] = known.points[row, axis]
    return layout, start


def _mounts(known: KnownSolution, order: str) -> tuple[np.ndarray | None, np.ndarray]:
    """Constant rotations that keep the middle angle away from ±90°, and the angles before them."""
    middle = 1 if order == "omega-phi-kappa" else 0
    steep = (np.abs(np.cos(known.angles[:, middle])) < STEEP_COSINE) & ~known.held_poses[:, 3:].any(axis=1)
    if not steep.any():
        return None, known.angles
    mount = np.where(steep[:, None, None], QUARTER_ABOUT_X, np.eye(3))
    rotation = rotation_matrix(known.angles, order) @ np.swapaxes(mount, 1, 2)
    return mount, np.where(steep[:, None], angles_of(rotation, order), known.angles)


def _start_points(paper: PaperBlock, layout: Layout, start: np.ndarray, known: KnownSolution, distance: float):
    """(P, 3) m, intersected from the displaced orientations; the lens is not yet known."""
    elements = start[layout.shared[paper.rays.elements]][paper.rays.setup]
    tangent = (paper.rays.xy - elements[:, 1:3]) / elements[:, :1]
    rays = (paper.rays.image, paper.rays.point, tangent)
    rotation = rotations(layout, start, paper.order)
    return intersect(start[layout.poses[:, :3]], rotation, rays, known.points, 1e-3 * distance)


def rotations(layout: Layout, x: np.ndarray, order: str) -> np.ndarray:
    """(n, 3, 3) camera → object at x."""
    turned = rotation_matrix(x[layout.poses[:, 3:]], order)
    return turned if layout.mount is None else turned @ layout.mount
