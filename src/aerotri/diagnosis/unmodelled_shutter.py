"""A rolling shutter that the adjustment does not have, in words."""

from __future__ import annotations

from aerotri.diagnosis.finding import NO_DOUBT, Finding, doubt
from aerotri.observations.rolling_shutter import RollingShutter
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.unmodelled_shutter import UnmodelledShutter

USUAL = RollingShutter()


def of_unmodelled_shutter(adjusted: AdjustedBlock) -> list[Finding]:
    """Rows that are displaced along the flight, more than chance explains."""
    found = adjusted.unmodelled_shutter
    if found is None:
        return []
    name, expected = "rolling shutter of a camera that states none", "0 within σ"
    if found.is_suspected and not found.counts:
        return [Finding(name, _way(found), expected, f"{_reason(found)}. {NO_DOUBT}", "attention")]
    if not found.counts:
        return [Finding(name, _way(found), expected, "none is needed", "good")]
    return doubt(name, _way(found), expected, "doubtful", _reason(found))


def _way(found: UnmodelledShutter) -> str:
    return f"way of {abs(found.way_m):.3f} m while a photograph is read (σ {found.sigma_m:.3f})"


def _reason(found: UnmodelledShutter) -> str:
    chance = f"{100.0 * found.p:.2g} %" if found.p >= 1e-5 else "less than 0.001 %"
    other = (
        ""
        if found.is_told_apart
        else ", or by an affinity of the camera: this block does not tell them apart. With a global shutter adjust b1 "
        "and b2 of brown"
    )
    rows = "" if found.row_direction == USUAL.row_direction else f' with row_direction = "{found.row_direction}"'
    return (
        f"the rows of camera '{found.camera}' are displaced along the flight as by a rolling shutter: the camera seems "
        f"to move by {abs(found.way_m):.3f} m ({found.way_px:.1f} px) while a photograph is read; by chance with a "
        f"probability of {chance}. Modelled, the object points would move by {found.moves_m:.3f} m (RMS), "
        f"{found.moves_sigma:.1f} times their σ. State [camera.{found.camera}.rolling_shutter]{rows} in block.toml"
        f"{other}"
    )
