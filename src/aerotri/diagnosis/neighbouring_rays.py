"""Errors that image points near one another have in common, in words."""

from __future__ import annotations

from aerotri.diagnosis.finding import Finding
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.ray_correlation import RayCorrelation


def ray_correlation_in_words(found: RayCorrelation | None) -> str:
    """What a specialist has to know of them, '' where they err independently or nothing was tested."""
    if found is None or not found.alike:
        return ""
    return (
        f"image points near one another have errors in common; their correlation halves beyond {found.half_px:.3g} px. "
        "Automatic matching does that, and image errors that the parameters do not contain. The mean of "
        "neighbouring points is less accurate than their number suggests"
    )


def of_neighbouring_rays(adjusted: AdjustedBlock) -> list[Finding]:
    """The correlation of the residuals of neighbours that was found."""
    found = adjusted.ray_correlation
    if found is None or found.reason or found.nearest < 0:
        return []
    value = f"residuals correlate by {found.largest:.2f} up to {found.limits_px[found.nearest + 1]:.3g} px"
    expected = "0 or a little less if every point errs by itself"
    said = ray_correlation_in_words(found)
    level, says = ("note", said) if said else ("good", "every point errs by itself")
    return [Finding("neighbouring image points", value, expected, says, level)]
