"""A block from its CRS into the local frame before the adjustment, and the result back into the CRS after it.

What is measured keeps its meaning: coordinates are transformed exactly, attitudes turn with the axes of the CRS at the
projection centre. Standard deviations go through the partials of the transformation; of the covariance that this gives
a control or GNSS position only the variances are kept [C], since axes differ by no more than the convergence and the
tilt of the vertical within the block: 0.0016 rad at 10 km from the origin.
"""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np

from aerotri.conventions import InputError
from aerotri.coordinates.local_frame import LocalFrame, local_frame
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles, small_rotation_per_angle
from aerotri.observations import Block, Control, GnssIns, Images
from aerotri.observations.block import Constraints
from aerotri.statistics.adjusted_block import AdjustedBlock, GroundPointResults, ImageResults, PointResults
from aerotri.statistics.reliability import normalised_residuals

SINGULAR = 1e-9
"""Determinant of the partials by the angles below which ω, φ, κ cannot be told apart."""


def frame_of_block(
    block: Block, geoid: str | os.PathLike | None = None, origin: np.ndarray | None = None
) -> LocalFrame:
    """The local frame of a block with a CRS: around its control points, projection centres and GNSS positions.

    Parameters
    ----------
    geoid, origin : see `local_frame`.
    """
    places = [block.control.xyz, block.images.centre]
    if block.gnss_ins is not None:
        places.append(block.gnss_ins.xyz)
    return local_frame(block.crs, np.concatenate(places), geoid, origin)


def needs_positions(block: Block) -> bool:
    """Whether control or GNSS with missing coordinates makes the transformation depend on what is not measured."""
    observed = [block.control.xyz] + ([] if block.gnss_ins is None else [block.gnss_ins.xyz])
    if block.constraints is not None and len(block.constraints):
        return True
    return any(_partly_known(xyz).any() for xyz in observed)


def transform_block(
    block: Block, frame: LocalFrame, points: np.ndarray | None = None, centres: np.ndarray | None = None
) -> Block:
    """The block in the local frame, with crs 'local'.

    A height-only or plan-only point has local coordinates only together with its other coordinates. They are taken
    from `points`; a wrong plan position moves the local height by its error times the distance from the origin over
    the earth's radius. So where `needs_positions`, transform again with what was adjusted and adjust again, until
    nothing moves: from a first guess 1 km off, 10 km from the origin, two times.

    Parameters
    ----------
    points, centres : (N, 3), (n, 3) m in the frame, approximate positions of the block's points and photographs, NaN
        where not known; None: points below the photographs that see them, at the mean height of the control, and
        photographs at their start values.

    Raises
    ------
    InputError
        When the block asks for an earth curvature correction, which the frame makes needless.
    """
    if block.crs != frame.crs:
        raise ValueError(f"block in {block.crs}, frame for {frame.crs}")
    if block.settings.earth_curvature != "off":
        raise InputError(
            f"earth_curvature is for local blocks; a block in {block.crs} is adjusted on the curved earth anyway",
            'set earth_curvature = "off"',
            file="block.toml",
        )
    images = _images_to_local(block.images, frame, block.rotation)
    control = _control_to_local(block, frame, points)
    gnss_ins = None if block.gnss_ins is None else _gnss_to_local(block, block.gnss_ins, frame, centres)
    constraints = None if block.constraints is None else _constraints_to_local(block.constraints, frame, points)
    return replace(block, crs="local", images=images, control=control, gnss_ins=gnss_ins, constraints=constraints)


def transform_result(adjusted: AdjustedBlock, block: Block, frame: LocalFrame) -> AdjustedBlock:
    """The result of `transform_block(block, frame)`, brought into the CRS of `block`.

    Differences of control and check points are those of CRS coordinates (of a geographic CRS: metres east, north, up),
    and their tests belong to these differences and the σ given in the CRS. Residuals of rays and groups stay as they
    were adjusted; GNSS shifts and drifts keep the axes of the frame, which are those of the CRS at its origin.

    Parameters
    ----------
    adjusted : in the frame. block : in its CRS, as it was before the transformation.
    """
    points = _points_from_local(adjusted.points, frame)
    return replace(
        adjusted,
        block=block,
        images=_images_from_local(adjusted.images, frame, block.rotation),
        points=points,
        control=_ground_from_local(adjusted, adjusted.control, points, block, frame, is_check=False),
        check=_ground_from_local(adjusted, adjusted.check, points, block, frame, is_check=True),
    )


def _constraints_to_local(constraints: Constraints, frame: LocalFrame, points: np.ndarray | None) -> Constraints:
    """Conditions with the axes of the CRS at their place: plumb lines and heights are those there, not the frame's."""
    places = np.zeros((len(constraints), 3))
    if points is not None:
        places = np.array([points[members].mean(axis=0) for members in constraints.points]).reshape(-1, 3)
    return replace(constraints, axes=frame.axes_at(frame.from_local(np.nan_to_num(places))))


def _images_to_local(images: Images, frame: LocalFrame, order: str) -> Images:
    place = _completed(images.centre, _middle_of(images.centre, frame))
    centre = np.where(np.isfinite(images.centre), frame.to_local(place), np.nan)
    return replace(images, centre=centre, angles=_angles_to_local(images.angles, place, frame, order))


def _angles_to_local(angles: np.ndarray, place: np.ndarray, frame: LocalFrame, order: str) -> np.ndarray:
    """(n, 3) angles in the frame of those in the CRS at `place`; a missing angle counts as zero for the others."""
    known = np.isfinite(angles)
    rotation = frame.axes_at(place) @ rotation_from_angles(np.where(known, angles, 0.0), order)
    return np.where(known, angles_from_rotation(rotation, order), np.nan)


def _control_to_local(block: Block, frame: LocalFrame, points: np.ndarray | None) -> Control:
    control = block.control
    guess = _below_photographs(block, frame)[control.point] if _partly_known(control.xyz).any() else control.xyz
    if points is not None:
        guess = _completed(frame.from_local(points[control.point]), guess)
    xyz, sigma = _positions_to_local(control.xyz, control.sigma, guess, frame)
    return replace(control, xyz=xyz, sigma=sigma)


def _gnss_to_local(block: Block, observed: GnssIns, frame: LocalFrame, centres: np.ndarray | None) -> GnssIns:
    guess = _completed(block.images.centre, _middle_of(observed.xyz, frame))[observed.image]
    if centres is not None:
        guess = _completed(frame.from_local(centres[observed.image]), guess)
    xyz, sigma = _positions_to_local(observed.xyz, observed.sigma, guess, frame)
    place = _completed(observed.xyz, guess)
    return replace(
        observed, xyz=xyz, sigma=sigma, angles=_angles_to_local(observed.angles, place, frame, block.rotation)
    )


def _positions_to_local(xyz: np.ndarray, sigma: np.ndarray, guess: np.ndarray, frame: LocalFrame):
    """Local positions and their σ, NaN where a coordinate is not known; `guess` stands in for the unknown ones."""
    known = np.isfinite(xyz)
    local = frame.to_local(_completed(xyz, guess))
    local_per_crs = np.linalg.inv(frame.crs_per_local(local))
    # what is not known has no σ, and the guess in its place none to pass on
    variance = np.where(known, np.nan_to_num(sigma), 0.0) ** 2
    spread = np.sqrt(np.einsum("nij,nj->ni", local_per_crs**2, variance))
    # what is held stays held, along the axis of the frame that takes its place
    spread = np.where(sigma == 0.0, 0.0, spread)
    return np.where(known, local, np.nan), np.where(np.isfinite(sigma), spread, np.nan)


def _partly_known(xyz: np.ndarray) -> np.ndarray:
    count = np.isfinite(xyz).sum(axis=1)
    return (count > 0) & (count < 3)


def _completed(xyz: np.ndarray, guess: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(xyz), xyz, guess)


def _middle_of(xyz: np.ndarray, frame: LocalFrame) -> np.ndarray:
    """(3,) in the CRS: the mean of what is known of `xyz`, the frame's origin where nothing is."""
    origin = frame.from_local(np.zeros((1, 3)))[0]
    known = [column[np.isfinite(column)] for column in xyz.T]
    return np.array([column.mean() if len(column) else origin[k] for k, column in enumerate(known)])


def _below_photographs(block: Block, frame: LocalFrame) -> np.ndarray:
    """(N, 3) in the CRS: plan positions below the photographs that see a point, at the mean height of the control."""
    centre = block.images.centre.copy()
    if block.gnss_ins is not None:
        centre[block.gnss_ins.image] = _completed(centre[block.gnss_ins.image], block.gnss_ins.xyz)
    rays = block.image_points
    use = np.isfinite(centre[rays.image, :2]).all(axis=1)
    guess = np.tile(_middle_of(block.control.xyz, frame), (len(block.points), 1))
    count = np.bincount(rays.point[use], minlength=len(block.points))
    for axis in range(2):
        total = np.bincount(rays.point[use], weights=centre[rays.image[use], axis], minlength=len(block.points))
        guess[count > 0, axis] = total[count > 0] / count[count > 0]
    return guess


def _points_from_local(points: PointResults, frame: LocalFrame) -> PointResults:
    jacobian = frame.crs_per_local(points.xyz)
    covariance = jacobian @ points.covariance @ np.swapaxes(jacobian, 1, 2)
    return replace(points, xyz=frame.from_local(points.xyz), covariance=covariance)


def _images_from_local(images: ImageResults, frame: LocalFrame, order: str) -> ImageResults:
    """Orientation in the CRS."""
    centre = frame.from_local(images.centre)
    angles, covariance = np.full_like(images.angles, np.nan), np.full_like(images.covariance, np.nan)
    there = np.isfinite(images.centre).all(axis=1)
    axes = np.swapaxes(frame.axes_at(centre[there]), 1, 2)
    angles[there] = angles_from_rotation(axes @ rotation_from_angles(images.angles[there], order), order)
    jacobian = orientation_partials(images.centre[there], images.angles[there], frame, order)
    covariance[there] = jacobian @ images.covariance[there] @ np.swapaxes(jacobian, 1, 2)
    return replace(images, centre=centre, angles=angles, covariance=covariance)


def orientation_partials(centre: np.ndarray, angles: np.ndarray, frame: LocalFrame, order: str) -> np.ndarray:
    """(n, 6, 6) partials of X0, Y0, Z0, ω, φ, κ in the CRS by those in the local frame.

    δ_crs = axesᵀ·δ_local, so the angles have the partials E_crs⁻¹·axesᵀ·E_local; NaN at a middle angle of ±90°.

    Parameters
    ----------
    centre : (n, 3) m and angles : (n, 3) rad, in the local frame.
    """
    axes = np.swapaxes(frame.axes_at(frame.from_local(centre)), 1, 2)
    angles_crs = angles_from_rotation(axes @ rotation_from_angles(angles, order), order)
    per_angle = small_rotation_per_angle(angles_crs, order)
    singular = np.abs(np.linalg.det(per_angle)) < SINGULAR
    jacobian = np.zeros((len(axes), 6, 6))
    jacobian[:, :3, :3] = frame.crs_per_local(centre)
    turned = axes @ small_rotation_per_angle(angles, order)
    jacobian[~singular, 3:, 3:] = np.linalg.solve(per_angle[~singular], turned[~singular])
    jacobian[singular, 3:, 3:] = np.nan
    return jacobian


def _ground_from_local(
    adjusted: AdjustedBlock, ground: GroundPointResults, points: PointResults, block: Block, frame: LocalFrame,
    is_check: bool,
) -> GroundPointResults:  # fmt: skip
    row = np.full(len(block.points), -1)
    own = np.flatnonzero(block.control.is_check == is_check)
    row[block.control.point[own]] = own
    given, sigma_given = block.control.xyz[row[ground.point]], block.control.sigma[row[ground.point]]
    xyz = points.xyz[ground.point]
    difference = xyz - given
    if not frame.georeference.is_projected:
        apart = adjusted.points.xyz[ground.point] - frame.to_local(_completed(given, xyz))
        metres = np.einsum("nji,nj->ni", frame.axes_at(xyz), apart)
        difference = np.where(np.isfinite(given), metres, np.nan)
    sigma = np.where(np.isfinite(given), points.sigma[ground.point], np.nan)
    if is_check:
        w = difference / np.sqrt(sigma**2 + sigma_given**2)
        return replace(ground, difference=difference, sigma=sigma, w=w)
    sigma_given_local = adjusted.block.control.sigma[row[ground.point]]
    # 1 − r is the variance of the adjusted over that of the given coordinate, each in its own axes
    with np.errstate(divide="ignore", invalid="ignore"):
        taken = (1.0 - ground.r) * (sigma / ground.sigma * sigma_given_local / sigma_given) ** 2
    held = sigma_given == 0.0
    r = np.where(np.isfinite(taken) & ~held, 1.0 - taken, ground.r)
    w = np.where(held, ground.w, normalised_residuals(difference, sigma_given, r))
    return replace(ground, difference=difference, sigma=sigma, r=r, w=w)
