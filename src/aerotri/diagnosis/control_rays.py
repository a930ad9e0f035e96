"""The rays of control and check points one by one: an average over all rays of a point hides the wrong one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.outliers import pixel_mm_of_rays, used_rays


@dataclass(frozen=True, eq=False)
class ControlRays:
    """Every ray of every control and check point, k of them, the point with the largest |w| first.

    Parameters
    ----------
    row : (k,) of the block's image points. role : (k,) str, 'control' or 'check'.
    v_px : (k, 2) residuals, px. w, r : (k, 2). error_px : (k, 2) −v/r, px. NaN where a ray was not used.
    """

    row: np.ndarray
    role: np.ndarray
    v_px: np.ndarray
    w: np.ndarray
    r: np.ndarray
    error_px: np.ndarray

    def __len__(self) -> int:
        return len(self.row)


def control_ray_rows(adjusted: AdjustedBlock) -> np.ndarray:
    """Rows of the block's image points that belong to control and check points."""
    known = np.concatenate([adjusted.control.point, adjusted.check.point])
    return np.flatnonzero(np.isin(adjusted.block.image_points.point, known))


def control_rays(adjusted: AdjustedBlock) -> ControlRays:
    """The rays of the control and check points of an adjustment, point by point, within a point largest |w| first."""
    block, rays = adjusted.block, adjusted.rays
    rows = control_ray_rows(adjusted)
    used = used_rays(adjusted)[rows, None]
    w, r = np.where(used, rays.w[rows], np.nan), np.where(used, rays.r[rows], np.nan)
    v_px = np.where(used, rays.v[rows], np.nan) / pixel_mm_of_rays(block)[rows, None]
    size = np.nan_to_num(np.abs(w)).max(axis=1, initial=0.0)
    point = block.image_points.point[rows]
    of_point = np.zeros(len(block.points))
    np.maximum.at(of_point, point, size)
    order = np.lexsort((-size, point, -of_point[point]))
    with np.errstate(divide="ignore", invalid="ignore"):
        error = -v_px / r
    role = np.where(np.isin(point, adjusted.check.point), "check", "control")
    return ControlRays(rows[order], role[order], v_px[order], w[order], r[order], error[order])
