"""The deformation of every cell of a DEM, wrong − true: scalar kernels without checks or objects.

P = I(true; m − d(m)), m = π(used, P_w), exact at a point. Patches of cells that lie in few models and in one tile of
either photograph of each get it from 3 × 3 exact nodes a model, biquadratic in plan and quadratic in the height above
the surface through the nodes; the worst cells of the patch are computed exactly, and where they are off by more than a
tolerance the patch is quartered, in the end down to exact cells.

photo   : (15,) U (3, 4) row by row with u = U·(x, y, z, 1), then c, x0, y0 in mm
photos  : (M, 4, 15) of every model: used left, used right, true left, true right
source  : (M, 2) image errors of left and right
cameras : half (S, 2) mm of the formats; edges (S, 2, 2) mm, x and y of the seams, rising, ∞ where there is none;
          meta (S, 3, 3, 7) of every tile (column, row from below): offset into values, nodes along x and y, x and y of
          the first node, nodes per mm along x and y; values (·,) mm, dx and dy at the nodes
place   : (4,) x of the first cell, its change per column, y of the first cell, its change per row
"""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel

SMALLEST_PATCH, NODES, CHECKS, MODELS_IN_PATCH = 4, 9, 6, 3
MIXED, ONE_TILE, OFF = 0, 1, 2
STEPS = 8
LAST_STEP_M = 5e-3
"""A step of the intersection after which the next one is below 0.01 mm: steps shrink a thousandfold."""


@kernel
def tile_of(s, x, y, edges):
    """Column and row from below of the tile that holds a position in a photograph with image errors s."""
    i = int(x >= edges[s, 0, 0]) + int(x >= edges[s, 0, 1])
    j = int(y >= edges[s, 1, 0]) + int(y >= edges[s, 1, 1])
    return i, j


@kernel
def error_in_tile(s, i, j, x, y, meta, values):
    """(dx, dy) mm of a tile at a measured position; beyond the tile it goes on straight."""
    nx, ny = int(meta[s, i, j, 1]), int(meta[s, i, j, 2])
    fx, fy = (x - meta[s, i, j, 3]) * meta[s, i, j, 5], (y - meta[s, i, j, 4]) * meta[s, i, j, 6]
    kx, ky = min(max(int(fx), 0), nx - 2), min(max(int(fy), 0), ny - 2)
    fx, fy = fx - kx, fy - ky
    low = int(meta[s, i, j, 0]) + 2 * (ky * nx + kx)
    high = low + 2 * nx
    low_x = values[low] + fx * (values[low + 2] - values[low])
    low_y = values[low + 1] + fx * (values[low + 3] - values[low + 1])
    high_x = values[high] + fx * (values[high + 2] - values[high])
    high_y = values[high + 1] + fx * (values[high + 3] - values[high + 1])
    return low_x + fy * (high_x - low_x), low_y + fy * (high_y - low_y)


@kernel
def image_error(s, x, y, edges, meta, values):
    """(dx, dy) mm at a measured position in a photograph with image errors s."""
    i, j = tile_of(s, x, y, edges)
    return error_in_tile(s, i, j, x, y, meta, values)


@kernel
def project(photos, m, k, x, y, z):
    """(x, y) mm in photograph k of model m, and u3, which is negative in front of the camera."""
    u1 = photos[m, k, 0] * x + photos[m, k, 1] * y + photos[m, k, 2] * z + photos[m, k, 3]
    u2 = photos[m, k, 4] * x + photos[m, k, 5] * y + photos[m, k, 6] * z + photos[m, k, 7]
    u3 = photos[m, k, 8] * x + photos[m, k, 9] * y + photos[m, k, 10] * z + photos[m, k, 11]
    scale = -photos[m, k, 12] / u3
    return photos[m, k, 13] + scale * u1, photos[m, k, 14] + scale * u2, u3


@kernel
def partials(photos, m, k, x, y, z):
    """Partials of x, then of y, in photograph k of model m by the point."""
    u1 = photos[m, k, 0] * x + photos[m, k, 1] * y + photos[m, k, 2] * z + photos[m, k, 3]
    u2 = photos[m, k, 4] * x + photos[m, k, 5] * y + photos[m, k, 6] * z + photos[m, k, 7]
    inverse = -1.0 / (photos[m, k, 8] * x + photos[m, k, 9] * y + photos[m, k, 10] * z + photos[m, k, 11])
    a, b, f = u1 * inverse, u2 * inverse, photos[m, k, 12] * inverse
    v0, v1, v2 = photos[m, k, 8], photos[m, k, 9], photos[m, k, 10]
    return (
        f * (photos[m, k, 0] + a * v0), f * (photos[m, k, 1] + a * v1), f * (photos[m, k, 2] + a * v2),
        f * (photos[m, k, 4] + b * v0), f * (photos[m, k, 5] + b * v1), f * (photos[m, k, 6] + b * v2),
    )  # fmt: skip


@kernel
def deformation(photos, source, cameras, m, x, y, z):
    """(dX, dY, dZ) at a point of the DEM in model m; NaN where not both photographs show it.

    The intersection keeps the partials A of its start, metres away from its end: that slows it down by a thousandth a
    step, and moves its end by that share of what the y-parallax does. a, b are rows of A of the left, c, d of the right
    photograph.
    """
    half, edges, meta, values = cameras
    left, right = source[m, 0], source[m, 1]
    x1, y1, depth1 = project(photos, m, 0, x, y, z)
    x2, y2, depth2 = project(photos, m, 1, x, y, z)
    on_left = depth1 < 0.0 and abs(x1) <= half[left, 0] and abs(y1) <= half[left, 1]
    on_right = depth2 < 0.0 and abs(x2) <= half[right, 0] and abs(y2) <= half[right, 1]
    if not (on_left and on_right):
        return np.nan, np.nan, np.nan
    dx, dy = image_error(left, x1, y1, edges, meta, values)
    x1, y1 = x1 - dx, y1 - dy
    dx, dy = image_error(right, x2, y2, edges, meta, values)
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
        u, v, _ = project(photos, m, 2, px, py, pz)
        g0, g1 = x1 - u, y1 - v
        u, v, _ = project(photos, m, 3, px, py, pz)
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
def deform_points(models, photos, source, cameras, points, out):
    """`deformation` at points (n, 3) of models (n,); out (n, 3)."""
    for k in range(len(points)):
        out[k, 0], out[k, 1], out[k, 2] = deformation(
            photos, source, cameras, models[k], points[k, 0], points[k, 1], points[k, 2]
        )


@kernel
def tile_case(photos, source, cameras, m, place, box, low, high):
    """Where a box of cells, from height low to high, lies: ONE_TILE of either photograph, OFF one of them, or MIXED.

    Tiles are rectangles and a box is convex: its corners decide. box : (4,) first and last row, first and last column.
    """
    half, edges, _, _ = cameras
    case = ONE_TILE
    for k in range(2):
        s = source[m, k]
        x_low, x_high, y_low, y_high = np.inf, -np.inf, np.inf, -np.inf
        for corner in range(8):
            row, column = box[corner & 1], box[2 + ((corner >> 1) & 1)]
            height = high if corner & 4 else low
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
def fit_patch(z, photos, source, cameras, m, place, box, heights, tolerance, fit):
    """Fit the deformation of a patch; False where it is off by more than the tolerance at the worst cells.

    box : (4,) first and last row, first and last column. heights : (2,) the lowest and the highest.
    fit : coefficients f (4, 3, 3) of dX, dY, dZ and of the surface through the nodes; slope (2, 3) of the deformation
    by height and height squared; node (4, 3, 3) scratch.
    """
    f, slope, node = fit
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
        d = deformation(photos, source, cameras, m, x0 + dx * c, y0 + dy * r, height)
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
def fill_patch(z, number, m, whole, place, box, f, slope, lines, du, dv, dz):
    """The fitted deformation at the cells of a patch in model m; NaN where the DEM has no data.

    whole : all cells are in it. lines : three rows of scratch.
    """
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
        out_u, out_v, out_z = lines[0][:n], lines[1][:n], lines[2][:n]
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
def patch_extremes(z, number, row, last_row, column, last_column, lows, highs, heights):
    """Lowest and highest height of a patch into heights (2,), ∞ and −∞ without data; whether it lies in one model.

    Column by column in lows and highs, which the processor does many at a time.
    """
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
def find_models(number, row, last_row, column, last_column, present):
    """The models of a patch into present; how many, or one more than there is room for."""
    n = 0
    for i in range(row, last_row):
        for j in range(column, last_column):
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
def blank_patch(box, du, dv, dz):
    """No deformation in a patch: NaN."""
    for i in range(int(box[0]), int(box[1]) + 1):
        for j in range(int(box[2]), int(box[3]) + 1):
            du[i, j] = dv[i, j] = dz[i, j] = np.nan


@kernel
def deform_patch(
    z, number, photos, source, cameras, place, tolerance, box, heights, present, n, whole, fit, lines, du, dv, dz
):
    """The deformation of a patch by a fit for each of its n models; False where one of them does not fit.

    whole : all cells of the patch are in its one model.
    """
    wide = min(box[1] - box[0], box[3] - box[2]) >= 2
    for k in range(n):
        m = present[k]
        case = tile_case(photos, source, cameras, m, place, box, heights[0], heights[1])
        if case == OFF:
            if whole:
                blank_patch(box, du, dv, dz)
            continue
        if case != ONE_TILE or not wide:
            return False
        if not fit_patch(z, photos, source, cameras, m, place, box, heights, tolerance, fit):
            return False
        fill_patch(z, number, m, whole, place, box, fit[0], fit[1], lines, du, dv, dz)
    return True


@kernel
def deform_window(z, number, photos, source, cameras, place, tolerance, largest, du, dv, dz):
    """The deformation of all cells of a window; returns how many of them were computed one by one.

    Parameters
    ----------
    z : (h, w) m, NaN where the DEM has no data.
    number : (h, w) model of every cell, −1 for none.
    tolerance : m, of the fit. largest : cells along the side of a patch to begin with, a power of two.
    du, dv : (h, w) out, dX and dY in columns and rows. dz : (h, w) out, m. NaN outside the models.
    """
    rows, columns = z.shape
    fit = np.empty((4, 3, 3)), np.empty((2, 3)), np.empty((4, 3, 3))
    box, heights, present = np.empty(4), np.empty(2), np.empty(MODELS_IN_PATCH, np.int64)
    lows, highs = np.empty(largest, z.dtype), np.empty(largest, z.dtype)
    lines = np.empty(largest, du.dtype), np.empty(largest, du.dtype), np.empty(largest, dz.dtype)
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
                uniform = patch_extremes(z, number, row, last_row, column, last_column, lows, highs, heights)
                present[0], n = number[row, column], 1
                if heights[0] > heights[1] or (uniform and present[0] < 0):
                    n = 0
                elif not uniform:
                    n = find_models(number, row, last_row, column, last_column, present)
                if n == 0 or not uniform:
                    blank_patch(box, du, dv, dz)
                if n == 0:
                    continue
                if n <= len(present) and deform_patch(
                    z, number, photos, source, cameras, place, tolerance, box, heights, present, n, uniform, fit,
                    lines, du, dv, dz,
                ):  # fmt: skip
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
                            du[i, j] = dv[i, j] = dz[i, j] = np.nan
                            continue
                        x, y = place[0] + place[1] * j, place[2] + place[3] * i
                        d = deformation(photos, source, cameras, m, x, y, height)
                        du[i, j], dv[i, j], dz[i, j] = d[0] / place[1], d[1] / place[3], d[2]
                        exact += 1
    return exact
