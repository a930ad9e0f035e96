"""What is to be thought of a result, and which usual mistake explains it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from aerotri.conventions import FilePath, InputError
from aerotri.coordinates.blocks import frame_of_block
from aerotri.diagnosis import diagnose, judge
from aerotri.diagnosis.check_points import in_doubt
from aerotri.diagnosis.control_heights import stand_out
from aerotri.diagnosis.fit import NO_FIT
from aerotri.diagnosis.purpose import purpose
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock, Outcome
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.check_freedom import check_freedom
from aerotri.statistics.control_heights import control_heights
from aerotri.statistics.unmodelled_shutter import unmodelled_shutter


def judged(found: Adjustment) -> Adjustment:
    """The adjustment with the verdict over it."""
    found = with_evidence(found)
    verdict = judge(found.local)
    outcome = replace(found.result.outcome, verdict=verdict.level, reasons=verdict.reasons)
    return with_purpose(with_outcome(found, outcome))


def with_evidence(found: Adjustment) -> Adjustment:
    """The adjustment with what takes time to compute: a test for a rolling shutter, and what doubts ask for."""
    if found.solution.status == "converged" and found.local.outcome.sigma0 < NO_FIT:
        shutter = unmodelled_shutter(found.system, found.solution, found.local)
        local = replace(found.local, unmodelled_shutter=shutter)
        found = replace(found, local=local, result=local if found.frame is None else found.result)
    return _with_doubts(found)


def _with_doubts(found: Adjustment) -> Adjustment:
    """The adjustment with tests of check points and of heights of control that stand out."""
    local, system, solution = found.local, found.system, found.solution
    if local.block.settings.adjustment.datum != "control" or solution.status != "converged":
        return found
    of_check, of_control = in_doubt(local), stand_out(local)
    if not of_check and not of_control:
        return found
    factor = system.factorise(solution.equations)
    if of_check:
        freedom = check_freedom(system, solution, factor, local)
        local = replace(local, check=replace(local.check, freedom=freedom))
    if of_control:
        heights = control_heights(system, solution, factor, local.outcome.sigma0)
        local = replace(local, control_heights=heights)
    return replace(found, local=local, result=local if found.frame is None else found.result)


def with_purpose(found: Adjustment) -> Adjustment:
    """The judged adjustment with what it is good for."""
    good = purpose(found.local)
    return with_outcome(found, replace(found.result.outcome, good_for=good.good_for, purpose=good.says))


def with_outcome(found: Adjustment, outcome: Outcome) -> Adjustment:
    """The adjustment with another outcome, in both frames."""
    result = replace(found.result, outcome=outcome)
    local = replace(found.local, outcome=outcome) if found.frame is not None else result
    return replace(found, result=result, local=local)


def causes(
    block: Block,
    found: Adjustment | None,
    adjust: Callable[[Block], AdjustedBlock],
    geoid: FilePath | None,
) -> tuple[str, ...]:
    """The usual mistake that explains a block, in words; nothing where none does.

    Parameters
    ----------
    block : as it was given.
    found : its adjustment, None where it has no result.
    adjust : what adjusts a changed block.
    """
    try:
        frame = None if block.crs == "local" else frame_of_block(block, geoid)
    except InputError:
        frame = None
    return diagnose(block, adjust, None if found is None else found.local, frame)
