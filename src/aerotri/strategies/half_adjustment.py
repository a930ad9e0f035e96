"""One half of a block adjusted by itself, with the settings and the final weights of the whole."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from aerotri.adjustment.carry_over import start_values_at, with_shared
from aerotri.adjustment.defects import checked_factor
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.ray_status import RayStatus, with_lonely_rays
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import State, Unknowns
from aerotri.adjustment.weak_geometry import minimise_tied, set_aside
from aerotri.conventions import InputError
from aerotri.observations import Block, Camera, Prior
from aerotri.statistics.covariance import Cofactors, cofactors
from aerotri.statistics.summarise import count_observations, weighted_sum

TYING_POINTS = 6
"""Common points that tie two photographs [C]: five determine the relative orientation, one more checks it."""
MOST_ITERATIONS = 20
"""[C] A half starts where the whole block stands: four iterations are usual, fifteen where control is weak."""
ROUNDING = 1e-6
"""vᵀPv over the redundancy of measurements without errors [C]: with residuals below a thousandth of their σ steps are
rounding, and no step is the last."""
LOOSE_POINT = 0.1
"""σ over distance of a point in a half, by its own rays, beyond which it is left out [C]: the equations are linear over
no such length, and the point says nothing about the block."""


@dataclass(frozen=True)
class Hold:
    """What holds a half beside its rays.

    Parameters
    ----------
    free_datum : a minimal datum whatever the settings say, the control not used.
    interior : principal distance and principal point keep the values of the whole.
    """

    free_datum: bool = False
    interior: bool = False


class HalfFailedError(Exception):
    """A half cannot be adjusted by itself; the message says why."""


@dataclass(frozen=True, eq=False)
class Whole:
    """The adjustment that halves are made of, in its local frame.

    Parameters
    ----------
    unknowns, state : of it. ray_status, weight : (m,) of the rays, the final robust weights.
    """

    unknowns: Unknowns
    state: State
    ray_status: np.ndarray
    weight: np.ndarray


@dataclass(frozen=True, eq=False)
class Half:
    """A half adjusted by itself.

    Parameters
    ----------
    system, solution, factor : its equations, undamped. q : its cofactors.
    loose : (·,) rows of the block's photographs that belong to it and are not tied to the others.
    vtpv, redundancy : with the final weights, what they take away left out.
    """

    system: NormalSystem
    solution: Solution
    factor: Factor
    q: Cofactors
    loose: np.ndarray
    vtpv: float
    redundancy: float

    @property
    def unknowns(self) -> Unknowns:
        return self.system.unknowns


def half_status(whole: Whole, images: np.ndarray) -> np.ndarray:
    """(m,) status of the rays when only the photographs `images` (n,) bool take part."""
    block = whole.unknowns.block
    status = whole.ray_status.copy()
    used = status == RayStatus.USED
    status[used & (np.nan_to_num(whole.weight) <= 0.0)] = RayStatus.REMOVED
    status[used & ~images[block.image_points.image]] = RayStatus.OFF
    return with_lonely_rays(block, status)


def adjust_half(whole: Whole, images: np.ndarray, other: np.ndarray, hold: Hold) -> Half:
    """Adjust the rays of some photographs alone, from where the whole block stands.

    The final weights of the whole are weights a priori here: weights found anew would make the halves differ by other
    rays than the division says.

    Parameters
    ----------
    images : (n,) bool, photographs of this half; other : (n,) bool, those of the other one. hold : what else
        holds the half.

    Raises
    ------
    HalfFailedError
    """
    block, status = _as_held(whole, hold), half_status(whole, images)
    # a condition that one half cannot have would hold that half alone
    block = _with_conditions_left(_with_conditions_left(block, status), half_status(whole, other))
    try:
        found = _solved(whole, block, status)
    except HalfFailedError:
        # pieces without a tie to one another may not be held each by itself
        largest = of_largest_piece(block, status)
        if (largest == status).all():
            raise
        found = _solved(whole, block, largest)
    prepared, solution, factor = found
    system = prepared.system
    q = cofactors(system, solution.state, factor, solution.estimator)
    loose = np.setdiff1d(np.flatnonzero(images & np.isin(np.arange(len(images)), whole.unknowns.images)),
                         system.unknowns.images)  # fmt: skip
    vtpv = weighted_sum(system, solution)
    weight = np.nan_to_num(whole.weight[system.unknowns.rays.source], nan=1.0)
    turned_down = float(np.sum((1.0 - weight) * q.ray_redundancy.sum(axis=1)))
    redundancy = count_observations(system).redundancy - turned_down
    if redundancy < 1.0:
        raise HalfFailedError("it has no redundancy")
    return Half(system, solution, factor, q, loose, vtpv, redundancy)


def _as_held(whole: Whole, hold: Hold) -> Block:
    """The block for least squares with the final weights of the whole in its σ."""
    block = whole.unknowns.block
    weight = np.nan_to_num(whole.weight, nan=1.0)
    factor = np.sqrt(np.where(weight > 0.0, weight, 1.0))
    rays = replace(block.image_points, sigma=block.image_points.sigma / factor[:, None])
    settings = replace(block.settings.adjustment, robust="off")
    if hold.free_datum:
        settings = replace(settings, datum="minimal", datum_fixed=(), datum_points=())
    cameras = _as_adjusted(whole) if hold.interior else block.cameras
    return replace(block, cameras=cameras, image_points=rays, settings=replace(block.settings, adjustment=settings))


def _as_adjusted(whole: Whole) -> tuple[Camera, ...]:
    """The cameras with the interior orientation of the whole, held."""
    shared = whole.unknowns.shared
    value = dict(zip(zip(shared.names, shared.groups, strict=True), whole.state.shared.tolist(), strict=True))
    out = []
    for camera in whole.unknowns.block.cameras:
        interior = {
            name: Prior(value.get((name, camera.name), prior.value), fixed=True)
            for name, prior in camera.interior.items()
        }
        out.append(replace(camera, interior=interior))
    return tuple(out)


def _solved(whole: Whole, block: Block, status: np.ndarray) -> tuple[Prepared, Solution, Factor]:
    if not (status == RayStatus.USED).any():
        raise HalfFailedError("no point is seen by two of its photographs")
    block = _with_conditions_left(block, status)
    start = start_values_at(whole.unknowns, whole.state)
    try:
        system, state = build_system(block, start, status)
        state = with_shared(system.unknowns, whole.unknowns, state, whole.state)
        state = system.unknowns.with_kept_points(state)
        prepared, state = _without_loose_points(Prepared(system, state, status, ()))
        prepared = replace(prepared, state=state)
        options = SolveOptions(MOST_ITERATIONS, "off")
        prepared, solution = minimise_tied(prepared, options, _redundancy, False)
    except InputError as error:
        raise HalfFailedError(error.message) from error
    if solution.defects:
        raise HalfFailedError("; ".join(solution.defects))
    at_rounding = solution.equations.cost < ROUNDING * max(_redundancy(prepared.system), 1)
    if solution.status != "converged" and not at_rounding:
        raise HalfFailedError("its adjustment does not converge, what it measures alone is too weak")
    system = prepared.system.with_motions_at(solution.state)
    prepared = replace(prepared, system=system)
    factor, defects = checked_factor(system, solution.state, solution.equations, solution.estimator)
    if factor is None or defects:
        raise HalfFailedError("; ".join(defects) or "its normal equations are singular")
    return prepared, solution, factor


def _redundancy(system: NormalSystem) -> int:
    return count_observations(system).redundancy


def _without_loose_points(prepared: Prepared) -> tuple[Prepared, State]:
    """Without the points whose rays in this half hardly cross."""
    looseness = prepared.system.looseness(prepared.state, LEAST_SQUARES)
    held = (prepared.system.unknowns.prior_weight > 0.0).any(axis=1) | prepared.system.unknowns.point_held.any(axis=1)
    loose = np.flatnonzero(~(looseness < LOOSE_POINT) & ~held)
    if not len(loose):
        return prepared, prepared.state
    return set_aside(prepared, prepared.state, np.zeros(0, dtype=np.int64), loose)


def _with_conditions_left(block: Block, status: np.ndarray) -> Block:
    """The block with the conditions whose points the rays still determine."""
    given = block.constraints
    if given is None or not len(given):
        return block
    seen = np.zeros(len(block.points), dtype=bool)
    seen[block.image_points.point[status == RayStatus.USED]] = True
    kept = np.array([k for k, points in enumerate(given.points) if seen[points].all()], dtype=np.int64)
    if not len(kept):
        return replace(block, constraints=None)
    left = replace(
        given, kind=given.kind[kept], points=tuple(given.points[k] for k in kept), value=given.value[kept],
        sigma=given.sigma[kept], axes=None if given.axes is None else given.axes[kept],
    )  # fmt: skip
    return replace(block, constraints=left)


def of_largest_piece(block: Block, status: np.ndarray) -> np.ndarray:
    """The status of rays with those outside the largest piece of photographs that points tie together set aside.

    As it is where no ray is used.
    """
    rays, used = block.image_points, status == RayStatus.USED
    if not used.any():
        return status
    incidence = coo_array(
        (np.ones(int(used.sum())), (rays.image[used], rays.point[used])), shape=(len(block.images), len(block.points))
    ).tocsr()
    common = (incidence @ incidence.T).tocoo()
    tied = common.data >= TYING_POINTS
    graph = coo_array((common.data[tied], (common.row[tied], common.col[tied])), shape=common.shape)
    label = connected_components(graph, directed=False)[1]
    per_piece = np.bincount(label[np.unique(rays.image[used])])
    outside = label != int(np.argmax(per_piece))
    status = status.copy()
    status[used & outside[rays.image]] = RayStatus.WEAK_PHOTOGRAPH
    return with_lonely_rays(block, status)
