"""Our adjustment, freed of systematic image errors, against Ceres through pycolmap's bundle adjuster.

The model travels as files (`formats.colmap`), pycolmap builds its problem with its own reprojection costs, and the
control enters that problem as priors on points. pyceres is an extra; this module is imported only where a check runs.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.adjustment.parallel import thread_count
from aerotri.colmap_library import pycolmap
from aerotri.crosscheck.ceres_solver import ObservedCost, run_solver
from aerotri.crosscheck.comparison import (
    CovarianceDifference,
    Difference,
    PeerCheck,
    covariance_difference,
    difference,
    judge,
)
from aerotri.crosscheck.freed import FreedBlock, freed_block
from aerotri.crosscheck.start import displacement, intersect, typical_distance
from aerotri.formats.assembly.oriented import OrientedBlock, oriented_from_adjusted
from aerotri.formats.assembly.reprojection import ideal_tangents
from aerotri.formats.foreign.colmap import point_numbers, write_colmap
from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA
from aerotri.functional_model.rotation import angles_from_rotation, exponential, small_rotation_per_angle
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock

PEER = "pycolmap"
HELD_SHARE = 1e-4
"""σ of a held coordinate over a typical one: an effect of 1e-8 on variances."""
QUESTION = "points, orientation and its covariance through pycolmap's problem, control as priors"


def check_with_colmap(adjusted: AdjustedBlock, adjust: Callable[[Block], AdjustedBlock]) -> PeerCheck:
    """Adjust the freed block by Ceres through pycolmap, from a start away from the solution, and compare.

    Parameters
    ----------
    adjust : our adjustment, which is repeated for the freed block.
    """
    freed = freed_block(adjusted)
    ours = adjust(freed.block)
    begun = time.perf_counter()
    problem = _problem(ours, freed)
    vtpv, iterations, converged = run_solver(problem.ceres, thread_count())
    seconds = time.perf_counter() - begun
    check = PeerCheck(
        PEER,
        QUESTION,
        status="not converged",
        reason=f"Ceres stopped after {iterations} iterations",
        solver="Ceres, SPARSE_SCHUR",
        iterations=iterations,
        seconds=seconds,
        observations=problem.ceres.num_residuals() - problem.held,
        unknowns=ours.outcome.unknowns,
        vtpv=ours.outcome.vtpv,
        vtpv_peer=vtpv / freed.sigma_px**2,
        differences=_differences(ours, problem),
        covariance=_covariance(ours, problem, freed.sigma_px) if converged else None,
        notes=freed.notes,
    )
    return judge(check) if converged else check


@dataclass(frozen=True, eq=False)
class _Problem:
    """pycolmap's problem: the model whose parameter blocks it moves, rows of photographs and points, local origin, and
    the number of coordinates held for the datum."""

    model: Any
    adjuster: Any
    ceres: Any
    images: np.ndarray
    points: np.ndarray
    point_id: np.ndarray
    origin: np.ndarray
    held: int = 0

    def orientation(self) -> tuple[np.ndarray, np.ndarray]:
        """Local centres (n, 3) m and rotations (n, 3, 3), camera → object, where the problem has them now."""
        poses = [self.model.images[int(row) + 1].cam_from_world().matrix() for row in self.images]
        turn = np.array([pose[:, :3] for pose in poses])
        centre = -np.einsum("nji,nj->ni", turn, np.array([pose[:, 3] for pose in poses]))
        return centre, np.swapaxes(turn, 1, 2) @ COLMAP_FROM_CAMERA

    def point_block(self, row: int) -> np.ndarray:
        """(3,) the coordinates of a point, in pycolmap's memory."""
        return self.model.points3D[int(self.point_id[row])].xyz


def _problem(ours: AdjustedBlock, freed: FreedBlock) -> _Problem:
    """pycolmap's problem of the freed block with our control and datum, at a start away from our solution."""
    origin = np.round(np.nanmean(ours.images.centre, axis=0))
    oriented = oriented_from_adjusted(ours)
    local = replace(oriented, centre=oriented.centre - origin, points=oriented.points - origin)
    model = _through_files(local)
    images = np.flatnonzero(local.oriented & (ours.images.rays > 0))
    points = np.flatnonzero(ours.points.rays > 0)
    adjuster = _adjuster(model, images)
    problem = _Problem(model, adjuster, adjuster.problem, images, points, point_numbers(ours.block.points)[points],
                       origin)  # fmt: skip
    _displace(problem, local)
    held = _hold_datum(problem, ours, local, freed.sigma_px)
    _add_control(problem, ours, freed.sigma_px)
    return replace(problem, held=held)


def _through_files(local: OrientedBlock) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        write_colmap(local, Path(folder) / "model")
        return pycolmap.Reconstruction(Path(folder) / "model")


def _adjuster(model: Any, images: np.ndarray) -> Any:
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_focal_length = options.refine_principal_point = options.refine_extra_params = False
    options.refine_sensor_from_rig = False
    options.print_summary = False
    config = pycolmap.BundleAdjustmentConfig()
    for row in images.tolist():
        config.add_image(row + 1)
    return pycolmap.create_default_ceres_bundle_adjuster(options, config, model)


def _displace(problem: _Problem, local: OrientedBlock) -> None:
    """Orientations displaced at random, points intersected from them."""
    rays = local.block.image_points
    distance = typical_distance(local.centre, local.points, rays.image, rays.point)
    moved = displacement(distance, len(local.centre))
    centre, rotation = local.centre + moved.centre, exponential(moved.angles) @ local.rotation
    for row in problem.images.tolist():
        block = problem.model.images[row + 1].frame.rig_from_world.params
        turn = COLMAP_FROM_CAMERA @ rotation[row].T
        block[:4] = pycolmap.Rotation3d(turn).quat
        block[4:] = -turn @ centre[row]
    tangent = ideal_tangents(local.block)
    found = intersect(centre, rotation, (rays.image, rays.point, tangent), local.points, 1e-3 * distance)
    for row, point in enumerate(problem.points.tolist()):
        problem.point_block(row)[:] = found[point]


def _hold_datum(problem: _Problem, ours: AdjustedBlock, local: OrientedBlock, sigma_px: float) -> int:
    """A minimal datum: the coordinates that ours held (σ = 0) are observed there; the number of them.

    Seven observations that no other contradicts leave no residual. A manifold would hold them outright, but pycolmap's
    covariance takes every point for one of three coordinates.
    """
    covariance = ours.points.covariance[problem.points]
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    typical = float(np.median(sigma[sigma > 0.0])) / ours.outcome.sigma0
    held = 0
    for row in np.flatnonzero((sigma == 0.0).any(axis=1)).tolist():
        axes = np.flatnonzero(sigma[row] == 0.0)
        block, value = problem.point_block(row), local.points[problem.points[row], axes]
        block[axes] = value
        weight = np.full(len(axes), sigma_px / (HELD_SHARE * typical))
        problem.ceres.add_residual_block(ObservedCost(block, axes, value, weight), None, [block])
        held += len(axes)
    return held


def _add_control(problem: _Problem, ours: AdjustedBlock, sigma_px: float) -> None:
    """Priors on control points, in the unit of pycolmap's residuals."""
    control = ours.block.control
    row_of = {int(point): row for row, point in enumerate(problem.points)}
    for k in np.flatnonzero(~control.is_check).tolist():
        row = row_of.get(int(control.point[k]))
        # what is held has its place already
        known = np.flatnonzero(np.isfinite(control.xyz[k]) & (control.sigma[k] > 0.0))
        if row is None or not len(known):
            continue
        block = problem.point_block(row)
        value = (control.xyz[k] - problem.origin)[known]
        prior = ObservedCost(block, known, value, sigma_px / control.sigma[k, known])
        problem.ceres.add_residual_block(prior, None, [block])


def _differences(ours: AdjustedBlock, problem: _Problem) -> tuple[Difference, ...]:
    images, points, block = ours.images, ours.points, ours.block
    names, sigma = block.images.names[problem.images], images.sigma[problem.images]
    centre, rotation = problem.orientation()
    turn = angles_from_rotation(rotation, block.rotation) - images.angles[problem.images]
    turn = (turn + np.pi) % (2.0 * np.pi) - np.pi
    xyz = np.array([problem.point_block(row) for row in range(len(problem.points))]) + problem.origin
    found = [
        difference("projection centres", centre + problem.origin - images.centre[problem.images], sigma[:, :3], names,
                   ("X0", "Y0", "Z0")),
        difference("orientation angles", turn, sigma[:, 3:], names, ("omega", "phi", "kappa")),
        difference("object points", xyz - points.xyz[problem.points], points.sigma[problem.points],
                   block.points[problem.points], ("X", "Y", "Z")),
    ]  # fmt: skip
    return tuple(d for d in found if d is not None)


def _covariance(ours: AdjustedBlock, problem: _Problem, sigma_px: float) -> CovarianceDifference | None:
    """pycolmap's covariance of the orientation against ours; σ̂0 of ours in both."""
    options = pycolmap.BACovarianceOptions()
    options.params = pycolmap.BACovarianceOptionsParams.POSES
    options.damping = 0.0
    estimated = pycolmap.estimate_ba_covariance_from_problem(options, problem.model, problem.ceres)
    if estimated is None:
        return None
    cofactor = np.array([estimated.get_cam_cov_from_world(int(row) + 1) for row in problem.images])
    jacobian = _angles_by_tangent(problem, ours.block.rotation)
    variance = (sigma_px * ours.outcome.sigma0) ** 2
    peer = variance * jacobian @ cofactor @ np.swapaxes(jacobian, 1, 2)
    return covariance_difference(ours.images.covariance[problem.images], peer, ours.block.images.names[problem.images])


def _angles_by_tangent(problem: _Problem, order: str) -> np.ndarray:
    """(n, 6, 6) partials of X0, Y0, Z0, ω, φ, κ by pycolmap's tangent (half a rotation vector of the camera, t).

    Ceres' quaternion manifold turns by twice its tangent: R ← exp([2δ]×)·R for R = camera ← world, t = −R·X0.
    """
    centre, rotation = problem.orientation()
    world_from_camera = rotation @ COLMAP_FROM_CAMERA
    t = -np.einsum("nji,nj->ni", world_from_camera, centre)
    cross = np.zeros((len(t), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -t[:, 2], t[:, 1], -t[:, 0]
    cross -= np.swapaxes(cross, 1, 2)
    jacobian = np.zeros((len(t), 6, 6))
    jacobian[:, :3, :3] = -2.0 * world_from_camera @ cross
    jacobian[:, :3, 3:] = -world_from_camera
    per_angle = small_rotation_per_angle(angles_from_rotation(rotation, order), order)
    jacobian[:, 3:, :3] = np.linalg.solve(per_angle, -2.0 * world_from_camera)
    return jacobian
