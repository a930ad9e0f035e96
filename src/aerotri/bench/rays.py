"""The table of rays, the worst first, and the rays of one point or photograph."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.bench.plain import number, numbers
from aerotri.bench.records import Records, pixels_of_rays

MOST_ROWS = 500
"""Rows of a table sent at once."""


def order_of_rays(records: Records) -> np.ndarray:
    """(m,) rows, the largest |w| first, those without a test last."""
    return np.argsort(-np.nan_to_num(records.size, nan=-1.0), kind="stable")


def chosen_rays(
    records: Records, order: np.ndarray, image: int | None = None, point: int | None = None, text: str = ""
) -> np.ndarray:
    """(k,) of the rows in order: those of a photograph, of a point, or with a text in one of their names."""
    rays = records.block.image_points
    keep = np.ones(len(order), dtype=bool)
    if image is not None:
        keep &= rays.image[order] == image
    if point is not None:
        keep &= rays.point[order] == point
    if text:
        images, points = (
            np.array([text.lower() in str(name).lower() for name in names.tolist()], dtype=bool)
            for names in (records.block.images.names, records.block.points)
        )
        keep &= images[rays.image[order]] | points[rays.point[order]]
    return order[keep]


def ray_rows(records: Records, rows: np.ndarray) -> dict[str, Any]:
    """Columns of rays: position and residual in pixels of the photograph, row down."""
    rays = records.block.image_points
    measured = pixels_of_rays(records.block, rows, rays.xy[rows])
    adjusted = pixels_of_rays(records.block, rows, rays.xy[rows] + records.v[rows])
    return {
        "ray": rows.tolist(), "image": rays.image[rows].tolist(), "point": rays.point[rows].tolist(),
        "px": numbers(measured, 3), "v": numbers(adjusted - measured, 3), "w": numbers(records.w[rows], 2),
        "size": numbers(records.size[rows], 2), "weight": numbers(records.weight[rows], 3),
        "status": [str(one) for one in records.status[rows].tolist()],
    }  # fmt: skip


def point_content(records: Records, point: int) -> dict[str, Any]:
    """A point with its coordinates, σ and rays."""
    rows = np.flatnonzero(records.block.image_points.point == point)
    control = np.flatnonzero(records.block.control.point == point)
    given = None if not len(control) else {
        "xyz": numbers(records.block.control.xyz[control[0]], 4),
        "is_check": bool(records.block.control.is_check[control[0]]),
        "difference": numbers(records.differences[control[0]], 4),
    }  # fmt: skip
    return {
        "point": point, "name": str(records.block.points[point]), "xyz": numbers(records.xyz[point], 4),
        "sigma": numbers(records.sigma[point], 4), "w": number(records.largest_w[point], 2), "given": given,
        "rays": ray_rows(records, rows),
    }  # fmt: skip
