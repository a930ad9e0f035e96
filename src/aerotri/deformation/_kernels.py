"""The deformation of every cell of a DEM, wrong − true: scalar kernels without checks or objects.

P = I(true; m − d(m)), m = π(used, P_w), exact at a point. Patches of cells that lie in few models and in one tile of
either photograph of each get it from 3 × 3 exact nodes a model, biquadratic in plan and quadratic in the height above
the surface through the nodes; the worst cells of the patch are computed exactly, and where they are off by more than a
tolerance the patch is quartered, in the end down to exact cells.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel
from aerotri.functional_model._photo_kernels import ErrorTable, delay, image_error, partials, project, project_at

SMALLEST_PATCH, NODES, CHECKS, MODELS_IN_PATCH = 4, 9, 6, 3
"""Cells along a patch that is not halved, nodes of a fit (3 × 3), places it is checked at, models of a patch [C]. A fit
takes 17 exact deformations, about as many as the 4 × 4 cells of the smallest patch."""
MIXED, ONE_TILE, OFF = 0, 1, 2
"""Where a patch lies: across tiles or an edge, in one tile of both photographs, off one of them."""
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


class Square(NamedTuple):
    """A patch of cells: its first row, the row after its last, the same of columns."""

    row: int
    last_row: int
    column: int
    last_column: int


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


@kernel
def patch_extremes(dem, square, lines, heights):
    """Lowest and highest height of a patch into heights (2,), ∞ and −∞ without data; whether it lies in one model.

    Column by column in rows of their own, which the processor does many at a time.
    """
    z, number, lows, highs = dem.z, dem.number, lines.lows, lines.highs
    row, last_row, column, last_column = square.row, square.last_row, square.column, square.last_column
    n = last_column - column
    for j in range(n):
        lows[j], highs[j] = np.inf, -np.inf
    m, differ = number[row, column], 0
    for i in range(row, last_row):
        cells, models = z[i, column:last_column], number[i, column:last_column]
        for j in range(n):
            # a comparison with NaN is false
            lows[j] = cells[j] if cells[j] < lows[j] else lows[j]
            highs[j] = cells[j] if cells[j] > highs[j] else highs[j]
        for j in range(n):
            differ |= models[j] ^ m
    heights[0], heights[1] = np.inf, -np.inf
    for j in range(n):
        heights[0], heights[1] = min(heights[0], lows[j]), max(heights[1], highs[j])
    return differ == 0


@kernel
def find_models(number, square, present):
    """The models of a patch into present; how many, or one more than there is room for."""
    n = 0
    for i in range(square.row, square.last_row):
        for j in range(square.column, square.last_column):
            m, known = number[i, j], number[i, j] < 0
            for k in range(n):
                known |= present[k] == m
            if not known:
                if n == len(present):
                    return n + 1
                present[n] = m
                n += 1
    return n


@kernel
def blank_patch(box, moves):
    """No deformation in a patch: NaN."""
    for i in range(int(box[0]), int(box[1]) + 1):
        for j in range(int(box[2]), int(box[3]) + 1):
            moves.du[i, j] = moves.dv[i, j] = moves.dz[i, j] = np.nan


@kernel
def deform_patch(dem, models, tolerance, patch, whole, room, moves):
    """The deformation of a patch by a fit for each of its models; False where one of them does not fit.

    whole : all cells of the patch are in its one model. room : a `Fit` and `Lines`.
    """
    fit, lines = room
    wide = min(patch.box[1] - patch.box[0], patch.box[3] - patch.box[2]) >= 2
    for m in patch.present:
        case = tile_case(models, m, dem.place, patch)
        if case == OFF:
            if whole:
                blank_patch(patch.box, moves)
            continue
        if case != ONE_TILE or not wide:
            return False
        if not fit_patch(dem, models, m, patch, tolerance, fit):
            return False
        fill_patch(dem, m, whole, patch.box, fit, lines, moves)
    return True


@kernel
def deform_window(dem, models, tolerance, largest, moves):
    """The deformation of all cells of a window; returns how many of them were computed one by one.

    Parameters
    ----------
    tolerance : m, of the fit. largest : cells along the side of a patch to begin with, a power of two.
    moves : out.
    """
    z, number, place = dem.z, dem.number, dem.place
    rows, columns = z.shape
    fit = Fit(np.empty((4, 3, 3)), np.empty((2, 3)), np.empty((4, 3, 3)))
    box, heights, present = np.empty(4), np.empty(2), np.empty(MODELS_IN_PATCH, np.int64)
    lines = Lines(
        np.empty(largest, z.dtype), np.empty(largest, z.dtype), np.empty(largest, moves.du.dtype),
        np.empty(largest, moves.du.dtype), np.empty(largest, moves.dz.dtype),
    )  # fmt: skip
    stack = np.empty((256, 3), np.int64)
    exact = 0
    for first_row in range(0, rows, largest):
        for first_column in range(0, columns, largest):
            stack[0, 0], stack[0, 1], stack[0, 2] = first_row, first_column, largest
            top = 1
            while top > 0:
                top -= 1
                row, column, size = stack[top, 0], stack[top, 1], stack[top, 2]
                last_row, last_column = min(row + size, rows), min(column + size, columns)
                box[0], box[1], box[2], box[3] = row, last_row - 1, column, last_column - 1
                square = Square(row, last_row, column, last_column)
                uniform = patch_extremes(dem, square, lines, heights)
                present[0], n = number[row, column], 1
                if heights[0] > heights[1] or (uniform and present[0] < 0):
                    n = 0
                elif not uniform:
                    n = find_models(number, square, present)
                if n == 0 or not uniform:
                    blank_patch(box, moves)
                if n == 0:
                    continue
                if n <= len(present):
                    patch = Patch(box, heights, present[:n])
                    if deform_patch(dem, models, tolerance, patch, uniform, (fit, lines), moves):
                        continue
                if size > SMALLEST_PATCH:
                    size //= 2
                    for i in range(row, last_row, size):
                        for j in range(column, last_column, size):
                            stack[top, 0], stack[top, 1], stack[top, 2] = i, j, size
                            top += 1
                    continue
                for i in range(row, last_row):
                    for j in range(column, last_column):
                        m = number[i, j]
                        height = z[i, j]
                        if m < 0 or height != height:
                            moves.du[i, j] = moves.dv[i, j] = moves.dz[i, j] = np.nan
                            continue
                        x, y = place[0] + place[1] * j, place[2] + place[3] * i
                        d = deformation(models, m, x, y, height)
                        moves.du[i, j], moves.dv[i, j] = d[0] / place[1], d[1] / place[3]
                        moves.dz[i, j] = d[2]
                        exact += 1
    return exact
