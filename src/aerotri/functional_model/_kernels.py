"""The collinearity equations of one ray with their partials: scalar kernels without checks or objects.

Columns of every table of interior elements: c, x0, y0, K1, K2, K3, P1, P2, b1, b2, k1, k2, p1, p2, k3.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel, leaf_kernel


class RayPartials(NamedTuple):
    """Image coordinates and their partials, out, of a ray; with m before every shape, of m rays.

    Parameters
    ----------
    prediction : (2,) mm.
    by_orientation : (2, 6) by (X0, Y0, Z0) and by the small rotation δ about the object axes.
    by_point : (2, 3) by (X, Y, Z).
    by_interior : (2, 15) by the columns of `interior`.
    """

    prediction: np.ndarray
    by_orientation: np.ndarray
    by_point: np.ndarray
    by_interior: np.ndarray


class RayList(NamedTuple):
    """m rays: photograph, point and set of interior elements (m,), and the measured position xy (m, 2) mm."""

    image: np.ndarray
    point: np.ndarray
    lens_row: np.ndarray
    xy: np.ndarray


@leaf_kernel
def predict_ray(rotation, centre, point, interior, x, y, prediction):
    """Ideal image coordinates plus the lens errors of `interior`.

    Parameters
    ----------
    rotation : (3, 3) camera → object; centre, point : (3,) m.
    interior : (15,) mm and the units of the families.
    x, y : the measured position, mm, where Brown's terms are evaluated.
    prediction : (2,) out, mm.
    """
    dx, dy, dz = point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]
    u1 = rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz
    u2 = rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz
    u3 = rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz
    a, b = -u1 / u3, -u2 / u3
    rho2 = a * a + b * b
    k1, k2, p1, p2, k3 = interior[10], interior[11], interior[12], interior[13], interior[14]
    radial = 1.0 + rho2 * (k1 + rho2 * (k2 + rho2 * k3))
    a_lens = a * radial + 2.0 * p1 * a * b + p2 * (rho2 + 2.0 * a * a)
    b_lens = b * radial + p1 * (rho2 + 2.0 * b * b) + 2.0 * p2 * a * b
    xb, yb = x - interior[1], y - interior[2]
    r2 = xb * xb + yb * yb
    rho = r2 * (interior[3] + r2 * (interior[4] + r2 * interior[5]))
    big_p1, big_p2, b1, b2 = interior[6], interior[7], interior[8], interior[9]
    correction_x = xb * rho + big_p1 * (r2 + 2.0 * xb * xb) + 2.0 * big_p2 * xb * yb + b1 * xb + b2 * yb
    correction_y = yb * rho + big_p2 * (r2 + 2.0 * yb * yb) + 2.0 * big_p1 * xb * yb
    prediction[0] = interior[0] * a_lens + interior[1] - correction_x
    prediction[1] = interior[0] * b_lens + interior[2] - correction_y


@leaf_kernel
def linearise_ray(rotation, centre, point, interior, x, y, prediction, by_orientation, by_point, by_interior):
    """As `predict_ray`, with the partials; they share their intermediates.

    The outputs are those of `RayPartials`, one by one: a record made for every ray costs a tenth of the linearisation.
    """
    dx, dy, dz = point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]
    u1 = rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz
    u2 = rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz
    u3 = rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz
    inverse = -1.0 / u3
    a, b = u1 * inverse, u2 * inverse
    rho2 = a * a + b * b
    c = interior[0]
    k1, k2, p1, p2, k3 = interior[10], interior[11], interior[12], interior[13], interior[14]
    radial = 1.0 + rho2 * (k1 + rho2 * (k2 + rho2 * k3))
    slope = 2.0 * (k1 + rho2 * (2.0 * k2 + 3.0 * rho2 * k3))
    a_lens = a * radial + 2.0 * p1 * a * b + p2 * (rho2 + 2.0 * a * a)
    b_lens = b * radial + p1 * (rho2 + 2.0 * b * b) + 2.0 * p2 * a * b
    cross = a * b * slope + 2.0 * (p1 * a + p2 * b)
    lens_aa = c * (radial + a * a * slope + 2.0 * p1 * b + 6.0 * p2 * a)
    lens_bb = c * (radial + b * b * slope + 6.0 * p1 * b + 2.0 * p2 * a)
    lens_ab = c * cross

    xb, yb = x - interior[1], y - interior[2]
    r2 = xb * xb + yb * yb
    big_k1, big_k2, big_k3 = interior[3], interior[4], interior[5]
    big_p1, big_p2, b1, b2 = interior[6], interior[7], interior[8], interior[9]
    rho = r2 * (big_k1 + r2 * (big_k2 + r2 * big_k3))
    rho_slope = 2.0 * (big_k1 + r2 * (2.0 * big_k2 + 3.0 * r2 * big_k3))
    correction_x = xb * rho + big_p1 * (r2 + 2.0 * xb * xb) + 2.0 * big_p2 * xb * yb + b1 * xb + b2 * yb
    correction_y = yb * rho + big_p2 * (r2 + 2.0 * yb * yb) + 2.0 * big_p1 * xb * yb
    prediction[0] = c * a_lens + interior[1] - correction_x
    prediction[1] = c * b_lens + interior[2] - correction_y

    # ∂(a, b)/∂u = −1/u3·[[1, 0, a], [0, 1, b]], and u = Rᵀ·(X − X0)
    for axis in range(3):
        by_a = inverse * (rotation[axis, 0] + a * rotation[axis, 2])
        by_b = inverse * (rotation[axis, 1] + b * rotation[axis, 2])
        by_point[0, axis] = lens_aa * by_a + lens_ab * by_b
        by_point[1, axis] = lens_ab * by_a + lens_bb * by_b
    for row in range(2):
        g0, g1, g2 = by_point[row, 0], by_point[row, 1], by_point[row, 2]
        by_orientation[row, 0] = -g0
        by_orientation[row, 1] = -g1
        by_orientation[row, 2] = -g2
        by_orientation[row, 3] = g1 * dz - g2 * dy
        by_orientation[row, 4] = g2 * dx - g0 * dz
        by_orientation[row, 5] = g0 * dy - g1 * dx

    mixed = xb * yb * rho_slope + 2.0 * (big_p1 * yb + big_p2 * xb)
    by_interior[0, 0], by_interior[1, 0] = a_lens, b_lens
    by_interior[0, 1] = 1.0 + rho + xb * xb * rho_slope + 6.0 * big_p1 * xb + 2.0 * big_p2 * yb + b1
    by_interior[1, 1] = mixed
    by_interior[0, 2] = mixed + b2
    by_interior[1, 2] = 1.0 + rho + yb * yb * rho_slope + 6.0 * big_p2 * yb + 2.0 * big_p1 * xb
    power = 1.0
    for i in range(3):
        power *= r2
        by_interior[0, 3 + i], by_interior[1, 3 + i] = -xb * power, -yb * power
    by_interior[0, 6], by_interior[1, 6] = -(r2 + 2.0 * xb * xb), -2.0 * xb * yb
    by_interior[0, 7], by_interior[1, 7] = -2.0 * xb * yb, -(r2 + 2.0 * yb * yb)
    by_interior[0, 8], by_interior[1, 8] = -xb, 0.0
    by_interior[0, 9], by_interior[1, 9] = -yb, 0.0
    by_interior[0, 10], by_interior[1, 10] = c * a * rho2, c * b * rho2
    by_interior[0, 11], by_interior[1, 11] = c * a * rho2 * rho2, c * b * rho2 * rho2
    by_interior[0, 12], by_interior[1, 12] = 2.0 * c * a * b, c * (rho2 + 2.0 * b * b)
    by_interior[0, 13], by_interior[1, 13] = c * (rho2 + 2.0 * a * a), 2.0 * c * a * b
    by_interior[0, 14], by_interior[1, 14] = c * a * rho2**3, c * b * rho2**3


@kernel
def predict_rays(rotation, centre, points, interior, rays, prediction):
    """`predict_ray` over m rays.

    Parameters
    ----------
    rotation : (n, 3, 3); centre : (n, 3); points : (p, 3); interior : (l, 15).
    rays : `RayList`. prediction : (m, 2) out.
    """
    image, point, lens_row, xy = rays.image, rays.point, rays.lens_row, rays.xy
    for k in range(len(image)):
        i = image[k]
        predict_ray(rotation[i], centre[i], points[point[k]], interior[lens_row[k]], xy[k, 0], xy[k, 1], prediction[k])


@kernel
def linearise_rays(rotation, centre, points, interior, rays, partials):
    """`linearise_ray` over m rays. rays : `RayList`. partials : `RayPartials`, out, m before every shape."""
    image, point, lens_row, xy = rays.image, rays.point, rays.lens_row, rays.xy
    prediction, by_orientation = partials.prediction, partials.by_orientation
    by_point, by_interior = partials.by_point, partials.by_interior
    for k in range(len(image)):
        i = image[k]
        linearise_ray(
            rotation[i], centre[i], points[point[k]], interior[lens_row[k]], xy[k, 0], xy[k, 1], prediction[k],
            by_orientation[k], by_point[k], by_interior[k],
        )  # fmt: skip
