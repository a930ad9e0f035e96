"""What the adjustment adds to the variance of pickets: they are intersected with an orientation that has its own σ.

[D] The ideal rays l = m − d(m; p) of a picket give dP = −G·(∂π/∂θ·dθ + ∂d/∂p·dp), G = (AᵀA)⁻¹Aᵀ of its intersection.
With J = dP/dx over all unknowns x of the reduced system its covariance is σ̂0²·J·Q·Jᵀ, by a solution with the factor;
in the inner datum of a free block where the block has it, as its points.
Where groups of photographs share errors it has a model part. Where the residuals show that the parameters leave image
errors it has the part of these, through the orientation and at the rays of the picket itself
(`statistics.camera_field`). It changes slowly over the ground: some pickets tell it for all.

[D] The shape of a surface has the covariance of what a similarity of all its places leaves (see `statistics.relative`):
J − G·A in place of J, G (n, 3, 7) the motions of a similarity at the places, A = (GᵀG)⁻¹Gᵀ·J.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from aerotri.adjustment.datum import motions_of_points
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.deformation.error_parameters import error_rows, shared_columns
from aerotri.deformation.model_grid import places_of
from aerotri.deformation.orientation import Orientation
from aerotri.deformation.restitution import Restitution
from aerotri.functional_model.collinearity import INTERIOR_COLUMNS, RayPartials, linearise
from aerotri.rasters.between_places import between_places, lattice_of, spread_places
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.camera_field import CameraField, model_beside_field
from aerotri.statistics.covariance import inner_datum, is_inner
from aerotri.statistics.image_sigma import weight_of_cameras
from aerotri.statistics.model_of_functions import model_of_functions
from aerotri.statistics.relative import DEGENERATE, MOTIONS
from aerotri.terrain.pickets import Pickets

MOST_PLACES, AT_A_TIME = 500, 100
"""Pickets whose variance is computed, the others interpolated, and how many at a time; chosen [C]: this variance
changes slowly over a block, and 100 at a time, 300 columns of the inverse, fit into memory."""
ELEMENTS = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
"""XX, YY, ZZ, XY, XZ, YZ of a matrix."""
RAYS_AT_A_TIME = 50_000
"""Rays whose partials are computed at a time: 400 bytes each."""


def adjustment_variances(
    calibration: Adjustment, restitution: Restitution, rows: np.ndarray, pickets: Pickets
) -> np.ndarray:
    """(n, 3) m², in the CRS, of pickets that were measured; NaN of others.

    Parameters
    ----------
    restitution : with which the pickets were measured. rows : photographs of the block that `pickets.photographs`
        counts.
    """
    measured = np.flatnonzero(np.isfinite(pickets.xyz).all(axis=1))
    out = np.full(pickets.xyz.shape, np.nan)
    if not len(measured):
        return out
    plan, places = pickets.xyz[measured, :2], measured
    if len(measured) > MOST_PLACES:
        places = measured[spread_places(plan, lattice_of(plan, MOST_PLACES))]
    variances = variances_at(calibration, restitution, rows, pickets.xyz[places], pickets.photographs[places])
    out[measured] = between_places(pickets.xyz[places, :2], variances, plan)
    return out


def variances_at(
    calibration: Adjustment, restitution: Restitution, rows: np.ndarray, xyz: np.ndarray, photographs: np.ndarray
) -> np.ndarray:
    """(n, 3) m² in the CRS, what the adjustment adds to points xyz (n, 3) intersected from photographs (n, m).

    Parameters
    ----------
    rows : photographs of the block that `photographs` counts, −1 where a point has fewer.
    """
    covariances = covariances_at(calibration, restitution, rows, xyz, photographs)
    return np.diagonal(covariances, axis1=1, axis2=2).copy()


def covariances_at(
    calibration: Adjustment, restitution: Restitution, rows: np.ndarray, xyz: np.ndarray, photographs: np.ndarray
) -> np.ndarray:
    """(n, 3, 3) m² in the CRS; as `variances_at`."""
    local = places_of(calibration).to_local(xyz)

    def partials(part: slice) -> np.ndarray:
        return _by_unknowns(calibration, restitution, rows, local[part], photographs[part], plan=False)

    return _covariances(calibration, restitution.left, local, partials, 3)


def both_covariances_at(
    calibration: Adjustment, restitution: Restitution, rows: np.ndarray, xyz: np.ndarray, photographs: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """As `covariances_at`, and the same after a similarity of all the places: of the shape of the surface."""
    local = places_of(calibration).to_local(xyz)

    def partials(part: slice) -> np.ndarray:
        return _by_unknowns(calibration, restitution, rows, local[part], photographs[part], plan=False)

    return _both(calibration, restitution.left, local, partials, motions_of_points(local - local.mean(axis=0)))


def _both(
    calibration: Adjustment, left: CameraField | None, local: np.ndarray, partials: Callable[[slice], np.ndarray],
    motions: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """The covariances of `_covariances`, and those of what a similarity of all the places leaves.

    Parameters
    ----------
    motions : (n, size, 7) what the similarity does to the vectors; it is determined by their last three coordinates.
    """
    size = motions.shape[1]
    factor = calibration.system.factorise(calibration.solution.equations)
    of_shape = _of_shape(motions, partials)
    absolute = _covariances(calibration, left, local, partials, size, factor)
    return absolute, _covariances(calibration, left, local, of_shape, size, factor)


def _of_shape(motions: np.ndarray, partials: Callable[[slice], np.ndarray]) -> Callable[[slice], np.ndarray]:
    """The partials (k, size, u + f) less those of the similarity of all places."""
    g = np.ascontiguousarray(motions[:, -3:]).reshape(-1, MOTIONS)
    size = np.linalg.norm(g, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    onto = (np.linalg.pinv(g / size, rcond=DEGENERATE) / size[:, None]).reshape(MOTIONS, len(motions), 3)
    similarity: np.ndarray | float = 0.0
    for first in range(0, len(motions), AT_A_TIME):
        part = slice(first, first + AT_A_TIME)
        similarity = similarity + np.tensordot(onto[:, part], partials(part)[:, -3:], axes=2)
    return lambda part: partials(part) - motions[part] @ similarity


def change_covariances(
    calibration: Adjustment, restitution: Restitution, rows: np.ndarray, xyz: tuple[np.ndarray, np.ndarray],
    photographs: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:  # fmt: skip
    """(n, 3, 3) m² in the CRS, of second less first places (n, 3) near one another, intersected from photographs."""
    local = [places_of(calibration).to_local(one) for one in xyz]

    def partials(part: slice) -> np.ndarray:
        first, second = (
            _by_unknowns(calibration, restitution, rows, at[part], seen[part], plan=False)
            for at, seen in zip(local, photographs, strict=True)
        )
        return second - first

    return _covariances(calibration, restitution.left, local[0], partials, 3)


def solved_partials(
    calibration: Adjustment, restitution: Restitution, rows: np.ndarray, xyz: np.ndarray, photographs: np.ndarray
) -> np.ndarray:
    """(u, n, 3) Q·Jᵀ of the coordinates in the CRS, by the u unknowns of the reduced system; as `variances_at`."""
    places, system = places_of(calibration), calibration.system
    factor, local = system.factorise(calibration.solution.equations), places.to_local(xyz)
    count = 6 * len(system.unknowns.images) + len(system.unknowns.shared)
    j = _by_unknowns(calibration, restitution, rows, local, photographs, plan=False)[:, :, :count]
    if places.frame is not None:
        j = places.frame.crs_per_local(local) @ j
    return factor.solve(np.ascontiguousarray(j.reshape(-1, count).T)).reshape(count, len(xyz), 3)


def plan_covariances(
    calibration: Adjustment, restitution: Restitution, rows: np.ndarray, xyz: np.ndarray, photograph: np.ndarray
) -> np.ndarray:
    """(n, 2, 2) m², of X and Y in the CRS, of places whose height is known and which one photograph each shows.

    Parameters
    ----------
    rows : photographs of the block. xyz : (n, 3) m in the CRS. photograph : (n,) place in `rows`.
    """
    local = places_of(calibration).to_local(xyz)

    def partials(part: slice) -> np.ndarray:
        return _by_unknowns(calibration, restitution, rows, local[part], photograph[part, None], plan=True)

    return _covariances(calibration, restitution.left, local, partials, 3)[:, :2, :2].copy()


def plan_of_images(
    calibration: Adjustment, restitution: Restitution, rows: np.ndarray, xyz: np.ndarray, photograph: np.ndarray
) -> np.ndarray:
    """(n, 2, 2) m²/mm², of X and Y in the CRS, by an image position with σ of 1 mm in x and y; as `plan_covariances`.

    G·Gᵀ, G the inverse of the partials of the image position by X and Y: of an oblique ray more than of a vertical one.
    """
    frame, image = places_of(calibration), rows[photograph]
    found = np.empty((len(xyz), 2, 2))
    for first in range(0, len(xyz), RAYS_AT_A_TIME):
        part = slice(first, first + RAYS_AT_A_TIME)
        local = frame.to_local(xyz[part])
        rays = _linearised(restitution.true, local, image[part], np.arange(len(local)), len(INTERIOR_COLUMNS))
        gain = _gain_in_plan(rays.by_point)
        found[part] = frame.covariances(local, gain @ np.swapaxes(gain, 1, 2))[:, :2, :2]
    return found


def shown_covariances(
    calibration: Adjustment, restitution: Restitution, rows: np.ndarray, xyz: np.ndarray, photograph: np.ndarray,
    measured_by: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """(n, 6, 6) m² in the CRS, what the adjustment does to details in an orthophoto and to the surface below it.

    And the same after a similarity of all the places, as of `both_covariances_at`.

    [D] A surface that was measured with the same orientation moves by e = J_e·dx, as points that are intersected do. A
    detail that is shown at a known height moves by J_p·dx, and by t·e_Z more as the height is e_Z too high, t the
    change of X and Y along the ray by Z. Both follow from one dx: the first three rows are J_p + t·J_e,Z (the third
    0), the others J_e.

    Parameters
    ----------
    photograph : (n,) place in `rows` that shows the place. measured_by : (n, m) those that the surface was measured
        in, two at least, −1 where there are fewer.
    """
    local = places_of(calibration).to_local(xyz)
    away = local - restitution.true.centre[rows[photograph]]
    along = np.zeros_like(away)
    along[:, :2] = away[:, :2] / away[:, 2:]

    def partials(part: slice) -> np.ndarray:
        shown = _by_unknowns(calibration, restitution, rows, local[part], photograph[part, None], plan=True)
        surface = _by_unknowns(calibration, restitution, rows, local[part], measured_by[part], plan=False)
        return np.concatenate([shown + along[part, :, None] * surface[:, 2:], surface], axis=1)

    of_surface = motions_of_points(local - local.mean(axis=0))
    # a similarity moves a detail along with the surface; a third coordinate is not shown
    of_shown = of_surface * np.array([1.0, 1.0, 0.0])[:, None]
    return _both(calibration, restitution.left, local, partials, np.concatenate([of_shown, of_surface], axis=1))


def _covariances(
    calibration: Adjustment, left: CameraField | None, local: np.ndarray, partials: Callable[[slice], np.ndarray],
    size: int, factor: Factor | None = None,
) -> np.ndarray:  # fmt: skip
    """(n, size, size) m² in the CRS of vectors of three coordinates, one behind the other.

    Parameters
    ----------
    left : what the parameters leave of image errors. local : (n, 3) m in the frame.
    partials : (k, size, u + f) of some places, by the unknowns of the reduced system, then by the patterns of `left`.
    factor : of the system, where it is known.
    """
    system, solution = calibration.system, calibration.solution
    frame, factor = places_of(calibration), factor or system.factorise(solution.equations)
    inner = inner_datum(system, solution.state, factor, solution.estimator) if is_inner(system) else None
    count = 6 * len(system.unknowns.images) + len(system.unknowns.shared)
    root = calibration.model if left is None else model_beside_field(calibration)
    covariances = np.empty((len(local), size, size))
    for first in range(0, len(local), AT_A_TIME):
        part = slice(first, first + AT_A_TIME)
        j, by_errors = np.split(partials(part), [count], axis=2)
        by_columns = np.ascontiguousarray(j.reshape(-1, count).T)
        q = factor.solve(by_columns)
        both = np.einsum("nau,unb->nab", j, q.reshape(count, len(j), size))
        if inner is not None:
            both = both + inner.correction(by_columns, size)
        covariance = (calibration.local.outcome.sigma0 if left is None else left.noise) ** 2 * both
        if root is not None:
            covariance = covariance + model_of_functions(
                system, solution, root, by_columns, q, size, None if inner is None else both
            )
        if left is not None:
            by_errors = by_errors + j @ left.by_unknowns
            covariance = covariance + by_errors @ np.swapaxes(by_errors, 1, 2)
        covariances[part] = frame.covariances(local[part], covariance)
    return covariances


def _by_scans(calibration: Adjustment, rays: RayPartials, own: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Of every unknown of rolling shutters that a ray may have: its shared parameter (r,), −1 none, partials (r, 2).

    Parameters
    ----------
    own : (r,) photographs of the system.
    """
    u, state = calibration.system.unknowns, calibration.solution.state
    if u.scanning is None:
        return
    scans, rotation = u.scans(state), state.rotation[own]
    rate = np.sum(scans.rate[own] * rays.prediction, axis=1)[:, None]
    tau = rate[:, :, None] * scans.readout[own][:, None, None]
    by_way, by_turn = rays.by_orientation[:, :, :3] @ rotation, rays.by_orientation[:, :, 3:] @ rotation
    moved = np.einsum("rka,ra->rk", by_way, scans.velocity[own]) + np.einsum("rka,ra->rk", by_turn, scans.spin[own])
    yield scans.columns[own, 0], rate * moved
    for first, by in ((scans.columns[own, 1], by_way), (scans.columns[own, 2], by_turn)):
        for axis in range(3):
            yield np.where(first >= 0, first + axis, -1), tau[:, :, 0] * by[:, :, axis]


def _linearised(
    orientation: Orientation, local: np.ndarray, image: np.ndarray, point: np.ndarray, size: int
) -> RayPartials:
    """Of rays from points (n, 3) m in the frame, point (r,), to photographs image (r,), `size` interior elements."""
    interior = np.zeros((len(orientation), size))
    interior[:, :3] = orientation.interior
    return linearise(
        np.ascontiguousarray(np.nan_to_num(orientation.rotation)), np.ascontiguousarray(orientation.centre), local,
        interior, image, point, image, np.zeros((len(image), 2)),
    )  # fmt: skip


def _gain(by_point: np.ndarray, weight: np.ndarray, picket: np.ndarray, count: int) -> np.ndarray:
    """(r, 3, 2) of rays with weights (r,), by which the points that they intersect in move."""
    normal, weighted = np.zeros((count, 3, 3)), by_point * weight[:, None, None]
    np.add.at(normal, picket, np.einsum("rki,rkj->rij", weighted, by_point))
    return np.linalg.solve(normal[picket], np.swapaxes(weighted, 1, 2))


def _gain_in_plan(by_point: np.ndarray) -> np.ndarray:
    """(r, 3, 2) of rays that meet a known height."""
    gain = np.zeros((len(by_point), 3, 2))
    gain[:, :2] = np.linalg.inv(by_point[:, :, :2])
    return gain


def _by_unknowns(
    calibration: Adjustment, restitution: Restitution, rows: np.ndarray, local: np.ndarray, photographs: np.ndarray,
    plan: bool,
) -> np.ndarray:  # fmt: skip
    """(n, 3, u + f) partials of intersected points by the unknowns of the reduced system, then by patterns of errors.

    plan : whether the height is known, so that one ray gives X and Y; the partials of Z are 0.
    """
    u, state = calibration.system.unknowns, calibration.solution.state
    in_system = np.full(len(restitution.group), -1)
    in_system[u.images] = np.arange(len(u.images))
    picket, column = np.nonzero(photographs >= 0)
    image = rows[photographs[picket, column]]
    rays = _linearised(restitution.true, local, image, picket, u.lens.base.shape[1])
    camera = calibration.local.block.images.camera[image]
    weight = weight_of_cameras(calibration)[camera]
    gain = _gain_in_plan(rays.by_point) if plan else _gain(rays.by_point, weight, picket, len(local))
    own = in_system[image]
    by_image = rays.by_orientation.copy()
    by_image[:, :, 3:] = rays.by_orientation[:, :, 3:] @ u.turn(state)[own]
    by_image[~np.broadcast_to(u.eo_free[own][:, None, :], by_image.shape)] = 0.0
    size = 6 * len(u.images) + len(u.shared)
    j = np.zeros((len(local), 3, size))
    effect = -gain @ by_image
    for k in range(6):
        np.add.at(j, (picket[:, None], np.arange(3), 6 * own[:, None] + k), effect[:, :, k])
    measured = _add_shared(calibration, restitution, rays, gain, picket, image, j)
    left = restitution.left
    if left is None:
        return j
    by_errors = np.zeros((len(local), 3, left.by_unknowns.shape[1]))
    np.add.at(by_errors, picket, left.moved(gain, measured, camera))
    return np.concatenate([j, by_errors], axis=2)


def _add_shared(
    calibration: Adjustment, restitution: Restitution, rays: RayPartials, gain: np.ndarray, picket: np.ndarray,
    image: np.ndarray, j: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Add the partials by the shared unknowns to those of `_by_unknowns`; (r, 2) mm, where the rays were measured.

    Parameters
    ----------
    gain : (r, 3, 2) of the rays, picket (r,) their points, image (r,) their photographs in the block.
    """
    u = calibration.system.unknowns
    in_system = np.full(len(restitution.group), -1)
    in_system[u.images] = np.arange(len(u.images))
    own = in_system[image]
    first_shared = 6 * len(u.images)
    free = u.lens.columns[u.lens.of_image][own][:, :3]
    for k in range(3):
        has = free[:, k] >= 0
        if has.any():
            e = -np.einsum("rik,rk->ri", gain[has], rays.by_interior[has][:, :, k])
            np.add.at(j, (picket[has][:, None], np.arange(3), first_shared + free[has, k][:, None]), e)
    for columns, effect in _by_scans(calibration, rays, own):
        there = columns >= 0
        e = -np.einsum("rik,rk->ri", gain[there], effect[there])
        np.add.at(j, (picket[there][:, None], np.arange(3), first_shared + columns[there][:, None]), e)
    columns, measured = shared_columns(calibration), rays.prediction.copy()
    if len(error_rows(calibration)):
        for g, errors in enumerate(restitution.errors):
            has = np.flatnonzero(restitution.group[image] == g)
            if len(has):
                measured[has] = errors.measured(rays.prediction[has])
                e = -gain[has] @ errors.partials(measured[has])
                for k, col in enumerate(columns.tolist()):
                    np.add.at(j, (picket[has][:, None], np.arange(3), first_shared + col), e[:, :, k])
    return measured
