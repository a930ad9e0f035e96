"""Rules on where points and photographs came to lie."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.ray_status import RayStatus
from aerotri.coordinates.blocks import starts_elsewhere
from aerotri.diagnosis.finding import Finding, doubt, graded, some
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.results.adjusted_block import AdjustedBlock

SOME_BEHIND, MANY_BEHIND = 0.01, 0.10
"""Shares of the rays whose point lies behind the camera or far out: mismatches are few, a wrong block has many."""

FAR = 100.0
"""Distance of a point, in usual distances, from which it is as good as at infinity."""

TURNED_DEG = 45.0
"""Turn of a photograph from its given orientation: no error of a given orientation, but another convention."""

MOVED = 0.5
"""Way from the given position to the adjusted one, in distances to the ground."""


def depths(adjusted: AdjustedBlock) -> np.ndarray:
    """(m,) m, how far in front of its camera the point of every used ray lies; NaN for other rays."""
    rays = adjusted.block.image_points
    rotation = rotation_from_angles(adjusted.images.angles, adjusted.block.rotation)
    reach = adjusted.points.xyz[rays.point] - adjusted.images.centre[rays.image]
    depth = -np.einsum("mi,mi->m", rotation[rays.image, :, 2], reach)
    return np.where(adjusted.rays.status == RayStatus.USED, depth, np.nan)


def usual_distance(adjusted: AdjustedBlock) -> float:
    """m, the median distance of points from their cameras; NaN where nothing was adjusted."""
    depth = depths(adjusted)
    depth = np.abs(depth[np.isfinite(depth)])
    return float(np.median(depth)) if len(depth) else np.nan


def of_depths(adjusted: AdjustedBlock) -> list[Finding]:
    """Points behind a camera, or as good as at infinity."""
    depth, usual = depths(adjusted), usual_distance(adjusted)
    depth = depth[np.isfinite(depth)]
    found = []
    for wrong, words in (
        (depth <= 0.0, "behind the camera"),
        (depth > FAR * usual, f"farther than {FAR:.0f} times the usual distance of {usual:.3g} m"),
    ):
        share = float(wrong.mean()) if len(depth) else 0.0
        value = f"{int(wrong.sum())} of {len(depth)}"
        reason = f"{value} rays lead to points {words}"
        expected = f"below {100 * SOME_BEHIND:.0f} %"
        found += doubt(f"rays to points {words}", value, expected, graded(share, SOME_BEHIND, MANY_BEHIND), reason)
    return found


def of_turns(adjusted: AdjustedBlock) -> list[Finding]:
    """Photographs turned far from their start values: doubtful only, for the result may be right all the same.

    Start values in axes of their own, as those of COLMAP, turn and move with all of the block: that tells nothing.
    """
    if starts_elsewhere(adjusted.block):
        return []
    order = adjusted.block.rotation
    given = rotation_from_angles(adjusted.block.images.angles, order)
    found = rotation_from_angles(adjusted.images.angles, order)
    trace = np.einsum("nij,nij->n", given, found)
    turn = np.degrees(np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)))
    turned = np.flatnonzero(turn > TURNED_DEG)
    if not len(turned):
        return []
    value = f"{len(turned)} of {int(np.isfinite(turn).sum())}"
    angle, names = float(np.median(turn[turned])), some(adjusted.block.images.names[turned])
    reason = f"{value} photographs were turned by about {angle:.0f}° from their start values ({names})"
    expected = f"by less than {TURNED_DEG:.0f}°"
    return doubt("photographs turned from their start values", value, expected, "doubtful", reason)


def of_ways(adjusted: AdjustedBlock) -> list[Finding]:
    """Photographs moved far from their start values; doubtful only, as in `of_turns`."""
    if starts_elsewhere(adjusted.block):
        return []
    way = np.linalg.norm(adjusted.images.centre - adjusted.block.images.centre, axis=1)
    usual = usual_distance(adjusted)
    moved = np.flatnonzero(way > MOVED * usual)
    if not len(moved):
        return []
    value = f"{len(moved)} of {int(np.isfinite(way).sum())}"
    names = some(adjusted.block.images.names[moved])
    reason = (
        f"{value} photographs were moved by up to {way[moved].max():.3g} m from their start values, {usual:.3g} m from "
        f"the ground ({names})"
    )
    expected = f"by less than {MOVED * usual:.3g} m"
    return doubt("photographs moved from their start values", value, expected, "doubtful", reason)
