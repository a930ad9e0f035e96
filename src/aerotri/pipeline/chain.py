"""The chain itself: a block is adjusted, judged, and where it is not accepted explained."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aerotri.adjustment.prepare import NoStartValuesError
from aerotri.adjustment.track import with_named_strips
from aerotri.conventions import FilePath
from aerotri.functional_model.additional_parameters import AUTO
from aerotri.observations import Block
from aerotri.pipeline.choosing import ParameterChoice, choose_again, choose_parameters, with_reason, with_rival
from aerotri.pipeline.components import with_variance_components
from aerotri.pipeline.control_doubts import doubts_at_start, with_control_doubts
from aerotri.pipeline.in_frame import adjust_in_frame
from aerotri.pipeline.local import Report
from aerotri.pipeline.model_part import with_model_part
from aerotri.pipeline.relative import with_relative
from aerotri.pipeline.shutter_test import with_shutter_test
from aerotri.pipeline.starting import NOT_CONVERGED, Started, with_start
from aerotri.pipeline.verdict import causes, judged, with_outcome
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.adjustment import Adjustment
from aerotri.results.failure import AdjustmentFailedError
from aerotri.strategies.parameter_comparison import Progress
from aerotri.strategies.shutter_test import asks_for_test

MOST_CHOICES = 6
"""Sets of additional parameters that are tried where the adjustment with the one chosen does not converge [C]."""


def adjust(block: Block, report: Report | None = None, given_points: np.ndarray | None = None) -> AdjustedBlock:
    """Adjust a block.

    Parameters
    ----------
    report : called after every iteration with (iteration, σ0, damping).
    given_points : (N, 3) m, start values of object points; intersected where not given.

    Returns
    -------
    AdjustedBlock

    Raises
    ------
    InputError
        When a setting or an observation makes no sense.
    AdjustmentFailedError
        When the observations do not determine the unknowns; the outcome names which.
    """
    return adjust_keeping_system(block, report, given_points).result


def adjust_keeping_system(
    block: Block,
    report: Report | None = None,
    given_points: np.ndarray | None = None,
    geoid: FilePath | None = None,
    tested: bool = True,
    sets: Progress | None = None,
) -> Adjustment:
    """As `adjust`, with the equations and the solution beside the result.

    Parameters
    ----------
    geoid : grid of geoid undulations for a block whose CRS has none of its own.
    tested : whether a rolling shutter is held against the block without it.
    sets : called before each set of additional parameters that is tried, where they are to be chosen.
    """
    started = with_start(with_named_strips(block), geoid)
    return _from_start(started, report, given_points, geoid, tested, sets)


def _from_start(
    started: Started,
    report: Report | None,
    given_points: np.ndarray | None,
    geoid: FilePath | None,
    tested: bool,
    sets: Progress | None,
) -> Adjustment:
    """As `adjust_keeping_system`, of a block with start values."""
    try:
        return started.told(_adjusted(started.block, report, given_points, geoid, tested, sets))
    except AdjustmentFailedError as error:
        raise started.blamed(error) from error


def _adjusted(
    block: Block,
    report: Report | None,
    given_points: np.ndarray | None,
    geoid: FilePath | None,
    tested: bool,
    sets: Progress | None,
) -> Adjustment:
    choice = None
    if block.settings.adjustment.additional_parameters == AUTO:
        choice = choose_parameters(block, geoid, sets)
        found, choice = _adjusted_as_chosen(choice, report, given_points, geoid)
        block = choice.block
    else:
        found = adjust_in_frame(block, report, given_points, geoid)
    if block.settings.adjustment.variance_components == "on":
        found = with_variance_components(block, found, report, geoid)
    found = found if choice is None else with_rival(found, choice)
    found = judged(with_relative(with_model_part(found)))
    if tested and asks_for_test(block):
        found = with_shutter_test(found, report)
    found = with_control_doubts(found, block)
    return found if choice is None else with_reason(found, choice)


def _adjusted_as_chosen(
    choice: ParameterChoice, report: Report | None, given_points: np.ndarray | None, geoid: FilePath | None
) -> tuple[Adjustment, ParameterChoice]:
    """The adjustment with the parameters chosen, or with the next choice where it does not converge."""
    first = (adjust_in_frame(choice.block, report, given_points, geoid), choice)
    found, tried = first[0], 1
    while found.result.outcome.status == NOT_CONVERGED:
        other = choose_again(choice, NOT_CONVERGED) if tried < MOST_CHOICES else None
        if other is None:
            return first
        choice, tried = other, tried + 1
        found = adjust_in_frame(choice.block, report, given_points, geoid)
    return found, choice


def adjust_and_explain(
    block: Block,
    report: Report | None = None,
    geoid: FilePath | None = None,
    say: Callable[[str], None] = lambda text: None,
    sets: Progress | None = None,
) -> Adjustment:
    """As `adjust_keeping_system`; where the block is not accepted, what explains it stands first among the reasons.

    Parameters
    ----------
    say : told when start values are sought from tie points, and when the search for an explanation begins.
    sets : as of `adjust_keeping_system`.
    """

    given = with_named_strips(block)

    def explained(found: Adjustment | None) -> tuple[str, ...]:
        # of the block as it was given: start values from wrong measurements would spoil every change that is tried
        say("looking for what explains it")

        def again(changed: Block) -> AdjustedBlock:
            return adjust_keeping_system(changed, geoid=geoid, tested=False).result

        return causes(_as_chosen(given, found), found, again, geoid)

    started = Started(given)
    try:
        started = with_start(given, geoid, say)
        found = _from_start(started, report, None, geoid, True, sets)
    except AdjustmentFailedError as error:
        o = error.outcome
        reasons = (*explained(None), *o.reasons, *doubts_at_start(started.block, geoid))
        raise AdjustmentFailedError(replace(o, reasons=reasons)) from error
    except NoStartValuesError as error:
        reasons = explained(None)
        if not reasons:
            raise
        raise NoStartValuesError(error.message, "; ".join(reasons), error.file) from error
    outcome = found.result.outcome
    if outcome.verdict == "accepted":
        return found
    return with_outcome(found, replace(outcome, reasons=(*explained(found), *outcome.reasons)))


def _as_chosen(block: Block, found: Adjustment | None) -> Block:
    """The block with the additional parameters that were chosen for it, not to choose them again."""
    settings = block.settings
    if found is None or settings.adjustment.additional_parameters != AUTO:
        return block
    chosen = found.result.block.settings.adjustment.additional_parameters
    adjustment = replace(settings.adjustment, additional_parameters=chosen)
    return replace(block, settings=replace(settings, adjustment=adjustment))
