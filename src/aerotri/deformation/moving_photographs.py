"""Photographs of rolling shutters as `imgeo` takes them: their motion, the ground below, what its relief leaves."""

from __future__ import annotations

import numpy as np

from aerotri.conventions import SIGMA_PER_MAD
from aerotri.deformation.orientation import Orientation
from aerotri.image_errors.error_function import ErrorFunction
from aerotri.image_errors.moving_errors import MovingErrors
from aerotri.results.adjustment import Adjustment

FEWEST = 6
"""Points from which a plane is fitted [C]; fewer say the distance of the ground alone."""
FAR_M = 1e6
"""Distance of the ground of a photograph without points: only its rotation shows."""
OUTLYING = 4.0
"""Robust σ beyond which a point is no ground [C]."""


def moving_errors(
    calibration: Adjustment, orientation: Orientation, row: int, function: ErrorFunction
) -> MovingErrors | None:
    """The image errors of a photograph of the block; None where its rows were exposed at once.

    Parameters
    ----------
    orientation : of all photographs of the block. function : the image errors of its group.
    """
    s = orientation.scans
    if s is None or not s.rate[row].any() or not orientation.known[row]:
        return None
    return MovingErrors(
        function, s.rate[row], float(s.readout[row]), s.velocity[row], s.spin[row],
        ground_plane(_points_seen(calibration, orientation, row)),
    )  # fmt: skip


def relief_left(calibration: Adjustment, orientation: Orientation, row: int, errors: MovingErrors) -> float:
    """RMS in pixels over the points of a photograph of what the relief over its plane leaves; NaN without points."""
    u = _points_seen(calibration, orientation, row)
    if not len(u):
        return float("nan")
    left = errors.measured_of(u) - errors.measured(errors.ideal_of(u))
    return float(np.sqrt(np.mean(np.sum(left**2, axis=1)))) / errors.camera.pixel_mm


def ground_plane(u: np.ndarray) -> np.ndarray:
    """(3,) 1/m, plane·u = 1, through places (n, 3) m in the camera frame, outlying ones left out.

    The distance along rays is what errs, so that its inverse is fitted: −1/u3 = plane·(u/−u3) is linear.
    """
    if not len(u):
        return np.array([0.0, 0.0, -1.0 / FAR_M])
    design, right = u / -u[:, 2:], -1.0 / u[:, 2]
    used = np.ones(len(u), dtype=bool)
    if len(u) < FEWEST or np.linalg.cond(design) > 1e4:
        return np.array([0.0, 0.0, -float(np.median(right))])
    plane = np.zeros(3)
    for _ in range(3):
        plane = np.linalg.lstsq(design[used], right[used], rcond=None)[0]
        away = np.abs(right - design @ plane)
        used = away <= OUTLYING * SIGMA_PER_MAD * max(float(np.median(away)), 1e-12)
    return plane


def _points_seen(calibration: Adjustment, orientation: Orientation, row: int) -> np.ndarray:
    """(n, 3) m, adjusted points that a photograph shows, in its frame in the middle of the readout."""
    adjusted = calibration.local
    rays = adjusted.block.image_points
    xyz = adjusted.points.xyz[np.unique(rays.point[rays.image == row])]
    u = (xyz[np.isfinite(xyz).all(axis=1)] - orientation.centre[row]) @ orientation.rotation[row]
    return u[u[:, 2] < 0.0]
