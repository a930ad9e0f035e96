"""σ of a measured image coordinate after the adjustment, of every camera."""

from __future__ import annotations

import numpy as np

from aerotri.results.adjustment import Adjustment
from aerotri.statistics.camera_field import noise_beside_field


def image_sigma_of_cameras(calibration: Adjustment) -> np.ndarray:
    """(c,) mm, the median σ of image coordinates of each camera after the adjustment; of all where one has none.

    σ̂0 times what was stated; beside a random field of the camera the noise in place of σ̂0.

    Cameras with pixels of different sizes have different σ in mm where they have the same in pixels.
    """
    return noise_beside_field(calibration) * _stated(calibration)


def weight_of_cameras(calibration: Adjustment) -> np.ndarray:
    """(c,) weight of an image coordinate of each camera over that of the most accurate one; 1 where all are alike."""
    sigma = _stated(calibration)
    least = sigma.min(initial=np.inf)
    return np.ones(len(sigma)) if not least > 0.0 else (least / sigma) ** 2


def _stated(calibration: Adjustment) -> np.ndarray:
    """(c,) mm, the median σ that was stated."""
    block = calibration.local.block
    rays, count = block.image_points, len(block.cameras)
    if not len(rays):
        return np.zeros(count)
    camera = block.images.camera[rays.image]
    own = [rays.sigma[camera == k] for k in range(count)]
    return np.array([float(np.median(part if len(part) else rays.sigma)) for part in own])
