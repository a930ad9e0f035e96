"""A rolling shutter of a camera that states none.

[L: a score test; Rao 1948] The way v·T of a camera while its rows are read is taken for one more unknown of the block
as it is adjusted, with the value 0. The other unknowns stand at their minimum, so that one step of Gauss and Newton
tells the way w and its cofactor Q_ww. [D] Modelled, it would move the points by Q_pw/Q_ww·w. An error of the lens is no
shutter: the usual parameters of a lens stand beside it where the adjustment has none, and always smooth image errors as
large as the noise of an image point, which are observed as zero. Without them a lens that is not modelled to the end
looks like a shutter where control alone holds the block. For a second look b1 and b2 of the camera stand beside it: in
level flight a rolling shutter is to first order an affinity [L: Bruno and Forlani 2023].

Velocities are those of whole strips, by their times or else by the base of their exposures: those of neighbours
scatter with the positions of single exposures, and only a ratio of speeds is asked for. Speeds are counted in the usual
one of the block, so that the readout time in ms is the way in mm. Rows are read along the short side of the photograph,
as sensors are built. σ counts total: it grows as that of the object points does by the model part.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from aerotri import of_known
from aerotri.adjustment.adjusted_positions import at_adjusted_positions
from aerotri.adjustment.carry_over import start_values_at, with_shared
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import expand_sides
from aerotri.adjustment.robust import normalised_lengths, scale_of
from aerotri.adjustment.scanning import READOUT
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import NotPositiveDefiniteError
from aerotri.adjustment.system import build_system
from aerotri.adjustment.track_velocity import strip_velocities
from aerotri.adjustment.unknowns import State
from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters.legendre import items_of_order
from aerotri.observations import Block, Prior
from aerotri.observations.block import Camera
from aerotri.observations.rolling_shutter import RollingShutter
from aerotri.quantiles import chi_square_exceedance
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.unmodelled_shutter import CHANCE, UnmodelledShutter

LENS, AFFINITY = ("K1", "K2", "K3", "P1", "P2"), ("b1", "b2")
SMOOTH, ORDER, ORDER_OF_LARGE, LARGE = "legendre", 4, 2, 5000
"""Smooth image errors that the parameters of the block do not contain: products of polynomials up to this order, and in
a block of more than LARGE photographs [C]: their 42 columns would cost a fifth of the adjustment."""
BROWN = "brown"
LIKE_A_SHUTTER = ("affinity", "shear")
"""Of these, what a rolling shutter is to first order: looked at beside it, not taken for granted."""
MOST_CAMERAS = 6
"""Cameras of a block that are tested, those with most photographs [C]: each has a column in the border."""
GROSS = 4.0
"""σ of most residuals beyond which a ray is no part of the test [C]: gross errors are no shutter."""
FEWEST = 3
"""Photographs of a camera below which it is not tested [C]: a strip of two has a base and no redundancy in it."""


@dataclass(frozen=True, eq=False)
class _Step:
    """From an adjustment to the same with ways of cameras: ways (k,) mm and the roots of their cofactors by camera.

    `points` (P, 3) m is what the way of the camera `worst`, the least likely one, moves them by; `rows` (P,) of the
    block's points they are.
    """

    cameras: tuple[str, ...]
    way: np.ndarray
    root: np.ndarray
    worst: int
    points: np.ndarray
    rows: np.ndarray


def unmodelled_shutter(system: NormalSystem, solution: Solution, adjusted: AdjustedBlock) -> UnmodelledShutter | None:
    """The camera whose way is the least likely one; None where there is nothing to test it with.

    Parameters
    ----------
    adjusted : the result, in the frame of the adjustment.
    """
    block = system.unknowns.block
    shutters = _to_test(block, system.unknowns.images)
    if not shutters:
        return None
    smooth_um = adjusted.outcome.sigma0_um
    step = _step(system, solution, _with_terms(block, shutters, _lens_terms(block), smooth_um), shutters)
    if step is None:
        return None
    unit, k = adjusted.outcome.sigma0 * _total(adjusted), step.worst
    sigma = unit * step.root
    p = min(1.0, len(step.way) * _chance(float(step.way[k] / sigma[k])))
    sigma_of_points = adjusted.points.total_sigma[step.rows]
    # points that are held have no σ, and do not move
    moves = step.points / np.where(sigma_of_points > 0.0, sigma_of_points, np.nan)
    camera = next(camera for camera in block.cameras if camera.name == step.cameras[k])
    found = UnmodelledShutter(
        camera.name, 1e-3 * float(step.way[k]), 1e-3 * float(sigma[k]), p, float("nan"),
        _in_pixels(camera, 1e-3 * float(step.way[k]), system, solution.state), _rms(step.points), _rms(moves),
        shutters[camera.name].row_direction,
    )  # fmt: skip
    if p >= CHANCE:
        return found
    terms, alone = (*_lens_terms(block), *AFFINITY), {camera.name: shutters[camera.name]}
    beside = _step(system, solution, _with_terms(block, alone, terms, smooth_um), alone)
    if beside is None:
        return found
    t = float(beside.way[0] / (unit * beside.root[0]))
    same_way = beside.way[0] * step.way[k] > 0.0
    return replace(found, p_beside=_chance(t) if same_way else 1.0)


def _to_test(block: Block, images: np.ndarray) -> dict[str, RollingShutter]:
    """A shutter with a free readout time for every camera that is tested."""
    count = Counter(block.images.camera[images].tolist())
    found = {}
    for k, number in count.most_common(MOST_CAMERAS):
        camera, stated = block.cameras[k], block.cameras[k].rolling_shutter
        if number >= FEWEST and (stated is None or not stated.acts) and not camera.fiducials:
            along = "down" if camera.size_px[1] <= camera.size_px[0] else "right"
            found[camera.name] = RollingShutter(Prior(0.0), along, speed_m_s=1.0, test="off")
    return found


def _lens_terms(block: Block) -> tuple[str, ...]:
    """The usual parameters of a lens, where the block has no unknown of a lens."""
    free = any(
        not prior.fixed
        for camera in block.cameras
        for family in (camera.brown, camera.lens, camera.parameters)
        for prior in family.values()
    )
    return () if free or block.settings.adjustment.additional_parameters else LENS


def _with_terms(block: Block, shutters: dict[str, RollingShutter], terms: tuple[str, ...], smooth_um: float) -> Block:
    """The block with shutters of its cameras, parameters of `brown` besides its own, and smooth image errors.

    Parameters
    ----------
    smooth_um : σ of each of the smooth errors, which are observed as zero.
    """
    adjustment = block.settings.adjustment
    chosen = dict(adjustment.additional_parameters)
    if terms:
        own = chosen.get(BROWN, ())
        chosen[BROWN] = (*own, *(term for term in terms if term not in own))
    order = ORDER if len(block.images) <= LARGE else ORDER_OF_LARGE
    items = () if SMOOTH in chosen else tuple(i for i in items_of_order(order, order) if i not in LIKE_A_SHUTTER)
    if items:
        chosen[SMOOTH] = items
    prior = Prior(0.0, 1e-3 * smooth_um)
    smooth = {f"{SMOOTH}.{item}": prior for item in items}
    cameras = tuple(
        replace(c, rolling_shutter=shutters.get(c.name, c.rolling_shutter), parameters={**smooth, **c.parameters})
        for c in block.cameras
    )
    adjustment = replace(adjustment, additional_parameters=tuple(chosen.items()))
    return replace(block, cameras=cameras, settings=replace(block.settings, adjustment=adjustment))


def _step(system: NormalSystem, solution: Solution, block: Block, tested: Collection[str]) -> _Step | None:
    """One step from the solution to that of a block with more unknowns; None where these are not determined.

    Parameters
    ----------
    tested : cameras with a way among these unknowns; those that state a shutter keep theirs as it is.
    """
    old, estimator = system.unknowns, solution.estimator
    row, axis = np.nonzero(old.point_held)
    held = list(zip(old.points[row].tolist(), axis.tolist(), strict=True)) if len(row) else None
    status = np.ones(len(block.image_points), dtype=np.int8)
    status[old.rays.source[_without_gross(system, solution)]] = 0
    try:
        other, start = build_system(block, start_values_at(old, solution.state), status, held)
        state = with_shared(other.unknowns, old, start, solution.state)
        other = _with_strip_velocities(at_adjusted_positions(other, state, estimator), state, tested)
        shared = zip(other.unknowns.shared.names, other.unknowns.shared.groups, strict=True)
        columns = [k for k, (name, camera) in enumerate(shared) if name == READOUT and camera in tested]
        equations = other.assemble(state, 0.0, estimator)
        factor = other.factorise(equations)
    except (InputError, NotPositiveDefiniteError):
        return None
    x, inverse = factor.solve(equations.right), factor.border_inverse()
    if not columns or not np.isfinite(x).all():
        return None
    n = len(other.unknowns.images)
    way, root = x[6 * n + np.array(columns)], np.sqrt(np.diagonal(inverse)[columns])
    worst = int(np.argmax(np.abs(way) / root))
    side = np.zeros((len(x), 1))
    side[6 * n + columns[worst]] = way[worst] / root[worst] ** 2
    moved = factor.solve(side)
    images, shared = np.ascontiguousarray(moved[: 6 * n].reshape(n, 6, 1)), np.ascontiguousarray(moved[6 * n :])
    nothing = np.zeros((len(other.unknowns.points), 3, 1))
    points = expand_sides(other, state, images, shared, nothing, estimator)[:, :, 0]
    return _Step(
        tuple(other.unknowns.shared.groups[k] for k in columns), way, root, worst, points, other.unknowns.points
    )


def _without_gross(system: NormalSystem, solution: Solution) -> np.ndarray:
    """(m,) bool of the rays that are no gross errors, of points that two or more of these see.

    A point that would lose its place and holds the datum keeps all its rays.
    """
    u = system.unknowns
    length = normalised_lengths(solution.equations.residual, u.rays.inv_sigma)
    keep = length <= GROSS * scale_of(length, 1.0)
    point = np.repeat(np.arange(len(u.points)), np.diff(u.rays.start))
    seen = np.bincount(point[keep], minlength=len(u.points)) > 1
    return (keep & seen[point]) | (~seen & u.point_held.any(axis=1))[point]


def _with_strip_velocities(system: NormalSystem, state: State, tested: Collection[str]) -> NormalSystem:
    """The system with the velocities of whole strips, in units of the usual one, for the cameras that are tested."""
    u, scanning = system.unknowns, system.unknowns.scanning
    if scanning is None:
        return system
    rolling = np.array([camera.name in tested for camera in u.block.cameras])[u.block.images.camera[u.images]]
    velocity = strip_velocities(u.block, u.images, state.centre, rolling)
    in_camera = np.where(rolling[:, None], np.einsum("nji,nj->ni", state.rotation, velocity), scanning.velocity)
    other = copy(system)
    other.unknowns = replace(u, scanning=replace(scanning, velocity=in_camera))
    return other


def _in_pixels(camera: Camera, way_m: float, system: NormalSystem, state: State) -> float:
    """The way in the image, at the usual distance of the points."""
    rays = system.unknowns.rays
    point = np.repeat(np.arange(len(state.points)), np.diff(rays.start))
    distance = of_known.median(np.linalg.norm(state.points[point] - state.centre[rays.image], axis=1))
    return abs(way_m) * camera.focal_length_mm / max(distance, 1e-12) / camera.pixel_mm


def _total(adjusted: AdjustedBlock) -> float:
    """σ total over σ of the object points, in the median."""
    part = adjusted.model_part
    return 1.0 if part is None else max(1.0, part.ratio_plan, part.ratio_height)


def _chance(t: float) -> float:
    return chi_square_exceedance(t**2, 1.0)


def _rms(values: np.ndarray) -> float:
    """Of points (P, 3), by the axis where it is largest, NaN left out."""
    known = values[np.isfinite(values).all(axis=1)]
    return float(np.sqrt(np.mean(known**2, axis=0)).max()) if len(known) else 0.0
