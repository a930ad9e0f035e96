"""The ray of a rolling shutter: where the camera is when its row is exposed, and the partials by the motion.

u = Eᵀ·(Rᵀ·(X − X0) − v·τ), E = exp([ω]×·τ), with the velocity v and the rates ω in the camera frame.
"""

from __future__ import annotations

import numpy as np

from aerotri.compiled import leaf_kernel


@leaf_kernel
def place_in_scan(tau, rotation, centre, velocity, spin, moved, turned):
    """Projection centre X0 + R·v·τ and rotation R·E, out, τ s after the middle of the readout.

    Parameters
    ----------
    rotation : (3, 3); centre : (3,) m. velocity : (3,) m/s. spin : (3,) rad/s. moved : (3,), turned : (3, 3) out.
    """
    t0, t1, t2 = spin[0] * tau, spin[1] * tau, spin[2] * tau
    square = t0 * t0 + t1 * t1 + t2 * t2
    # sin θ/θ and (1 − cos θ)/θ²
    sine, cosine = 1.0 - square / 6.0, 0.5 - square / 24.0
    if square > 1e-6:
        angle = np.sqrt(square)
        sine, cosine = np.sin(angle) / angle, (1.0 - np.cos(angle)) / square
    e00, e01, e02 = 1.0 - cosine * (t1 * t1 + t2 * t2), cosine * t0 * t1 - sine * t2, cosine * t0 * t2 + sine * t1
    e10, e11, e12 = cosine * t0 * t1 + sine * t2, 1.0 - cosine * (t0 * t0 + t2 * t2), cosine * t1 * t2 - sine * t0
    e20, e21, e22 = cosine * t0 * t2 - sine * t1, cosine * t1 * t2 + sine * t0, 1.0 - cosine * (t0 * t0 + t1 * t1)
    for a in range(3):
        r0, r1, r2 = rotation[a, 0], rotation[a, 1], rotation[a, 2]
        moved[a] = centre[a] + (r0 * velocity[0] + r1 * velocity[1] + r2 * velocity[2]) * tau
        turned[a, 0] = r0 * e00 + r1 * e10 + r2 * e20
        turned[a, 1] = r0 * e01 + r1 * e11 + r2 * e21
        turned[a, 2] = r0 * e02 + r1 * e12 + r2 * e22


@leaf_kernel
def scan_partials(rate, tau, rotation, velocity, spin, by_eo, columns, out, place, first):
    """Partials of a ray by readout time, velocity and rates, and `by_eo` brought from the moved centre to the middle.

    Parameters
    ----------
    rate : s by which the ray is exposed later per ms of the readout time. tau : s.
    by_eo : (2, 6) of the moved centre and rotation, in and out: δ turns the way of the centre as well.
    columns : (3,) shared parameter of the readout time, first of velocity, first of rates; −1 none.
    out : (2, ·) partials, and place : (·,) their shared parameters, from number `first` on.

    Returns
    -------
    The number after the last.
    """
    n = first
    t0, t1, t2 = spin[0] * tau, spin[1] * tau, spin[2] * tau
    for row in range(2):
        n = first
        c0, c1, c2 = by_eo[row, 0], by_eo[row, 1], by_eo[row, 2]
        d0, d1, d2 = by_eo[row, 3], by_eo[row, 4], by_eo[row, 5]
        # along the axes of the camera
        v0 = c0 * rotation[0, 0] + c1 * rotation[1, 0] + c2 * rotation[2, 0]
        v1 = c0 * rotation[0, 1] + c1 * rotation[1, 1] + c2 * rotation[2, 1]
        v2 = c0 * rotation[0, 2] + c1 * rotation[1, 2] + c2 * rotation[2, 2]
        w0 = d0 * rotation[0, 0] + d1 * rotation[1, 0] + d2 * rotation[2, 0]
        w1 = d0 * rotation[0, 1] + d1 * rotation[1, 1] + d2 * rotation[2, 1]
        w2 = d0 * rotation[0, 2] + d1 * rotation[1, 2] + d2 * rotation[2, 2]
        if columns[0] >= 0:
            place[n] = columns[0]
            along = v0 * velocity[0] + v1 * velocity[1] + v2 * velocity[2]
            out[row, n] = rate * (along + w0 * spin[0] + w1 * spin[1] + w2 * spin[2])
            n += 1
        if columns[1] >= 0:
            place[n], place[n + 1], place[n + 2] = columns[1], columns[1] + 1, columns[1] + 2
            out[row, n], out[row, n + 1], out[row, n + 2] = tau * v0, tau * v1, tau * v2
            n += 3
        if columns[2] >= 0:
            place[n], place[n + 1], place[n + 2] = columns[2], columns[2] + 1, columns[2] + 2
            # w·(I + ½[θ]× + ⅙[θ]×²): a change of the rates turns about axes that have turned themselves
            y0, y1, y2 = w1 * t2 - w2 * t1, w2 * t0 - w0 * t2, w0 * t1 - w1 * t0
            z0, z1, z2 = y1 * t2 - y2 * t1, y2 * t0 - y0 * t2, y0 * t1 - y1 * t0
            out[row, n] = tau * (w0 + 0.5 * y0 + z0 / 6.0)
            out[row, n + 1] = tau * (w1 + 0.5 * y1 + z1 / 6.0)
            out[row, n + 2] = tau * (w2 + 0.5 * y2 + z2 / 6.0)
            n += 3
        a0 = (rotation[0, 0] * velocity[0] + rotation[0, 1] * velocity[1] + rotation[0, 2] * velocity[2]) * tau
        a1 = (rotation[1, 0] * velocity[0] + rotation[1, 1] * velocity[1] + rotation[1, 2] * velocity[2]) * tau
        a2 = (rotation[2, 0] * velocity[0] + rotation[2, 1] * velocity[1] + rotation[2, 2] * velocity[2]) * tau
        by_eo[row, 3] += a1 * c2 - a2 * c1
        by_eo[row, 4] += a2 * c0 - a0 * c2
        by_eo[row, 5] += a0 * c1 - a1 * c0
    return n
