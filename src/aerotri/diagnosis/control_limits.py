"""What nothing in a block can show, however well all of it fits, and which survey would."""

from __future__ import annotations

import numpy as np

from aerotri import of_known
from aerotri.diagnosis.finding import Finding
from aerotri.results.adjusted_block import AdjustedBlock

FREE = ("estimated", "weighted")
SHADOWS = (
    "Tie points on shadows that move by less than the noise of the image points do not show either: a flight at "
    "another hour does"
)
WORTH_SAYING = 4.0
"""σ of the object points, total, from which an error that may stay hidden is told [C]: it would be a gross error."""


def of_control(adjusted: AdjustedBlock) -> list[Finding]:
    """A note on errors that all control points share: the block follows them without a residual."""
    block = adjusted.block
    if block.settings.adjustment.datum != "control":
        return []
    positions, checked = _has_positions(adjusted), len(adjusted.check) > 0
    if not len(adjusted.control) and not positions:
        return []
    hidden = what_is_hidden(adjusted)
    if not hidden:
        return []
    remedy = (
        "Check points of another survey show them, if they have another base point, another pole and other marks"
        if checked
        else "Check points show them, if measured from another base point, with another pole, and on other marks"
    )
    says = f"No residual shows errors such as: {'; '.join(hidden)}. {remedy}. {SHADOWS}"
    held = (
        "control points alone" if not positions else "GNSS alone" if not len(adjusted.control) else "control and GNSS"
    )
    return [Finding("what this block cannot show", f"held by {held}", "an independent survey", says, "note")]


def what_is_hidden(adjusted: AdjustedBlock) -> list[str]:
    """Errors that the observations of this block follow, in words."""
    positions, control = _has_positions(adjusted), len(adjusted.control) > 0
    p = adjusted.parameters
    free_c = bool(np.any((p.names == "focal_length_mm") & np.isin(p.status, FREE)))
    hidden = []
    if control and not positions:
        hidden = [
            "an error that all control points share: a wrong base point, a wrong height of the pole",
            "distances of the map grid taken for distances on the ground",
            "all marks measured at the same wrong edge of the target",
        ]
        if not free_c:
            hidden.append("a principal distance held at a wrong value, as far as the ground is flat")
    elif positions and not control:
        hidden = ["an error that all positions share: a wrong base station, another datum, a wrong geoid"]
        if free_c:
            hidden.append("a shift of all heights: the free principal distance absorbs it")
    elif positions:
        hidden = [
            "an error that control points and GNSS share: one wrong base point for both, distances of the map grid "
            "taken for distances on the ground in both"
        ]
        if free_c or _shift_is_free(adjusted):
            hidden.append(
                "an error in height that all control points share, such as a wrong height of the pole: "
                + ("the principal distance" if free_c else "the shift of the GNSS positions")
                + " absorbs it, against the heights of GNSS"
            )
        hidden += _below_detection(adjusted)
    return hidden


def _below_detection(adjusted: AdjustedBlock) -> list[str]:
    """Errors of all control points that are large beside σ, and too small for the contradiction with GNSS to count."""
    motion, sigma = adjusted.common_motion, adjusted.points.total_sigma
    if motion is None:
        return []
    plan, height = of_known.median(np.hypot(sigma[:, 0], sigma[:, 1])), of_known.median(sigma[:, 2])
    length, found = float(np.hypot(*motion.extent[:2])), []
    along_x, along_y = motion.detectable_tilt_m
    if max(along_x, along_y) > WORTH_SAYING * height:
        found.append(
            f"a tilt of all control points against GNSS below {along_x:.2g} m along X, or {along_y:.2g} m along Y, "
            "over the length of the block"
        )
    if motion.detectable_scale * length > WORTH_SAYING * plan:
        found.append(
            f"a difference of scale of control points and GNSS below {1e6 * motion.detectable_scale:.0f} ppm, "
            f"{motion.detectable_scale * length:.2g} m over {length:.0f} m"
        )
    return found


def _has_positions(adjusted: AdjustedBlock) -> bool:
    gnss = adjusted.block.gnss_ins
    return gnss is not None and bool(np.isfinite(gnss.xyz).any())


def _shift_is_free(adjusted: AdjustedBlock) -> bool:
    return adjusted.block.settings.gnss.shift != "off"
