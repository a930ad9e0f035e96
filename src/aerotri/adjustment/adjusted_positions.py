"""Where additional parameters are evaluated: at the adjusted image points, not at the measured ones.

[D] Families that are functions of the position in the photograph say measured = ideal + d(measured position without its
error). Evaluated at the measured position m + e, the parameters p have the normal equations Σ B(m + e)ᵀ·P·v = 0 with
B(m + e) = B(m) + B′·e, and E(B′·e·v) = σ²·B′·r, r the redundancy of the ray: not zero. The parameters lean towards what
makes the photograph smaller. What a block determines well does not mind; the curvature of a block without positions of
the projection centres is determined so weakly that this moved heights by five times their σ (CU-SBR, held by control
alone). The adjusted position is free of it, because adjusted observations and residuals are not correlated.

The positions follow the adjustment: adjusted with those of before, evaluated anew, adjusted again, until they stand.
So do the velocities of photographs with a rolling shutter, which come from the adjusted projection centres, and the
heights that a parameter depends on.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np

from aerotri.adjustment.height_columns import relief_of
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.robust import Estimator, normalised_lengths, scale_of
from aerotri.adjustment.solve import INTERRUPTED, Solution, SolveOptions, minimise
from aerotri.adjustment.stopping import EARLY_STEP_TOLERANCE
from aerotri.adjustment.unknowns import State
from aerotri.functional_model.collinearity import INTERIOR_COLUMNS

MOST_ROUNDS = 5
"""Adjustments with new positions at most [C]: the second changes next to nothing."""
MOST_STEPS = 8
"""Steps of m = ideal + d(m) at most [C]: each shrinks the error by the slope of d, a few hundredths, rarely two
tenths."""
SETTLED, STANDING = 1e-4, 1e-3
"""Change of the positions (root mean square, in units of the residuals) below which one of these steps is the last,
and below which the adjustment need not follow [C]: what is left of the bias is in proportion."""
GROSS = 50.0
"""Residual in units of the residuals from which a ray keeps its measured position [C]: a blunder has no adjusted one
worth the name."""
LEAST_UNIT = 1e-6
"""Unit of the residuals, in stated σ, at least [C]: below, positions move by rounding."""
BROWN = np.array([name.startswith("brown.") for name in INTERIOR_COLUMNS])


def acts_by_position(system: NormalSystem) -> bool:
    """Whether an unknown parameter is a function of the position in the photograph."""
    u = system.unknowns
    if u.block.settings.adjustment.parameter_position == "measured":
        return False
    by_position = u.rays.ap_index.shape[1] > 0 or u.rays.held is not None or u.scanning is not None
    return bool(by_position or (u.lens.columns[:, BROWN] >= 0).any())


def follows_solution(system: NormalSystem) -> bool:
    """Whether something is evaluated anew where the adjustment ended."""
    u = system.unknowns
    return acts_by_position(system) or u.scanning is not None or u.linear.heights is not None


def at_adjusted_positions(system: NormalSystem, state: State, estimator: Estimator) -> NormalSystem:
    """The system with its parameters evaluated at the adjusted image points of a state, and velocities by its centres.

    A function of the state alone: the positions begin at the measured ones.
    """
    system = _at_heights(_on_track(system, state), state)
    if not acts_by_position(system):
        return system if system.unknowns.linear.heights is None else _evaluated_at(system, system.unknowns.rays.at)
    rays = system.unknowns.rays
    system = _evaluated_at(system, rays.xy)
    for _ in range(MOST_STEPS):
        residual = system.right_side(state, estimator).residual
        unit = unit_of_residuals(system, residual, estimator)
        gross = np.any(np.abs(residual * rays.inv_sigma) > GROSS * unit, axis=1, keepdims=True)
        before, system = system, _evaluated_at(system, np.where(gross, rays.xy, rays.xy - residual))
        if positions_moved(before, system) < SETTLED * unit:
            break
    return system


def unit_of_residuals(system: NormalSystem, residual: np.ndarray, estimator: Estimator) -> float:
    """Size of most residuals (m, 2) mm in stated σ, however far these are from true; gross errors do not count."""
    if estimator.is_robust:
        return max(estimator.scale, LEAST_UNIT)
    return max(scale_of(normalised_lengths(residual, system.unknowns.rays.inv_sigma), 1.0), LEAST_UNIT)


def minimise_at_adjusted(
    system: NormalSystem, state: State, redundancy: int, options: SolveOptions
) -> tuple[NormalSystem, Solution]:
    """As `solve.minimise`, with the parameters evaluated at the adjusted image points.

    Parameters that are determined at the measured points alone, by their noise, stay there: the block of the system
    then says so. An adjustment that does not converge stays there as well.

    Returns
    -------
    The system with the positions of the solution, and the solution.
    """
    if not follows_solution(system):
        return system, minimise(system, state, redundancy, options)
    early = max(options.step_tolerance, EARLY_STEP_TOLERANCE)
    solution = first = minimise(system, state, redundancy, replace(options, step_tolerance=early))
    for round_ in range(MOST_ROUNDS):
        if solution.status != "converged":
            break
        there = at_adjusted_positions(system, solution.state, solution.estimator)
        change = max(
            positions_moved(system, there),
            _moved_by_velocity(system, there, solution.state),
            _moved_by_height(system, there, solution.state),
        )
        unit = unit_of_residuals(system, solution.equations.residual, solution.estimator)
        is_near = round_ == 0 and solution.estimator.is_robust
        if round_ == MOST_ROUNDS - 1 or (change < STANDING * unit and not is_near):
            equations = there.assemble(solution.state, 0.0, solution.estimator)
            return there, replace(solution, equations=equations)
        again = minimise(there, solution.state, redundancy, options.going_on(solution))
        again = replace(again, iterations=solution.iterations + again.iterations)
        if again.status != "converged" and again.status != INTERRUPTED:
            if not acts_by_position(system):
                return there, again
            return _without_positions(_at_measured_positions(system), first, again.iterations, redundancy, options)
        system, solution = there, again
    return system, solution


def _without_positions(
    measured: NormalSystem, first: Solution, iterations: int, redundancy: int, options: SolveOptions
) -> tuple[NormalSystem, Solution]:
    """The solution with parameters at measured points; velocities of rolling shutters are still those of the solution.

    Parameters
    ----------
    first : near the solution before anything followed. iterations : made so far; those of the attempt do not count.
    """
    first = replace(first, iterations=iterations)
    if first.estimator.is_robust:
        first = minimise(measured, first.state, redundancy, options.going_on(first))
        first = replace(first, iterations=iterations + first.iterations)
    if not follows_solution(measured):
        return measured, first
    system, again = minimise_at_adjusted(measured, first.state, redundancy, options)
    return system, replace(again, iterations=first.iterations + again.iterations)


def _at_measured_positions(system: NormalSystem) -> NormalSystem:
    """The system with its parameters evaluated at the measured points, and a block that asks for it."""
    other = _evaluated_at(system, system.unknowns.rays.xy)
    block = other.unknowns.block
    adjustment = replace(block.settings.adjustment, parameter_position="measured")
    block = replace(block, settings=replace(block.settings, adjustment=adjustment))
    other.unknowns = replace(other.unknowns, block=block)
    return other


def _evaluated_at(system: NormalSystem, at: np.ndarray) -> NormalSystem:
    u, other = system.unknowns, copy(system)
    columns = u.linear.columns(at)
    rays = replace(
        u.rays, at=np.ascontiguousarray(at), ap_index=columns.index, ap_value=columns.value,
        held=u.linear.held.image_errors(at),
    )  # fmt: skip
    other.unknowns = replace(u, rays=rays)
    return other


def _on_track(system: NormalSystem, state: State) -> NormalSystem:
    """The system with the velocities of its photographs taken from the projection centres of a state."""
    u = system.unknowns
    if u.scanning is None:
        return system
    scanning = u.scanning.on_track(u.block, u.images, state.centre, state.rotation)
    other = copy(system)
    other.unknowns = replace(u, scanning=scanning)
    return other


def _at_heights(system: NormalSystem, state: State) -> NormalSystem:
    """The system with the heights of a state, for the parameters that depend on them; its columns are as they were."""
    u = system.unknowns
    if u.linear.heights is None:
        return system
    other = copy(system)
    relief = relief_of(state.centre, state.points, u.rays.image, u.rays.start)
    # the first heights come from start values and say nothing of flat ground
    u.linear.heights.at(relief).refuse_flat_ground()
    other.unknowns = replace(u, linear=u.linear.at(relief))
    return other


def _moved_by_height(system: NormalSystem, there: NormalSystem, state: State) -> float:
    """Root mean square change of the image points by the pattern at other heights, in σ."""
    before, after = system.unknowns.rays, there.unknowns.rays
    if there.unknowns.linear.heights is None or not len(before.at):
        return 0.0
    value = state.shared[after.ap_index[:, -1:]]
    moved = (after.ap_value[:, :, -1] - before.ap_value[:, :, -1]) * value * after.inv_sigma
    return float(np.sqrt(np.mean(moved**2)))


def _moved_by_velocity(system: NormalSystem, there: NormalSystem, state: State) -> float:
    """Root mean square change of the image points by other velocities, in σ, at most."""
    u, other = system.unknowns, there.unknowns
    if u.scanning is None or other.scanning is None:
        return 0.0
    rays, scanning = u.rays, other.scanning
    change = np.linalg.norm(scanning.velocity - u.scanning.velocity, axis=1)[rays.image]
    since = np.sum(scanning.rate[rays.image] * rays.at, axis=1) * scanning.readout(state.shared)[rays.image]
    point = np.repeat(np.arange(len(u.points)), np.diff(rays.start))
    distance = np.linalg.norm(state.points[point] - state.centre[rays.image], axis=1)
    c = u.interior(state)[rays.lens_row, 0]
    moved = c * change * np.abs(since) / np.maximum(distance, 1e-12) * rays.inv_sigma.max(axis=1)
    return float(np.sqrt(np.mean(moved**2))) if len(moved) else 0.0


def positions_moved(system: NormalSystem, there: NormalSystem) -> float:
    """Root mean square change of the positions, in σ."""
    rays = system.unknowns.rays
    change = (there.unknowns.rays.at - rays.at) * rays.inv_sigma
    return float(np.sqrt(np.mean(change**2))) if change.size else 0.0
