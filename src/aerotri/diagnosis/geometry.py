"""Rules on where points and photographs came to lie."""

from __future__ import annotations

import numpy as np

from aerotri.diagnosis.left_out import some
from aerotri.diagnosis.reason import Reason, graded
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.statistics.adjusted_block import RAY_STATUS, AdjustedBlock

SOME_BEHIND, MANY_BEHIND = 0.01, 0.10
"""Shares of the rays whose point lies behind the camera or far out: mismatches are few, a wrong block has many."""

FAR = 100.0
"""Distance of a point, in median distances, from which it is as good as at infinity."""

TURNED_DEG = 45.0
"""Turn of a photograph from its given orientation: no error of a given orientation, but another convention."""

MOVED = 0.5
"""Way from the given position to the adjusted one, in distances to the ground."""

MANY_MOVED = 0.5


def depths(adjusted: AdjustedBlock) -> np.ndarray:
    """(m,) m, how far in front of its camera the point of every used ray lies; NaN for other rays."""
    rays = adjusted.block.image_points
    rotation = rotation_from_angles(adjusted.images.angles, adjusted.block.rotation)
    reach = adjusted.points.xyz[rays.point] - adjusted.images.centre[rays.image]
    depth = -np.einsum("mi,mi->m", rotation[rays.image, :, 2], reach)
    return np.where(adjusted.rays.status == RAY_STATUS.index("used"), depth, np.nan)


def of_depths(adjusted: AdjustedBlock) -> list[Reason]:
    """Points behind a camera, or as good as at infinity."""
    depth = depths(adjusted)
    depth = depth[np.isfinite(depth)]
    if not len(depth):
        return []
    reasons = []
    typical = float(np.median(np.abs(depth)))
    for wrong, words in (
        (depth <= 0.0, "behind the camera"),
        (depth > FAR * typical, f"farther than {FAR:.0f} times the usual distance of {typical:.3g} m"),
    ):
        level = graded(float(wrong.mean()), SOME_BEHIND, MANY_BEHIND)
        if level != "accepted":
            reasons.append(Reason(level, f"{int(wrong.sum())} of {len(depth)} rays lead to points {words}"))
    return reasons


def of_given_orientations(adjusted: AdjustedBlock) -> list[Reason]:
    """Photographs turned or moved far away from the orientation given."""
    given, found = adjusted.block.images, adjusted.images
    reasons = []
    turn = _turns(adjusted)
    turned = np.flatnonzero(turn > TURNED_DEG)
    compared = int(np.isfinite(turn).sum())
    if len(turned):
        level = "rejected" if len(turned) > MANY_MOVED * compared else "doubtful"
        angle = float(np.median(turn[turned]))
        reasons.append(
            Reason(level, f"{len(turned)} of {compared} photographs were turned by about {angle:.0f}° from the "
                          f"orientation given ({some(given.names[turned])})")
        )  # fmt: skip
    way = np.linalg.norm(found.centre - given.centre, axis=1)
    typical = float(np.nanmedian(np.abs(depths(adjusted)))) if np.isfinite(depths(adjusted)).any() else np.nan
    moved = np.flatnonzero(way > MOVED * typical)
    compared = int(np.isfinite(way).sum())
    if len(moved):
        level = "rejected" if len(moved) > MANY_MOVED * compared else "doubtful"
        reasons.append(
            Reason(level, f"{len(moved)} of {compared} photographs were moved by up to {way[moved].max():.3g} m from "
                          f"the position given, at {typical:.3g} m from the ground ({some(given.names[moved])})")
        )  # fmt: skip
    return reasons


def _turns(adjusted: AdjustedBlock) -> np.ndarray:
    """(n,) degrees between the given and the adjusted rotation; NaN where there is none of them."""
    order = adjusted.block.rotation
    given = rotation_from_angles(adjusted.block.images.angles, order)
    found = rotation_from_angles(adjusted.images.angles, order)
    trace = np.einsum("nij,nij->n", given, found)
    return np.degrees(np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)))
