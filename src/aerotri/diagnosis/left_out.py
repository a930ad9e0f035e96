"""Rules on what did not take part: photographs, points and rays left out, and on points that should be."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.ray_status import RayStatus
from aerotri.diagnosis.finding import Finding, doubt, graded, some
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.loose_points import loose_points

SOME_PHOTOGRAPHS, MANY_PHOTOGRAPHS = 0.02, 0.25
"""Shares left out from which there is some doubt, and serious doubt [C]: a lost photograph is a gap in the block."""
SOME_POINTS, MANY_POINTS = 0.10, 0.40
"""Shares left out likewise [C]: mismatched points are usual in automatic measurements."""
SOME_RAYS, MANY_RAYS = 0.15, 0.40
"""Shares left out. Mismatched points and rays are usual in automatic measurements, lost photographs are not."""

TURNED_DOWN = 0.1
"""Robust weight below which a ray no longer takes part."""


def of_photographs(adjusted: AdjustedBlock) -> list[Finding]:
    """Photographs with image points that were not adjusted."""
    measured = np.unique(adjusted.block.image_points.image)
    gone = measured[~np.isfinite(adjusted.images.centre[measured, 0])]
    grade = graded(len(gone) / max(len(measured), 1), SOME_PHOTOGRAPHS, MANY_PHOTOGRAPHS)
    value = f"{len(gone)} of {len(measured)}"
    names = some(adjusted.block.images.names[gone])
    expected = f"below {100 * SOME_PHOTOGRAPHS:.0f} %"
    return doubt("photographs left out", value, expected, grade, f"{value} photographs were left out ({names})")


def of_points(adjusted: AdjustedBlock) -> list[Finding]:
    """Points measured in two photographs or more that were not adjusted; not those that the operator took out."""
    rays, status = adjusted.block.image_points, adjusted.rays.status
    asked = status != RayStatus.OFF
    # a point measured twice in one photograph counts once; one number for both sorts ten times faster than two
    count = max(len(adjusted.block.images), 1)
    point = np.unique(rays.point[asked].astype(np.int64) * count + rays.image[asked]) // count
    measured = np.flatnonzero(np.bincount(point, minlength=len(adjusted.block.points)) >= 2)
    gone = measured[~np.isfinite(adjusted.points.xyz[measured, 0])]
    grade = graded(len(gone) / max(len(measured), 1), SOME_POINTS, MANY_POINTS)
    value = f"{len(gone)} of {len(measured)}"
    names, expected = some(adjusted.block.points[gone]), f"below {100 * SOME_POINTS:.0f} %"
    return doubt("points left out", value, expected, grade, f"{value} measured points were left out ({names})")


def of_loose_points(adjusted: AdjustedBlock) -> list[Finding]:
    """Points that were adjusted although the block does not fix them in distance."""
    loose, count = loose_points(adjusted), int(np.sum(adjusted.points.rays > 0))
    grade = graded(len(loose) / max(count, 1), SOME_POINTS, MANY_POINTS)
    value = f"{len(loose)} of {count}"
    names, expected = some(adjusted.block.points[loose]), f"below {100 * SOME_POINTS:.0f} %"
    return doubt("points not fixed", value, expected, grade, f"{value} points are not fixed in distance ({names})")


def of_rays(adjusted: AdjustedBlock) -> list[Finding]:
    """Rays that data snooping removed or a robust estimator gave no weight."""
    status, weight = adjusted.rays.status, adjusted.rays.weight
    removed = status == RayStatus.REMOVED
    used = status == RayStatus.USED
    gone = int(removed.sum()) + int(np.sum(weight[used] < TURNED_DOWN))
    count = int(removed.sum() + used.sum())
    value = f"{gone} of {count}"
    grade = graded(gone / max(count, 1), SOME_RAYS, MANY_RAYS)
    expected = f"below {100 * SOME_RAYS:.0f} %"
    return doubt("gross errors", value, expected, grade, f"{value} rays were taken for gross errors")
