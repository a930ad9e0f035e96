"""Conditions between object points, as weighted observations.

vertical: the points stand on one plumb line (paper 002: no absolute coordinates are needed, it holds the roll of a
strip); horizontal: same height; height_difference; distance; plane: three unknowns, one residual a point; line: four
unknowns, two residuals a point [D, models.md 1]. Vertical and horizontal relate every point to the first one [C].
The points are unknowns of the border: `columns` give the three shared parameters of each.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from aerotri.conventions import EARTH_RADIUS_M
from aerotri.functional_model.observed_unknowns import Rows

NO_BASIS = (np.zeros(3), np.eye(3))
"""Of conditions that need none."""


@dataclass(frozen=True, eq=False)
class Constraint:
    """One condition.

    Parameters
    ----------
    kind : see the module. label : for tables.
    columns : (p, 3) shared parameters of the points' coordinates, in order.
    extra : shared parameters of its own: three of a plane, four of a line.
    value : m, where the kind has one. sigma : m.
    axes : (3, 3) east, north and up at the place, as columns.
    curved : the heights count from the curved earth (blocks in a local frame of a CRS).
    centre, basis : of plane and line at the start: a point (3,), and directions (3, 3) as rows, the line's direction or
        the plane's normal last.
    """

    kind: str
    label: str
    columns: np.ndarray
    extra: np.ndarray
    value: float
    sigma: float
    axes: np.ndarray
    curved: bool = False
    centre: np.ndarray = field(default_factory=lambda: np.zeros(3))
    basis: np.ndarray = field(default_factory=lambda: np.eye(3))

    @property
    def count(self) -> int:
        """Number of equations."""
        per_point = {"plane": 1, "line": 2}.get(self.kind)
        if per_point:
            return per_point * len(self.columns)
        return (2 if self.kind == "vertical" else 1) * (len(self.columns) - 1)


@dataclass(frozen=True, eq=False)
class ConstraintObservations:
    """All conditions of a block."""

    constraints: tuple[Constraint, ...]

    @property
    def count(self) -> int:
        """Number of equations."""
        return sum(c.count for c in self.constraints)

    def rows(self, centre: np.ndarray, rotation: np.ndarray, shared: np.ndarray) -> Rows:
        """Linearised at the coordinates in `shared`; arguments as of the other observations."""
        parts = [_equations(constraint, shared) for constraint in self.constraints]
        width = max(columns.shape[1] for _, columns, _ in parts)
        gap = np.concatenate([gaps for gaps, _, _ in parts])
        columns = np.concatenate([_padded(c, width, -1) for _, c, _ in parts])
        partial = np.concatenate([_padded(p, width, 0.0) for _, _, p in parts])
        counts = [len(gaps) for gaps, _, _ in parts]
        sigma = np.repeat([c.sigma for c in self.constraints], counts)
        labels = np.repeat(np.array([c.label for c in self.constraints], dtype=object), counts)
        g = len(gap)
        return Rows(
            "constraints", "m", labels, ("",), np.full(g, -1), gap[:, None], 1.0 / sigma[:, None],
            np.zeros((g, 1, 6)), columns, partial[:, None, :],
        )  # fmt: skip


def flat_basis(points: np.ndarray, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Centre (3,) and directions (3, 3, rows) of points (p, 3): a plane's normal or a line's direction comes last."""
    centre = points.mean(axis=0)
    _, _, directions = np.linalg.svd(points - centre)
    return centre, directions if kind == "plane" else directions[[1, 2, 0]]


def _padded(a: np.ndarray, width: int, fill: float) -> np.ndarray:
    if a.shape[1] == width:
        return a
    wide = np.full((len(a), width), fill, a.dtype)
    wide[:, : a.shape[1]] = a
    return wide


def _equations(c: Constraint, shared: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gaps (g,), columns (g, w) and partials (g, w) of one condition."""
    points = shared[c.columns]
    if c.kind in ("plane", "line"):
        return _flat(c, points, shared)
    along = points[1:] - points[0]
    if c.kind == "distance":
        length = np.linalg.norm(along, axis=1)
        directions, gap = along / length[:, None], c.value - length
        pairs = np.arange(1, len(points))
    else:
        axes = c.axes.T[:2] if c.kind == "vertical" else c.axes.T[2:]
        wanted = c.value if c.kind == "height_difference" else 0.0
        across, drop = along @ c.axes[:, :2], np.zeros(len(along))
        if c.curved and c.kind != "vertical":
            drop = np.sum(across**2, axis=1) / (2.0 * EARTH_RADIUS_M)
        gap = (wanted - drop[:, None] - along @ axes.T).ravel()
        directions, pairs = np.tile(axes, (len(along), 1)), np.repeat(np.arange(1, len(points)), len(axes))
        if c.curved and c.kind != "vertical":
            directions = directions + across @ c.axes[:, :2].T / EARTH_RADIUS_M
    columns = np.concatenate([np.broadcast_to(c.columns[0], (len(pairs), 3)), c.columns[pairs]], axis=1)
    return gap, columns, np.concatenate([-directions, directions], axis=1)


def _flat(c: Constraint, points: np.ndarray, shared: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Plane: w − (p0 + p1·u + p2·v) = 0. Line: u − (p0 + p1·w) = 0 and v − (p2 + p3·w) = 0, in the starting basis."""
    u, v, w = c.basis @ (points - c.centre).T
    p, one, zero = shared[c.extra], np.ones_like(u), np.zeros_like(u)
    if c.kind == "plane":
        miss = [w - p[0] - p[1] * u - p[2] * v]
        by_point = [c.basis[2] - p[1] * c.basis[0] - p[2] * c.basis[1]]
        by_extra = [np.column_stack([-one, -u, -v])]
    else:
        miss = [u - p[0] - p[1] * w, v - p[2] - p[3] * w]
        by_point = [c.basis[0] - p[1] * c.basis[2], c.basis[1] - p[3] * c.basis[2]]
        by_extra = [np.column_stack([-one, -w, zero, zero]), np.column_stack([zero, zero, -one, -w])]
    columns = np.concatenate([c.columns, np.broadcast_to(c.extra, (len(points), len(c.extra)))], axis=1)
    partial = [
        np.concatenate([np.broadcast_to(b, (len(points), 3)), e], axis=1)
        for b, e in zip(by_point, by_extra, strict=True)
    ]
    return -np.concatenate(miss), np.tile(columns, (len(miss), 1)), np.concatenate(partial)
