"""The displacement of a window against a template by least squares."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel
from aerotri.terrain._plan_kernels import UNKNOWNS
from aerotri.terrain._sampling_kernels import sample_cubic
from aerotri.terrain._view_kernels import window_corners

SHIFT_STEPS = 12
"""Steps of least squares until a window is given up; chosen [C]: good windows need a few, and those that never settle
cost time."""
FIRST_NOISE = 0.05
"""Share of the variance of the grey values that is taken for noise before it is known."""
CONVERGED_POSTS = 0.005
"""Change of the displacement, in posts, at which the steps end; chosen [C]: far below any σ of matching; a smaller one
only adds steps."""
LONGEST_SHIFT_POSTS = 3.0
"""Displacement, in posts, beyond which the window is given up; chosen [C]: the search before it is finer than a post,
and farther away lies other texture."""
MOST_EXCESS = 10.0
"""`excess_of_slopes` from which a window is refused; chosen [C]: a σ ten times that of least squares says that the
windows have nothing but noise in common."""


@kernel
def invert(a, n):
    """Inverse of a symmetric positive matrix in place; False where it is singular."""
    for p in range(n):
        pivot = a[p, p]
        if not pivot > 1e-12:
            return False
        a[p, p] = 1.0
        for c in range(n):
            a[p, c] /= pivot
        for r in range(n):
            if r != p:
                factor = a[r, p]
                a[r, p] = 0.0
                for c in range(n):
                    a[r, c] -= factor * a[p, c]
    return True


@kernel
def template_columns(template, q, p, n, e, slope, column):
    """Partials of grey values by a0 … a5 and b0 of `match_shift`, then 1 and f, at a post of the template."""
    half = 0.5 * (n - 1)
    u, v = (p - half) / half, (q - half) / half
    fu = slope * (template[q + 1, p + 2] - template[q + 1, p])
    fv = slope * (template[q + 2, p + 1] - template[q, p + 1])
    fe = e[0] * fu + e[1] * fv
    column[0], column[1], column[2] = fe, u * fe, v * fe
    column[3], column[4], column[5] = u * u * fe, u * v * fe, v * v * fe
    column[6], column[7], column[8] = e[0] * fv - e[1] * fu, 1.0, template[q + 1, p + 1]


@kernel
def template_normals(template, n, e, window, normal):
    """Normal matrix of the columns of a template."""
    slope, column = 0.5 / window, np.empty(UNKNOWNS)
    normal[:] = 0.0
    for q in range(n):
        for p in range(n):
            template_columns(template, q, p, n, e, slope, column)
            for a in range(UNKNOWNS):
                for b in range(a + 1):
                    normal[a, b] += column[a] * column[b]
    for a in range(UNKNOWNS):
        for b in range(a):
            normal[b, a] = normal[a, b]


@kernel
def excess_of_slopes(template, other, e, gain):
    """By how much noise makes the slopes of a template along e larger than what the two windows have in common.

    [D] A shift D makes Σf·g(D) vanish, f the slopes of the template and g the other window, whose slopes are g': the
    variance of D is σ²·Σf²/(Σf·g')². Least squares takes σ²/(r1²·Σf²), with the noise of the template for information:
    its σ is too small by r1·Σf²/Σf·g', which is 1 for windows without noise.

    Returns
    -------
    ∞ where the slopes have nothing in common.
    """
    own, both = 0.0, 0.0
    n = other.shape[0]
    for q in range(1, n - 1):
        for p in range(1, n - 1):
            fu, fv = template[q + 1, p + 2] - template[q + 1, p], template[q + 2, p + 1] - template[q, p + 1]
            f = e[0] * fu + e[1] * fv
            own += f * f
            both += f * (e[0] * (other[q, p + 1] - other[q, p - 1]) + e[1] * (other[q + 1, p] - other[q - 1, p]))
    return max(gain * own / both, 1.0) if both > 0.0 else np.inf


@kernel
def match_shift(view, k, spot, window, bending, room):
    """Displacement of photograph k's window against the template by least squares, in plan.

    g(u + D(u)) = r0 + r1·f(u), D = (a0 + a1·u + a2·v + a3·u² + a4·uv + a5·v²)·e + b0·e⊥, e the direction of parallax:
    what changes along u and v is slope and curvature of the ground, b0 the y-parallax. a3, a4, a5 are zero within
    their σ [D]: flat ground is matched as if it were plane, rough ground pays in σ for what is not known of it.

    Parameters
    ----------
    bending : m, σ of a3 and a5; that of a4 is 2/√3 of it, as on ground that is rough alike in all directions.
    room : a `ShiftRoom`; its template are the grey values of the reference, scaled to a deviation of 1, and normal is
        that of the template. found : (5,) out, a0, b0 m, their variances m², correlation.

    Returns
    -------
    Whether it converged.
    """
    template, other, normal, e, found = room.template, room.other, room.normal, room.e, room.found
    corner, shift, weights, right, bend, cofactor = (
        room.corner, room.shift, room.weights, room.right, room.bend, room.cofactor
    )  # fmt: skip
    n = other.shape[0]
    reach, slope = 0.5 * (n - 1) * window, 0.5 / window
    x = np.zeros(UNKNOWNS)
    coefficient, column = np.empty(UNKNOWNS), np.empty(UNKNOWNS)
    shift[:] = 0.0
    if not window_corners(view, k, spot, reach, shift, corner):
        return False
    here_c, here_r = corner[0, 0], corner[0, 1]
    shift[0], shift[1] = e[0] * window, e[1] * window
    if not window_corners(view, k, spot, reach, shift, corner):
        return False
    bend[0], bend[1] = (corner[0, 0] - here_c) / window, (corner[0, 1] - here_r) / window
    noise, gain, squares, mean = 0.0, 0.0, 0.0, 0.0
    for step in range(SHIFT_STEPS):
        shift[0], shift[1] = x[0] * e[0] - x[6] * e[1], x[0] * e[1] + x[6] * e[0]
        shift[2], shift[3], shift[4], shift[5] = x[1] * e[0], x[1] * e[1], x[2] * e[0], x[2] * e[1]
        if not window_corners(view, k, spot, reach, shift, corner):
            return False
        bend[2], bend[3], bend[4] = x[3], x[4], x[5]
        sample_cubic(view, k, corner, bend, other, weights)
        right[:] = 0.0
        squares = 0.0
        for q in range(n):
            for p in range(n):
                template_columns(template, q, p, n, e, slope, column)
                g = other[q, p]
                for a in range(UNKNOWNS):
                    right[a] += column[a] * g
                squares += g * g
        mean = right[7] / (n * n)
        if step == 0:
            spread = squares / (n * n) - mean * mean
            if not spread > 0.0:
                return False
            noise, gain = FIRST_NOISE * spread, np.sqrt(spread)
        for a in range(UNKNOWNS):
            for b in range(UNKNOWNS):
                cofactor[a, b] = normal[a, b]
        for a in range(3, 6):
            sigma = bending * (1.1547 if a == 4 else 1.0) + 1e-6 * window
            weight = noise / (gain * gain * sigma * sigma)
            cofactor[a, a] += weight
            right[a] += weight * gain * x[a]
        if not invert(cofactor, UNKNOWNS):
            return False
        explained = 0.0
        for a in range(UNKNOWNS):
            coefficient[a] = 0.0
            for b in range(UNKNOWNS):
                coefficient[a] += cofactor[a, b] * right[b]
            explained += coefficient[a] * right[a]
        gain = coefficient[8]
        if not gain > 0.0:
            return False
        noise = max(squares - explained, 1e-9 * squares) / (n * n - UNKNOWNS)
        for a in range(7):
            x[a] -= coefficient[a] / gain
        if not np.hypot(x[0], x[6]) < LONGEST_SHIFT_POSTS * window:
            return False
        if abs(coefficient[0]) + abs(coefficient[6]) < CONVERGED_POSTS * window * gain:
            break
        if step == SHIFT_STEPS - 1:
            return False
    found[0], found[1] = x[0], x[6]
    excess = excess_of_slopes(template, other, e, gain)
    if not excess < MOST_EXCESS:
        return False
    scale = noise * excess * excess / (gain * gain)
    found[2], found[3] = scale * cofactor[0, 0], scale * cofactor[6, 6]
    # correlation of the windows where they now lie, without what a further step would gain
    spread = squares - n * n * mean * mean
    template_mean, template_square = normal[7, 8] / (n * n), normal[8, 8]
    covariance = right[8] - n * n * mean * template_mean
    template_spread = template_square - n * n * template_mean**2
    found[4] = covariance / np.sqrt(spread * template_spread) if spread > 0.0 and template_spread > 0.0 else 0.0
    return True


@kernel
def turned_shift(found, e, out):
    """A displacement along and across e, with their variances, as x and y.

    What texture makes common to both is left out: y-parallaxes are those of the orientation and of the image errors
    rather than of matching, and must not pull the parallax along with them.
    """
    a, b, va, vb = found[0], found[1], found[2], found[3]
    out[0], out[1] = a * e[0] - b * e[1], a * e[1] + b * e[0]
    out[2] = e[0] * e[0] * va + e[1] * e[1] * vb
    out[3] = e[1] * e[1] * va + e[0] * e[0] * vb
    out[4] = e[0] * e[1] * (va - vb)
    out[5] = found[4]
