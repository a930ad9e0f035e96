"""Whether the result of an adjustment may be used: accepted, doubtful or rejected, with reasons."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from aerotri.diagnosis import (
    check_points,
    common_motion,
    common_shift,
    control_digits,
    control_heights,
    control_limits,
    fit,
    geometry,
    left_out,
    moving_errors,
    neighbouring_rays,
    other_set,
    parameters,
    photograph_fields,
    position_errors,
    rigidity,
    unmodelled_shutter,
)
from aerotri.diagnosis.finding import GRADES, Finding, Grade
from aerotri.results.adjusted_block import AdjustedBlock

Rule = Callable[[AdjustedBlock], list[Finding]]

RULES: tuple[Rule, ...] = (
    fit.of_status,
    fit.of_sigma0,
    fit.of_redundancy,
    check_points.of_check_points,
    check_points.of_means,
    moving_errors.of_model_part,
    other_set.of_other_set,
    moving_errors.of_control,
    common_shift.of_common_shift,
    common_motion.of_common_motion,
    control_digits.of_digits,
    control_heights.of_heights,
    control_limits.of_control,
    unmodelled_shutter.of_unmodelled_shutter,
    position_errors.of_positions,
    neighbouring_rays.of_neighbouring_rays,
    photograph_fields.of_photograph_fields,
    rigidity.of_rigs,
    left_out.of_photographs,
    left_out.of_points,
    left_out.of_loose_points,
    left_out.of_rays,
    geometry.of_depths,
    geometry.of_turns,
    geometry.of_ways,
    fit.of_groups,
    fit.of_single_observations,
    fit.of_large_residuals,
    parameters.of_interior,
    parameters.of_gnss,
    parameters.of_additional,
)
"""In the order in which they are read: first what the numbers are worth, then where it may come from."""


@dataclass(frozen=True)
class Verdict:
    """What a result is worth.

    Parameters
    ----------
    level : 'accepted', 'doubtful' (to be looked at before it is used) or 'rejected' (not to be used).
    reasons : sentences, the gravest first; empty where the result is accepted.
    """

    level: Grade
    reasons: tuple[str, ...] = ()


def findings(adjusted: AdjustedBlock) -> list[Finding]:
    """What to look at first, each number beside what it should be.

    No σ of an adjustment that is not accepted can call anything good: the check points say so.

    Parameters
    ----------
    adjusted : in metres, in the frame of the adjustment; its block has the orientations and cameras as given.
    """
    found = [finding for rule in RULES for finding in rule(adjusted)]
    worst = _worst(found)
    if worst == "accepted":
        return found
    return [_with_doubtful_sigma(f, worst) if f.quantity.endswith(check_points.AT_CHECK_POINTS) else f for f in found]


def _with_doubtful_sigma(finding: Finding, verdict: Grade) -> Finding:
    if finding.level != "good":
        return finding
    says = f"as expected from the σ, but the adjustment is {verdict}, and so are its σ"
    return replace(finding, says=says, level="attention" if verdict == "rejected" else "note")


def judge(adjusted: AdjustedBlock) -> Verdict:
    """The verdict over an adjustment; `adjusted` as in `findings`."""
    found = [finding for finding in findings(adjusted) if finding.grade != "accepted"]
    ordered = sorted(found, key=lambda finding: -GRADES.index(finding.grade))
    return Verdict(_worst(found), tuple(finding.reason for finding in ordered))


def _worst(found: list[Finding]) -> Grade:
    return GRADES[max((GRADES.index(finding.grade) for finding in found), default=0)]
