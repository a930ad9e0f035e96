"""Heights of the control points that together contradict the photographs, in words."""

from __future__ import annotations

import numpy as np

from aerotri.diagnosis.finding import SIGNIFICANCE, Finding, doubt, some, times
from aerotri.diagnosis.fit import POOR_FIT
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.control_heights import BOWL, CHANCE, NAMES, ControlHeights, HeightPattern

STANDING_OUT = 1.25
"""RMS of the normalised residuals of the heights from which they are tested together [C]: below, none stands out. It
saves a factorisation of blocks that fit."""
EARTH_RADIUS_M = 6.371e6
"""Mean radius [L]."""
LIKE_EARTH = 3.0
"""σ within which a bowl is as large as the curvature of the Earth."""


def stand_out(adjusted: AdjustedBlock) -> bool:
    """Whether the residuals of the heights of control are large enough to be tested together."""
    w = adjusted.control.w[:, 2] if len(adjusted.control) else np.zeros(0)
    w = w[np.isfinite(w)]
    return len(w) > 0 and float(np.sqrt(np.mean(w**2))) > STANDING_OUT


def of_heights(adjusted: AdjustedBlock) -> list[Finding]:
    """Heights that contradict the photographs as two groups, as a bowl, or all together."""
    found = adjusted.control_heights
    if found is None:
        return []
    name, expected = "heights of control together", f"ratio 1; chance {100.0 * SIGNIFICANCE:g} %"
    value = f"{found.ratio:.2g} times as large as expected from σ ({found.freedom} of {found.count} determined)"
    counting = [one for one in found.patterns if min(one.p, found.p) < CHANCE and one.warp >= POOR_FIT * found.sigma]
    if counting and _has_random_field(adjusted):
        # a field takes a bowl only as far as its variance allows: what is left at control is its own, not control's
        words = _in_words(adjusted, counting[0], min(counting[0].p, found.p))
        return [Finding(name, value, expected, words, "attention")]
    if counting:
        return doubt(name, value, expected, "doubtful", _in_words(adjusted, counting[0], min(counting[0].p, found.p)))
    if found.p < SIGNIFICANCE and found.ratio >= POOR_FIT:
        return doubt(name, value, expected, "doubtful", _together(found))
    return []


def _has_random_field(adjusted: AdjustedBlock) -> bool:
    return any(family == "collocation" for family, _ in adjusted.block.settings.adjustment.additional_parameters)


def _in_words(adjusted: AdjustedBlock, one: HeightPattern, p: float) -> str:
    chance = f"by chance with a probability of {f'{100.0 * p:.2g} %' if p >= 1e-5 else 'less than 0.001 %'}"
    size = f"{abs(one.size):.3g} m (σ {one.sigma:.2g})"
    if one.kind == BOWL:
        return (
            "the heights of the control points bend against the photographs like a "
            f"{'bowl' if one.size > 0 else 'dome'}: {size} from the middle to the outermost point, {chance}. "
            f"{_causes_of_bowl(one)}"
        )
    names = adjusted.block.points[one.points]
    who = f"whose names begin with '{one.label}'" if one.kind == NAMES else f"{some(names)} ({len(names)} of them)"
    side = "higher" if one.size > 0.0 else "lower"
    return (
        f"the heights of the control points fall into two groups: those {who} are {size} {side} than the others and "
        f"the photographs say, {chance}. Possible causes: two surveys, two poles, two height systems. Look at their "
        "protocols, and adjust with one group as check points"
    )


def _causes_of_bowl(one: HeightPattern) -> str:
    earth = one.reach**2 / (2.0 * EARTH_RADIUS_M)
    if abs(abs(one.size) - earth) < LIKE_EARTH * one.sigma and earth > LIKE_EARTH * one.sigma:
        return (
            f"The curvature of the Earth is {earth:.3g} m there: state the coordinate system (crs), or give control "
            "points and positions in one plane"
        )
    return (
        "Possible causes: a lens distortion that is not modelled, a wrong principal distance, the curvature of the "
        f"Earth ({earth:.2g} m there)"
    )


def _together(found: ControlHeights) -> str:
    return (
        f"the heights of the control points contradict the photographs together: their residuals are "
        f"{times(found.ratio)} as large as expected from all σ, though no single one stands out. Look at the largest "
        "residuals in height, at the additional parameters, and at the σ of the control points"
    )
