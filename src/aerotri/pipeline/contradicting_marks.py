"""Marks of control points that contradict the others of their point, left out of a robust adjustment.

A mark at another detail is off by hundreds of pixels. No weight makes it harmless where control is weak: the block is
then turned to meet it. The start orientations tell such a mark from the others (`diagnosis.control_marks`); where it
fits after the adjustment, it comes back.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.carry_over import reference_state, start_values_at, with_shared
from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.ray_status import RayStatus
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import State
from aerotri.conventions import counted
from aerotri.diagnosis.control_marks import LEAST_MISS_PX, alone_in_their_photograph, listed, marks_of, rays_that_tell
from aerotri.observations import ImagePoints
from aerotri.statistics.summarise import count_observations


def without_contradicting_marks(prepared: Prepared) -> Prepared:
    """The block without single marks that contradict, where it is robust, and a warning that names them."""
    u = prepared.system.unknowns
    block, rays = u.block, u.block.image_points
    if block.settings.adjustment.robust == "off" or not len(block.control):
        return prepared
    start = start_values_at(u, prepared.state)
    rows = rays_that_tell(block)
    some = ImagePoints(rays.image[rows], rays.point[rows], rays.xy[rows], rays.sigma[rows])
    marks = marks_of(replace(block, image_points=some), start.centre, start.rotation)
    wrong = [(one.wrong, one.point) for one in alone_in_their_photograph(marks.contradictions)]
    status = prepared.ray_status.copy()
    for image, point in wrong:
        mark = (rays.image == image) & (rays.point == point) & (status == RayStatus.USED)
        status[mark] = RayStatus.CONTRADICTING
    if (status == prepared.ray_status).all():
        return prepared
    names = listed(f"{block.points[point]} in {block.images.names[image]}" for image, point in wrong)
    words = f"{counted(len(wrong), 'mark', 'marks')} left out, far from where the other photographs see it: {names}"
    system, begin = build_system(block, start, status)
    return Prepared(system, begin, status, (*prepared.warnings, words))


def with_fitting_marks(prepared: Prepared, solution: Solution, options: SolveOptions) -> tuple[Prepared, Solution]:
    """The block and its solution with the marks brought back that fit what was adjusted without them."""
    left_out = prepared.ray_status == RayStatus.CONTRADICTING
    if solution.status != "converged" or not left_out.any():
        return prepared, solution
    every = _with_rays(prepared, solution.state, left_out)
    u = every.system.unknowns
    miss = np.linalg.norm(every.system.right_side(every.state, LEAST_SQUARES).residual, axis=1)
    pixel = np.array([camera.pixel_mm for camera in u.block.cameras])[u.block.images.camera[u.images[u.rays.image]]]
    fits = left_out.copy()
    fits[u.rays.source[miss > LEAST_MISS_PX * pixel]] = False
    if not fits.any():
        return prepared, solution
    back = _with_rays(prepared, solution.state, fits)
    redundancy = count_observations(back.system).redundancy
    system, again = minimise_at_adjusted(back.system, back.state, redundancy, options.going_on(solution))
    if again.status != "converged":
        return prepared, solution
    reference = reference_state(system.unknowns, prepared.system.unknowns, back.state, prepared.state)
    return replace(back, system=system, state=reference), replace(
        again, iterations=solution.iterations + again.iterations
    )


def _with_rays(prepared: Prepared, state: State, rays: np.ndarray) -> Prepared:
    """The block with these rays (m,) bool taking part again, at a state."""
    u = prepared.system.unknowns
    status = np.where(rays, RayStatus.USED, prepared.ray_status).astype(prepared.ray_status.dtype)
    system, begin = build_system(u.block, start_values_at(u, state), status)
    return replace(prepared, system=system, state=with_shared(system.unknowns, u, begin, state), ray_status=status)
