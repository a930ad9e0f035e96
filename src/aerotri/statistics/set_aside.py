"""Photographs and points that did not take part, and why: what tables and verdict say of them.

The reason follows from the status of their rays. Where rays were left out for several reasons, the first in the order
of `PHOTOGRAPH_REASONS` or `POINT_REASONS` is given: the geometry before what follows from it.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.ray_status import RAY_STATUS
from aerotri.results.adjusted_block import AdjustedBlock

USED, SET_ASIDE = "used", "set aside"

PHOTOGRAPH_REASONS = {
    "weak photograph": "too weakly tied to the others",
    "no start value": "no start value",
    "weak point": "its points are not fixed by their rays",
    "removed": "nearly all its rays contradict the block",
    "contradicting mark": "nearly all its rays contradict the block",
    "off": "its rays are switched off",
    "one ray": "no point in common with another photograph",
    "not finite": "its rays are not finite",
}
"""Why a photograph is left out, by the status of its rays."""

POINT_REASONS = {
    "weak point": "its rays do not fix it in distance",
    "weak photograph": "measured in photographs that are too weakly tied",
    "removed": "its rays contradict each other",
    "contradicting mark": "its rays contradict each other",
    "no start value": "its rays do not intersect, or its photographs have no start value",
    "off": "switched off",
    "one ray": "measured in one photograph only",
    "not finite": "its rays are not finite",
}
"""Why a point is left out, by the status of its rays."""


def photograph_reasons(adjusted: AdjustedBlock) -> np.ndarray:
    """(n,) str why a photograph was set aside, '' where it was adjusted."""
    taken = np.isfinite(adjusted.images.centre[:, 0])
    return _reasons(adjusted, adjusted.block.image_points.image, taken, PHOTOGRAPH_REASONS, "no image points")


def point_reasons(adjusted: AdjustedBlock) -> np.ndarray:
    """(N,) str why a point was set aside, '' where it was adjusted."""
    taken = np.isfinite(adjusted.points.xyz[:, 0])
    return _reasons(adjusted, adjusted.block.image_points.point, taken, POINT_REASONS, "not measured")


def status_columns(reasons: np.ndarray) -> dict[str, np.ndarray]:
    """The columns `status` and `reason` of a table."""
    return {"status": np.where(reasons == "", USED, SET_ASIDE), "reason": reasons}


def counts_by_reason(reasons: np.ndarray) -> dict[str, int]:
    """How many were set aside for each reason."""
    names, counts = np.unique(reasons[reasons != ""], return_counts=True)
    return {str(name): int(count) for name, count in zip(names, counts, strict=True)}


def _reasons(
    adjusted: AdjustedBlock, owner: np.ndarray, taken: np.ndarray, reasons: dict[str, str], nothing: str
) -> np.ndarray:
    """(k,) reasons of photographs or points; owner : (m,) which one a ray belongs to."""
    found = np.where(taken, "", nothing).astype(object)
    for status, reason in reversed(reasons.items()):
        own = np.zeros(len(taken), dtype=bool)
        own[owner[adjusted.rays.status == RAY_STATUS.index(status)]] = True
        found[own & ~taken] = reason
    return found
