"""Sets of additional parameters compared in one block, and the choice among them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aerotri.adjustment.datum import FREEDOMS, nothing_holds
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.solve import SolveOptions
from aerotri.conventions import FilePath
from aerotri.coordinates.blocks import frame_of_block, transform_block
from aerotri.diagnosis.doubts import failure
from aerotri.observations import Block
from aerotri.pipeline.local import Report
from aerotri.pipeline.verdict import with_outcome
from aerotri.results.adjustment import Adjustment
from aerotri.results.parameter_comparison import Choice, ParameterComparison
from aerotri.strategies.parameter_choice import choose
from aerotri.strategies.parameter_comparison import Progress, compare_sets

FOLDS = 10
"""Parts in which control points are left out: with ten the sets are told apart as well as with every point by itself,
where there are many."""


def compare_parameters(
    block: Block,
    choices: Sequence[Choice],
    folds: int = FOLDS,
    geoid: FilePath | None = None,
    progress: Progress | None = None,
    report: Report | None = None,
) -> ParameterComparison:
    """Adjust a block with several sets of additional parameters, in the frame of the adjustment.

    Data snooping would take different rays out under each set: Huber's estimator stands in for it.

    Parameters
    ----------
    choices : as `parse_parameters` returns them. folds : parts in which control points are left out, one by one where
        there are no more points than that. progress : called before each set. report : after every iteration.
    """
    settings = block.settings.adjustment
    robust = "huber" if settings.robust == "data-snooping" else settings.robust
    plain = replace(settings, additional_parameters=(), parameter_selection="off", robust=robust)
    block = replace(block, settings=replace(block.settings, adjustment=plain))
    if block.crs != "local":
        block = transform_block(block, frame_of_block(block, geoid))
    prepared = prepare(block)
    if nothing_holds(prepared.system.unknowns, prepared.system.extras):
        raise failure(prepared.system, "rank deficient", f"the datum is free in {', '.join(FREEDOMS)}")
    return compare_sets(prepared, choices, folds, SolveOptions(settings.max_iterations, robust, report), progress)


def with_choice(block: Block, compared: ParameterComparison) -> Block:
    """The block with the additional parameters that the comparison speaks for."""
    adjustment = replace(block.settings.adjustment, additional_parameters=choose(compared).choice)
    return replace(block, settings=replace(block.settings, adjustment=adjustment))


def with_reason(found: Adjustment, compared: ParameterComparison) -> Adjustment:
    """The adjustment with the comparison, and why its parameters were chosen among the warnings."""
    outcome = found.result.outcome
    found = with_outcome(found, replace(outcome, warnings=(choose(compared).reason, *outcome.warnings)))
    return replace(found, compared=compared)
