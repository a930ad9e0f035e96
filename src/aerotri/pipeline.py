"""The chain of stages: block → start values → unknowns → adjustment → statistics."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.datum import FREEDOMS, control_share, nothing_holds, restore_datum
from aerotri.adjustment.defects import SUSPECT_PIVOT, find_defects
from aerotri.adjustment.normal_equations import NormalEquations, NormalSystem
from aerotri.adjustment.prepare import build_system, prepare
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.solve import Solution, SolveOptions, minimise
from aerotri.adjustment.sparse_cholesky import Factor, NotPositiveDefiniteError
from aerotri.adjustment.unknowns import StartValues, State
from aerotri.formats.solution import SavedSolution
from aerotri.observations import Block
from aerotri.statistics.adjusted_block import AdjustedBlock, Outcome
from aerotri.statistics.summarise import count_observations, inseparable, summarise

RUNAWAY = 5.0
"""Factor by which a principal distance may change before the adjustment is taken for lost."""

LITTLE_CONTROL = 0.25
"""Share of the block's area that height control should span at least."""


class AdjustmentFailedError(Exception):
    """The adjustment has no result; `outcome` says why."""

    def __init__(self, outcome: Outcome):
        self.outcome = outcome
        super().__init__(f"{outcome.status}: {outcome.message}")


@dataclass(frozen=True, eq=False)
class Adjustment:
    """A result together with the system and solution it came from, for stages that need covariances beyond σ."""

    result: AdjustedBlock
    system: NormalSystem
    solution: Solution


def adjust(
    block: Block,
    report: Callable[[int, float, float], None] | None = None,
    given_points: np.ndarray | None = None,
) -> AdjustedBlock:
    """Adjust a block.

    Parameters
    ----------
    report : called after every iteration with (iteration, vᵀPv, damping).
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
    report: Callable[[int, float, float], None] | None = None,
    given_points: np.ndarray | None = None,
) -> Adjustment:
    """As `adjust`, with the equations and the solution beside the result."""
    begun = time.perf_counter()
    prepared = prepare(block, given_points)
    system, state = prepared.system, prepared.state
    started = time.perf_counter()
    counts = count_observations(system)
    if nothing_holds(system):
        free = f"the datum is free in {', '.join(FREEDOMS)}"
        raise AdjustmentFailedError(_failure(system, "rank deficient", _in_words(system, [free])))
    settings = block.settings.adjustment
    options = SolveOptions(settings.max_iterations, settings.robust, report)
    solution = minimise(system, state, counts.redundancy, options)
    if solution.defects:
        raise AdjustmentFailedError(_failure(system, "rank deficient", _in_words(system, list(solution.defects))))
    solution = _without_runaway(system, solution)
    if settings.datum in ("minimal", "inner"):
        moved = restore_datum(system.unknowns, solution.state, state.points)
        solution = replace(solution, state=moved, equations=system.assemble(moved, 0.0, solution.estimator))
    factor = _refuse_defects(system, solution.state, solution.equations)
    solved = time.perf_counter()
    warnings = prepared.warnings + _doubts(system, solution.state, counts.redundancy)
    result = summarise(system, solution, factor, prepared.ray_status, warnings)
    result = _with_warnings(result, inseparable(result.parameters))
    timings = {
        "start_values": started - begun, "solve": solved - started, "statistics": time.perf_counter() - solved,
    }  # fmt: skip
    return Adjustment(replace(result, outcome=replace(result.outcome, timings_s=timings)), system, solution)


def reopen(block: Block, saved: SavedSolution) -> Adjustment:
    """An adjustment from its saved solution: linearised and factorised once, never adjusted again.

    Parameters
    ----------
    block : as it was adjusted (the result's block/). saved : its solution.npz.
    """
    start = StartValues(saved.origin, saved.rotation, saved.centre, saved.points)
    held = [(int(point), int(axis)) for point, axis in saved.held]
    system, state = build_system(block, start, saved.ray_status, held)
    state = replace(state, shared=saved.shared)
    estimator = Estimator(saved.estimator_code, saved.estimator_limit)
    equations = system.assemble(state, 0.0, estimator)
    solution = Solution(saved.status, state, equations, estimator, saved.iterations)
    result = summarise(system, solution, _refuse_defects(system, state, equations), saved.ray_status, saved.warnings)
    return Adjustment(result, system, solution)


def _without_runaway(system: NormalSystem, solution: Solution) -> Solution:
    """A principal distance that ran away is no convergence, however small the residuals have become.

    Raises
    ------
    AdjustmentFailedError
    """
    u = system.unknowns
    ratio = u.interior(solution.state)[:, 0] / u.lens.base[:, 0]
    if (np.abs(np.log(np.maximum(ratio, 1e-12))) > np.log(RUNAWAY)).any():
        worst = int(np.argmax(np.abs(np.log(np.maximum(ratio, 1e-12)))))
        c, start = u.interior(solution.state)[worst, 0], u.lens.base[worst, 0]
        text = f"the principal distance ran from {start:g} to {c:.3g} mm: the parameters chosen cannot be told apart"
        raise AdjustmentFailedError(replace(_failure(system, "not converged", text), iterations=solution.iterations))
    return solution


def _with_warnings(result: AdjustedBlock, more: tuple[str, ...]) -> AdjustedBlock:
    return replace(result, outcome=replace(result.outcome, warnings=result.outcome.warnings + more))


def _doubts(system: NormalSystem, state: State, redundancy: int) -> tuple[str, ...]:
    block, doubts = system.unknowns.block, []
    share = control_share(system.unknowns, state)
    if block.settings.adjustment.datum == "control" and system.centres is None and share < LITTLE_CONTROL:
        doubts.append(
            f"the height control spans {100.0 * share:.0f} % of the block's area: beyond it heights are extrapolated, "
            "see their σ"
        )
    if redundancy <= 0:
        doubts.append(f"redundancy {redundancy}: nothing controls the observations, σ is not known")
    if block.gnss_ins is not None and np.isfinite(block.gnss_ins.angles).any():
        doubts.append("observed attitudes are not used as observations in this version")
    return tuple(doubts)


def _refuse_defects(system: NormalSystem, state: State, equations: NormalEquations) -> Factor:
    """The factor of the undamped equations; a defect ends the adjustment with the unknowns named.

    Raises
    ------
    AdjustmentFailedError
    """
    try:
        factor = system.factorise(equations)
        if factor.smallest_pivot > SUSPECT_PIVOT:
            return factor
    except NotPositiveDefiniteError:
        factor = None
    defects = find_defects(system, state, equations)
    if not defects:
        defects = [] if factor is not None else ["the normal equations are singular"]
    if defects:
        raise AdjustmentFailedError(_failure(system, "rank deficient", _in_words(system, defects)))
    return system.factorise(equations)


def _in_words(system: NormalSystem, defects: list[str]) -> str:
    u = system.unknowns
    text = "; ".join(defects)
    if u.block.settings.adjustment.datum != "control" or "datum" not in text:
        return text
    if nothing_holds(system):
        return f'no control: {text}. Give control points, or set datum = "minimal" or "inner"'
    return f"too little control: {text}"


def _failure(system: NormalSystem, status: str, message: str) -> Outcome:
    counts = count_observations(system)
    return Outcome(
        status=status, message=message, iterations=0, sigma0=np.nan, sigma0_um=np.nan, vtpv=np.nan,
        observations=counts.observations, unknowns=counts.unknowns, conditions=counts.conditions,
        redundancy=counts.redundancy,
    )  # fmt: skip
