"""Sets of additional parameters compared in one block, and the choice among them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.datum import FREEDOMS, nothing_holds
from aerotri.adjustment.prepare import Prepared, prepare
from aerotri.adjustment.solve import SolveOptions
from aerotri.conventions import FilePath
from aerotri.coordinates.blocks import frame_of_block, transform_block
from aerotri.diagnosis.doubts import failure
from aerotri.execution.work import Workplace
from aerotri.observations import Block, PhotographFieldSettings
from aerotri.pipeline.contradicting_marks import without_contradicting_marks
from aerotri.pipeline.starting import with_start
from aerotri.pipeline.verdict import with_outcome
from aerotri.results.adjustment import Adjustment
from aerotri.results.parameter_comparison import Choice, ParameterComparison, SetOutcome
from aerotri.strategies.compared_sets import compare_sets
from aerotri.strategies.moving_sets import moving_outcomes, names_of_strips
from aerotri.strategies.other_set import set_difference
from aerotri.strategies.parameter_choice import Chosen, choose, sets_to_choose_from
from aerotri.strategies.parameter_comparison import (
    Candidate,
    Progress,
    SetComparer,
    set_name,
    with_candidate,
)
from aerotri.strategies.parameter_sample import sampled_status

FOLDS = 10
"""Parts in which control points are left out: with ten the sets are told apart as well as with every point by itself,
where there are many."""
CHOICE_TOLERANCE = 0.1
"""Share of σ within which an adjustment ends that is made for the choice [C]: what it moves is far below what tells two
sets apart."""


@dataclass(frozen=True, eq=False)
class ParameterChoice:
    """The sets that were compared, the one that was chosen, and the block that takes it.

    Parameters
    ----------
    bare : the block as it was given. strips : (n,) names of its strips, None where some photograph has none.
    """

    compared: ParameterComparison
    chosen: Chosen
    bare: Block
    strips: np.ndarray | None

    @property
    def block(self) -> Block:
        chosen = self.chosen
        return with_candidate(self.bare, Candidate(chosen.choice, chosen.groups, chosen.kind), self.strips)


def compare_parameters(
    block: Block,
    choices: Sequence[Choice],
    folds: int = FOLDS,
    geoid: FilePath | None = None,
    progress: Progress | None = None,
    at: Workplace | None = None,
) -> ParameterComparison:
    """Adjust a block with several sets of additional parameters, in the frame of the adjustment.

    Data snooping would take different rays out under each set: Huber's estimator stands in for it.

    Parameters
    ----------
    choices : as `parse_parameters` returns them. folds : parts in which control points are left out, one by one where
        there are no more points than that. progress : called before each set.
    at : where the sets after the first are adjusted, a task each; in this process where None.

    Raises
    ------
    TasksFailedError
        When a set could not be computed elsewhere.
    """
    prepared = _prepared_without(with_start(block, geoid).block, geoid)
    settings = prepared.system.unknowns.block.settings.adjustment
    options = SolveOptions(settings.max_iterations, settings.robust)
    return compare_sets(prepared, choices, folds, options, progress, at)


def choose_parameters(
    block: Block,
    geoid: FilePath | None = None,
    progress: Progress | None = None,
) -> ParameterChoice:
    """Choose the additional parameters of a block by what they predict, large blocks by a sample.

    Where no set can be adjusted there are none: the adjustment then says what is wrong with the block.
    """
    prepared = _prepared_without(block, geoid)
    settings = prepared.system.unknowns.block.settings.adjustment
    options = SolveOptions(settings.max_iterations, settings.robust, step_tolerance=CHOICE_TOLERANCE)
    strips, sets = names_of_strips(prepared), sets_to_choose_from(block)
    sample = sampled_status(prepared)
    comparer = SetComparer(prepared, FOLDS, options, sample, strips)
    outcomes = _outcomes(comparer, sets, progress)
    if not any(outcome.converged for outcome in outcomes) and (sample != prepared.ray_status).any():
        # a part of a block may be loose where the whole is not
        comparer = SetComparer(prepared, FOLDS, options, strips=strips)
        outcomes = _outcomes(comparer, sets, progress)
    if progress is not None:
        progress(len(sets) + 1, len(sets) + 1, "parameters that change")
    outcomes += moving_outcomes(comparer, prepared, strips, outcomes)
    compared = comparer.comparison(outcomes)
    if any(outcome.converged for outcome in outcomes):
        chosen = choose(compared)
    else:
        chosen = Chosen("none", (), "no set of additional parameters could be adjusted: adjusted without")
    return ParameterChoice(compared, chosen, block, strips)


def _outcomes(comparer: SetComparer, sets: Sequence[Choice], progress: Progress | None) -> list[SetOutcome]:
    """Every set, adjusted from where the one before it ended; one step of `progress` is left for what comes after."""
    outcomes = list[SetOutcome]()
    for number, choice in enumerate(sets, start=1):
        if progress is not None:
            progress(number, len(sets) + 1, set_name(choice))
        outcomes.append(comparer.outcome(Candidate(choice)))
    return outcomes


def choose_again(made: ParameterChoice, status: str) -> ParameterChoice | None:
    """The choice among the other sets, where the adjustment with the one chosen ended with `status`; None of none."""
    failed = made.chosen.name
    outcomes = tuple(replace(o, status=status) if o.name == failed else o for o in made.compared.outcomes)
    if not any(outcome.converged for outcome in outcomes):
        return None
    compared = replace(made.compared, outcomes=outcomes)
    chosen = choose(compared)
    chosen = replace(chosen, reason=f"{chosen.reason}. The adjustment with {failed}, chosen first, did not converge")
    return replace(made, compared=compared, chosen=chosen)


def _prepared_without(block: Block, geoid: FilePath | None) -> Prepared:
    """The block in the frame of its adjustment, without additional parameters."""
    settings = block.settings.adjustment
    robust = "huber" if settings.robust == "data-snooping" else settings.robust
    plain = replace(settings, additional_parameters=(), parameter_selection="off", robust=robust)
    # sets are compared for what all photographs have in common; errors of their own would take part of it
    settings = replace(block.settings, adjustment=plain, photograph_fields=PhotographFieldSettings())
    block = replace(block, settings=settings)
    if block.crs != "local":
        block = transform_block(block, frame_of_block(block, geoid))
    prepared = without_contradicting_marks(prepare(block))
    if nothing_holds(prepared.system.unknowns, prepared.system.extras):
        raise failure(prepared.system, "rank deficient", f"the datum is free in {', '.join(FREEDOMS)}")
    return prepared


def with_rival(found: Adjustment, choice: ParameterChoice) -> Adjustment:
    """The adjustment with what the set changes that the choice could not tell from the one it took."""
    rival = choice.chosen.rival
    if rival is None or choice.bare.settings.adjustment.model_part == "off":
        return found
    candidate = Candidate(rival.choice, rival.groups, rival.kind)
    return replace(found, other=set_difference(found, candidate, rival.weight, choice.bare, choice.strips))


def with_reason(found: Adjustment, choice: ParameterChoice) -> Adjustment:
    """The adjustment with the comparison, and why its parameters were chosen among the notes."""
    outcome = found.result.outcome
    found = with_outcome(found, replace(outcome, notes=(choice.chosen.reason, *outcome.notes)))
    return replace(found, compared=choice.compared)
