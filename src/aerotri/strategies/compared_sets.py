"""Sets of additional parameters compared, wherever they are adjusted.

The first set that can be adjusted begins at the start values of the block; every other begins where that one ended.
No set depends on another one then, but for the first: they are tasks, and come out alike in any order and any place.
Folds of control points and groups of photographs are predicted within the task of their set, with its factor: to make
the factor again in a task of their own would take longer than what it is for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.solve import SolveOptions
from aerotri.execution.work import Work, Workplace
from aerotri.results.parameter_comparison import Choice, ParameterComparison, SetOutcome
from aerotri.strategies.parameter_comparison import Candidate, Progress, SetComparer, set_name

BYTES_OF_PROCESS, BYTES_OF_RAY = 300_000_000, 12_000
"""Memory of a process that adjusts sets, without and by rays of the block; with 26 541 and 112 339 rays 475 and 1253 MB
were measured for sets of up to 66 parameters that all act on every ray. The second is chosen [C] above that."""


def compare_sets(
    prepared: Prepared, choices: Sequence[Choice], folds: int, options: SolveOptions, progress: Progress | None = None,
    at: Workplace | None = None,
) -> ParameterComparison:  # fmt: skip
    """Adjust a block with every set, each from where the first one ended that could be adjusted.

    Parameters
    ----------
    prepared : the block with any set. folds : of the cross-validation over control points.
    progress : called before each set with its number from 1, how many there are, and its name; of sets adjusted
        elsewhere, when one is done.
    at : where the sets after the first are adjusted, a task each; in this process where None.

    Raises
    ------
    TasksFailedError
        When a set could not be computed elsewhere. One that does not converge is an outcome and no failure.
    """
    comparer, outcomes = SetComparer(prepared, folds, options), list[SetOutcome]()

    def tell(number: int) -> None:
        if progress is not None and number <= len(choices):
            progress(number, len(choices), set_name(choices[number - 1]))

    while len(outcomes) < len(choices) and not any(outcome.converged for outcome in outcomes):
        tell(len(outcomes) + 1)
        outcomes.append(comparer.outcome(Candidate(choices[len(outcomes)])))
    rest = choices[len(outcomes) :]
    if at is not None and rest:
        begun = len(outcomes) + 1
        tell(begun)
        outcomes += _apart(comparer, rest, lambda done: tell(begun + done), at)
        return comparer.comparison(outcomes)
    for choice in rest:
        tell(len(outcomes) + 1)
        outcomes.append(adjust_set(comparer, choice))
    return comparer.comparison(outcomes)


def adjust_set(comparer: SetComparer, choice: Choice) -> SetOutcome:
    """One set, adjusted from where the first one ended."""
    return comparer.outcome_from_here(Candidate(choice))


def _apart(
    comparer: SetComparer, choices: Sequence[Choice], done: Callable[[int], None], at: Workplace
) -> list[SetOutcome]:
    """Sets adjusted elsewhere; `done` is called with how many are."""
    work = Work(
        adjust_set, comparer, choices, [f"set {set_name(choice)}" for choice in choices], "sets of parameters",
        at.folder, BYTES_OF_PROCESS + BYTES_OF_RAY * comparer.rays,
    )  # fmt: skip
    return at.executor.run(work, lambda share: done(round(share * len(choices))))
