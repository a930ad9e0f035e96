"""Rules on what did not take part: photographs, points, rays left out."""

from __future__ import annotations

import numpy as np

from aerotri.diagnosis.reason import Reason, graded
from aerotri.statistics.adjusted_block import RAY_STATUS, AdjustedBlock

SOME_PHOTOGRAPHS, MANY_PHOTOGRAPHS = 0.02, 0.25
SOME_POINTS, MANY_POINTS = 0.05, 0.30
"""Shares left out. A few per cent of mismatched points are usual in automatic measurements, photographs are not."""


def of_photographs(adjusted: AdjustedBlock) -> list[Reason]:
    """Photographs with image points that were not adjusted."""
    measured = np.unique(adjusted.block.image_points.image)
    gone = measured[~np.isfinite(adjusted.images.centre[measured, 0])]
    level = graded(len(gone) / max(len(measured), 1), SOME_PHOTOGRAPHS, MANY_PHOTOGRAPHS)
    if level == "accepted":
        return []
    names = adjusted.block.images.names[gone]
    return [Reason(level, f"{len(gone)} of {len(measured)} photographs were left out ({some(names)})")]


def of_points(adjusted: AdjustedBlock) -> list[Reason]:
    """Points measured in two photographs or more that were not adjusted; not those that the operator took out."""
    rays, status = adjusted.block.image_points, adjusted.rays.status
    asked = status != RAY_STATUS.index("off")
    pairs = np.unique(np.column_stack([rays.point[asked], rays.image[asked]]), axis=0)
    measured = np.flatnonzero(np.bincount(pairs[:, 0], minlength=len(adjusted.block.points)) >= 2)
    gone = measured[~np.isfinite(adjusted.points.xyz[measured, 0])]
    level = graded(len(gone) / max(len(measured), 1), SOME_POINTS, MANY_POINTS)
    if level == "accepted":
        return []
    names = adjusted.block.points[gone]
    return [Reason(level, f"{len(gone)} of {len(measured)} measured points were left out ({some(names)})")]


def some(names: np.ndarray) -> str:
    """The first few names."""
    return ", ".join(str(name) for name in names[:3]) + (" …" if len(names) > 3 else "")
