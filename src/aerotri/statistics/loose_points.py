"""Points that an adjusted block leaves loose although their own rays hold them.

A point is as loose as its photographs let it be: where these are hardly tied themselves, or its rays part by little
more than the directions of the photographs are known to, σ from the covariance is far beyond what the rays alone say.
Measure and limit are those of `adjustment.weak_geometry`, the covariance that of the tables.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.ray_status import RayStatus, some_names
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.weak_geometry import LOOSE, MOST, loose_in_block
from aerotri.results.adjusted_block import AdjustedBlock


def loose_points(adjusted: AdjustedBlock) -> np.ndarray:
    """Rows of the block's points whose σ exceeds a third of the way to their nearest photograph.

    Parameters
    ----------
    adjusted : in metres, in the frame of the adjustment.
    """
    rays, images, points = adjusted.block.image_points, adjusted.images, adjusted.points
    used = adjusted.rays.status == RayStatus.USED
    of_centres = images.covariance[:, :3, :3]
    return loose_in_block(rays.point[used], rays.image[used], points.xyz, images.centre, points.covariance, of_centres)


def to_set_aside(adjusted: AdjustedBlock) -> np.ndarray:
    """The loose points; none of them where they are so many that it is the block."""
    loose = loose_points(adjusted)
    return loose if len(loose) <= MOST * np.sum(adjusted.points.rays > 0) else loose[:0]


def loose_by_rays(system: NormalSystem, solution: Solution, sigma0: float) -> np.ndarray:
    """Rows of the block's points that are loose by their own rays.

    A point that ran to infinity is found by this alone: its covariance drowns in rounding.
    """
    own = sigma0 * system.looseness(solution.state, solution.estimator)
    return system.unknowns.points[own > LOOSE]


def loose_in_words(adjusted: AdjustedBlock, loose: np.ndarray) -> tuple[str, ...]:
    """A sentence about loose points that were kept; nothing where there is none."""
    if not len(loose):
        return ()
    names = some_names(adjusted.block.points[loose], "point")
    return (f"{names} hardly fixed in distance: σ is more than a third of the way to the nearest photograph",)
