"""Triangles against a boundary: TIN prisms, and how a volume depends on the corners of a TIN."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from aerotri.volume import _kernels
from aerotri.volume.boundary import Boundary


@dataclass(frozen=True, eq=False)
class Pieces:
    """The parts of triangles inside a boundary.

    Parameters
    ----------
    triangle : (n,) which triangle. area : (n,) m². weights : (n, 3) mean barycentric coordinates over the part.
    whole : (n,) bool, inside as a whole. geometry : (n,) the parts, None where whole.
    """

    triangle: np.ndarray
    area: np.ndarray
    weights: np.ndarray
    whole: np.ndarray
    geometry: np.ndarray


def areas(corners: np.ndarray) -> np.ndarray:
    """(t,) m² of triangles (t, 3, 2), positive."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def cut_to(polygon: BaseGeometry, corners: np.ndarray) -> Pieces:
    """The parts of triangles (t, 3, 2) inside a polygon."""
    shapes = np.asarray(shapely.polygons(np.concatenate([corners, corners[:, :1]], axis=1)))
    shapely.prepare(polygon)
    whole = shapely.contains(polygon, shapes)
    rest = np.flatnonzero(~whole & shapely.intersects(polygon, shapes))
    parts = shapely.intersection(shapes[rest], polygon)
    part_area = shapely.area(parts)
    rest, parts, part_area = rest[part_area > 0.0], parts[part_area > 0.0], part_area[part_area > 0.0]
    middle = shapely.get_coordinates(shapely.centroid(parts))
    inside = np.flatnonzero(whole)
    geometry = np.concatenate([np.full(len(inside), None), parts])
    return Pieces(
        np.concatenate([inside, rest]),
        np.concatenate([areas(corners[inside]), part_area]),
        np.concatenate([np.full((len(inside), 3), 1.0 / 3.0), barycentric(corners[rest], middle)]),
        np.arange(len(geometry)) < len(inside),
        geometry,
    )


def barycentric(corners: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(n, 3) barycentric coordinates of places (n, 2) in triangles (n, 3, 2)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    d = at - corners[:, 0]
    det = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    second = (d[:, 0] * b[:, 1] - d[:, 1] * b[:, 0]) / det
    third = (a[:, 0] * d[:, 1] - a[:, 1] * d[:, 0]) / det
    return np.column_stack([1.0 - second - third, second, third])


def prism_sums(polygon: BaseGeometry, corners: np.ndarray, d: np.ndarray) -> np.ndarray:
    """(5,) sums of the prisms of triangles (t, 3, 2) with differences (t, 3) at their corners, inside a polygon."""
    sums = np.zeros(5)
    if not len(corners):
        return sums
    pieces = cut_to(polygon, corners)
    own = d[pieces.triangle]
    _kernels.add_triangles(np.ascontiguousarray(own[pieces.whole]), pieces.area[pieces.whole], sums)
    mixed = ~pieces.whole & (own.min(axis=1) < 0.0) & (own.max(axis=1) > 0.0)
    plain = ~pieces.whole & ~mixed
    # over a part without a change of sign the mean counts; its area stands for a triangle of that height
    mean = np.sum(own[plain] * pieces.weights[plain], axis=1)
    _kernels.add_triangles(np.ascontiguousarray(np.column_stack([mean] * 3)), pieces.area[plain], sums)
    for k in np.flatnonzero(mixed):
        sums += _split_sums(pieces.geometry[k], corners[pieces.triangle[k]], own[k])
    return sums


def _split_sums(part: BaseGeometry, corners: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Sums of a part of a triangle in which the difference changes its sign."""
    above = _above(corners, d)
    sums = np.zeros(5)
    for sign, shape in ((1.0, above), (-1.0, shapely.difference(part, above))):
        piece = shapely.intersection(part, shape) if sign > 0.0 else shape
        area = float(piece.area)
        if area <= 0.0:
            continue
        middle = shapely.get_coordinates(shapely.centroid(piece))
        height = float(barycentric(corners[None], middle)[0] @ d)
        sums += area * np.array([max(height, 0.0), max(-height, 0.0), sign > 0.0, sign < 0.0, 0.0])
    return sums


def _above(corners: np.ndarray, d: np.ndarray) -> BaseGeometry:
    """The part of a triangle where the linear function is above zero."""
    out = []
    for k in range(3):
        a, b = d[k], d[(k + 1) % 3]
        if a >= 0.0:
            out.append(corners[k])
        if (a > 0.0) != (b > 0.0) and a != b:
            t = a / (a - b)
            if 0.0 < t < 1.0:
                out.append(corners[k] + t * (corners[(k + 1) % 3] - corners[k]))
    return shapely.Polygon(out)


def corner_weights(boundary: Boundary, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How the integral of a TIN depends on its corners.

    Returns
    -------
    triangle : (n,) the triangles that have a part inside.
    weight : (n, 3) m², ∫ of the barycentric coordinates over that part.
    """
    pieces = cut_to(boundary.polygon, corners)
    return pieces.triangle, pieces.area[:, None] * pieces.weights
