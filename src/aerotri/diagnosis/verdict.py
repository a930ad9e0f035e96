"""Whether the result of an adjustment may be used: accepted, doubtful or rejected, with reasons."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from aerotri.diagnosis import fit, geometry, left_out, parameters
from aerotri.diagnosis.reason import LEVELS, Level, Reason
from aerotri.statistics.adjusted_block import AdjustedBlock

Rule = Callable[[AdjustedBlock], list[Reason]]

RULES: tuple[Rule, ...] = (
    fit.of_sigma0,
    fit.of_groups,
    fit.of_check_points,
    left_out.of_photographs,
    left_out.of_points,
    geometry.of_depths,
    geometry.of_given_orientations,
    fit.of_single_observations,
    parameters.of_interior,
    parameters.of_gnss_shifts,
)
"""In the order in which their reasons are read: first what the numbers say, then where it may come from."""


@dataclass(frozen=True)
class Verdict:
    """What a result is worth.

    Parameters
    ----------
    level : 'accepted', 'doubtful' (to be looked at before it is used) or 'rejected' (not to be used).
    reasons : sentences, the gravest first; empty where the result is accepted.
    """

    level: Level
    reasons: tuple[str, ...] = ()


def judge(adjusted: AdjustedBlock) -> Verdict:
    """The verdict over an adjustment.

    Parameters
    ----------
    adjusted : in metres, in the frame of the adjustment; its block has the orientations and cameras as given.
    """
    reasons = [reason for rule in RULES for reason in rule(adjusted)]
    if adjusted.outcome.status != "converged":
        reasons.insert(0, Reason("rejected", f"{adjusted.outcome.status}: {adjusted.outcome.message}"))
    level = max((reason.level for reason in reasons), key=LEVELS.index, default="accepted")
    ordered = sorted(reasons, key=lambda reason: -LEVELS.index(reason.level))
    return Verdict(level, tuple(reason.sentence for reason in ordered))
