"""How far residuals may go: their spread without the gross errors, and the limits that follow from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.ray_status import RayStatus
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.reliability import critical_value

MEDIAN_OF_NORMAL = 0.6744897501960817
"""Median of |z| for z standard normal."""


@dataclass(frozen=True, eq=False)
class RayTests:
    """The m rays, each judged by the coordinate with the larger |w|; NaN where a ray was not used.

    Parameters
    ----------
    w : (m,) normalised residual of that coordinate. axis : (m,) which it is, 0 for x, 1 for y.
    estimated_mm : (m,) the error −v/r that would explain it alone.
    estimated_px : (m,) the same in pixels of the camera.
    scale : spread of all w, robust: 1 where the a-priori σ are right.
    limit : |w| that one residual exceeds with probability α. sure : |w| that the largest of all exceeds so.
    """

    w: np.ndarray
    axis: np.ndarray
    estimated_mm: np.ndarray
    estimated_px: np.ndarray
    scale: float
    limit: float
    sure: float

    @property
    def order(self) -> np.ndarray:
        """Rows of the tested rays, largest |w| first; of equal ones that first which the smaller error explains."""
        size = np.round(np.nan_to_num(np.abs(self.w)), 3)
        rows = np.lexsort((np.nan_to_num(np.abs(self.estimated_mm)), -size))
        return rows[size[rows] > 0.0]


def spread(w: np.ndarray) -> float:
    """Standard deviation of normalised residuals from their median size, blind to gross errors; 1 without residuals."""
    size = np.abs(w[np.isfinite(w)])
    found = float(np.median(size)) / MEDIAN_OF_NORMAL if len(size) else 0.0
    return found if found > 0.0 else 1.0


def sure_value(alpha: float, count: int) -> float:
    """Limit that the largest of `count` standard normal numbers exceeds with probability `alpha` (Bonferroni)."""
    return critical_value(alpha / max(count, 1))


def pixel_mm_of_rays(block: Block) -> np.ndarray:
    """(m,) mm, size of a pixel of the camera that took each ray."""
    pixel = np.array([camera.pixel_mm for camera in block.cameras])
    return pixel[block.images.camera[block.image_points.image]]


def used_rays(adjusted: AdjustedBlock) -> np.ndarray:
    """(m,) bool."""
    return adjusted.rays.status == RayStatus.USED


def judge_rays(adjusted: AdjustedBlock) -> RayTests:
    """Judge every ray of an adjustment.

    The limits are those of the normal distribution times the robust spread of all w: neither a wrong a-priori σ nor
    the gross errors themselves move them.
    """
    block, rays = adjusted.block, adjusted.rays
    w = np.where(used_rays(adjusted)[:, None], rays.w, np.nan)
    axis = np.argmax(np.nan_to_num(np.abs(w)), axis=1)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.take_along_axis(-rays.v / rays.r, axis, axis=1)[:, 0]
    largest = np.take_along_axis(w, axis, axis=1)[:, 0]
    scale, alpha = spread(w), block.settings.adjustment.alpha
    return RayTests(
        w=largest,
        axis=axis[:, 0],
        estimated_mm=np.where(np.isfinite(largest), error, np.nan),
        estimated_px=np.where(np.isfinite(largest), error / pixel_mm_of_rays(block), np.nan),
        scale=scale,
        limit=scale * critical_value(alpha),
        sure=scale * sure_value(alpha, int(np.isfinite(w).sum())),
    )
