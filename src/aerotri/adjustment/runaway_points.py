"""Points that ran away in an adjustment by least squares: taken out, intersected anew, and brought back.

From poor start values a point of two or three rays can be led through infinity while the photographs are still far off.
It then comes to rest far away or behind its photographs, in a minimum of its own: its rays miss it by hundreds of σ and
pull their photographs along. A point that really is far away fits its rays, and stays.

[D] What the rest of the block says of the photographs does not depend on such a point. So the rest is adjusted without
it, its rays are intersected from there, and the block is adjusted with it again. Where its rays do not meet, or it runs
away once more, it is left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.carry_over import reference_state, start_values_at, with_shared
from aerotri.adjustment.directions import directions_of
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.ray_status import RayStatus, some_names, with_weak_words
from aerotri.adjustment.robust import normalised_lengths, scale_of
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.start_values import intersect_into
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import StartValues, State
from aerotri.adjustment.weak_geometry import LOOSE, MOST, go_on_without

MISSED = 50.0
"""σ of most residuals by which the rays of a point have to miss it [C]: those of a point that ran away miss it by
hundreds, wrong matches in a block that fits (BAL's problem 49) by up to 45."""

Redundancy = Callable[[NormalSystem], int]


def with_runaways_back(
    prepared: Prepared, solution: Solution, options: SolveOptions, redundancy: Redundancy
) -> tuple[Prepared, Solution]:
    """The block and its solution with the points that ran away brought back, or left out where they cannot be.

    Parameters
    ----------
    solution : by least squares; any other is returned as it is, and so is one whose rest does not converge.
    """
    u = prepared.system.unknowns
    points = u.points[runaway_points(prepared.system, solution, redundancy(prepared.system))]
    if not len(points):
        return prepared, solution
    rest, without = go_on_without(prepared, solution, points, options, redundancy)
    if without.status != "converged":
        return prepared, solution
    start = _intersected(rest, without, points)
    meeting = points[np.isfinite(start.points[points]).all(axis=1)]
    back = _brought_back(prepared, rest, without, start, meeting)
    if back is not None:
        freedom = redundancy(back[0].system)
        system, again = minimise_at_adjusted(back[0].system, back[1], freedom, options.after(without.iterations))
        if again.status == "converged" and not len(runaway_points(system, again, freedom)):
            again = replace(again, iterations=without.iterations + again.iterations)
            return _left_out(replace(back[0], system=system), prepared, np.setdiff1d(points, meeting)), again
    return _left_out(rest, prepared, points), without


def runaway_points(system: NormalSystem, solution: Solution, redundancy: int) -> np.ndarray:
    """Rows of the points that are behind a photograph of theirs or not fixed in distance, and miss their rays.

    None where the adjustment is robust or did not converge, and none where they are so many that it is the block.
    """
    u, state = system.unknowns, solution.state
    if solution.estimator.is_robust or solution.status != "converged" or not len(u.points):
        return np.zeros(0, dtype=np.int64)
    point = np.repeat(np.arange(len(u.points)), np.diff(u.rays.start))
    length = normalised_lengths(solution.equations.residual, u.rays.inv_sigma)
    scale = scale_of(length, redundancy / max(redundancy + u.count, 1))
    missed, behind = np.zeros(len(u.points), bool), np.zeros(len(u.points), bool)
    missed[point[length > MISSED * scale]] = True
    if not missed.any():
        return np.zeros(0, dtype=np.int64)
    reach = state.points[point] - state.centre[u.rays.image]
    behind[point[np.einsum("mi,mi->m", state.rotation[u.rays.image, :, 2], reach) >= 0.0]] = True
    loose = scale * system.looseness(state, solution.estimator) > LOOSE
    found = np.flatnonzero(missed & (behind | loose) & (u.kept < 0) & ~u.point_held.any(axis=1))
    return found if len(found) <= MOST * len(u.points) else found[:0]


def _intersected(rest: Prepared, without: Solution, points: np.ndarray) -> StartValues:
    """Where the rest of the block stands, with these points where their rays meet; NaN where they do not."""
    u = rest.system.unknowns
    start = start_values_at(u, without.state)
    found = np.full_like(start.points, np.nan)
    intersect_into(found, u.block, directions_of(u.block), start.rotation, start.centre)
    xyz = start.points.copy()
    xyz[points] = found[points]
    return replace(start, points=xyz)


def _brought_back(
    prepared: Prepared, rest: Prepared, without: Solution, start: StartValues, points: np.ndarray
) -> tuple[Prepared, State] | None:
    """The block with these points again, and the state to go on from; None where there are none."""
    if not len(points):
        return None
    u, rays = rest.system.unknowns, prepared.system.unknowns.block.image_points
    status = np.where(np.isin(rays.point, points), prepared.ray_status, rest.ray_status)
    system, begin = build_system(u.block, start, status)
    reference = reference_state(system.unknowns, prepared.system.unknowns, begin, prepared.state)
    state = with_shared(system.unknowns, u, begin, without.state)
    return Prepared(system, reference, status, with_weak_words(u.block, status, prepared.warnings)), state


def _left_out(found: Prepared, before: Prepared, points: np.ndarray) -> Prepared:
    """With the status and the words of points that are left out."""
    if not len(points):
        return found
    block = found.system.unknowns.block
    status = found.ray_status.copy()
    status[np.isin(block.image_points.point, points) & (before.ray_status == RayStatus.USED)] = RayStatus.NO_START
    words = f"{some_names(block.points[points], 'point')} whose rays do not intersect, left out"
    return replace(found, ray_status=status, warnings=(*with_weak_words(block, status, before.warnings), words))
