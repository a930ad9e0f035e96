"""Points that their rays do not fix, and photographs too weakly tied: found by their σ and set aside with a reason.

The measure of a point is σ in its worst direction over its distance to the nearest photograph, from its own weighted
rays; that of a photograph σ of its attitude in rad, or of its position over the distance of its points. Where it is
beyond LOOSE, three σ reach to infinity, or all the way round: the equations are linear over no such length, so neither
the value nor its σ means anything, and the point or photograph creeps on from step to step. Weights of a robust
estimator count: a point held by rays that are weighted down is as loose as if they were not there.

A photograph is measured twice. Its own 6 × 6 block of the reduced normal equations tells whether it is tied even if
all others were known; that costs nothing and is looked at in every adjustment. Photographs that hold each other and
nothing else show in the inverse of the whole matrix alone, which is formed where a pivot vanishes or the adjustment
does not settle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.carry_over import reference_state, start_values_at, with_shared
from aerotri.adjustment.kernel_records import Inverse
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import point_cofactors
from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.ray_status import RayStatus, with_lonely_rays, with_weak_words
from aerotri.adjustment.reduced_equations import NormalEquations
from aerotri.adjustment.rigging import Rigging
from aerotri.adjustment.robust import Estimator, normalised_lengths, scale_of
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.sparse_cholesky import BorderedMatrix, NotPositiveDefiniteError
from aerotri.adjustment.stopping import ROBUST_COST_TOLERANCE
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import State, Unknowns

LOOSE = 1.0 / 3.0
"""σ over distance (points, positions) or in rad (attitudes) beyond which three σ reach to infinity."""
MOST = 1.0 / 3.0
"""Share of photographs, or of points within the block, beyond which it is the datum or the block and not they."""
LOOKS = range(6, 1000, 4)
"""Iterations after which a robust adjustment that has not settled is looked at."""
LONG = 10
"""Iterations after which photographs are looked at as well."""
MOST_ROUNDS = 12
"""Adjustments that may be interrupted to set weak geometry aside [C]: each takes out all that is found at the time, so
few are needed; the bound ends a block that falls apart piece by piece."""
REGULARISATION = 1e-12
"""Relative addition to the diagonal [C]: above rounding, and so small that what is free still has a σ beyond all
bounds."""
HELD = 1e12
"""Stands on the diagonal for orientation elements that are held, in units where free ones are judged against 1/LOOSE²
[C]: so large that a held element is never the weakest."""


@dataclass(eq=False)
class _Look:
    """What an adjustment is asked while it runs; keeps what it found, rows of the system's photographs and points.

    whole : whether points, and steps after the first, are looked at too.
    last_cost : after the step before.
    """

    redundancy: int
    whole: bool
    photographs: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    points: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    last_cost: float = np.inf

    def __call__(
        self, system: NormalSystem, state: State, equations: NormalEquations, estimator: Estimator, iteration: int,
        suspect: bool,
    ) -> bool:  # fmt: skip
        if iteration == 0:
            self.photographs = loose_alone(system, state, equations)
            if suspect and not len(self.photographs):
                self.photographs = loose_together(system, state, equations)
        elif self.whole and estimator.is_robust and iteration in LOOKS:
            # far from the minimum too many points would go; where the cost hardly changes, few hold up the others
            creeps = abs(self.last_cost - equations.cost) <= ROBUST_COST_TOLERANCE * self.last_cost
            is_long = iteration >= LONG
            self.look(system, state, equations, estimator, is_long, in_block=creeps and is_long)
        self.last_cost = equations.cost
        return bool(len(self.photographs) or len(self.points))

    def look(
        self, system: NormalSystem, state: State, equations: NormalEquations, estimator: Estimator, photographs: bool,
        in_block: bool = True,
    ) -> bool:  # fmt: skip
        """Look at the points, and the photographs too where there is time for that; whether any is loose.

        in_block : where a point is loose by its own rays, or the photographs are looked at anyway, so are the points
            once more, within the whole block.
        """
        scale = _scale(system, equations, estimator, self.redundancy)
        self.points = _unless_all(np.flatnonzero(scale * system.looseness(state, estimator) > LOOSE), len(state.points))
        if not (photographs or (in_block and len(self.points))):
            return bool(len(self.points))
        inverse = _regularised_inverse(system, equations)
        if inverse is None:
            return bool(len(self.points))
        if photographs:
            self.photographs = _loose_photographs(system, state, inverse, scale)
        if in_block and not len(self.photographs):
            in_block_too = np.union1d(self.points, _loose_points(system, state, inverse, estimator, scale))
            self.points = _unless_all(in_block_too, len(state.points))
        return bool(len(self.photographs) or len(self.points))


def minimise_tied(
    prepared: Prepared, options: SolveOptions, redundancy: Callable[[NormalSystem], int], whole: bool = True
) -> tuple[Prepared, Solution]:
    """As `minimise`, with what is too weak set aside on the way; the rest goes on from where it stands.

    Parameters
    ----------
    redundancy : of a system.
    whole : look at points, and later than before the first step; False where start values are all that is wanted.

    Returns
    -------
    The block prepared without what was set aside, its state where the given one was, and its solution.
    """
    return _tied(prepared, prepared.state, options, redundancy, whole, 0)


def go_on_without(
    prepared: Prepared, solution: Solution, points: np.ndarray, options: SolveOptions,
    redundancy: Callable[[NormalSystem], int],
) -> tuple[Prepared, Solution]:  # fmt: skip
    """Some more points set aside, and the rest adjusted on from where it stands.

    Parameters
    ----------
    points : rows of the block's points. redundancy : of a system.

    Returns
    -------
    As `minimise_tied`; the iterations of `solution` count.
    """
    rows = np.flatnonzero(np.isin(prepared.system.unknowns.points, points))
    prepared, state = set_aside(prepared, solution.state, np.zeros(0, dtype=np.int64), rows)
    options = replace(options, step_tolerance=solution.step_tolerance, bent=solution.bent)
    return _tied(prepared, state, options, redundancy, True, solution.iterations)


def _tied(
    prepared: Prepared, state: State, options: SolveOptions, redundancy: Callable[[NormalSystem], int], whole: bool,
    done: int,
) -> tuple[Prepared, Solution]:  # fmt: skip
    """As `minimise_tied`, from a state, after `done` iterations.

    Where the rest does not converge without the points that were found loose at the end, they stay.
    """
    round_, bent = 0, options.bent
    settled: tuple[Prepared, Solution] | None = None
    while True:
        freedom = redundancy(prepared.system)
        look = _Look(freedom, whole)
        counted = replace(options.after(done), inspect=look if round_ < MOST_ROUNDS else None, bent=bent)
        system, solution = minimise_at_adjusted(prepared.system, state, freedom, counted)
        prepared = replace(prepared, system=system)
        done, bent = done + solution.iterations, solution.bent
        ended = not solution.defects and solution.status in ("not converged", "converged")
        robust = solution.estimator.is_robust
        if ended and whole and (robust or solution.status != "converged") and round_ < MOST_ROUNDS:
            stuck = solution.status != "converged"
            look.look(prepared.system, solution.state, solution.equations, solution.estimator, stuck)
        if not (len(look.photographs) or len(look.points)):
            if settled is not None and solution.status == "not converged":
                return settled
            return prepared, replace(solution, iterations=done)
        if solution.status == "converged":
            settled = prepared, replace(solution, iterations=done)
        prepared, state = set_aside(prepared, solution.state, look.photographs, look.points)
        round_ += 1


def _scale(system: NormalSystem, equations: NormalEquations, estimator: Estimator, redundancy: int) -> float:
    """σ of the residuals in a-priori σ, by their median."""
    if estimator.is_robust:
        return estimator.scale
    share = redundancy / max(redundancy + system.unknowns.count, 1)
    return scale_of(normalised_lengths(equations.residual, system.unknowns.rays.inv_sigma), share)


def loose_alone(system: NormalSystem, state: State, equations: NormalEquations) -> np.ndarray:
    """Rows of the photographs that would be loose if all others were known; none where it is the datum."""
    n = len(system.unknowns.images)
    if system.unknowns.rigging is not None:
        return _loose_stations(system, state, equations, system.unknowns.rigging)
    normal = equations.matrix.blocks[:n] / _unit_products(system.unknowns, state)
    held = ~system.unknowns.eo_free
    diagonal = np.arange(6)
    normal[:, diagonal, diagonal] = np.where(held, HELD, normal[:, diagonal, diagonal])
    smallest = np.linalg.eigvalsh(normal)[:, 0]
    return _unless_many(np.flatnonzero(smallest * LOOSE**2 < 1.0), n)


def _loose_stations(system: NormalSystem, state: State, equations: NormalEquations, rigging: Rigging) -> np.ndarray:
    """As `loose_alone`, of the photographs of a station on a rigid rig together: what follows adds to what leads."""
    u, leads = system.unknowns, rigging.leads
    normal = system.own_blocks(equations) / _unit_products(u, state, rigging.lead)[leads]
    diagonal = np.arange(6)
    normal[:, diagonal, diagonal] = np.where(~u.eo_free[leads], HELD, normal[:, diagonal, diagonal])
    loose = leads[np.linalg.eigvalsh(normal)[:, 0] * LOOSE**2 < 1.0]
    return _unless_many(np.flatnonzero(np.isin(rigging.lead, loose)), len(u.images))


def loose_together(system: NormalSystem, state: State, equations: NormalEquations) -> np.ndarray:
    """Rows of the photographs that are loose within the whole block; none where it is the datum."""
    inverse = _regularised_inverse(system, equations)
    return np.zeros(0, dtype=np.int64) if inverse is None else _loose_photographs(system, state, inverse)


def _regularised_inverse(system: NormalSystem, equations: NormalEquations) -> Inverse | None:
    """A trace of regularisation lets the matrix be inverted; what is free gets a σ beyond all bounds by it."""
    n, matrix = len(system.unknowns.images), equations.matrix
    blocks, corner, diagonal = matrix.blocks.copy(), matrix.corner.copy(), np.arange(6)
    blocks[:n, diagonal, diagonal] *= 1.0 + REGULARISATION
    corner[np.diag_indices_from(corner)] *= 1.0 + REGULARISATION
    try:
        regular = system.factorise_like(equations, BorderedMatrix(blocks, matrix.border, corner))
        return regular.inverse_on_pattern()
    except NotPositiveDefiniteError:
        return None


def _loose_photographs(system: NormalSystem, state: State, inverse: Inverse, scale: float = 1.0) -> np.ndarray:
    """Rows of the photographs that are loose; none where it is the datum."""
    n = len(system.unknowns.images)
    cofactor = inverse.blocks[:n] * _unit_products(system.unknowns, state)
    cofactor[~system.unknowns.eo_free] = 0.0
    largest = np.linalg.eigvalsh(0.5 * (cofactor + np.swapaxes(cofactor, 1, 2)))[:, -1]
    return _unless_many(np.flatnonzero(~(scale**2 * largest <= LOOSE**2)), n)


def _loose_points(
    system: NormalSystem, state: State, inverse: Inverse, estimator: Estimator, scale: float
) -> np.ndarray:
    """Rows of the points that are loose within the whole block; none where it is the block."""
    u = system.unknowns
    cofactor, _ = point_cofactors(system, state, inverse, estimator)
    of_centres = np.where(u.eo_free[:, :3, None], inverse.blocks[: len(u.images), :3, :3], 0.0)
    point = np.repeat(np.arange(len(u.points)), np.diff(u.rays.start))
    variances = scale**2 * cofactor, scale**2 * of_centres
    loose = loose_in_block(point, u.rays.image, state.points, state.centre, *variances)
    return _unless_many(loose, len(u.points))


def loose_in_block(
    point: np.ndarray, image: np.ndarray, xyz: np.ndarray, centre: np.ndarray, of_points: np.ndarray,
    of_centres: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Rows of the points that are loose within the whole block.

    σ of the nearest photograph's position is taken off: relative to that photograph the point is not known better than
    the difference of the two says (triangle inequality), so that a datum known to metres only, or a strip that drifts,
    makes no point loose.

    Parameters
    ----------
    point, image : (m,) of the rays. xyz : (P, 3), centre : (n, 3) m.
    of_points : (P, 3, 3), of_centres : (n, 3, 3) m², their covariance.
    """
    way = np.linalg.norm(xyz[point] - centre[image], axis=1)
    reach, nearest = np.full(len(xyz), np.inf), np.zeros(len(xyz), dtype=np.int64)
    np.minimum.at(reach, point, way)
    first = way == reach[point]
    nearest[point[first]] = image[first]
    # the trace is a bound of the largest eigenvalue: hardly a point is looked at closer
    trace = np.einsum("pii->p", of_points)
    rows = np.flatnonzero(np.isfinite(trace) & (trace > (LOOSE * reach) ** 2))
    return rows[_worst(of_points[rows]) - _worst(of_centres[nearest[rows]]) > LOOSE * reach[rows]]


def _worst(covariance: np.ndarray) -> np.ndarray:
    """(k,) σ in the worst direction, of covariance matrices (k, 3, 3)."""
    return np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[:, -1], 0.0)) if len(covariance) else np.zeros(0)


def _unit_products(unknowns: Unknowns, state: State, carrier: np.ndarray | None = None) -> np.ndarray:
    """(n, 6, 6) by which cofactors are multiplied, normals divided, to count positions in distances of the points.

    The distance of a photograph is the harmonic mean of its rays' lengths, on which points far away have no influence.

    Parameters
    ----------
    carrier : (n,) the photograph that the rays of every photograph count for; itself where None.
    """
    rays, n = unknowns.rays, len(unknowns.images)
    image = rays.image if carrier is None else carrier[rays.image]
    point = np.repeat(np.arange(len(unknowns.points)), np.diff(rays.start))
    reach = np.maximum(np.linalg.norm(state.points[point] - state.centre[rays.image], axis=1), 1e-300)
    nearness = np.bincount(image, 1.0 / reach, n) / np.maximum(np.bincount(image, minlength=n), 1)
    unit = np.ones((n, 6))
    # a photograph without rays of its own, such as the first of a station, has no distance
    unit[:, :3] = np.where(nearness > 0.0, nearness, 1.0)[:, None]
    return unit[:, :, None] * unit[:, None, :]


def _unless_all(rows: np.ndarray, n: int) -> np.ndarray:
    return rows if len(rows) < n else rows[:0]


def _unless_many(rows: np.ndarray, n: int) -> np.ndarray:
    return rows if len(rows) <= MOST * n else rows[:0]


def set_aside(prepared: Prepared, state: State, photographs: np.ndarray, points: np.ndarray) -> tuple[Prepared, State]:
    """The block prepared anew without some photographs and points, and the state to go on from.

    Parameters
    ----------
    photographs, points : rows of the system's unknowns.
    """
    u, rays = prepared.system.unknowns, prepared.system.unknowns.block.image_points
    status = prepared.ray_status.copy()
    used = status == RayStatus.USED
    status[used & np.isin(rays.point, u.points[points])] = RayStatus.WEAK_POINT
    status[used & np.isin(rays.image, u.images[photographs])] = RayStatus.WEAK_PHOTOGRAPH
    status = with_lonely_rays(u.block, status)
    warnings = with_weak_words(u.block, status, prepared.warnings)
    system, start = build_system(u.block, start_values_at(u, state), status)
    prepared = Prepared(system, reference_state(system.unknowns, u, start, prepared.state), status, warnings)
    return prepared, with_shared(system.unknowns, u, start, state)
