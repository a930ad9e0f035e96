"""The variance of any linear functional of heights through the covariance of the adjustment.

[D, checked by Monte Carlo] Pickets P_k are intersected with the adjusted orientation; they were not in the adjustment.
With g_k = ∂V/∂P_k, A_k = ∂rays/∂P_k, B_k = ∂rays/∂θ (θ orientation, interior orientation, additional parameters) and
N_k = A_kᵀW_kA_k, a change of θ moves P_k by −N_k⁻¹A_kᵀW_kB_k, so that c = ∂V/∂θ = −Σ B_kᵀW_kA_kN_k⁻¹g_k and

    Var V = σ̂0²·cᵀQc + Σ g_kᵀN_k⁻¹g_k,   Qc by one solution with the reduced factor of the final normal equations.

The first part holds every correlation between pickets. Where groups of photographs share errors, it has a model part,
see `statistics.model_of_functions`; so has what the parameters leave of the errors of a camera, see
`statistics.camera_field`: rays of pickets have these errors too, and the noise beside them takes the place of σ̂0. An
image error d that is not corrected moves V by Σ g_kᵀN_k⁻¹A_kᵀW_k·d, as does the way of the camera during the readout of
a rolling shutter, and where the orientation was adjusted without parameters by c times its change besides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment import scanning
from aerotri.adjustment.kernel_records import Scans
from aerotri.adjustment.parallel import chunk_bounds, run_chunks
from aerotri.adjustment.point_sides import expand_sides
from aerotri.conventions import InputError
from aerotri.deformation.absorbed import absorbed_orientation, absorbed_partials
from aerotri.deformation.error_parameters import KINDS, error_rows, shared_columns
from aerotri.deformation.orientation import calibrated_orientation
from aerotri.deformation.photo_errors import PhotoErrors, errors_by_image
from aerotri.functional_model.additional_parameters import Parameter
from aerotri.functional_model.additional_parameters.registry import INTERIOR_FAMILIES
from aerotri.functional_model.rotation import logarithm
from aerotri.observations import Block
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.camera_field import CameraField, known_field, model_beside_field, noise_beside_field
from aerotri.statistics.cluster_test import NUMBERS_AT_ONCE
from aerotri.statistics.covariance import inner_datum, is_inner
from aerotri.statistics.model_of_functions import model_of_functions
from aerotri.volume import _response_kernels as _kernels
from aerotri.volume.error_nodes import ErrorNodes, nodes_of
from aerotri.volume.pickets import Pickets


@dataclass(frozen=True, eq=False)
class Response:
    """How a functional V of heights responds to the adjustment, and what its pickets bring along.

    Parameters
    ----------
    unknowns : (6n + s,) c = ∂V/∂θ in the unknowns of the reduced system, zero where held. solved : Q·c.
    variance : σ0²·cᵀQc, the part of the adjustment, σ0 as of `noise_beside_field`. model : its model part.
    noise : Σ gᵀN⁻¹g, the part of matching.
    by_orientation : (n, 6) ∂V by projection centre and small rotation of the photographs of the system, held or not.
    by_interior : (L, 24) ∂V by the interior elements of the system's rows.
    by_parameters : (p,) change of V by a parameter that is left uncorrected, as `error_rows`.
    error : change of V by the image errors in force, left uncorrected.
    """

    unknowns: np.ndarray
    solved: np.ndarray
    variance: float
    model: float
    noise: float
    by_orientation: np.ndarray
    by_interior: np.ndarray
    by_parameters: np.ndarray
    error: float


@dataclass(frozen=True)
class Systematic:
    """What uncorrected image errors do to a functional: wrong − true, and σ of that.

    Parameters
    ----------
    variant : 'free' (orientation of the self-calibrated block) or 'absorbed' (adjusted without parameters).
    """

    variant: str
    value: float
    sigma: float


@dataclass(frozen=True, eq=False)
class _Laid:
    """What responses of one adjustment have in common: image errors, nodes over them, photographs of the system."""

    errors: tuple[PhotoErrors, ...]
    nodes: ErrorNodes
    photos: _kernels.PhotoArrays


def respond(calibration: Adjustment, pickets: Pickets, gradient: np.ndarray, corrected: bool = True) -> Response:
    """The response of a linear functional of pickets.

    Parameters
    ----------
    gradient : (k, 3) ∂V/∂(X, Y, Z) of every picket in the CRS of the block.
    corrected : the rays were corrected for the additional parameters; else these have no part in V.

    Raises
    ------
    InputError
        When a photograph is not oriented, or the rays of a picket do not determine it.
    """
    return respond_to_all(calibration, pickets, [gradient], corrected)[0]


def respond_to_all(
    calibration: Adjustment, pickets: Pickets, gradients: Sequence[np.ndarray], corrected: bool = True
) -> list[Response]:
    """As `respond`, of several functionals of the same pickets, by one solution with one factor."""
    system, solution = calibration.system, calibration.solution
    laid = _laid(calibration)
    found = [_before_solution(calibration, pickets, gradient, laid, corrected) for gradient in gradients]
    c = np.stack([one.unknowns for one in found], axis=1)
    factor = system.factorise(solution.equations)
    solved = factor.solve(c)
    cofactor = np.einsum("uk,uk->k", c, solved)
    if is_inner(system):
        cofactor += inner_datum(system, solution.state, factor, solution.estimator).correction(c)[:, 0, 0]
    variance, model = noise_beside_field(calibration) ** 2 * cofactor, np.zeros(len(found))
    root = model_beside_field(calibration)
    if root is not None:
        model = model_of_functions(system, solution, root, c, solved, 1, cofactor[:, None, None])[:, 0, 0]
    return [
        replace(one, solved=solved[:, k].copy(), variance=float(variance[k]), model=one.model + float(model[k]))
        for k, one in enumerate(found)
    ]


def _laid(calibration: Adjustment) -> _Laid:
    u, state = calibration.system.unknowns, calibration.solution.state
    errors, number = errors_by_image(calibration, error_rows(calibration))
    photos = _kernels.PhotoArrays(
        np.ascontiguousarray(state.rotation), state.centre, u.interior(state), u.lens.of_image, number[u.images],
        *_scans(calibration),
    )  # fmt: skip
    return _Laid(errors, nodes_of(errors), photos)


def _before_solution(
    calibration: Adjustment, pickets: Pickets, gradient: np.ndarray, laid: _Laid, corrected: bool
) -> Response:
    """A response without what a solution with the factor tells; its model part is that of the camera's field alone."""
    errors, nodes = laid.errors, laid.nodes
    by_eo, by_interior, deposits, noise, by_shared, error = _summed(calibration, pickets, gradient, laid.photos, nodes)
    by_parameters = -by_shared[shared_columns(calibration)]
    for group, own in zip(errors, nodes.of_group, strict=True):
        used = np.flatnonzero(deposits[own].any(axis=1))
        xy, f = nodes.xy[own][used], deposits[own][used]
        by_parameters += np.einsum("na,nap->p", f, group.partials(xy))
        error += float(np.sum(f * group.function.of_measured(xy)))
    c = _in_unknowns(calibration, by_eo, by_interior, by_parameters, corrected)
    model, left = 0.0, known_field(calibration)
    if left is not None:
        model = _left_by_parameters(left, calibration.system.unknowns.block, errors, nodes, deposits, c)
    return Response(c, np.zeros_like(c), 0.0, model, noise, by_eo, by_interior, by_parameters, error)


def _left_by_parameters(
    left: CameraField,
    block: Block,
    errors: tuple[PhotoErrors, ...],
    nodes: ErrorNodes,
    deposits: np.ndarray,
    c: np.ndarray,
) -> float:
    """Variance of V by what the parameters leave of image errors, through the unknowns and at the rays of pickets.

    Parameters
    ----------
    deposits : (·, 2) ∂V by the image errors at the nodes. c : ∂V by the unknowns.
    """
    names = [camera.name for camera in block.cameras]
    by_patterns = left.by_unknowns.T @ c
    for group, own in zip(errors, nodes.of_group, strict=True):
        used = np.flatnonzero(deposits[own].any(axis=1))
        camera = np.full(len(used), names.index(group.camera.name))
        by_patterns += left.summed(deposits[own][used], nodes.xy[own][used], camera)
    return float(by_patterns @ by_patterns)


def covariance(calibration: Adjustment, first: Response, second: Response) -> float:
    """Covariance that the adjustment brings to two functionals of one block."""
    return noise_beside_field(calibration) ** 2 * float(first.unknowns @ second.solved)


def control_response(calibration: Adjustment, response: Response) -> np.ndarray:
    """(P, 3) ∂V by the given coordinates of the control points, in the order of the system's points."""
    return control_responses(calibration, response.solved[:, None])[:, :, 0]


def control_responses(
    calibration: Adjustment, solved: np.ndarray, rows: np.ndarray | slice = slice(None)
) -> np.ndarray:
    """(p, 3, k) as `control_response`, of some points, for the solutions Q·c (6n + s, k) of k functionals."""
    system, solution = calibration.system, calibration.solution
    u, k = system.unknowns, solved.shape[1]
    n, weight = 6 * len(u.images), u.prior_weight[rows][:, :, None]
    out = np.empty((len(weight), 3, k))
    at_once = int(np.clip(NUMBERS_AT_ONCE / (3 * len(u.points)), 1, max(k, 1)))
    for own in (slice(first, first + at_once) for first in range(0, k if len(weight) else 0, at_once)):
        images, shared = solved[:n, own].reshape(len(u.images), 6, -1), np.ascontiguousarray(solved[n:, own])
        nothing = np.zeros((len(u.points), 3, shared.shape[1]))
        points = expand_sides(system, solution.state, np.ascontiguousarray(images), shared, nothing, solution.estimator)
        out[:, :, own] = weight * points[rows]
    return out


def systematic(calibration: Adjustment, response: Response, variant: str = "free") -> Systematic:
    """What the image errors in force do to the functional when the photographs were used uncorrected.

    Raises
    ------
    AbsorptionFailedError
    """
    value, by_parameters = response.error, response.by_parameters.copy()
    if variant == "absorbed":
        u = calibration.system.unknowns
        true, used = calibrated_orientation(calibration), absorbed_orientation(calibration).orientation
        follows = absorbed_partials(calibration)[u.images]
        true, used = true.take(u.images), used.take(u.images)
        turned = logarithm(used.rotation @ np.swapaxes(true.rotation, 1, 2))
        moved = np.column_stack([used.centre - true.centre, turned])
        first = np.array([int(np.argmax(u.lens.of_image == row)) for row in range(len(response.by_interior))])
        interior = (used.interior - true.interior)[first]
        value += float(np.sum(response.by_orientation * moved) + np.sum(response.by_interior[:, :3] * interior))
        by_parameters += np.einsum("na,nap->p", response.by_orientation, follows[:, :6])
        by_parameters += np.einsum("na,nap->p", response.by_interior[:, :3], follows[first, 6:])
    rows = error_rows(calibration)
    q = calibration.local.parameters.total_covariance[np.ix_(rows, rows)]
    return Systematic(variant, value, float(np.sqrt(max(by_parameters @ q @ by_parameters, 0.0))))


def _summed(
    calibration: Adjustment, pickets: Pickets, gradient: np.ndarray, photos: _kernels.PhotoArrays, nodes: ErrorNodes
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, np.ndarray, float]:
    """Sums over the pickets, in threads: by orientation, by interior elements, at the nodes, the noise, by shared
    unknowns of rolling shutters, and what these do where they are left uncorrected."""
    u = calibration.system.unknowns
    row_of = np.full(len(u.block.images), -1, np.int64)
    row_of[u.images] = np.arange(len(u.images))
    image = row_of[pickets.image]
    if (image < 0).any():
        name = u.block.images.names[pickets.image[int(np.argmax(image < 0))]]
        raise InputError(
            f"a ground point (picket) was measured in photograph '{name}', which was not adjusted",
            "measure again with this adjustment: `aerotri dtm`",
        )
    points, along = in_frame(calibration, pickets.xyz, np.asarray(gradient, dtype=float))
    bounds = chunk_bounds(np.diff(pickets.start).astype(float))
    arrays = _kernels.PicketArrays(pickets.start, image, 1.0 / pickets.sigma_mm, points, along, pickets.noise_share)
    shapes = (len(u.images), 6), u.lens.base.shape, (len(nodes.xy), 2), 1, len(u.shared), 1
    # no chunk where there is no picket: the sums are 0 then
    outs = [_kernels.ResponseSums(*(np.zeros(shape) for shape in shapes)) for _ in bounds or [None]]

    def chunk(k: int) -> int:
        return _kernels.respond(*bounds[k], arrays, photos, nodes.tiles, outs[k])

    worst = max(run_chunks(chunk, len(bounds)), default=-1)
    if worst >= 0:
        raise _undetermined(u.block, pickets, worst)
    total = _kernels.ResponseSums(*(np.sum([out[part] for out in outs], axis=0) for part in range(6)))
    return (
        total.by_eo, total.by_interior, total.nodes, float(total.noise[0]), total.by_shared, float(total.moved[0])
    )  # fmt: skip


def _undetermined(block: Block, pickets: Pickets, row: int) -> InputError:
    """Names a picket by its place and its photographs: pickets were sorted, and may be cells of a raster."""
    x, y = pickets.xyz[row, :2]
    own = block.images.names[pickets.image[pickets.start[row] : pickets.start[row + 1]]]
    return InputError(
        f"the rays of the ground point (picket) at X {x:.2f}, Y {y:.2f} do not determine it; its photographs: "
        + ", ".join(f"'{name}'" for name in own.tolist()),
        "leave this point out (of `aerotri dtm`: its row in pickets.parquet), or measure it in photographs from "
        "different places",
    )


def _scans(calibration: Adjustment) -> Scans:
    """What rolling shutters do, of every photograph of the system; zeros without."""
    u = calibration.system.unknowns
    n = len(u.images)
    if u.scanning is not None:
        return u.scans(calibration.solution.state)
    nothing = np.zeros((n, 3))
    return Scans(np.zeros((n, 2)), np.zeros(n), nothing, nothing, np.full((n, 3), -1, dtype=np.int64))


def in_frame(calibration: Adjustment, xyz: np.ndarray, gradient: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places counted from the local origin, and the gradient along the axes there.

    The partials of the CRS are those in the middle of the pickets: they change by 1e-4 in a kilometre.
    """
    frame, origin = calibration.frame, calibration.system.unknowns.origin
    if frame is None or not len(xyz):
        return np.ascontiguousarray(xyz - origin), np.ascontiguousarray(gradient)
    local = frame.to_local(xyz)
    partials = frame.crs_per_local(local.mean(axis=0)[None])[0]
    return np.ascontiguousarray(local - origin), np.ascontiguousarray(gradient @ partials)


def _in_unknowns(
    calibration: Adjustment, by_eo: np.ndarray, by_interior: np.ndarray, by_parameters: np.ndarray, corrected: bool
) -> np.ndarray:
    """c in the order of the reduced system; a parameter that is corrected for moves V against what its error does."""
    u, state = calibration.system.unknowns, calibration.solution.state
    turned = by_eo.copy()
    turned[:, 3:] = np.einsum("nij,ni->nj", u.turn(state), by_eo[:, 3:])
    shared = np.zeros(len(u.shared))
    kinds = np.array(u.shared.kinds, dtype=object)
    rows, columns = np.nonzero(u.lens.columns >= 0)
    np.add.at(shared, u.lens.columns[rows, columns], by_interior[rows, columns])
    names = calibration.local.parameters.names[error_rows(calibration)]
    own = kinds[shared_columns(calibration)]
    linear = np.array(
        [kind == scanning.KIND or Parameter.of(name).family not in INTERIOR_FAMILIES
         for kind, name in zip(own, names, strict=True)], dtype=bool,
    )  # fmt: skip
    shared[shared_columns(calibration)[linear]] = -by_parameters[linear]
    if not corrected:
        shared[np.isin(kinds, KINDS)] = 0.0
    return np.concatenate([(turned * u.eo_free).ravel(), shared])
