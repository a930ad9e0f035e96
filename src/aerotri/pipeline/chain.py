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
from aerotri.pipeline.choosing import compare_parameters, with_choice, with_reason
from aerotri.pipeline.components import with_variance_components
from aerotri.pipeline.in_frame import adjust_in_frame
from aerotri.pipeline.local import Report
from aerotri.pipeline.model_part import with_model_part
from aerotri.pipeline.verdict import causes, judged, with_outcome
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.adjustment import Adjustment
from aerotri.results.failure import AdjustmentFailedError
from aerotri.strategies.parameter_choice import candidate_sets


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
) -> Adjustment:
    """As `adjust`, with the equations and the solution beside the result.

    Parameters
    ----------
    geoid : grid of geoid undulations for a block whose CRS has none of its own.
    """
    compared, block = None, with_named_strips(block)
    if block.settings.adjustment.additional_parameters == AUTO:
        compared = compare_parameters(block, candidate_sets(block), geoid=geoid, report=report)
        block = with_choice(block, compared)
    found = adjust_in_frame(block, report, given_points, geoid)
    if block.settings.adjustment.variance_components == "on":
        found = with_variance_components(block, found, report, geoid)
    found = judged(with_model_part(found))
    return found if compared is None else with_reason(found, compared)


def adjust_and_explain(
    block: Block,
    report: Report | None = None,
    geoid: FilePath | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> Adjustment:
    """As `adjust_keeping_system`; where the block is not accepted, what explains it stands first among the reasons.

    Parameters
    ----------
    say : told when the search for it begins.
    """

    def explained(found: Adjustment | None) -> tuple[str, ...]:
        say("looking for what explains it")
        return causes(block, found, lambda changed: adjust_keeping_system(changed, geoid=geoid).result, geoid)

    try:
        found = adjust_keeping_system(block, report, geoid=geoid)
    except AdjustmentFailedError as error:
        o = error.outcome
        raise AdjustmentFailedError(replace(o, reasons=(*explained(None), *o.reasons))) from error
    except NoStartValuesError as error:
        reasons = explained(None)
        if not reasons:
            raise
        raise NoStartValuesError(error.message, "; ".join(reasons), error.file) from error
    outcome = found.result.outcome
    if outcome.verdict == "accepted":
        return found
    return with_outcome(found, replace(outcome, reasons=(*explained(found), *outcome.reasons)))
