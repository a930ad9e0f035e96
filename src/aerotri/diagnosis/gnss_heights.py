"""Heights of GNSS positions held against those that control points give the photographs, before any adjustment."""

from __future__ import annotations

import numpy as np

from aerotri.observations import Block

SURE_M = 1.0
"""σ of heights up to which positions are of PPK or RTK [C]; others may be off by tens of metres."""
OFF = 5.0
"""Times σ by which the heights have to differ [C]."""
BENT = 0.05
"""Part of the height above ground by which a first orientation may have photographs too high or low [C]: so much an
unknown focal length makes."""


def doubts_of_gnss_heights(block: Block) -> tuple[str, ...]:
    """A sentence where positions of centimetres and control points do not count heights from one place.

    Parameters
    ----------
    block : in its CRS, with start orientations that control points have placed.
    """
    observed, control = block.gnss_ins, block.control
    if observed is None or not len(control):
        return ()
    apart = observed.xyz[:, 2] - block.images.centre[observed.image, 2]
    known = np.isfinite(apart) & (observed.sigma[:, 2] <= SURE_M)
    above = np.nanmedian(block.images.centre[:, 2]) - np.nanmedian(control.xyz[:, 2])
    if 2 * known.sum() <= len(apart):
        return ()
    off = float(np.median(apart[known]))
    if not abs(off) > max(OFF * float(np.median(observed.sigma[known, 2])), BENT * abs(float(above))):
        return ()
    where = "above" if off > 0.0 else "below"
    remedy = "is the geoid the right one, and the base station where it is stated to be?"
    if "+" not in block.crs:
        remedy = f"do control points count from sea level? state the system of the heights then: --crs {block.crs}+…"
    return (f"GNSS positions are {abs(off):.1f} m {where} where control points put the photographs: {remedy}",)
