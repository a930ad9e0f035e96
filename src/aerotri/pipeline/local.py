"""A block adjusted in its local frame: the stages from start values to statistics."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aerotri import of_known
from aerotri.adjustment.datum import FREEDOMS, nothing_holds, restore_datum
from aerotri.adjustment.defects import checked_factor, point_without_rays_enough
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.prepare import Prepared, prepare
from aerotri.adjustment.runaway_points import with_runaways_back
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.weak_geometry import go_on_without, minimise_tied
from aerotri.diagnosis.common_height import common_height
from aerotri.diagnosis.common_shift import common_shift_in_words
from aerotri.diagnosis.doubts import defects_in_words, doubts, failure, refuse_runaway, too_good_in_words
from aerotri.diagnosis.photograph_fields import photograph_fields_in_words
from aerotri.diagnosis.position_errors import position_errors_in_words
from aerotri.diagnosis.rigidity import movements_in_words, rigidity_in_words
from aerotri.observations import Block
from aerotri.pipeline.contradicting_marks import with_fitting_marks, without_contradicting_marks
from aerotri.results.adjusted_block import AdjustedBlock, Blunder
from aerotri.results.adjustment import Adjustment
from aerotri.results.deviations import Deviations
from aerotri.results.photograph_fields import PhotographFields
from aerotri.results.position_errors import PositionErrors
from aerotri.results.removal import Removal
from aerotri.statistics.common_motion import common_motion
from aerotri.statistics.common_shift import common_shift
from aerotri.statistics.loose_points import loose_by_rays, loose_in_words, loose_points, to_set_aside
from aerotri.statistics.rigidity import rigidity_of
from aerotri.statistics.summarise import count_observations, inseparable, summarise
from aerotri.strategies.deviation_estimation import with_estimated_deviations
from aerotri.strategies.field_estimation import with_estimated_fields
from aerotri.strategies.photograph_field_estimation import photograph_fields_of, with_photograph_fields
from aerotri.strategies.position_estimation import position_errors_of, with_position_errors
from aerotri.strategies.removal import with_datum_of
from aerotri.strategies.rig_estimation import with_estimated_movements
from aerotri.strategies.selection import select, with_findings_of, with_removed
from aerotri.strategies.snooping import snoop

Report = Callable[[int, float, float], None]
"""Called after every iteration with (iteration, σ0, damping)."""

ROUNDS_OF_LOOSE_POINTS = 3
"""Times that a robust adjustment goes on without the points that its covariance shows to be loose."""
DETERMINED_BY_NOISE = (
    "the additional parameters are evaluated at the measured image points: at the adjusted ones they are not "
    "determined, so only noise tells them from other unknowns. Adjust with fewer parameters"
)


@dataclass(frozen=True, eq=False)
class _Stand:
    """How far an adjustment has come.

    Parameters
    ----------
    prepared, solution : the equations, and where they are solved.
    block : as it will be delivered.
    blunders : taken out by data snooping. removals : additional parameters that the selection took out.
    deviations : how much parameters differ between groups of photographs.
    movements : (k, 2) bool, which σ of movements on weighted rigs were estimated.
    position_errors : what was found of errors of positions that stay; None where they were not estimated.
    photograph_fields : what was found of smooth errors of single photographs; None where nobody asked.
    """

    prepared: Prepared
    solution: Solution
    block: Block
    blunders: tuple[Blunder, ...] = ()
    removals: tuple[Removal, ...] = ()
    deviations: Deviations | None = None
    position_errors: PositionErrors | None = None
    photograph_fields: PhotographFields | None = None
    movements: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class _Delivered:
    """A solution in its datum with its statistics.

    Parameters
    ----------
    solved : time at which the statistics began, s.
    """

    stand: _Stand
    factor: Factor
    result: AdjustedBlock
    solved: float


def adjust_local(block: Block, report: Report | None, given_points: np.ndarray | None) -> Adjustment:
    """Adjust a block in the local frame, stage by stage."""
    begun = time.perf_counter()
    prepared = without_contradicting_marks(prepare(block, given_points))
    started = time.perf_counter()
    _refuse_without_datum(prepared)
    settings = block.settings.adjustment
    options = SolveOptions(settings.max_iterations, settings.robust, report)
    stand = _Stand(*_determined(_tied(prepared, options)), block)
    stand = _without_gross_errors(stand, options)
    stand = _with_fields(stand, options)
    stand = _with_photograph_fields(stand, options)
    stand = _with_deviations(stand, options)
    stand = _with_movements(stand, options)
    stand = _with_position_errors(stand, options)
    stand = _with_selected_parameters(stand, options)
    delivered = _without_loose_points(_delivered(stand), options)
    timings = {"start_values": started - begun, "solve": delivered.solved - started}
    return _with_words(delivered, timings)


def _tied(prepared: Prepared, options: SolveOptions) -> tuple[Prepared, Solution]:
    """The first solution, without what is too weak, and with the points that ran away brought back."""
    prepared, solution = minimise_tied(prepared, options, _redundancy)
    prepared, solution = with_runaways_back(prepared, solution, options, _redundancy)
    return with_fitting_marks(prepared, solution, options)


def _refuse_without_datum(prepared: Prepared) -> None:
    system = prepared.system
    if nothing_holds(system.unknowns, system.extras):
        free = f"the datum is free in {', '.join(FREEDOMS)}"
        raise failure(system, "rank deficient", defects_in_words(system, [free]))


def _without_gross_errors(stand: _Stand, options: SolveOptions) -> _Stand:
    """After data snooping, where it is asked for."""
    if options.robust != "data-snooping":
        return stand
    snooped = snoop(stand.prepared, stand.solution, options)
    block = with_datum_of(stand.block, snooped.prepared.system.unknowns.block)
    return replace(stand, prepared=snooped.prepared, solution=snooped.solution, block=block, blunders=snooped.blunders)


def _with_fields(stand: _Stand, options: SolveOptions) -> _Stand:
    """With the covariance of random fields estimated, where there are any."""
    system, solution = with_estimated_fields(stand.prepared.system, stand.solution, options)
    return replace(stand, prepared=replace(stand.prepared, system=system), solution=solution)


def _with_photograph_fields(stand: _Stand, options: SolveOptions) -> _Stand:
    """With the covariance of smooth errors of single photographs estimated, where they are asked for."""
    prepared, solution, found = with_photograph_fields(stand.prepared, stand.solution, options)
    return replace(stand, prepared=prepared, solution=solution, photograph_fields=found)


def _with_deviations(stand: _Stand, options: SolveOptions) -> _Stand:
    """With the sizes of deviations from group to group estimated, where there are any."""
    system, solution, found = with_estimated_deviations(stand.prepared.system, stand.solution, options)
    return replace(stand, prepared=replace(stand.prepared, system=system), solution=solution, deviations=found)


def _with_movements(stand: _Stand, options: SolveOptions) -> _Stand:
    """With the σ of movements on weighted rigs estimated, where the block does not state them."""
    system, solution, estimated = with_estimated_movements(stand.prepared.system, stand.solution, options)
    prepared = replace(stand.prepared, system=system)
    return replace(stand, prepared=prepared, solution=solution, movements=estimated)


def _with_position_errors(stand: _Stand, options: SolveOptions) -> _Stand:
    """With errors of positions that stay for a while estimated, where they are asked for."""
    prepared, solution, found = with_position_errors(stand.prepared, stand.solution, options)
    return replace(stand, prepared=prepared, solution=solution, position_errors=found)


def _with_selected_parameters(stand: _Stand, options: SolveOptions) -> _Stand:
    """After the selection of additional parameters, where it is asked for; the block says what was found."""
    if stand.block.settings.adjustment.parameter_selection == "on":
        found = select(stand.prepared, stand.solution, options)
        stand = replace(stand, prepared=found.prepared, solution=found.solution, removals=found.removals)
    block = with_findings_of(stand.block, stand.prepared.system.unknowns.block)
    if block.settings.adjustment.parameter_position != stand.block.settings.adjustment.parameter_position:
        warnings = (*stand.prepared.warnings, DETERMINED_BY_NOISE)
        stand = replace(stand, prepared=replace(stand.prepared, warnings=warnings))
    return replace(stand, block=block)


def _delivered(stand: _Stand) -> _Delivered:
    """The solution in its datum, with statistics."""
    prepared, solution, factor = _in_its_datum(stand.prepared, stand.solution)
    solved = time.perf_counter()
    stand = replace(stand, prepared=prepared, solution=solution)
    return _Delivered(stand, factor, _summarised(prepared, solution, factor), solved)


def _without_loose_points(delivered: _Delivered, options: SolveOptions) -> _Delivered:
    """A robust adjustment without the points that the covariance of the whole block shows to be loose.

    Where the rest does not converge without them they stay, and are named.
    """
    for _ in range(ROUNDS_OF_LOOSE_POINTS if delivered.stand.solution.estimator.is_robust else 0):
        stand, loose = delivered.stand, to_set_aside(delivered.result)
        if stand.solution.status != "converged" or not len(loose):
            break
        prepared, solution = go_on_without(stand.prepared, stand.solution, loose, options, _redundancy)
        if solution.status != "converged":
            # the factor of before was overwritten
            return _delivered(stand)
        _determined((prepared, solution))
        delivered = _delivered(replace(stand, prepared=prepared, solution=solution))
    return delivered


def _with_words(delivered: _Delivered, timings: dict[str, float]) -> Adjustment:
    """The adjustment with what the user has to be told beside its numbers."""
    stand, result = delivered.stand, delivered.result
    system, solution, sigma0 = stand.prepared.system, stand.solution, result.outcome.sigma0
    kept = np.union1d(loose_points(result), loose_by_rays(system, solution, sigma0))
    result = replace(
        result, parameters=with_removed(result.parameters, stand.removals), removals=stand.removals,
        deviations=stand.deviations,
    )  # fmt: skip
    errors = position_errors_of(system, solution, delivered.factor, sigma0, stand.position_errors)
    rigidity = rigidity_of(system, solution, delivered.factor, result.outcome)
    shift = common_shift(system, solution, delivered.factor, sigma0)
    motion = common_motion(system, solution, delivered.factor, sigma0)
    fields = photograph_fields_of(system, sigma0, stand.photograph_fields)
    result = replace(
        result, position_errors=errors, rigidity=rigidity, common_shift=shift, common_motion=motion,
        photograph_fields=fields,
    )  # fmt: skip
    timings = timings | {"statistics": time.perf_counter() - delivered.solved}
    tied = () if stand.deviations is None else (stand.deviations.sentence,)
    said = (*result.outcome.warnings, *too_good_in_words(result), *tied, *loose_in_words(result, kept))
    said += inseparable(result.parameters)
    shared_height = common_height(system, solution, delivered.factor, sigma0)
    if shared_height is not None:
        sentence = shared_height.sentence(of_known.median(result.points.sigma[:, 2]))
        said += (sentence,) if sentence else ()
    found = common_shift_in_words(shift), position_errors_in_words(errors), photograph_fields_in_words(fields)
    said += tuple(words for words in found if words)
    said += rigidity_in_words(rigidity)
    if result.rig_movements is not None and stand.movements is not None:
        movements = replace(result.rig_movements, estimated=stand.movements[_cameras_that_move(system)])
        result = replace(result, rig_movements=movements)
        said += movements_in_words(movements)
    outcome = replace(result.outcome, warnings=said, timings_s=timings)
    result = replace(result, block=stand.block, outcome=outcome, blunders=stand.blunders + result.blunders)
    return Adjustment(result, result, system, solution)


def _cameras_that_move(system: NormalSystem) -> np.ndarray:
    """Rows of the mountings of weighted rigs that photographs have."""
    ties = system.unknowns.ties
    return np.zeros(0, dtype=np.int64) if ties is None else np.unique(ties.mounting)


def _redundancy(system: NormalSystem) -> int:
    return count_observations(system).redundancy


def _determined(found: tuple[Prepared, Solution]) -> tuple[Prepared, Solution]:
    """What was adjusted, if the observations determine it.

    Raises
    ------
    AdjustmentFailedError
    """
    prepared, solution = found
    # where the principal distance ran away everything is undetermined, and names nothing of use
    refuse_runaway(prepared.system, solution, prepared.state)
    if solution.defects:
        status = solution.status if solution.status == "not converged" else "rank deficient"
        raise failure(prepared.system, status, defects_in_words(prepared.system, solution.defects))
    return found


def _in_its_datum(prepared: Prepared, solution: Solution) -> tuple[Prepared, Solution, Factor]:
    """The solution of a free block moved to where its datum wants it, any other as it is; with its factor."""
    system = prepared.system
    if system.unknowns.block.settings.adjustment.is_free:
        free = system.with_motions_at(solution.state).unknowns
        moved = restore_datum(free, solution.state, prepared.state.points)
        system = system.with_motions_at(moved)
        solution = replace(solution, state=moved, equations=system.assemble(moved, 0.0, solution.estimator))
    return replace(prepared, system=system), solution, undamped_factor(system, solution)


def _summarised(prepared: Prepared, solution: Solution, factor: Factor) -> AdjustedBlock:
    warnings = prepared.warnings + doubts(prepared.system, solution.state)
    return summarise(prepared.system, solution, factor, prepared.ray_status, warnings)


def undamped_factor(system: NormalSystem, solution: Solution) -> Factor:
    """The factor of the undamped equations; a defect ends the adjustment with the unknowns named.

    Raises
    ------
    AdjustmentFailedError
    """
    equations = solution.equations
    factor, defects = checked_factor(system, solution.state, equations, solution.estimator)
    defects += point_without_rays_enough(system, solution.state, equations)
    if factor is None or defects:
        raise failure(system, "rank deficient", defects_in_words(system, defects))
    return factor
