"""The standard deviation of tie points, from how they fit one another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.solve import SolveOptions, minimise
from aerotri.conventions import InputError
from aerotri.observations import Block

POWERS = tuple((i, j) for i in range(4) for j in range(4 - i))
"""Of x and y, up to the third together: what errors of an orientation and of a lens do within a photograph."""
STEPS = 6
"""Iterations of each stage of the adjustment that the misfit is taken from [C]: a first orientation is near its end."""
FEWEST = 10 * len(POWERS)
"""Rays of a photograph from which so many unknowns can be taken off without much effect on the rest [C]."""


def with_sigma_of_ties(block: Block, offset_px: np.ndarray, ties: int) -> tuple[Block, float]:
    """The block with the standard deviation of a coordinate that the misfit of its tie points shows, and it in px.

    Of a point with k rays, residuals have 2k − 3 redundant coordinates of 2k; half of two-dimensional errors are less
    than √(2 ln 2) σ [L]. What is smooth within a photograph is taken off before: a first orientation is not exact.
    Ratios between the rays stay.

    Parameters
    ----------
    offset_px : (m, 2) measured less predicted. ties : the first so many points are tie points.
    """
    rays = block.image_points
    own = (rays.point < ties) & np.isfinite(offset_px).all(axis=1)
    length = np.bincount(rays.point, minlength=len(block.points))[rays.point[own]]
    pixel = np.array([camera.pixel_mm for camera in block.cameras])[block.images.camera[rays.image]]
    rest = np.linalg.norm(without_smooth_part(offset_px[own], rays.xy[own], rays.image[own]), axis=1)
    relative = rest * pixel[own] / rays.sigma[own].mean(axis=1) / np.sqrt(1.0 - 3.0 / (2.0 * length))
    factor = float(np.median(relative)) / np.sqrt(2.0 * np.log(2.0)) if own.any() else 0.0
    # three digits, more than it is known to: rounding in the adjustment shall change no σ
    factor = float(f"{factor:.3g}") if factor > 0.0 else 1.0
    sigma = np.where((rays.point < ties)[:, None], factor * rays.sigma, rays.sigma)
    common = float(np.median(sigma[own])) if own.any() else float(np.median(sigma))
    settings = replace(block.settings, image_sigma_um=1e3 * common)
    found = replace(block, image_points=replace(rays, sigma=sigma), settings=settings)
    used = own if own.any() else np.ones(len(sigma), bool)
    return found, float(np.median(sigma[used] / pixel[used, None]))


def adjusted_offsets(local: Block, points: np.ndarray, offset_px: np.ndarray) -> tuple[np.ndarray, str]:
    """(m, 2) px, measured less predicted after some steps of the adjustment, and a sentence where it leads nowhere.

    The offsets are then those given, and their misfit contains the errors of the start values.

    Parameters
    ----------
    local : in a local frame, with start values. points : (N, 3) m, start values of its points.
    offset_px : (m, 2) at the start values, and of rays that the adjustment leaves out.
    """
    try:
        prepared = prepare(local, points)
        unknowns = prepared.system.unknowns
        redundancy = max(2 * len(unknowns.rays.source) - unknowns.count, 1)
        found = minimise(prepared.system, prepared.state, redundancy, SolveOptions(STEPS, "huber"))
    except InputError as error:
        return offset_px, _as_given(error.message)
    except np.linalg.LinAlgError:
        return offset_px, _as_given("the equations cannot be solved")
    residual = found.equations.residual
    if found.defects or not np.isfinite(residual).all():
        return offset_px, _as_given("the image points do not determine all unknowns")
    pixel = np.array([camera.pixel_mm for camera in local.cameras])[local.images.camera[local.image_points.image]]
    after, rows = offset_px.copy(), unknowns.rays.source
    after[rows] = residual / pixel[rows, None]
    return after, ""


def _as_given(why: str) -> str:
    return (
        f"the standard deviation of tie points contains errors of the first orientation, because it could not be "
        f"adjusted: {why}"
    )


def without_smooth_part(offset: np.ndarray, xy: np.ndarray, image: np.ndarray) -> np.ndarray:
    """(m, 2) offsets less a polynomial of every photograph with rays enough.

    Parameters
    ----------
    offset, xy : (m, 2), where the offsets are. image : (m,).
    """
    rest = offset.copy()
    for number in np.unique(image).tolist():
        own = np.flatnonzero(image == number)
        if len(own) < FEWEST:
            continue
        x, y = (xy[own] / np.abs(xy[own]).max()).T
        design = np.column_stack([x**i * y**j for i, j in POWERS])
        rest[own] -= design @ np.linalg.lstsq(design, offset[own], rcond=None)[0]
    return rest
