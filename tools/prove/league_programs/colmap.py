"""What pycolmap's BACovariance states for an adjustment of ours: same image points, same unknowns, same datum.

The adjusted block goes to COLMAP as a model in the local frame of the adjustment. pycolmap builds its own problem
with its own reprojection costs; principal distance, principal point and the radial and decentring terms are free as
in ours. Control points, observed projection centres and elements that ours holds enter that problem as observations
with their σ: the datum is the same. Both state σ of the same solution, ours; that pycolmap finds the same one is
shown by `aerotri crosscheck`. `as_it_comes`: two photographs hold the datum, no control, σ of an image coordinate 1
pixel. Measures what no command prints: it looks within the package on purpose.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyceres

from aerotri.adjustment.prepare import with_edits
from aerotri.colmap_library import pycolmap
from aerotri.formats.assembly.oriented import oriented_from_adjusted
from aerotri.formats.foreign.colmap import point_numbers, write_colmap
from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA
from aerotri.functional_model.rotation import angles_from_rotation, small_rotation_per_angle
from aerotri.results.adjusted_block import AdjustedBlock
from league_programs.stated import Held, Stated, bare

HELD_M, HELD_CENTRE_M = 1e-6, 1e-4
"""σ of what ours holds: points and projection centres."""
FREE = {3: np.full(3, 1e-6), 7: np.array([1e3] * 4 + [0.1] * 3), 8: np.full(8, 1e-4), 12: np.full(12, 1e-4)}
"""Weights of what is not observed of points, poses and cameras, by the number of their parameters: nothing beside those
of image points, and not so small that rounding of the weights observed is larger [C]."""
HELD_LENS, HELD_PX = 1e-7, 1e-3
"""σ of lens terms of COLMAP's model that ours does not have, and of the difference of its two focal lengths, px."""
LENS_NAMES = {"k1": 4, "k2": 5, "p1": 6, "p2": 7, "k3": 8, "k4": 9, "k5": 10, "k6": 11}
"""Places in the parameters of FULL_OPENCV, behind fx, fy, cx, cy."""


def prior(information: np.ndarray, mean: np.ndarray, free: np.ndarray) -> Any:
    """An observation of a block of parameters by its weight matrix; Ceres' own cost, so that its threads can run.

    Parameters
    ----------
    free : weights of directions without weight: pyceres takes covariances.
    """
    return pyceres.factors.NormalPrior(mean, np.linalg.inv(information + np.diag(free)))


def centre_by_pose(pose: np.ndarray) -> np.ndarray:
    """(3, 7) partials of the projection centre −Rᵀ·t by a pose (quaternion x, y, z, w; t)."""
    v, w, t = pose[:3], pose[3], pose[4:]
    partials = np.empty((3, 7))
    partials[:, :3] = -2.0 * (w * _skew(t) + v @ t * np.eye(3) + np.outer(v, t) - 2.0 * np.outer(t, v))
    partials[:, 3] = 2.0 * np.cross(v, t)
    partials[:, 4:] = -(np.eye(3) + 2.0 * (_skew(v) @ _skew(v) - w * _skew(v)))
    return partials


def _skew(a: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


@dataclass(frozen=True, eq=False)
class Problem:
    """pycolmap's problem of a block.

    Parameters
    ----------
    ours : in the local frame. model : pycolmap's. adjuster : holds the problem. images, points : rows in ours.
    origin : (3,) m, taken off. sigma_px : of an image coordinate. costs : ours, kept alive.
    """

    ours: AdjustedBlock
    model: Any
    adjuster: Any
    images: np.ndarray
    points: np.ndarray
    origin: np.ndarray
    sigma_px: float
    costs: list[Any]

    def pose(self, row: int) -> np.ndarray:
        return self.model.images[row + 1].frame.rig_from_world.params

    def point(self, row: int) -> np.ndarray:
        return self.model.points3D[int(point_numbers(self.ours.block.points)[row])].xyz

    def observe(self, block: np.ndarray, matrix: np.ndarray, sigma: np.ndarray) -> None:
        """Add linear observations of a block, by their partials (k, n) and σ (k,): its values now are observed."""
        weighted = matrix / sigma[:, None]
        self.add(block, prior(weighted.T @ weighted, block.copy(), FREE[len(block)]))

    def add(self, block: np.ndarray, cost: Any) -> None:
        """Add a cost of one block."""
        self.adjuster.problem.add_residual_block(cost, None, [block])
        self.costs.append(cost)


def stated(ours: AdjustedBlock) -> Stated:
    """σ of pycolmap in our datum, with our σ̂0.

    Parameters
    ----------
    ours : in the local frame of the adjustment, by least squares with one σ for all image points.
    """
    problem = _problem(ours, gauge=False)
    return _stated("pycolmap, same datum", problem, problem.sigma_px * ours.outcome.sigma0)


def as_it_comes(ours: AdjustedBlock) -> Stated:
    """σ of pycolmap without control: two photographs hold the datum, σ of an image coordinate is 1 pixel."""
    problem = _problem(ours, gauge=True)
    return replace(_stated("pycolmap, as it comes", problem, 1.0), held=None)


def _problem(ours: AdjustedBlock, gauge: bool) -> Problem:
    ours = replace(ours, block=with_edits(ours.block)[0])
    origin = np.round(np.nanmean(ours.images.centre, axis=0))
    oriented = oriented_from_adjusted(ours)
    local = replace(oriented, centre=oriented.centre - origin, points=oriented.points - origin)
    with tempfile.TemporaryDirectory() as folder:
        write_colmap(local, Path(folder) / "model")
        model = pycolmap.Reconstruction(Path(folder) / "model")
    images = np.flatnonzero(local.oriented & (ours.images.rays > 0))
    free = bool((ours.parameters.kinds == "interior").any() or (ours.parameters.kinds == "additional").any())
    adjuster = _adjuster(model, images, gauge, free)
    numbers = point_numbers(ours.block.points)
    there = set(model.point3D_ids())
    points = np.array([k for k in np.flatnonzero(ours.points.rays > 1) if int(numbers[k]) in there])
    pixel = np.array([camera.pixel_mm for camera in ours.block.cameras])[
        ours.block.images.camera[ours.block.image_points.image]
    ]
    sigma_px = float(np.median(ours.block.image_points.sigma[:, 0] / pixel))
    problem = Problem(ours, model, adjuster, images, points, origin, sigma_px, [])
    if free:
        _tie_cameras(problem)
    if not gauge:
        _observe_control(problem)
        _observe_centres(problem)
        _hold_datum(problem)
    return problem


def _adjuster(model: Any, images: np.ndarray, gauge: bool, free: bool) -> Any:
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_focal_length = options.refine_principal_point = options.refine_extra_params = free
    options.print_summary = False
    config = pycolmap.BundleAdjustmentConfig()
    for row in images.tolist():
        config.add_image(row + 1)
    if gauge:
        config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    return pycolmap.create_default_ceres_bundle_adjuster(options, config, model)


def _tie_cameras(problem: Problem) -> None:
    """One focal length, and no more lens terms than ours has, where COLMAP's model has more."""
    for number, camera in problem.model.cameras.items():
        ours = problem.ours.block.cameras[number - 1]
        if not problem.adjuster.problem.has_parameter_block(camera.params):
            continue
        own = {
            name.removeprefix("lens.")
            for name, group in zip(problem.ours.parameters.names, problem.ours.parameters.groups, strict=True)
            if group == ours.name and name.startswith("lens.")
        }
        size = len(camera.params)
        matrix = [np.eye(size)[place] for name, place in LENS_NAMES.items() if place < size and name not in own]
        sigma = [HELD_LENS] * len(matrix)
        if camera.model.name not in ("FULL_OPENCV", "OPENCV"):
            continue
        if "b1" not in own:
            matrix, sigma = [*matrix, np.eye(size)[0] - np.eye(size)[1]], [*sigma, HELD_PX]
        if matrix:
            problem.observe(camera.params, np.array(matrix), np.array(sigma))


def _observe_control(problem: Problem) -> None:
    control = problem.ours.block.control
    for k in np.flatnonzero(~control.is_check).tolist():
        row = int(control.point[k])
        known = np.flatnonzero(np.isfinite(control.xyz[k]))
        if row not in problem.points or not len(known):
            continue
        sigma = np.maximum(control.sigma[k, known], HELD_M)
        problem.observe(problem.point(row), np.eye(3)[known], sigma / problem.sigma_px)


def _observe_centres(problem: Problem) -> None:
    gnss = problem.ours.block.gnss_ins
    if gnss is None:
        return
    for k, row in enumerate(gnss.image.tolist()):
        known = np.flatnonzero(np.isfinite(gnss.xyz[k]) & np.isfinite(gnss.sigma[k]))
        if row in problem.images and len(known):
            pose = problem.pose(row)
            problem.observe(pose, centre_by_pose(pose)[known], gnss.sigma[k, known] / problem.sigma_px)


def _hold_datum(problem: Problem) -> None:
    """What ours holds without control: coordinates of points and centres whose σ is 0, poses that are held whole."""
    ours = problem.ours
    control = ours.block.control
    if np.isfinite(control.xyz[~control.is_check]).any():
        return
    sigma = ours.images.sigma
    for row in problem.images.tolist():
        held = np.flatnonzero(sigma[row] == 0.0)
        if len(held) == 6:
            problem.adjuster.problem.set_parameter_block_constant(problem.pose(row))
        elif len(held):
            pose = problem.pose(row)
            problem.observe(pose, centre_by_pose(pose)[held], np.full(len(held), HELD_CENTRE_M))
    for row in problem.points[(ours.points.sigma[problem.points] == 0.0).any(axis=1)].tolist():
        held = np.flatnonzero(ours.points.sigma[row] == 0.0)
        problem.observe(problem.point(row), np.eye(3)[held], np.full(len(held), HELD_M))


def _stated(program: str, problem: Problem, scale: float) -> Stated:
    options = pycolmap.BACovarianceOptions()
    options.params = pycolmap.BACovarianceOptionsParams.ALL
    options.damping = 0.0
    found = pycolmap.estimate_ba_covariance_from_problem(options, problem.model, problem.adjuster.problem)
    if found is None:
        raise RuntimeError("pycolmap gives no covariance")
    return Stated(
        program,
        photographs=_photographs(problem, found, scale),
        points=_points(problem, found, scale),
        interior=_interior(problem, found, scale),
        held=_held(problem, found, scale),
    )


def _photographs(problem: Problem, found: Any, scale: float) -> dict[str, np.ndarray]:
    names, out = problem.ours.block.images.names, {}
    for row in problem.images.tolist():
        cofactor = found.get_cam_cov_from_world(row + 1)
        if cofactor is None or cofactor.shape != (6, 6):
            continue
        jacobian = _elements_by_tangent(problem.model.images[row + 1], problem.ours.block.rotation)
        sigma = scale * np.sqrt(np.diagonal(jacobian @ cofactor @ jacobian.T))
        out[bare(str(names[row]))] = sigma * [1.0, 1.0, 1.0, *[np.degrees(1.0)] * 3]
    return out


def _elements_by_tangent(image: Any, order: str) -> np.ndarray:
    """(6, 6) partials of X0, Y0, Z0, ω, φ, κ by pycolmap's tangent (half a rotation vector of the camera, t)."""
    pose = image.cam_from_world().matrix()
    world_from_camera, t = pose[:, :3].T, pose[:, 3]
    jacobian = np.zeros((6, 6))
    jacobian[:3, :3] = -2.0 * world_from_camera @ _skew(t)
    jacobian[:3, 3:] = -world_from_camera
    angles = angles_from_rotation(world_from_camera @ COLMAP_FROM_CAMERA, order)
    per_angle = small_rotation_per_angle(angles[None], order)[0]
    jacobian[3:, :3] = np.linalg.solve(per_angle, -2.0 * world_from_camera)
    return jacobian


def _points(problem: Problem, found: Any, scale: float) -> dict[str, np.ndarray]:
    names, numbers, out = problem.ours.block.points, point_numbers(problem.ours.block.points), {}
    for row in problem.points.tolist():
        cofactor = found.get_point_cov(int(numbers[row]))
        if cofactor is not None and cofactor.shape == (3, 3):
            out[str(names[row])] = scale * np.sqrt(np.diagonal(cofactor))
    return out


def _interior(problem: Problem, found: Any, scale: float) -> dict[str, np.ndarray]:
    out = {}
    for number, camera in problem.model.cameras.items():
        if not problem.adjuster.problem.has_parameter_block(camera.params):
            continue
        cofactor, ours = found.get_other_params_cov(camera.params), problem.ours.block.cameras[number - 1]
        if cofactor is not None:
            two = camera.model.name in ("FULL_OPENCV", "OPENCV")
            variance = np.diagonal(cofactor)[[1, 2, 3] if two else [0, 1, 2]]
            out[ours.name] = scale * ours.pixel_mm * np.sqrt(variance)
    return out


def _held(problem: Problem, found: Any, scale: float) -> Held | None:
    """Check points, with the σ that is stated for points."""
    control, rows = problem.ours.block.control, []
    sigmas = _points(problem, found, scale)
    for k in np.flatnonzero(control.is_check).tolist():
        row = int(control.point[k])
        sigma = sigmas.get(str(problem.ours.block.points[row]))
        if sigma is not None and np.isfinite(control.xyz[k]).all():
            rows.append((problem.point(row) + problem.origin - control.xyz[k], sigma, control.sigma[k]))
    return Held(*(np.array(column) for column in zip(*rows, strict=True))) if rows else None
