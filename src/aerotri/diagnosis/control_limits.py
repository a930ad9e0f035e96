"""What nothing in a block can show, however well all of it fits, and which survey would."""

from __future__ import annotations

import numpy as np

from aerotri.diagnosis.finding import Finding
from aerotri.results.adjusted_block import AdjustedBlock

FREE = ("estimated", "weighted")


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
    says = f"No residual shows errors such as: {'; '.join(hidden)}. {remedy}"
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
    elif positions and (free_c or _shift_is_free(adjusted)):
        hidden = [
            "an error in height that all control points share, such as a wrong height of the pole: "
            + ("the principal distance" if free_c else "the shift of the GNSS positions")
            + " absorbs it, against the heights of GNSS"
        ]
    return hidden


def _has_positions(adjusted: AdjustedBlock) -> bool:
    gnss = adjusted.block.gnss_ins
    return gnss is not None and bool(np.isfinite(gnss.xyz).any())


def _shift_is_free(adjusted: AdjustedBlock) -> bool:
    return adjusted.block.settings.gnss.shift != "off"
