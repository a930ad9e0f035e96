"""σ of a measured image coordinate after the adjustment, of every camera."""

from __future__ import annotations

import numpy as np

from aerotri.results.adjustment import Adjustment


def image_sigma_of_cameras(calibration: Adjustment) -> np.ndarray:
    """(c,) mm, σ̂0 times the median σ of the image coordinates of a camera; of all cameras where one has none.

    Cameras with pixels of different sizes have different σ in mm where they have the same in pixels.
    """
    block = calibration.local.block
    rays, count = block.image_points, len(block.cameras)
    if not len(rays):
        return np.zeros(count)
    camera = block.images.camera[rays.image]
    own = [rays.sigma[camera == k] for k in range(count)]
    sigma = np.array([float(np.median(part if len(part) else rays.sigma)) for part in own])
    return calibration.local.outcome.sigma0 * sigma
