"""The chain of stages: block → local frame → start values → unknowns → adjustment → statistics → CRS of the block."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from aerotri.adjustment.datum import FREEDOMS, nothing_holds, restore_datum
from aerotri.adjustment.defects import checked_factor, point_without_rays_enough
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.prepare import NoStartValuesError, Prepared, prepare
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import StartValues
from aerotri.adjustment.weak_geometry import go_on_without, minimise_tied
from aerotri.conventions import FilePath, InputError
from aerotri.coordinates.blocks import frame_of_block, needs_positions, transform_block
from aerotri.coordinates.metric import outside_in_words
from aerotri.diagnosis import diagnose, judge
from aerotri.diagnosis.check_points import in_doubt
from aerotri.diagnosis.common_height import common_height
from aerotri.diagnosis.doubts import defects_in_words, doubts, failure, refuse_runaway
from aerotri.formats.results.solution import SavedSolution
from aerotri.functional_model.additional_parameters import AUTO
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock, Blunder, Outcome
from aerotri.results.adjustment import Adjustment
from aerotri.results.failure import AdjustmentFailedError
from aerotri.results.in_crs import transform_result
from aerotri.results.parameter_comparison import Choice, ParameterComparison
from aerotri.results.removal import Removal
from aerotri.results.variance_components import VarianceComponents
from aerotri.statistics.check_freedom import check_freedom
from aerotri.statistics.loose_points import loose_by_rays, loose_in_words, loose_points, to_set_aside
from aerotri.statistics.observation_groups import with_scaled_sigmas
from aerotri.statistics.summarise import count_observations, inseparable, summarise
from aerotri.strategies.field_estimation import with_estimated_fields
from aerotri.strategies.parameter_choice import candidate_sets, choose
from aerotri.strategies.parameter_comparison import Progress, compare_sets
from aerotri.strategies.removal import with_datum_of
from aerotri.strategies.selection import select, with_findings_of, with_removed, without_parameters
from aerotri.strategies.snooping import snoop
from aerotri.strategies.variance_components import Fitted, estimate_components, in_words, with_components

__all__ = ["Adjustment", "AdjustmentFailedError", "adjust", "adjust_keeping_system", "reopen"]

Report = Callable[[int, float, float], None]
FOLDS = 10
FRAME_ROUNDS = 2
"""Adjustments after the first one where a coordinate's place in the local frame depends on the adjusted position."""
ROUNDS_OF_LOOSE_POINTS = 3
"""Times that a robust adjustment goes on without the points that its covariance shows to be loose."""


def adjust(block: Block, report: Report | None = None, given_points: np.ndarray | None = None) -> AdjustedBlock:
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
    report: Report | None = None,
    given_points: np.ndarray | None = None,
    geoid: FilePath | None = None,
) -> Adjustment:
    """As `adjust`, with the equations and the solution beside the result.

    Parameters
    ----------
    geoid : grid of geoid undulations for a block whose CRS has none of its own.
    """
    if block.settings.adjustment.additional_parameters == AUTO:
        return _adjust_with_chosen_parameters(block, report, given_points, geoid)
    found = _adjust_in_frame(block, report, given_points, geoid)
    if block.settings.adjustment.variance_components == "on":
        found = _with_variance_components(block, found, report, geoid)
    return judged(found)


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
    try:
        found = adjust_keeping_system(block, report, geoid=geoid)
    except AdjustmentFailedError as error:
        o = error.outcome
        raise AdjustmentFailedError(replace(o, reasons=(*_causes(block, None, geoid, say), *o.reasons))) from error
    except NoStartValuesError as error:
        causes = _causes(block, None, geoid, say)
        if not causes:
            raise
        raise NoStartValuesError(error.message, "; ".join(causes), error.file) from error
    outcome = found.result.outcome
    if outcome.verdict == "accepted":
        return found
    return _with_outcome(found, replace(outcome, reasons=(*_causes(block, found, geoid, say), *outcome.reasons)))


def _causes(
    block: Block, found: Adjustment | None, geoid: FilePath | None, say: Callable[[str], None]
) -> tuple[str, ...]:
    """The usual mistake that explains a block, in words; nothing where none does."""
    say("looking for what explains it")
    try:
        frame = None if block.crs == "local" else frame_of_block(block, geoid)
    except InputError:
        frame = None
    return diagnose(
        block, lambda changed: adjust_keeping_system(changed, geoid=geoid).result,
        None if found is None else found.local, frame,
    )  # fmt: skip


def judged(found: Adjustment) -> Adjustment:
    """The adjustment with the verdict over it."""
    if found.local.block.settings.adjustment.datum == "control" and in_doubt(found.local):
        factor = found.system.factorise(found.solution.equations)
        freedom = check_freedom(found.system, found.solution, factor, found.local)
        local = replace(found.local, check=replace(found.local.check, freedom=freedom))
        found = replace(found, local=local, result=local if found.frame is None else found.result)
    verdict = judge(found.local)
    outcome = replace(found.result.outcome, verdict=verdict.level, reasons=verdict.reasons)
    return _with_outcome(found, outcome)


def _with_outcome(found: Adjustment, outcome: Outcome) -> Adjustment:
    result = replace(found.result, outcome=outcome)
    local = replace(found.local, outcome=outcome) if found.frame is not None else result
    return replace(found, result=result, local=local)


def _adjust_with_chosen_parameters(
    block: Block, report: Report | None, given_points: np.ndarray | None, geoid: FilePath | None
) -> Adjustment:
    compared = compare_parameters(block, candidate_sets(block), geoid=geoid, report=report)
    chosen = choose(compared)
    adjustment = replace(block.settings.adjustment, additional_parameters=chosen.choice)
    block = replace(block, settings=replace(block.settings, adjustment=adjustment))
    found = adjust_keeping_system(block, report, given_points, geoid)
    outcome = found.result.outcome
    found = _with_outcome(found, replace(outcome, warnings=(chosen.reason, *outcome.warnings)))
    return replace(found, compared=compared)


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


def _adjust_in_frame(
    block: Block, report: Report | None, given_points: np.ndarray | None, geoid: FilePath | None
) -> Adjustment:
    if block.crs == "local":
        return _adjust_local(block, report, given_points)
    frame = frame_of_block(block, geoid)
    points = None if given_points is None else frame.to_local(given_points)
    outside = outside_in_words(frame)
    found = _adjust_local(transform_block(block, frame), report, points)
    for _ in range(FRAME_ROUNDS if needs_positions(block) else 0):
        local = transform_block(block, frame, found.local.points.xyz, found.local.images.centre)
        found = _adjust_local(local, report, found.local.points.xyz)
    if outside:
        outcome = found.local.outcome
        local = replace(found.local, outcome=replace(outcome, warnings=(outside, *outcome.warnings)))
        found = replace(found, local=local)
    used = with_findings_of(with_datum_of(block, found.local.block), found.local.block)
    try:
        result = transform_result(found.local, used, frame)
    except InputError as error:
        raise failure(
            found.system, "not converged", f"the block ran away: {error}", found.solution.iterations
        ) from error
    return replace(found, result=result, frame=frame)


def _with_variance_components(
    block: Block, first: Adjustment, report: Report | None, geoid: FilePath | None
) -> Adjustment:
    """The adjustment with the σ of every group estimated; the block of the result has these σ."""
    latest, used = first, block
    timings = [dict(first.result.outcome.timings_s)]

    def readjust(factors: Mapping[str, float]) -> Fitted:
        nonlocal latest, used
        used = with_scaled_sigmas(block, factors)
        latest = _adjust_in_frame(_continued(used, latest.result), report, latest.result.points.xyz, geoid)
        timings.append(dict(latest.result.outcome.timings_s))
        return Fitted(latest.local, latest.system, latest.solution)

    started = time.perf_counter()
    components, _ = estimate_components(Fitted(first.local, first.system, first.solution), readjust)
    readjusting = sum(sum(round_.values()) for round_ in timings[1:])
    seconds = {stage: sum(round_.get(stage, 0.0) for round_ in timings) for stage in timings[0]}
    seconds["statistics"] += time.perf_counter() - started - readjusting
    said = (*latest.result.outcome.warnings, *in_words(components))
    outcome = replace(latest.result.outcome, warnings=said, timings_s=seconds)
    # the rounds began at what was adjusted; the block keeps the orientations that were given
    given = replace(latest.local.block, images=first.local.block.images)
    local = replace(with_components(latest.local, components), outcome=outcome, block=given)
    delivered = with_findings_of(with_datum_of(used, latest.result.block), latest.result.block)
    result = replace(latest.result, groups=local.groups, components=components, outcome=outcome, block=delivered)
    return replace(latest, result=result, local=local if latest.frame is not None else result)


def _continued(block: Block, result: AdjustedBlock) -> Block:
    """The block with what was adjusted as start values."""
    images, found = block.images, result.images
    there = np.isfinite(found.centre).all(axis=1, keepdims=True)
    centre, angles = np.where(there, found.centre, images.centre), np.where(there, found.angles, images.angles)
    return replace(block, images=replace(images, centre=centre, angles=angles))


def reopen(block: Block, saved: SavedSolution) -> Adjustment:
    """An adjustment from its saved solution: linearised and factorised once, never adjusted again.

    Parameters
    ----------
    block : as it was adjusted (the result's block/). saved : its solution.npz.
    """
    removals = tuple(Removal(**removal) for removal in json.loads(saved.removals or "[]"))
    block = without_parameters(block, [(removal.name, removal.group) for removal in removals])
    frame, local = None, block
    if block.crs != "local":
        frame = frame_of_block(block, saved.geoid or None, saved.frame_origin)
        local = transform_block(block, frame, saved.points + saved.origin, saved.centre + saved.origin)
    start = StartValues(saved.origin, saved.rotation, saved.centre, saved.points)
    held = [(int(point), int(axis)) for point, axis in saved.held]
    measured = replace(local, image_points=replace(local.image_points, xy=saved.xy))
    system, state = build_system(measured, start, saved.ray_status, held)
    _refuse_other_parameters(system, saved)
    state = replace(state, shared=saved.shared)
    estimator = Estimator(saved.estimator_code, saved.estimator_limit)
    system = system.with_motions_at(state)
    equations = system.assemble(state, 0.0, estimator)
    solution = Solution(saved.status, state, equations, estimator, saved.iterations)
    factor = _factor(system, solution)
    result = replace(summarise(system, solution, factor, saved.ray_status, saved.warnings), block=local)
    result = replace(result, parameters=with_removed(result.parameters, removals), removals=removals)
    if saved.components:
        result = with_components(result, VarianceComponents.from_json(saved.components))
    if saved.verdict:
        result = replace(result, outcome=replace(result.outcome, verdict=saved.verdict, reasons=saved.reasons))
    delivered = result if frame is None else transform_result(result, block, frame)
    found = Adjustment(delivered, result, system, solution, frame)
    return found if saved.verdict else judged(found)


def _refuse_other_parameters(system: NormalSystem, saved: SavedSolution) -> None:
    """The shared parameters of the file have to be those of the block, one by one."""
    own, kept = system.unknowns.shared, saved
    same = len(own.names) == len(kept.shared) and (
        list(own.names) == kept.shared_names.tolist() and list(own.groups) == kept.shared_groups.tolist()
    )
    if not same:
        message = f"has {len(kept.shared)} shared parameters, the block beside it {len(own.names)} or others"
        raise InputError(message, "adjust the block again", "solution.npz")


def _adjust_local(block: Block, report: Report | None, given_points: np.ndarray | None) -> Adjustment:
    begun = time.perf_counter()
    prepared = prepare(block, given_points)
    started = time.perf_counter()
    if nothing_holds(prepared.system.unknowns, prepared.system.extras):
        free = f"the datum is free in {', '.join(FREEDOMS)}"
        raise failure(prepared.system, "rank deficient", defects_in_words(prepared.system, [free]))
    settings = block.settings.adjustment
    options = SolveOptions(settings.max_iterations, settings.robust, report)
    prepared, solution = _determined(minimise_tied(prepared, options, _redundancy))
    removed: tuple[Blunder, ...] = ()
    if settings.robust == "data-snooping":
        snooped = snoop(prepared, solution, options)
        prepared, solution, removed = snooped.prepared, snooped.solution, snooped.blunders
        block = with_datum_of(block, prepared.system.unknowns.block)
    system, solution = with_estimated_fields(prepared.system, solution, options)
    prepared = replace(prepared, system=system)
    removals: tuple[Removal, ...] = ()
    if settings.parameter_selection == "on":
        selected = select(prepared, solution, options)
        prepared, solution, removals = selected.prepared, selected.solution, selected.removals
    block = with_findings_of(block, prepared.system.unknowns.block)
    prepared, solution, factor = _in_its_datum(prepared, solution)
    solved = time.perf_counter()
    result = _summarised(prepared, solution, factor)
    for _ in range(ROUNDS_OF_LOOSE_POINTS if solution.estimator.is_robust else 0):
        loose = to_set_aside(result)
        if solution.status != "converged" or not len(loose):
            break
        found = _determined(go_on_without(prepared, solution, loose, options, _redundancy))
        prepared, solution, factor = _in_its_datum(*found)
        solved = time.perf_counter()
        result = _summarised(prepared, solution, factor)
    system = prepared.system
    kept = np.union1d(loose_points(result), loose_by_rays(system, solution, result.outcome.sigma0))
    result = replace(result, parameters=with_removed(result.parameters, removals), removals=removals)
    timings = {
        "start_values": started - begun,
        "solve": solved - started,
        "statistics": time.perf_counter() - solved,
    }
    said = (*result.outcome.warnings, *loose_in_words(result, kept), *inseparable(result.parameters))
    shared_height = common_height(system, solution, factor, result.outcome.sigma0)
    if shared_height is not None:
        said += tuple(s for s in [shared_height.sentence(float(np.nanmedian(result.points.sigma[:, 2])))] if s)
    blunders = removed + result.blunders
    outcome = replace(result.outcome, warnings=said, timings_s=timings)
    result = replace(result, block=block, outcome=outcome, blunders=blunders)
    return Adjustment(result, result, system, solution)


def _redundancy(system: NormalSystem) -> int:
    return count_observations(system).redundancy


def _determined(found: tuple[Prepared, Solution]) -> tuple[Prepared, Solution]:
    """What was adjusted, if the observations determine it.

    Raises
    ------
    AdjustmentFailedError
    """
    prepared, solution = found
    if solution.defects:
        raise failure(prepared.system, "rank deficient", defects_in_words(prepared.system, solution.defects))
    refuse_runaway(prepared.system, solution)
    return found


def _in_its_datum(prepared: Prepared, solution: Solution) -> tuple[Prepared, Solution, Factor]:
    """The solution of a free block moved to where its datum wants it, any other as it is; with its factor."""
    system = prepared.system
    if system.unknowns.block.settings.adjustment.is_free:
        free = system.with_motions_at(solution.state).unknowns
        moved = restore_datum(free, solution.state, prepared.state.points)
        system = system.with_motions_at(moved)
        solution = replace(solution, state=moved, equations=system.assemble(moved, 0.0, solution.estimator))
    return replace(prepared, system=system), solution, _factor(system, solution)


def _summarised(prepared: Prepared, solution: Solution, factor: Factor) -> AdjustedBlock:
    warnings = prepared.warnings + doubts(prepared.system, solution.state)
    return summarise(prepared.system, solution, factor, prepared.ray_status, warnings)


def _factor(system: NormalSystem, solution: Solution) -> Factor:
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
