"""The collinearity equations of one ray with their partials: scalar kernels without checks or objects.

Columns of every table of interior elements: c, x0, y0; Brown's K1, K2, K3, P1, P2, b1, b2; the forward lens' k1, k2,
p1, p2, k3, k4, q1, q2, q3, sx, sy, b1, b2 (see `additional_parameters.lens`); 1 for a fisheye, else 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel, leaf_kernel

INTERIOR = 24
"""Columns of a table of interior elements."""
USUAL = 15
"""The first of them, which most cameras need alone."""


class RayPartials(NamedTuple):
    """Image coordinates and their partials, out, of a ray; with m before every shape, of m rays.

    Parameters
    ----------
    prediction : (2,) mm.
    by_orientation : (2, 6) by (X0, Y0, Z0) and by the small rotation δ about the object axes.
    by_point : (2, 3) by (X, Y, Z).
    by_interior : (2, 24) by the columns of `interior`.
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
def equidistant(u1, u2, u3):
    """Scale s = θ/r that makes s·(u1, u2) the position in a fisheye for c = 1, and t = (−u3/R² − s)/r².

    r² = u1² + u2², R² = r² + u3², θ = atan2(r, −u3). The partials of s·u1 by u are s + u1²·t, u1·u2·t and u1/R².
    """
    r2 = u1 * u1 + u2 * u2
    z = -u3
    if z > 0.0 and r2 < 1e-4 * z * z:
        q = r2 / (z * z)
        s = (1.0 - q * (1.0 / 3.0 - q * (0.2 - q / 7.0))) / z
        return s, -(2.0 / 3.0 - q * (0.8 - q * (6.0 / 7.0))) / (z * z * z)
    r = np.sqrt(r2)
    s = np.arctan2(r, z) / r
    return s, (z / (r2 + z * z) - s) / r2


@leaf_kernel
def predict_ray(rotation, centre, point, interior, x, y, prediction):
    """Ideal image coordinates plus the lens errors of `interior`.

    Parameters
    ----------
    rotation : (3, 3) camera → object; centre, point : (3,) m.
    interior : (24,) mm and the units of the families.
    x, y : the measured position, mm, where Brown's terms are evaluated.
    prediction : (2,) out, mm.
    """
    dx, dy, dz = point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]
    u1 = rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz
    u2 = rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz
    u3 = rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz
    scale = -1.0 / u3
    if interior[23] != 0.0:
        scale, _ = equidistant(u1, u2, u3)
    a, b = u1 * scale, u2 * scale
    rho2 = a * a + b * b
    k1, k2, p1, p2, k3, k4 = interior[10], interior[11], interior[12], interior[13], interior[14], interior[15]
    below = 1.0 + rho2 * (interior[16] + rho2 * (interior[17] + rho2 * interior[18]))
    radial = (1.0 + rho2 * (k1 + rho2 * (k2 + rho2 * (k3 + rho2 * k4)))) / below
    a_lens = a * radial + 2.0 * p1 * a * b + p2 * (rho2 + 2.0 * a * a) + interior[19] * rho2
    b_lens = b * radial + p1 * (rho2 + 2.0 * b * b) + 2.0 * p2 * a * b + interior[20] * rho2
    a_lens += interior[21] * a_lens + interior[22] * b_lens
    xb, yb = x - interior[1], y - interior[2]
    r2 = xb * xb + yb * yb
    rho = r2 * (interior[3] + r2 * (interior[4] + r2 * interior[5]))
    big_p1, big_p2, b1, b2 = interior[6], interior[7], interior[8], interior[9]
    correction_x = xb * rho + big_p1 * (r2 + 2.0 * xb * xb) + 2.0 * big_p2 * xb * yb + b1 * xb + b2 * yb
    correction_y = yb * rho + big_p2 * (r2 + 2.0 * yb * yb) + 2.0 * big_p1 * xb * yb
    prediction[0] = interior[0] * a_lens + interior[1] - correction_x
    prediction[1] = interior[0] * b_lens + interior[2] - correction_y


@leaf_kernel
def linearise_ray(rotation, centre, point, interior, x, y, prediction, by_orientation, by_point, by_interior, used):
    """As `predict_ray`, with the partials; they share their intermediates.

    used : USUAL where the further elements are 0 and no partial by them is asked for, 0 where none by any interior
        element is, else INTERIOR.

    The outputs are those of `RayPartials`, one by one: a record made for every ray costs a tenth of the linearisation.
    """
    dx, dy, dz = point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]
    u1 = rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz
    u2 = rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz
    u3 = rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz
    c = interior[0]
    scale, bend, along = -1.0 / u3, 0.0, 0.0
    if interior[23] != 0.0:
        scale, bend = equidistant(u1, u2, u3)
        along = 1.0 / (u1 * u1 + u2 * u2 + u3 * u3)
    else:
        along = scale * scale
    a, b = u1 * scale, u2 * scale
    rho2 = a * a + b * b
    k1, k2, p1, p2, k3 = interior[10], interior[11], interior[12], interior[13], interior[14]
    radial = 1.0 + rho2 * (k1 + rho2 * (k2 + rho2 * k3))
    slope = 2.0 * (k1 + rho2 * (2.0 * k2 + 3.0 * rho2 * k3))
    below, sx, sy, stretch, shear = 1.0, 0.0, 0.0, 1.0, 0.0
    if used > USUAL:
        q1, q2, q3 = interior[16], interior[17], interior[18]
        sx, sy, stretch, shear = interior[19], interior[20], 1.0 + interior[21], interior[22]
        below = 1.0 / (1.0 + rho2 * (q1 + rho2 * (q2 + rho2 * q3)))
        radial = (radial + rho2**4 * interior[15]) * below
        slope = slope + 8.0 * rho2**3 * interior[15]
        slope = (slope - 2.0 * radial * (q1 + rho2 * (2.0 * q2 + 3.0 * rho2 * q3))) * below
    a_lens = a * radial + 2.0 * p1 * a * b + p2 * (rho2 + 2.0 * a * a)
    b_lens = b * radial + p1 * (rho2 + 2.0 * b * b) + 2.0 * p2 * a * b
    cross = a * b * slope + 2.0 * (p1 * a + p2 * b)
    lens_aa = c * (radial + a * a * slope + 2.0 * p1 * b + 6.0 * p2 * a)
    lens_bb = c * (radial + b * b * slope + 6.0 * p1 * b + 2.0 * p2 * a)
    lens_ab = lens_ba = c * cross
    a_bent = a_lens
    if used > USUAL:
        a_bent, b_lens = a_lens + sx * rho2, b_lens + sy * rho2
        a_lens = stretch * a_bent + shear * b_lens
        lens_ba, lens_bb = lens_ba + 2.0 * c * sy * a, lens_bb + 2.0 * c * sy * b
        lens_aa = stretch * (lens_aa + 2.0 * c * sx * a) + shear * lens_ba
        lens_ab = stretch * (lens_ab + 2.0 * c * sx * b) + shear * lens_bb

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

    # ∂(a, b)/∂u, perspective: [[s, 0, u1·s²], [0, s, u2·s²]] with s = −1/u3; and u = Rᵀ·(X − X0)
    for axis in range(3):
        turned = bend * (u1 * rotation[axis, 0] + u2 * rotation[axis, 1]) + along * rotation[axis, 2]
        by_a = scale * rotation[axis, 0] + u1 * turned
        by_b = scale * rotation[axis, 1] + u2 * turned
        by_point[0, axis] = lens_aa * by_a + lens_ab * by_b
        by_point[1, axis] = lens_ba * by_a + lens_bb * by_b
    for row in range(2):
        g0, g1, g2 = by_point[row, 0], by_point[row, 1], by_point[row, 2]
        by_orientation[row, 0], by_orientation[row, 1], by_orientation[row, 2] = -g0, -g1, -g2
        t0, t1, t2 = g1 * dz - g2 * dy, g2 * dx - g0 * dz, g0 * dy - g1 * dx
        by_orientation[row, 3], by_orientation[row, 4], by_orientation[row, 5] = t0, t1, t2

    if used == 0:
        return
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
    power = c * rho2 * below
    by_interior[0, 10], by_interior[1, 10] = a * power, b * power
    power *= rho2
    by_interior[0, 11], by_interior[1, 11] = a * power, b * power
    by_interior[0, 12], by_interior[1, 12] = 2.0 * c * a * b, c * (rho2 + 2.0 * b * b)
    by_interior[0, 13], by_interior[1, 13] = c * (rho2 + 2.0 * a * a), 2.0 * c * a * b
    power *= rho2
    by_interior[0, 14], by_interior[1, 14] = a * power, b * power
    if used == USUAL:
        return
    by_interior[0, 15], by_interior[1, 15] = a * power * rho2, b * power * rho2
    by_interior[0, 19], by_interior[1, 19] = c * rho2, 0.0
    by_interior[0, 20], by_interior[1, 20] = 0.0, c * rho2
    for t in range(10, 21):
        by_interior[0, t] = stretch * by_interior[0, t] + shear * by_interior[1, t]
    for t, of in ((16, 10), (17, 11), (18, 14)):
        by_interior[0, t], by_interior[1, t] = -radial * by_interior[0, of], -radial * by_interior[1, of]
    by_interior[0, 21], by_interior[1, 21] = c * a_bent, 0.0
    by_interior[0, 22], by_interior[1, 22] = c * b_lens, 0.0
    by_interior[0, 23], by_interior[1, 23] = 0.0, 0.0


@kernel
def predict_rays(rotation, centre, points, interior, rays, prediction):
    """`predict_ray` over m rays.

    Parameters
    ----------
    rotation : (n, 3, 3); centre : (n, 3); points : (p, 3); interior : (l, 24).
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
            by_orientation[k], by_point[k], by_interior[k], INTERIOR,
        )  # fmt: skip
