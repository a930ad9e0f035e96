"""Model deformation once more, by other means: nothing of the package's geometry or image errors is used here.

Three parameters of BLUH and four of the upper left tile of the UltraCamD are written out; intersection is a general
least-squares solver's business.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

SPEC = "bluh:1+2+9,ultracam_d:42+50+58+66"
C, HALF, PIXEL = 101.4, np.array([51.75, 33.75]), 0.009
S = 115.0 * np.sqrt(2.0) / np.hypot(*HALF)
SEAM_X, SEAM_Y = (3877 - 5750) * PIXEL, (3750 - 2543) * PIXEL
"""Right and lower border of the upper left tile."""
CENTRE = np.array([(2004 - 5750) * PIXEL, (3750 - 1336) * PIXEL])


def in_upper_left(xy) -> bool:
    return bool(xy[0] < SEAM_X and xy[1] > SEAM_Y)


def image_error(xy, p: dict[str, float], upper_left: bool) -> np.ndarray:
    """d at a measured position that belongs to the upper left tile, or to another one."""
    u, v = S * np.asarray(xy)
    zero = u * u + v * v - 128.0**2
    d = p["bluh.1"] * np.array([-v, -u]) + p["bluh.2"] * np.array([-u, v]) + p["bluh.9"] * np.array([-u, -v]) * zero
    d = d / S
    if upper_left:
        x, y = np.asarray(xy) - CENTRE
        d = d + p["ultracam_d.42"] * np.array([x, y]) + p["ultracam_d.66"] * np.array([-y, x])
        d = d + np.array([p["ultracam_d.50"], p["ultracam_d.58"]])
    return d


def rotation(omega: float, phi: float, kappa: float) -> np.ndarray:
    """R = Rx·Ry·Rz, camera → object."""
    (so, sp, sk), (co, cp, ck) = np.sin([omega, phi, kappa]), np.cos([omega, phi, kappa])
    x = np.array([[1, 0, 0], [0, co, -so], [0, so, co]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    return x @ y @ np.array([[ck, -sk, 0], [sk, ck, 0], [0, 0, 1]])


def projected(centre, r, point) -> np.ndarray:
    u = r.T @ (np.asarray(point) - centre)
    return -C * u[:2] / u[2]


def measured(ideal, p) -> np.ndarray:
    """m = ideal + d(m) in the tile of the ideal position."""
    upper_left, m = in_upper_left(ideal), ideal
    for _ in range(100):
        m = ideal + image_error(m, p, upper_left)
    return m


def intersected(centres, rotations, xy, start) -> np.ndarray:
    """The point whose images are nearest to xy (2, 2)."""

    def gaps(offset):
        images = [projected(c, r, start + offset) for c, r in zip(centres, rotations, strict=True)]
        return 1e3 * (np.array(images) - xy).ravel()

    found = least_squares(gaps, np.zeros(3), method="lm", x_scale=1.0, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return start + found.x


def deformation(centres, rotations, point, p, used=None) -> np.ndarray:
    """(dX, dY, dZ) at a true point; `used` (centres, rotations) where they differ from the true ones."""
    point = np.asarray(point)
    images = np.array([measured(projected(c, r, point), p) for c, r in zip(centres, rotations, strict=True)])
    return intersected(*(used or (centres, rotations)), images, point) - point
