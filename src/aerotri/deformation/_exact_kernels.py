"""The exact deformation at points, wrong − true: P = I(true; m − d(m)), m = π(used, P_w)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel
from aerotri.functional_model._photo_kernels import ErrorTable, delay, image_error, partials, project, project_at

STEPS = 8
"""Steps of an intersection at most [C]: two or three reach LAST_STEP_M; the others are for rays that hardly meet."""
LAST_STEP_M = 5e-3
"""A step of the intersection after which the next one is below 0.01 mm: steps shrink a thousandfold."""


class Models(NamedTuple):
    """M stereo models.

    photos : (M, 4, 23) used left, used right, true left, true right, as in `_photo_kernels`; a true one may have a
        rolling shutter.
    source : (M, 2) image errors of left and right. errors : of all groups of photographs.
    """

    photos: np.ndarray
    source: np.ndarray
    errors: ErrorTable


@kernel
def deformation(models, m, x, y, z):
    """(dX, dY, dZ) at a point of the DEM in model m; NaN where not both photographs show it.

    The intersection keeps the partials A of its start, metres away from its end: that slows it down by a thousandth a
    step, and moves its end by that share of what the y-parallax does. a, b are rows of A of the left, c, d of the right
    photograph.
    """
    photos, half = models.photos, models.errors.half
    left, right = models.source[m, 0], models.source[m, 1]
    x1, y1, depth1 = project(photos, m, 0, x, y, z)
    x2, y2, depth2 = project(photos, m, 1, x, y, z)
    on_left = depth1 < 0.0 and abs(x1) <= half[left, 0] and abs(y1) <= half[left, 1]
    on_right = depth2 < 0.0 and abs(x2) <= half[right, 0] and abs(y2) <= half[right, 1]
    if not (on_left and on_right):
        return np.nan, np.nan, np.nan
    tau1, tau2 = delay(photos, m, 2, x1, y1), delay(photos, m, 3, x2, y2)
    dx, dy = image_error(left, x1, y1, models.errors)
    x1, y1 = x1 - dx, y1 - dy
    dx, dy = image_error(right, x2, y2, models.errors)
    x2, y2 = x2 - dx, y2 - dy
    a0, a1, a2, b0, b1, b2 = partials(photos, m, 2, x, y, z)
    c0, c1, c2, d0, d1, d2 = partials(photos, m, 3, x, y, z)
    n00 = a0 * a0 + b0 * b0 + c0 * c0 + d0 * d0
    n10 = a1 * a0 + b1 * b0 + c1 * c0 + d1 * d0
    n11 = a1 * a1 + b1 * b1 + c1 * c1 + d1 * d1
    n20 = a2 * a0 + b2 * b0 + c2 * c0 + d2 * d0
    n21 = a2 * a1 + b2 * b1 + c2 * c1 + d2 * d1
    n22 = a2 * a2 + b2 * b2 + c2 * c2 + d2 * d2
    q00, q10, q20 = n11 * n22 - n21 * n21, n20 * n21 - n10 * n22, n10 * n21 - n20 * n11
    q11, q21, q22 = n00 * n22 - n20 * n20, n10 * n20 - n00 * n21, n00 * n11 - n10 * n10
    scale = 1.0 / (n00 * q00 + n10 * q10 + n20 * q20)
    px, py, pz = x, y, z
    for _ in range(STEPS):
        u, v = project_at(photos, m, 2, tau1, px, py, pz)
        g0, g1 = x1 - u, y1 - v
        u, v = project_at(photos, m, 3, tau2, px, py, pz)
        g2, g3 = x2 - u, y2 - v
        r0 = a0 * g0 + b0 * g1 + c0 * g2 + d0 * g3
        r1 = a1 * g0 + b1 * g1 + c1 * g2 + d1 * g3
        r2 = a2 * g0 + b2 * g1 + c2 * g2 + d2 * g3
        sx = scale * (q00 * r0 + q10 * r1 + q20 * r2)
        sy = scale * (q10 * r0 + q11 * r1 + q21 * r2)
        sz = scale * (q20 * r0 + q21 * r1 + q22 * r2)
        px, py, pz = px + sx, py + sy, pz + sz
        if abs(sx) + abs(sy) + abs(sz) < LAST_STEP_M:
            break
    return x - px, y - py, z - pz


@kernel
def deform_points(models, number, points, out):
    """`deformation` at points (n, 3) in models of these numbers (n,); out (n, 3)."""
    for k in range(len(points)):
        out[k, 0], out[k, 1], out[k, 2] = deformation(models, number[k], points[k, 0], points[k, 1], points[k, 2])
