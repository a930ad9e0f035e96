"""Rays that do not meet the others of their track once photographs are oriented are taken out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.conventions import SIGMA_PER_MAD
from aerotri.formats.assembly.reprojection import reproject
from aerotri.observations import Block

ROUNDS = 6
"""Rounds, in each of which a track loses its worst ray; chosen [C]: a track with more wrong rays than that holds no
point."""
LIMIT = 4.0
"""Residuals, in robust standard deviations, beyond which a ray belongs to another point."""
SMALLEST_LIMIT = 1.0
"""The same at least, in a-priori standard deviations of a coordinate."""


def rays_that_meet(block: Block, centre: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """(m,) bool, the rays that meet the others of their point; of a point that does not fit the worst goes first.

    Parameters
    ----------
    centre : (n, 3) m; rotation : (n, 3, 3); NaN for photographs that are not oriented, whose rays are left out.
    """
    rays = block.image_points
    pixel = np.array([camera.pixel_mm for camera in block.cameras])[block.images.camera[rays.image]]
    sigma = rays.sigma.mean(axis=1) / pixel
    good = np.isfinite(centre[rays.image, 0])
    for _ in range(ROUNDS):
        rows = np.flatnonzero(good)
        left = replace(rays, image=rays.image[rows], point=rays.point[rows], xy=rays.xy[rows], sigma=rays.sigma[rows])
        relative = reproject(replace(block, image_points=left), centre, rotation).residual_px / sigma[rows]
        known = np.isfinite(relative)
        limit = LIMIT * SIGMA_PER_MAD * float(np.median(relative[known])) if known.any() else 0.0
        size = np.where(np.isnan(relative), np.inf, relative)
        worst = np.zeros(len(block.points))
        np.maximum.at(worst, left.point, size)
        bad = (size > max(limit, SMALLEST_LIMIT)) & (size >= worst[left.point])
        if not bad.any():
            break
        good[rows[bad]] = False
    return good
