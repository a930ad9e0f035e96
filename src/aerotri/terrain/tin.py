"""Triangulated surfaces: of pickets, along breaklines, and what lies between their corners.

Breaklines are honoured by a conforming Delaunay triangulation [L: Shewchuk 1997, segment splitting]: a piece of a
breakline that is no edge is halved until all pieces are, so that no triangle reaches across.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from scipy.spatial import Delaunay, KDTree

from aerotri.adjustment.parallel import blas_threads
from aerotri.conventions import InputError, counted

MOST_ROUNDS = 60
"""Rounds in which pieces of breaklines are halved; chosen [C]: breaklines that cross or touch at narrow angles would
otherwise be halved without end."""
SAME_PLACE_M = 1e-4
"""Points closer than this in plan are one, m; chosen [C]: 0.1 mm is below every measurement, and triangles between such
points have no stable slope."""


@dataclass(frozen=True, eq=False)
class Tin:
    """Triangles over n corners.

    Parameters
    ----------
    origin : (2,) m, taken off the plan coordinates inside. plan : (n, 2) m, z : (n,) m.
    variance, common : (n,) m², what corners have each for itself, and what they share with their neighbours.
    delaunay : of scipy. used : (t,) bool, triangles that count: none of them bridges a hole.
    source : (n,) row of what was triangulated, −1 for points put on breaklines.
    """

    origin: np.ndarray
    plan: np.ndarray
    z: np.ndarray
    variance: np.ndarray
    common: np.ndarray
    delaunay: Delaunay
    used: np.ndarray
    source: np.ndarray

    def interpolate(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Heights (n,) m, their variances (n,) m² from those of the corners, and how far from them, at places (n, 2).

        What is off the surface is NaN. The distance from the corners is 2(1 − Σλ²), λ the weights of the corners: 0 at
        a corner, 1 in the mean of a triangle.
        """
        at = np.asarray(xy, dtype=float) - self.origin
        triangle = self.delaunay.find_simplex(at)
        inside = triangle >= 0
        inside[inside] = self.used[triangle[inside]]
        z, variance, away = (np.full(len(at), np.nan) for _ in range(3))
        if inside.any():
            t = triangle[inside]
            # thousands of 2 × 2 systems: threads of the BLAS gain nothing, and were seen to wait for one another
            with blas_threads(0.0):
                transform = self.delaunay.transform[t]
            two = np.einsum("nij,nj->ni", transform[:, :2], at[inside] - transform[:, 2])
            weight = np.column_stack([two, 1.0 - two.sum(axis=1)])
            corner = self.delaunay.simplices[t]
            z[inside] = np.einsum("ni,ni->n", weight, self.z[corner])
            variance[inside] = np.einsum("ni,ni->n", weight**2, self.variance[corner])
            variance[inside] += np.einsum("ni,ni->n", weight, self.common[corner])
            away[inside] = 2.0 * (1.0 - np.einsum("ni,ni->n", weight, weight))
        return z, variance, away


def triangulate(
    xyz: np.ndarray, variance: np.ndarray | None = None, longest: float = np.inf,
    breaklines: Sequence[np.ndarray] = (), common: np.ndarray | None = None,
) -> Tin:  # fmt: skip
    """The Delaunay triangulation of points.

    Parameters
    ----------
    xyz : (n, 3) m. variance, common : (n,) m² of the heights, see `Tin`; zero unless given.
    longest : m, side of a triangle that is still taken for ground, not for a hole.
    breaklines : (k, 3) m each, heights linear between their corners.

    Raises
    ------
    InputError
    """
    if len(xyz) < 3:
        raise InputError(f"{counted(len(xyz), 'point')} do not make a surface", "measure more ground points (pickets)")
    source = order_in_plan(xyz)
    own = np.zeros(len(xyz)) if variance is None else variance[source]
    shared = np.zeros(len(xyz)) if common is None else common[source]
    origin = xyz[source, :2].mean(axis=0)
    plan, z = xyz[source, :2] - origin, xyz[source, 2]
    if breaklines:
        line_points, segments = _segments([line - [*origin, 0.0] for line in breaklines])
        apart = KDTree(line_points[:, :2]).query(plan)[0] > SAME_PLACE_M
        plan, z, own, shared, source = plan[apart], z[apart], own[apart], shared[apart], source[apart]
        line_points = _conforming(plan, line_points, segments)
        plan, z = np.vstack([plan, line_points[:, :2]]), np.concatenate([z, line_points[:, 2]])
        own = np.concatenate([own, np.zeros(len(line_points))])
        shared = np.concatenate([shared, np.zeros(len(line_points))])
        source = np.concatenate([source, np.full(len(line_points), -1)])
    delaunay = _delaunay(plan)
    corners = plan[delaunay.simplices]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return Tin(origin, plan, z, own, shared, delaunay, sides.max(axis=1) <= longest, source)


def order_in_plan(xyz: np.ndarray) -> np.ndarray:
    """(n,) rows of points (n, 3) by X, then Y, then Z.

    Four points on a circle, as those of a grid are, may be joined either way: which way hangs on their order, and that
    must not be the one of the rows they came in.
    """
    return np.lexsort(xyz.T[::-1])


def corners_in_plan(xyz: np.ndarray) -> np.ndarray:
    """(t, 3) rows of the corners of the Delaunay triangles over points (n, 3)."""
    order = order_in_plan(xyz)
    plan = xyz[order, :2]
    return order[Delaunay(plan - plan.mean(axis=0)).simplices]


def _delaunay(plan: np.ndarray) -> Delaunay:
    from scipy.spatial import QhullError

    try:
        return Delaunay(plan)
    except QhullError as error:
        raise InputError(
            "the points lie on a line and do not make a surface", "measure ground points (pickets) in an area"
        ) from error


def _plan_distance(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.hypot(*(b - a)[:2]))


def _segments(lines: Sequence[np.ndarray]) -> tuple[np.ndarray, list[tuple[int, int]]]:
    """Corners of the lines and of their crossings, (k, 3), and the pieces between them by their numbers."""
    points, pieces = [], []
    for line in lines:
        line = np.asarray(line, dtype=float)
        pieces += [(line[k], line[k + 1]) for k in range(len(line) - 1) if np.hypot(*(line[k + 1] - line[k])[:2]) > 0]
    cuts: list[list[np.ndarray]] = [[] for _ in pieces]
    low = np.array([np.minimum(a, b)[:2] for a, b in pieces])
    high = np.array([np.maximum(a, b)[:2] for a, b in pieces])
    for i in range(len(pieces)):
        near = np.flatnonzero(((low[i + 1 :] <= high[i]) & (high[i + 1 :] >= low[i])).all(axis=1)) + i + 1
        for j in near.tolist():
            crossing = _crossing(pieces[i], pieces[j])
            if crossing is not None:
                cuts[i].append(crossing)
                cuts[j].append(crossing)
    number: dict[tuple[int, int], int] = {}
    segments = []

    def at(point: np.ndarray) -> int:
        key = (round(point[0] / SAME_PLACE_M), round(point[1] / SAME_PLACE_M))
        if key not in number:
            number[key] = len(points)
            points.append(point)
        return number[key]

    for (a, b), between in zip(pieces, cuts, strict=True):
        along = sorted([a, *between, b], key=partial(_plan_distance, a))
        numbers = [at(p) for p in along]
        segments += [(m, n) for m, n in pairwise(numbers) if m != n]
    return np.array(points), segments


def _crossing(one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> np.ndarray | None:
    """Where two pieces cross in plan, its height the mean of both; None where they do not, or run side by side."""
    (a, b), (c, d) = one, other
    u, v, w = (b - a)[:2], (d - c)[:2], (c - a)[:2]
    cross = u[0] * v[1] - u[1] * v[0]
    if abs(cross) < 1e-12 * np.hypot(*u) * np.hypot(*v):
        return None
    s, t = (w[0] * v[1] - w[1] * v[0]) / cross, (w[0] * u[1] - w[1] * u[0]) / cross
    if not (0.0 <= s <= 1.0 and 0.0 <= t <= 1.0):
        return None
    return 0.5 * (a + s * (b - a) + c + t * (d - c))


def _conforming(plan: np.ndarray, points: np.ndarray, segments: list[tuple[int, int]]) -> np.ndarray:
    """The points of breaklines with as many between them as make every piece an edge of the triangulation."""
    put, pieces = list(points), np.array(segments)
    for _ in range(MOST_ROUNDS):
        of_lines = np.array(put)
        delaunay = _delaunay(np.vstack([plan, of_lines[:, :2]]))
        start, neighbours = delaunay.vertex_neighbor_vertices
        missing = np.array([
            not np.isin(b, neighbours[start[a] : start[a + 1]]) for a, b in (pieces + len(plan)).tolist()
        ])  # fmt: skip
        if not missing.any():
            return of_lines
        halves = []
        for a, b in pieces[missing].tolist():
            halves += [(a, len(put)), (len(put), b)]
            put.append(0.5 * (put[a] + put[b]))
        pieces = np.vstack([pieces[~missing], np.array(halves)])
    raise InputError("breaklines run so close together that they cannot be kept apart", "leave out some of them")
