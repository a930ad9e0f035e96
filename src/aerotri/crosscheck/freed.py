"""Our own adjustment in the form in which a peer can repeat it.

Robust weights are kept as they ended. For pycolmap, which has no self-calibration of ours and weighs every pixel alike,
the image points are freed of the systematic errors that were found, the camera is held as adjusted, and the block is
adjusted again with one σ for all: the same points and orientations where the σ were equal, by a pinhole.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.ray_status import RayStatus
from aerotri.formats.assembly.oriented import oriented_from_adjusted
from aerotri.observations import AdjustmentSettings, Block, Control, ImagePoints, Settings
from aerotri.results.adjusted_block import AdjustedBlock

NO_CORRECTIONS = {"refraction": "off", "earth_curvature": "off"}
LEAST_WEIGHT = 0.5
"""Robust weight below which a ray is left out of an adjustment with equal weights."""


def as_adjusted(local: AdjustedBlock, measured: Block) -> AdjustedBlock:
    """A result whose block needs no correction any more: the peers know neither the air nor the curved earth.

    Parameters
    ----------
    local : the result in the frame of the adjustment. measured : the block that the equations were made of, its image
        points freed of refraction and earth curvature.
    """
    return replace(local, block=replace(measured, settings=replace(measured.settings, **NO_CORRECTIONS)))


def used_rays(adjusted: AdjustedBlock) -> np.ndarray:
    """(m,) bool, the rays that took part."""
    return adjusted.rays.status == RayStatus.USED


def with_fixed_weights(adjusted: AdjustedBlock) -> Block:
    """The block of a robust adjustment as least squares with the weights it ended with."""
    block, used = adjusted.block, used_rays(adjusted)
    rays = block.image_points
    weight = np.where(used, adjusted.rays.weight, 1.0)
    block = _with_rays(block, used, rays.xy, rays.sigma / np.sqrt(weight)[:, None])
    plain = replace(block.settings.adjustment, robust="off", variance_components="off", parameter_selection="off")
    return replace(_from_solution(block, adjusted), settings=replace(block.settings, adjustment=plain))


@dataclass(frozen=True, eq=False)
class FreedBlock:
    """A pinhole block of one σ in pixels, and what had to change to make it one."""

    block: Block
    sigma_px: float
    notes: tuple[str, ...]


def freed_block(adjusted: AdjustedBlock) -> FreedBlock:
    """The block freed of systematic image errors, the camera held as adjusted."""
    oriented = oriented_from_adjusted(adjusted)
    block, rays = oriented.block, oriented.block.image_points
    keep = oriented.complete & (np.nan_to_num(adjusted.rays.weight) >= LEAST_WEIGHT)
    keep &= np.bincount(rays.point[keep], minlength=len(block.points))[rays.point] >= 2
    pixel = np.array([camera.pixel_mm for camera in block.cameras])[block.images.camera[rays.image]]
    in_pixels = rays.sigma / pixel[:, None]
    sigma_px = float(np.median(in_pixels[keep]))
    sigma = np.repeat(sigma_px * pixel[:, None], 2, axis=1)
    cameras = tuple(replace(camera, brown={}, parameters={}) for camera in block.cameras)
    xy = oriented.corrected_xy()
    freed = _with_rays(replace(block, cameras=cameras), keep, xy, sigma)
    by_control = block.settings.adjustment.datum == "control" and block.gnss_ins is None
    notes = ["camera held as adjusted"]
    if (xy != rays.xy).any():
        notes[0] = f"image points freed of our own systematic errors, which this does not check; {notes[0]}"
    if any(camera.lens for camera in block.cameras):
        notes[0] += ", its lens in COLMAP's own model"
    if np.ptp(in_pixels[keep]) > 1e-9 * sigma_px:
        notes.append(f"ours adjusted again with one σ of {sigma_px:.3g} px for all image points")
    left_out = int(used_rays(adjusted).sum() - keep.sum())
    if left_out:
        notes.append(f"rays left out: {left_out} (the only ray of a point, or a robust weight below {LEAST_WEIGHT})")
    if block.gnss_ins is not None:
        notes.append("both without observed projection centres and attitudes, in a minimal datum")
    elif not by_control:
        notes.append("datum: seven point coordinates held")
    if block.constraints is not None and len(block.constraints):
        notes.append("both without constraints")
    settings = Settings(
        adjustment=AdjustmentSettings(datum="control" if by_control else "minimal"),
        image_sigma_um=block.settings.image_sigma_um,
    )
    control = block.control if by_control else Control.empty()
    freed = _from_solution(freed, adjusted)
    freed = replace(freed, control=control, gnss_ins=None, edits=None, constraints=None, settings=settings)
    return FreedBlock(freed, sigma_px, tuple(notes))


def _with_rays(block: Block, keep: np.ndarray, xy: np.ndarray, sigma: np.ndarray) -> Block:
    rays = block.image_points
    kept = ImagePoints(rays.image[keep], rays.point[keep], xy[keep], sigma[keep])
    return replace(block, image_points=kept)


def _from_solution(block: Block, adjusted: AdjustedBlock) -> Block:
    """The block with the adjusted orientation as start values."""
    return replace(block, images=replace(block.images, centre=adjusted.images.centre, angles=adjusted.images.angles))
