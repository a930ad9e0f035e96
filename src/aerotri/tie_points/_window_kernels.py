"""A window of one photograph found in another by least squares, in pixels as they are."""

from __future__ import annotations

import math

import numpy as np

from aerotri.compiled import kernel, leaf_kernel
from aerotri.terrain._sampling_kernels import cubic_weights
from aerotri.terrain._shift_kernels import invert

HALF = 10
"""Pixels of a window on either side of its middle."""
SIDE = 2 * HALF + 1
COLUMNS = 8
"""Six of an affine map, offset and gain of the grey values."""
STEPS = 12
"""Steps until a window is given up."""
SETTLED = 0.01
"""Pixels of a last step."""
FLATTEST = 1e-6
"""Grey values² below which a window has no texture."""


@leaf_kernel
def _columns(window, out):
    """Partials of the grey values of a window with its rim of one pixel: by the six unknowns, by offset and by gain."""
    at = 0
    for i in range(SIDE):
        v = i - float(HALF)
        for j in range(SIDE):
            u = j - float(HALF)
            fu = 0.5 * (float(window[i + 1, j + 2]) - float(window[i + 1, j]))
            fv = 0.5 * (float(window[i + 2, j + 1]) - float(window[i, j + 1]))
            out[at, 0], out[at, 1], out[at, 2] = fu, u * fu, v * fu
            out[at, 3], out[at, 4], out[at, 5] = fv, u * fv, v * fv
            out[at, 6], out[at, 7] = 1.0, float(window[i + 1, j + 1])
            at += 1


@leaf_kernel
def _sample(image, x, y, a, along, across, out):
    """Grey values (n²,) at (x, y) + a·(u, v), by cubic convolution; False where the window leaves the photograph."""
    reach_x, reach_y = HALF * (abs(a[0]) + abs(a[1])), HALF * (abs(a[2]) + abs(a[3]))
    if not (x - reach_x >= 2.0 and x + reach_x < image.shape[1] - 2.0):
        return False
    if not (y - reach_y >= 2.0 and y + reach_y < image.shape[0] - 2.0):
        return False
    at = 0
    for i in range(-HALF, HALF + 1):
        for j in range(-HALF, HALF + 1):
            c, r = x - 0.5 + a[0] * j + a[1] * i, y - 0.5 + a[2] * j + a[3] * i
            ic, ir = int(c), int(r)
            cubic_weights(c - ic, along)
            cubic_weights(r - ir, across)
            value = 0.0
            for k in range(4):
                line = image[ir - 1 + k]
                value += across[k] * (
                    along[0] * line[ic - 1] + along[1] * line[ic] + along[2] * line[ic + 1] + along[3] * line[ic + 2]
                )
            out[at] = value
            at += 1
    return True


@leaf_kernel
def _inverse_normals(column, normal):
    """Inverse of the normal matrix of the columns; False without texture."""
    count = column.shape[0]
    normal[:] = 0.0
    for s in range(count):
        for p in range(COLUMNS):
            value = column[s, p]
            for q in range(COLUMNS):
                normal[p, q] += value * column[s, q]
    mean = normal[6, 7] / count
    return normal[7, 7] / count - mean * mean > FLATTEST and invert(normal, COLUMNS)


@leaf_kernel
def _solve(column, normal, grey, right, x):
    """Unknowns x of the grey values, the first six over the gain x[7]; Σ of their squares, and how much is explained.

    normal is the inverse.
    """
    squares, explained = 0.0, 0.0
    right[:] = 0.0
    for s in range(len(grey)):
        value = grey[s]
        squares += value * value
        for p in range(COLUMNS):
            right[p] += value * column[s, p]
    for p in range(COLUMNS):
        total = 0.0
        for q in range(COLUMNS):
            total += normal[p, q] * right[q]
        x[p] = total
        explained += total * right[p]
    for p in range(6):
        x[p] /= x[7]
    return squares, explained


@leaf_kernel
def _move(x, xy, a):
    """Take the displacement of the six unknowns into the map, xy and a; how far it moves, px."""
    dx, dy = a[0] * x[0] + a[1] * x[3], a[2] * x[0] + a[3] * x[3]
    a0, a1, a2, a3 = a[0], a[1], a[2], a[3]
    a[0], a[1] = a0 - a0 * x[1] - a1 * x[4], a1 - a0 * x[2] - a1 * x[5]
    a[2], a[3] = a2 - a2 * x[1] - a3 * x[4], a3 - a2 * x[2] - a3 * x[5]
    xy[0] -= dx
    xy[1] -= dy
    return math.hypot(dx, dy)


@kernel
def match_windows(image, windows, which, reach, place, slope, found):
    """Windows of other photographs found in one: g(W(u)) = r0 + r1·f(u + D(u)), D of six unknowns, W moved until D = 0.

    image (rows, columns) uint8; windows (p, n + 2, n + 2) uint8 of the others; which (k,) of them is sought; reach (k,)
    px that it may lie from its start. place (k, 2) px and slope (k, 2, 2) px by pixels of the other photograph: in,
    start values; out, where it is. found (k, 2): out, correlation and σ of the place, px; NaN where it is not found.
    """
    count = SIDE * SIDE
    column, grey = np.empty((count, COLUMNS)), np.empty(count)
    normal, right, x = np.empty((COLUMNS, COLUMNS)), np.empty(COLUMNS), np.empty(COLUMNS)
    along, across, a, xy = np.empty(4), np.empty(4), np.empty(4), np.empty(2)
    for k in range(len(which)):
        found[k] = np.nan
        _columns(windows[which[k]], column)
        if not _inverse_normals(column, normal):
            continue
        xy[:] = place[k]
        a[0], a[1], a[2], a[3] = slope[k, 0, 0], slope[k, 0, 1], slope[k, 1, 0], slope[k, 1, 1]
        for _ in range(STEPS):
            if not _sample(image, xy[0], xy[1], a, along, across, grey):
                break
            squares, explained = _solve(column, normal, grey, right, x)
            moved = _move(x, xy, a)
            if not (x[7] > 0.0 and math.hypot(xy[0] - place[k, 0], xy[1] - place[k, 1]) <= reach[k]):
                break
            if moved < SETTLED:
                own, left = squares - right[6] * right[6] / count, max(squares - explained, 0.0)
                found[k, 0] = math.sqrt(max(1.0 - left / own, 0.0)) if own > 0.0 else 0.0
                area = abs(a[0] * a[3] - a[1] * a[2])
                variance = left / (count - COLUMNS) * 0.5 * (normal[0, 0] + normal[3, 3]) * area
                found[k, 1] = math.sqrt(variance) / x[7]
                place[k] = xy
                slope[k, 0, 0], slope[k, 0, 1], slope[k, 1, 0], slope[k, 1, 1] = a[0], a[1], a[2], a[3]
                break
