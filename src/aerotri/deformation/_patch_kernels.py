"""The deformation of a patch of cells that lie in one tile of either photograph: fitted, checked at the worst cells.

From 3 × 3 exact nodes, biquadratic in plan and quadratic in the height above the surface through the nodes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel
from aerotri.deformation._exact_kernels import deformation
from aerotri.functional_model._photo_kernels import project

NODES, CHECKS = 9, 6
"""Nodes of a fit (3 × 3), places it is checked at [C]: 17 exact deformations with the two that tell its slope by
height."""
MIXED, ONE_TILE, OFF = 0, 1, 2
"""Where a patch lies: across tiles or an edge, in one tile of both photographs, off one of them."""


class Dem(NamedTuple):
    """A window of a DEM.

    z : (h, w) m, NaN without data. number : (h, w) model of every cell, −1 for none.
    place : (4,) x of the first cell, its change per column, y of the first cell, its change per row.
    """

    z: np.ndarray
    number: np.ndarray
    place: np.ndarray


class Moves(NamedTuple):
    """(h, w) each: dX and dY of a DEM in columns and rows, dZ in m; NaN outside the models."""

    du: np.ndarray
    dv: np.ndarray
    dz: np.ndarray


class Patch(NamedTuple):
    """box : (4,) first and last row, first and last column. heights : (2,) lowest, highest. present : its models."""

    box: np.ndarray
    heights: np.ndarray
    present: np.ndarray


class Fit(NamedTuple):
    """A fitted patch.

    f : (4, 3, 3) coefficients of dX, dY, dZ and of the surface through the nodes. slope : (2, 3) of the deformation by
    height and height squared. node : (4, 3, 3) what was fitted.
    """

    f: np.ndarray
    slope: np.ndarray
    node: np.ndarray


class Lines(NamedTuple):
    """Room for one row or column of a patch each."""

    lows: np.ndarray
    highs: np.ndarray
    u: np.ndarray
    v: np.ndarray
    z: np.ndarray


@kernel
def tile_case(models, m, place, patch):
    """Where a patch of cells lies: ONE_TILE of either photograph, OFF one of them, or MIXED.

    Tiles are rectangles and the box of a patch is convex: its corners decide.
    """
    photos, half, edges, box = models.photos, models.errors.half, models.errors.edges, patch.box
    case = ONE_TILE
    for k in range(2):
        s = models.source[m, k]
        x_low, x_high, y_low, y_high = np.inf, -np.inf, np.inf, -np.inf
        for corner in range(8):
            row, column = box[corner & 1], box[2 + ((corner >> 1) & 1)]
            height = patch.heights[1] if corner & 4 else patch.heights[0]
            x, y, u3 = project(photos, m, k, place[0] + place[1] * column, place[2] + place[3] * row, height)
            if not u3 < 0.0:
                return MIXED
            x_low, x_high = min(x_low, x), max(x_high, x)
            y_low, y_high = min(y_low, y), max(y_high, y)
        if x_low > half[s, 0] or x_high < -half[s, 0] or y_low > half[s, 1] or y_high < -half[s, 1]:
            return OFF
        if x_low < -half[s, 0] or x_high > half[s, 0] or y_low < -half[s, 1] or y_high > half[s, 1]:
            case = MIXED
        for e in range(2):
            if x_low < edges[s, 0, e] <= x_high or y_low < edges[s, 1, e] <= y_high:
                case = MIXED
    return case


@kernel
def fit_coefficients(node, span, f, slope):
    """Coefficients f[k, p, q] of t^p·s^q from node[k] (3, 3) at t, s = −1, 0, 1, and slopes by height.

    slope : (2, 3) in, values above and below the middle node by `span`; out, linear and quadratic.
    """
    for k in range(4):
        for q in range(3):
            f[k, 0, q] = node[k, 1, q]
            f[k, 1, q] = 0.5 * (node[k, 2, q] - node[k, 0, q])
            f[k, 2, q] = 0.5 * (node[k, 2, q] + node[k, 0, q]) - node[k, 1, q]
        for p in range(3):
            low, middle, high = f[k, p, 0], f[k, p, 1], f[k, p, 2]
            f[k, p, 0], f[k, p, 1], f[k, p, 2] = middle, 0.5 * (high - low), 0.5 * (high + low) - middle
    for k in range(3):
        above, below = slope[0, k], slope[1, k]
        slope[0, k] = (above - below) / (2.0 * span)
        slope[1, k] = (above + below - 2.0 * node[k, 1, 1]) / (2.0 * span * span)


@kernel
def value_at(f, k, t, s):
    """Biquadratic value of coefficients f[k]."""
    low = f[k, 0, 0] + s * (f[k, 0, 1] + s * f[k, 0, 2])
    middle = f[k, 1, 0] + s * (f[k, 1, 1] + s * f[k, 1, 2])
    high = f[k, 2, 0] + s * (f[k, 2, 1] + s * f[k, 2, 2])
    return low + t * (middle + t * high)


@kernel
def find_height(z, box, height):
    """Row and column of the first cell of a patch with a height."""
    for i in range(int(box[0]), int(box[1]) + 1):
        for j in range(int(box[2]), int(box[3]) + 1):
            if z[i, j] == height:
                return i, j
    return int(box[0]), int(box[2])


@kernel
def fit_patch(dem, models, m, patch, tolerance, fit):
    """Fit the deformation of a patch; False where it is off by more than the tolerance at the worst cells."""
    f, slope, node = fit.f, fit.slope, fit.node
    z, place, box, heights = dem.z, dem.place, patch.box, patch.heights
    x0, dx, y0, dy = place[0], place[1], place[2], place[3]
    half_rows, half_columns = 0.5 * (box[1] - box[0]), 0.5 * (box[3] - box[2])
    middle, span = 0.5 * (heights[0] + heights[1]), max(1.0, 0.5 * (heights[1] - heights[0]))
    for k in range(NODES + 2 + CHECKS):
        if k < NODES:
            r, c = box[0] + (k // 3) * half_rows, box[2] + (k % 3) * half_columns
            height = float(z[int(r + 0.5), int(c + 0.5)])
            if height != height:
                height = middle
        elif k < NODES + 2:
            r, c = box[0] + half_rows, box[2] + half_columns
            height = node[3, 1, 1] + (span if k == NODES else -span)
        else:
            check = k - NODES - 2
            if check < 4:
                i = int(box[0] + half_rows * (0.5 if check & 1 else 1.5))
                j = int(box[2] + half_columns * (0.5 if check & 2 else 1.5))
            else:
                i, j = find_height(z, box, heights[check - 4])
            r, c, height = float(i), float(j), float(z[i, j])
            if height != height:
                continue
        d = deformation(models, m, x0 + dx * c, y0 + dy * r, height)
        if k < NODES:
            p, q = k // 3, k % 3
            node[0, p, q], node[1, p, q], node[2, p, q], node[3, p, q] = d[0], d[1], d[2], height
        elif k == NODES:
            slope[0, 0], slope[0, 1], slope[0, 2] = d[0], d[1], d[2]
        elif k == NODES + 1:
            slope[1, 0], slope[1, 1], slope[1, 2] = d[0], d[1], d[2]
            fit_coefficients(node, span, f, slope)
        else:
            t, s = (r - box[0]) / half_rows - 1.0, (c - box[2]) / half_columns - 1.0
            up = height - value_at(f, 3, t, s)
            off_x = value_at(f, 0, t, s) + up * (slope[0, 0] + up * slope[1, 0]) - d[0]
            off_y = value_at(f, 1, t, s) + up * (slope[0, 1] + up * slope[1, 1]) - d[1]
            off_z = value_at(f, 2, t, s) + up * (slope[0, 2] + up * slope[1, 2]) - d[2]
            # a comparison with NaN, of a node off the format, is false
            if not (abs(off_x) <= tolerance and abs(off_y) <= tolerance and abs(off_z) <= tolerance):
                return False
    return True


@kernel
def fill_patch(dem, m, whole, box, fit, lines, moves):
    """The fitted deformation at the cells of a patch in model m; NaN where the DEM has no data.

    whole : all cells are in it.
    """
    z, number, place, f, slope = dem.z, dem.number, dem.place, fit.f, fit.slope
    du, dv, dz = moves.du, moves.dv, moves.dz
    per_column, per_row = 1.0 / place[1], 1.0 / place[3]
    half_rows, half_columns = 0.5 * (box[1] - box[0]), 0.5 * (box[3] - box[2])
    ax, ay, az, bx, by, bz = slope[0, 0], slope[0, 1], slope[0, 2], slope[1, 0], slope[1, 1], slope[1, 2]
    first = int(box[2])
    n, per_cell = int(box[3]) - first + 1, 1.0 / half_columns
    for i in range(int(box[0]), int(box[1]) + 1):
        t = (i - box[0]) / half_rows - 1.0
        x0 = f[0, 0, 0] + t * (f[0, 1, 0] + t * f[0, 2, 0])
        x1 = f[0, 0, 1] + t * (f[0, 1, 1] + t * f[0, 2, 1])
        x2 = f[0, 0, 2] + t * (f[0, 1, 2] + t * f[0, 2, 2])
        y0 = f[1, 0, 0] + t * (f[1, 1, 0] + t * f[1, 2, 0])
        y1 = f[1, 0, 1] + t * (f[1, 1, 1] + t * f[1, 2, 1])
        y2 = f[1, 0, 2] + t * (f[1, 1, 2] + t * f[1, 2, 2])
        z0 = f[2, 0, 0] + t * (f[2, 1, 0] + t * f[2, 2, 0])
        z1 = f[2, 0, 1] + t * (f[2, 1, 1] + t * f[2, 2, 1])
        z2 = f[2, 0, 2] + t * (f[2, 1, 2] + t * f[2, 2, 2])
        h0 = f[3, 0, 0] + t * (f[3, 1, 0] + t * f[3, 2, 0])
        h1 = f[3, 0, 1] + t * (f[3, 1, 1] + t * f[3, 2, 1])
        h2 = f[3, 0, 2] + t * (f[3, 1, 2] + t * f[3, 2, 2])
        heights = z[i, first : first + n]
        out_u, out_v, out_z = lines.u[:n], lines.v[:n], lines.z[:n]
        if whole:
            out_u, out_v, out_z = du[i, first : first + n], dv[i, first : first + n], dz[i, first : first + n]
        for j in range(n):
            s = j * per_cell - 1.0
            above = heights[j] - (h0 + s * (h1 + s * h2))
            out_u[j] = (x0 + s * (x1 + s * x2) + above * (ax + above * bx)) * per_column
            out_v[j] = (y0 + s * (y1 + s * y2) + above * (ay + above * by)) * per_row
            out_z[j] = z0 + s * (z1 + s * z2) + above * (az + above * bz)
        if not whole:
            for j in range(n):
                if number[i, first + j] == m:
                    du[i, first + j], dv[i, first + j], dz[i, first + j] = out_u[j], out_v[j], out_z[j]
