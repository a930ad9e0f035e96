"""Whether a surface lies where an adjusted block has its ground."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from aerotri.conventions import SIGMA_PER_MAD

if TYPE_CHECKING:
    from aerotri.public.surfaces import Reader
    from aerotri.results.adjustment import Adjustment as Record

FEWEST, MOST = 20, 500
"""Points of the block on the surface that tell its place, and how many are looked at."""
FARTHEST_M, SIGMAS = 2.0, 5.0
"""By which the surface may lie off them, and in σ of their scatter about it; chosen [C]: two systems of heights, as
above the ellipsoid and above sea level, mostly differ by more, and crowns of trees over bare ground scatter."""


def off_the_ground(surface: Reader, record: Record) -> str:
    """A sentence where a surface lies far above or below the object points of a block; '' elsewhere.

    Parameters
    ----------
    surface : in the CRS of the block, heights in m.
    """
    from aerotri.volume.bases import sampled

    xyz = np.asarray(record.result.points.xyz)
    left, bottom, right, top = surface.grid.bounds
    x, y = xyz[:, 0], xyz[:, 1]
    xyz = xyz[np.isfinite(xyz).all(axis=1) & (x > left) & (x < right) & (y > bottom) & (y < top)]
    xyz = xyz[:: len(xyz) // MOST + 1]
    # one by one: they lie all over the surface, which may be larger than the memory
    off = sampled(surface, xyz[:, 0], xyz[:, 1], 1) - xyz[:, 2]
    off = off[np.isfinite(off)]
    if len(off) < FEWEST:
        return ""
    median = float(np.median(off))
    scatter = SIGMA_PER_MAD * float(np.median(np.abs(off - median)))
    if abs(median) <= max(FARTHEST_M, SIGMAS * scatter):
        return ""
    return (
        f"{surface.path.name} lies {abs(median):.1f} m {'above' if median > 0.0 else 'below'} the points of the "
        f"adjustment (median of {len(off)}): check that both have heights of one system (above the ellipsoid or above "
        "sea level)"
    )
