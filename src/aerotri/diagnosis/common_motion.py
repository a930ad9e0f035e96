"""A turn or a scale of all observed positions against control and photographs, in words."""

from __future__ import annotations

import numpy as np

from aerotri.diagnosis.finding import NO_DOUBT, Finding, doubt
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.common_motion import CHANCE, SUSPECTED, CommonMotion

CAUSES_OF_TILT = "heights of the control points that are wrong along one direction, or another datum of the GNSS"
CAUSES_OF_TURN = "control points and GNSS in different grids, or a wrong time of the exposures"
CAUSES_OF_SCALE = (
    "distances of the map grid taken for distances on the ground, or the other way round; another ellipsoid or unit; "
    "a principal distance that is held at a wrong value"
)


def of_common_motion(adjusted: AdjustedBlock) -> list[Finding]:
    """Positions that are turned or scaled against the rest: control, GNSS and photographs contradict each other."""
    found = adjusted.common_motion
    if found is None:
        return []
    said = common_motion_in_words(found)
    name, expected = "turn and scale of GNSS", "0 within σ"
    if not said:
        suspected = common_motion_in_words(found, SUSPECTED)
        if suspected:
            return [Finding(name, _scale(found), expected, f"{text}. {NO_DOUBT}", "attention") for text in suspected]
        return [Finding(name, _scale(found), expected, "GNSS and the rest agree", "good")]
    if adjusted.position_errors is not None and adjusted.position_errors.neighbours_agree:
        # errors of GNSS that stay for a while look like a turn of all: they are told by themselves
        return [Finding(name, _scale(found), expected, text, "attention") for text in said]
    return [finding for text in said for finding in doubt(name, _scale(found), expected, "doubtful", text)]


def common_motion_in_words(found: CommonMotion | None, chance: float = CHANCE) -> list[str]:
    """What contradicts what, a sentence each; none where chance explains it with this probability or more."""
    if found is None:
        return []
    said, contradict, what = [], "control points and GNSS contradict each other", "GNSS positions"
    if found.with_attitudes:
        contradict, what = "control points contradict GNSS and INS", "positions and attitudes"
    if found.p_tilt < chance:
        said.append(
            f"{contradict}: the {what} are tilted by "
            f"{found.tilt_m[0]:.3f} m (σ {found.tilt_m[1]:.3f}) in height "
            f"over the length of the block ({_chance(found.p_tilt)}). Possible causes: {CAUSES_OF_TILT}"
        )
    if found.p_turn < chance:
        across = abs(float(found.turn[2])) * float(np.hypot(*found.extent[:2]))
        said.append(
            f"{contradict}: the {what} are turned in plan by {across:.3f} m "
            f"over the length of the block ({_chance(found.p_turn)}). Possible causes: {CAUSES_OF_TURN}"
        )
    if found.p_scale < chance:
        said.append(
            f"GNSS contradicts control points and photographs in scale: {_scale(found)} "
            f"({_chance(found.p_scale)}). Possible causes: {CAUSES_OF_SCALE}"
        )
    return said


def _scale(found: CommonMotion) -> str:
    length = float(np.hypot(*found.extent[:2]))
    ppm = f"{1e6 * found.scale:+.0f} ppm (σ {1e6 * found.scale_sigma:.0f})"
    return f"{ppm}, {found.scale * length:+.3f} m over {length:.0f} m"


def _chance(p: float) -> str:
    return f"by chance with a probability of {f'{100.0 * p:.2g} %' if p >= 1e-5 else 'less than 0.001 %'}"
