"""Another set of additional parameters that the choice could not tell from the one it took, in words."""

from __future__ import annotations

import numpy as np

from aerotri.diagnosis.finding import Finding
from aerotri.diagnosis.moving_errors import WORTH_SAYING
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.model_part import LEAST_DIFFERENCE, ModelPart, OtherSet


def growth(other: OtherSet) -> float:
    """Total σ over σ of the noise by it alone, RMS of the points, the larger one of plan and height."""
    largest = max(other.plan_sigma, other.height_sigma)
    return float(np.sqrt(1.0 + other.share * largest**2)) if other.share > 0.0 else 1.0


def other_set_in_words(part: ModelPart) -> str:
    """What a surveyor has to know of it, '' where there is nothing to speak of."""
    other = part.other_set
    if other is None or growth(other) < WORTH_SAYING:
        return ""
    return (
        f"the image points cannot tell the additional parameters from {other.set} (probability that these are the "
        f"better ones: {100.0 * other.weight:.0f} %), {_differs(other)}. The total σ (tX, tY, tZ) contain this. "
        "More control points, or precise positions of the photographs, would decide it"
    )


def _differs(other: OtherSet) -> str:
    return (
        f"which change heights by {other.height_m:.2g} m and positions by {other.plan_m:.2g} m (RMS of the points): "
        f"{other.height_sigma:.1f} and {other.plan_sigma:.1f} times their σ"
    )


def of_other_set(adjusted: AdjustedBlock) -> list[Finding]:
    """The other set, beside what its difference should be."""
    other = None if adjusted.model_part is None else adjusted.model_part.other_set
    if adjusted.model_part is None or other is None or not np.isfinite(other.height_m):
        return []
    name, text = "another set of parameters", "changes points by less than σ"
    worst = ("heights", other.height_m, other.height_sigma), ("positions", other.plan_m, other.plan_sigma)
    what, size_m, ratio = max(worst, key=lambda one: one[2])
    value = f"{what} {size_m:.2g} m, {ratio:.1f} times σ"
    said = other_set_in_words(adjusted.model_part)
    if said:
        return [Finding(name, value, text, said, "attention")]
    little = "changes little" if ratio <= LEAST_DIFFERENCE else "adds little to the total σ"
    explained = ratio > LEAST_DIFFERENCE and other.share == 0.0
    why = "the σ of both explain the difference" if explained else little
    return [Finding(name, value, text, f"{other.set} predicts as well, and {why}", "good")]
