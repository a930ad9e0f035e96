"""An adjustment from its saved solution, without adjusting again."""

from __future__ import annotations

from dataclasses import replace

from aerotri.adjustment.adjusted_positions import at_adjusted_positions
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import StartValues
from aerotri.conventions import InputError
from aerotri.coordinates.blocks import frame_of_block, transform_block
from aerotri.formats.results.solution import SavedSolution
from aerotri.observations import Block
from aerotri.pipeline.local import undamped_factor
from aerotri.pipeline.model_part import with_model_part
from aerotri.pipeline.relative import with_relative
from aerotri.pipeline.verdict import judged, with_evidence, with_purpose
from aerotri.results.adjustment import Adjustment
from aerotri.results.in_crs import transform_result
from aerotri.statistics.common_motion import common_motion
from aerotri.statistics.common_shift import common_shift
from aerotri.statistics.rigidity import rigidity_of
from aerotri.statistics.summarise import summarise
from aerotri.strategies.deviation_estimation import ReducedToGroups, found_deviations
from aerotri.strategies.selection import with_removed, without_parameters
from aerotri.strategies.variance_components import with_components


def reopen(block: Block, saved: SavedSolution) -> Adjustment:
    """An adjustment from its saved solution: linearised and factorised once, never adjusted again.

    Parameters
    ----------
    block : as it was adjusted (the result's block/). saved : its solution.npz.
    """
    removals = saved.removal_records()
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
    state = system.unknowns.with_followers(replace(state, shared=saved.shared))
    estimator = Estimator(saved.estimator_code, saved.estimator_limit)
    system = system.with_motions_at(state)
    if saved.status == "converged":
        system = at_adjusted_positions(system, state, estimator)
    equations = system.assemble(state, 0.0, estimator)
    solution = Solution(saved.status, state, equations, estimator, saved.iterations)
    factor = undamped_factor(system, solution)
    result = replace(summarise(system, solution, factor, saved.ray_status, saved.warnings), block=local)
    deviations = None
    if system.priors.deviations and saved.status == "converged":
        deviations = found_deviations(system, ReducedToGroups.of(system, solution, factor))
    result = replace(
        result, parameters=with_removed(result.parameters, removals), removals=removals, deviations=deviations
    )
    rigidity = rigidity_of(system, solution, factor, result.outcome)
    result = replace(result, outcome=replace(result.outcome, notes=saved.notes))
    shift = common_shift(system, solution, factor, result.outcome.sigma0)
    result = replace(
        result, position_errors=saved.position_record(), photograph_fields=saved.photograph_record(), rigidity=rigidity,
        common_shift=shift, common_motion=common_motion(system, solution, factor, result.outcome.sigma0),
    )  # fmt: skip
    components = saved.component_record()
    if components is not None:
        result = with_components(result, components)
    if saved.verdict:
        result = replace(result, outcome=replace(result.outcome, verdict=saved.verdict, reasons=saved.reasons))
    delivered = result if frame is None else transform_result(result, block, frame)
    opened = Adjustment(delivered, result, system, solution, frame, other=saved.difference(system.unknowns))
    found = with_relative(with_model_part(opened))
    return with_purpose(with_evidence(found)) if saved.verdict else judged(found)


def _refuse_other_parameters(system: NormalSystem, saved: SavedSolution) -> None:
    """The shared parameters of the file have to be those of the block, one by one."""
    own, kept = system.unknowns.shared, saved
    same = len(own.names) == len(kept.shared) and (
        list(own.names) == kept.shared_names.tolist() and list(own.groups) == kept.shared_groups.tolist()
    )
    if not same:
        message = f"has {len(kept.shared)} shared parameters, the block beside it {len(own.names)} or others"
        raise InputError(message, "adjust the block again", "solution.npz")
