"""What the plan draws: footprints, strips, points with their σ and w, control points with their differences."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.bench.plain import numbers, texts
from aerotri.bench.records import Records
from aerotri.formats.gis.layers import strips_in
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.precision import plan_ellipses

OF_SPACING = 0.4
"""Semi-axis of a usual ellipse on the plan, over the distance of the points."""
LOWEST = -0.05
"""Cosine that a ray falls by at least to meet the ground [C]: flatter ones end beyond any footprint of use."""


def plan_content(records: Records) -> dict[str, Any]:
    """The plan as lists, by rows of photographs and points; coordinates from `origin` on, m."""
    block, origin = records.block, plan_origin(records)
    roles = np.zeros(len(block.points), dtype=int)
    roles[block.control.point] = np.where(block.control.is_check, 2, 1)
    return {
        "origin": origin.tolist(),
        "images": {
            "name": texts(block.images.names), "strip": texts(block.images.strip),
            "centre": numbers(records.centre - origin, 3), "footprint": numbers(footprints(records) - origin[:2], 2),
        },
        "strips": [
            {"name": str(name), "images": members.tolist()} for name, _, members in strips_in(block, records.centre)
        ],
        "points": {
            "name": texts(block.points), "xyz": numbers(records.xyz - origin, 4), "sigma": numbers(records.sigma, 5),
            "w": numbers(records.largest_w, 3), "role": roles.tolist(), "rays": _ray_counts(block),
        },
        "control": {
            "point": block.control.point.tolist(), "xyz": numbers(block.control.xyz - origin, 4),
            "difference": numbers(records.differences, 5),
        },
    }  # fmt: skip


def ellipse_content(adjusted: AdjustedBlock) -> dict[str, Any]:
    """Error ellipses in plan, one total σ: point, semi-axes in m, azimuth in rad, and how much larger to draw them."""
    a, b, azimuth = plan_ellipses(adjusted.points.total_covariance)
    xy = adjusted.points.xyz[:, :2]
    rows = np.flatnonzero(np.isfinite(a) & np.isfinite(xy).all(axis=1))
    area = float(np.prod(np.ptp(xy[rows], axis=0))) if len(rows) else 1.0
    spacing, middle = np.sqrt(area / max(len(rows), 1)), float(np.median(a[rows])) if len(rows) else 1.0
    return {
        "point": rows.tolist(), "a": numbers(a[rows], 6), "b": numbers(b[rows], 6),
        "azimuth": numbers(azimuth[rows], 4), "k": OF_SPACING * spacing / max(middle, 1e-12),
    }  # fmt: skip


def footprints(records: Records) -> np.ndarray:
    """(n, 4, 2) m, where the corners of every format meet the mean height of its points; NaN where they do not."""
    block, out = records.block, np.full((len(records.centre), 4, 2), np.nan)
    height = ground_heights(records)
    rotation = rotation_from_angles(records.angles, block.rotation)
    for number in range(len(out)):
        camera = block.cameras[block.images.camera[number]]
        (a, b), (x0, y0) = camera.half_format_mm, camera.principal_point_mm
        corners = np.array([[-a, b], [a, b], [a, -b], [-a, -b]]) - [x0, y0]
        rays = np.column_stack([corners, np.full(4, -camera.focal_length_mm)]) @ rotation[number].T
        falls = rays[:, 2] < LOWEST * np.linalg.norm(rays, axis=1)
        if falls.all():
            along = (height[number] - records.centre[number, 2]) / rays[:, 2]
            out[number] = records.centre[number, :2] + along[:, None] * rays[:, :2]
    return out


def ground_heights(records: Records) -> np.ndarray:
    """(n,) m, median height of the points measured in every photograph; of all points where it has none."""
    rays = records.block.image_points
    z = records.xyz[rays.point, 2]
    known = np.isfinite(z)
    out = np.full(len(records.centre), np.median(z[known]) if known.any() else np.nan)
    image, z = rays.image[known], z[known]
    order = np.argsort(image, kind="stable")
    for part in np.split(order, np.flatnonzero(np.diff(image[order])) + 1):
        if len(part):
            out[image[part[0]]] = np.median(z[part])
    return out


def plan_origin(records: Records) -> np.ndarray:
    """(3,) m, whole numbers near the middle of the block, so that few digits are sent."""
    every = np.concatenate([records.xyz, records.centre])
    known = every[np.isfinite(every).all(axis=1)]
    return np.round(np.median(known, axis=0)) if len(known) else np.zeros(3)


def _ray_counts(block: Block) -> list[int]:
    return np.bincount(block.image_points.point, minlength=len(block.points)).tolist()
