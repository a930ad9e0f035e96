"""The result of an adjustment from its local frame back into the CRS of the block."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.adjustment.prepare import with_edits
from aerotri.coordinates.blocks import completed
from aerotri.coordinates.local_frame import LocalFrame
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles, small_rotation_per_angle
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock, GroundPointResults, ImageResults, PointResults
from aerotri.results.normalised import normalised_residuals

SINGULAR = 1e-9
"""Determinant of the partials by the angles below which ω, φ, κ cannot be told apart."""


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


def _points_from_local(points: PointResults, frame: LocalFrame) -> PointResults:
    jacobian = frame.crs_per_local(points.xyz)
    covariance = jacobian @ points.covariance @ np.swapaxes(jacobian, 1, 2)
    return replace(points, xyz=frame.from_local(points.xyz), covariance=covariance)


def with_model_of(result: AdjustedBlock, local: AdjustedBlock, frame: LocalFrame | None) -> AdjustedBlock:
    """The result with the model part of σ that was found in the local frame.

    Parameters
    ----------
    result : in the CRS of the block, `local` : the same in the frame of the adjustment, with its model part.
    """
    points, images, local_images = local.points.model, local.images.model, local.images.model
    if frame is not None and points is not None and local_images is not None:
        jacobian = frame.crs_per_local(local.points.xyz)
        points = jacobian @ points @ np.swapaxes(jacobian, 1, 2)
        there = np.isfinite(local.images.centre).all(axis=1)
        partials = orientation_partials(
            local.images.centre[there], local.images.angles[there], frame, result.block.rotation
        )
        images = np.full_like(local_images, np.nan)
        images[there] = partials @ local_images[there] @ np.swapaxes(partials, 1, 2)
    result = replace(
        result,
        images=replace(result.images, model=images),
        points=replace(result.points, model=points),
        parameters=replace(result.parameters, model=local.parameters.model),
        model_part=local.model_part,
        deviations=local.deviations,
    )
    return replace(result, control=_with_model(result, result.control), check=_with_model(result, result.check))


def _with_model(result: AdjustedBlock, ground: GroundPointResults) -> GroundPointResults:
    if result.points.model is None:
        return replace(ground, model_sigma=None)
    sigma = np.sqrt(np.diagonal(result.points.model[ground.point], axis1=1, axis2=2))
    return replace(ground, model_sigma=np.where(np.isfinite(ground.sigma), sigma, np.nan))


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
    # as the operator decided, who may have made a control point a check point
    control = with_edits(block)[0].control
    row = np.full(len(block.points), -1)
    own = np.flatnonzero(control.is_check == is_check)
    row[control.point[own]] = own
    given, sigma_given = control.xyz[row[ground.point]], control.sigma[row[ground.point]]
    xyz = points.xyz[ground.point]
    difference = xyz - given
    if not frame.georeference.is_projected:
        apart = adjusted.points.xyz[ground.point] - frame.to_local(completed(given, xyz))
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
