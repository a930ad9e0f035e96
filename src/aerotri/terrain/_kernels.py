"""Matching along loci in object space, on windows rectified by the orientation: scalar kernels without objects.

A window is a square of posts on a plane piece of ground. Its corners are projected into a photograph with the image
errors of the tile that shows its middle, its posts lie bilinearly between them.

view   : photos (1, n, 15) u = U·(x, y, z, 1) row by row, then c, x0, y0; source (n,) image errors; cameras as in
         `deformation._kernels`; sensor (n, 3) half columns, half rows, pixels per mm; centres (n, 3) m;
         crops (n, 5) offset into pixels, first row, first column, rows, columns, of the level; pixels (·,) uint16;
         scale, pixels of the level per pixel of the photograph; edge, share of the format at its edge not used
window : posts a side (odd), m between posts
"""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel
from aerotri.deformation._kernels import error_in_tile, partials, project, tile_of

ACCEPTED, UNSEEN, POOR, AT_END, WEAK = 0, 1, 2, 3, 4
BACKWARD, AMBIGUOUS = 5, 6
"""Status of a picket; from `BACKWARD` on it was measured and is in error."""
FIXED_POINT_MM, FIXED_POINT_STEPS = 1e-5, 40
SHIFT_STEPS = 12
UNKNOWNS = 9
FIRST_NOISE = 0.05
"""Share of the variance of the grey values that is taken for noise before it is known."""
CONVERGED_POSTS = 0.005
LONGEST_SHIFT_POSTS = 3.0
SMALLEST_ANGLE = 0.02
"""Base over height below which two photographs give no height."""


@kernel
def photo_place(view, k, i, j, x, y, z):
    """(column, row) px in photograph k, with the image errors of its tile (i, j); NaN behind the camera."""
    photos, source, cameras, sensor = view[0], view[1], view[2], view[3]
    ideal_x, ideal_y, u3 = project(photos, 0, k, x, y, z)
    if not u3 < 0.0:
        return np.nan, np.nan
    mx, my = ideal_x, ideal_y
    for _ in range(FIXED_POINT_STEPS):
        dx, dy = error_in_tile(source[k], i, j, mx, my, cameras[2], cameras[3])
        change = abs(ideal_x + dx - mx) + abs(ideal_y + dy - my)
        mx, my = ideal_x + dx, ideal_y + dy
        if not change > FIXED_POINT_MM:
            break
    return sensor[k, 0] + mx * sensor[k, 2], sensor[k, 1] - my * sensor[k, 2]


@kernel
def is_seen(view, k, x, y, z):
    """Whether a place lies in the usable part of photograph k."""
    half, edge = view[2][0], view[8]
    ideal_x, ideal_y, u3 = project(view[0], 0, k, x, y, z)
    if not u3 < 0.0:
        return False
    i, j = tile_of(view[1][k], ideal_x, ideal_y, view[2][1])
    column, row = photo_place(view, k, i, j, x, y, z)
    across = abs(column / view[3][k, 0] - 1.0)
    along = abs(row / view[3][k, 1] - 1.0)
    beyond = abs(ideal_x) > 3.0 * half[view[1][k], 0] or abs(ideal_y) > 3.0 * half[view[1][k], 1]
    return not beyond and across <= 1.0 - 2.0 * edge and along <= 1.0 - 2.0 * edge


@kernel
def window_corners(view, k, spot, reach, shift, corner):
    """Corners of a window in the crop of photograph k, (4, 2) column and row counted from its first pixel centre.

    Parameters
    ----------
    spot : (5,) x, y, z of the middle and the slopes of the ground. reach : m from the middle to a side.
    shift : (6,) m, plan displacement of the middle, and by which it changes along u and v over the reach.

    Returns
    -------
    Whether all of it lies in the crop.
    """
    sensor, crop, scale = view[3], view[5][k], view[7]
    ideal_x, ideal_y, u3 = project(view[0], 0, k, spot[0], spot[1], spot[2])
    if not u3 < 0.0:
        return False
    i, j = tile_of(view[1][k], ideal_x, ideal_y, view[2][1])
    for c in range(4):
        u, v = (1.0 if c & 1 else -1.0), (1.0 if c & 2 else -1.0)
        x = spot[0] + u * reach + shift[0] + u * shift[2] + v * shift[4]
        y = spot[1] + v * reach + shift[1] + u * shift[3] + v * shift[5]
        z = spot[2] + reach * (u * spot[3] + v * spot[4])
        column, row = photo_place(view, k, i, j, x, y, z)
        if not (0.0 <= column <= 2.0 * sensor[k, 0] and 0.0 <= row <= 2.0 * sensor[k, 1]):
            return False
        corner[c, 0] = column * scale - 0.5 - crop[2]
        corner[c, 1] = row * scale - 0.5 - crop[1]
        if not (1.0 <= corner[c, 0] < crop[4] - 2.0 and 1.0 <= corner[c, 1] < crop[3] - 2.0):
            return False
    return True


@kernel
def sample_linear(view, k, corner, window):
    """Grey values at the posts between corners, bilinear."""
    pixels, offset, columns = view[6], view[5][k, 0], view[5][k, 4]
    n = window.shape[0]
    for q in range(n):
        t = q / (n - 1.0)
        left_c = corner[0, 0] + t * (corner[2, 0] - corner[0, 0])
        left_r = corner[0, 1] + t * (corner[2, 1] - corner[0, 1])
        step_c = (corner[1, 0] + t * (corner[3, 0] - corner[1, 0]) - left_c) / (n - 1.0)
        step_r = (corner[1, 1] + t * (corner[3, 1] - corner[1, 1]) - left_r) / (n - 1.0)
        for p in range(n):
            c, r = left_c + p * step_c, left_r + p * step_r
            ic, ir = int(c), int(r)
            fc, fr = np.float32(c - ic), np.float32(r - ir)
            at = offset + ir * columns + ic
            top = pixels[at] + fc * (np.float32(pixels[at + 1]) - pixels[at])
            low = pixels[at + columns] + fc * (np.float32(pixels[at + columns + 1]) - pixels[at + columns])
            window[q, p] = top + fr * (low - top)


@kernel
def cubic_weights(f, weight):
    """Weights of four pixels around a place f beyond the second [L: Keys 1981, a = −1/2]."""
    weight[0] = ((-0.5 * f + 1.0) * f - 0.5) * f
    weight[1] = (1.5 * f - 2.5) * f * f + 1.0
    weight[2] = ((-1.5 * f + 2.0) * f + 0.5) * f
    weight[3] = (0.5 * f - 0.5) * f * f


@kernel
def sample_cubic(view, k, corner, bend, window, weights):
    """As `sample_linear`, by cubic convolution, the posts displaced by what curves the ground.

    bend : (5,) px of column and row per metre of displacement, and m of it for u², uv, v², u and v being ±1 at the
        sides. weights : (2, 4) room.
    """
    pixels, offset, columns = view[6], view[5][k, 0], view[5][k, 4]
    n = window.shape[0]
    for q in range(n):
        t = q / (n - 1.0)
        v = 2.0 * t - 1.0
        left_c = corner[0, 0] + t * (corner[2, 0] - corner[0, 0])
        left_r = corner[0, 1] + t * (corner[2, 1] - corner[0, 1])
        step_c = (corner[1, 0] + t * (corner[3, 0] - corner[1, 0]) - left_c) / (n - 1.0)
        step_r = (corner[1, 1] + t * (corner[3, 1] - corner[1, 1]) - left_r) / (n - 1.0)
        for p in range(n):
            u = 2.0 * p / (n - 1.0) - 1.0
            more = bend[2] * u * u + bend[3] * u * v + bend[4] * v * v
            c, r = left_c + p * step_c + more * bend[0], left_r + p * step_r + more * bend[1]
            ic, ir = int(c), int(r)
            cubic_weights(c - ic, weights[0])
            cubic_weights(r - ir, weights[1])
            value = 0.0
            for b in range(4):
                at = offset + (ir - 1 + b) * columns + ic - 1
                line = 0.0
                for a in range(4):
                    line += weights[0, a] * pixels[at + a]
                value += weights[1, b] * line
            window[q, p] = value


@kernel
def normalise(window):
    """Take off the mean and divide by the length; False for a window without contrast."""
    total = 0.0
    n = window.shape[0]
    for q in range(n):
        for p in range(n):
            total += window[q, p]
    mean = np.float32(total / (n * n))
    squares = 0.0
    for q in range(n):
        for p in range(n):
            value = window[q, p] - mean
            window[q, p] = value
            squares += value * value
    if not squares > 0.0:
        return False
    scale = np.float32(1.0 / np.sqrt(squares))
    for q in range(n):
        for p in range(n):
            window[q, p] *= scale
    return True


@kernel
def product(one, other):
    """Normalised cross-correlation of two normalised windows."""
    total = np.float32(0.0)
    for q in range(one.shape[0]):
        for p in range(one.shape[1]):
            total += one[q, p] * other[q, p]
    return float(total)


@kernel
def correlation_at(view, chosen, spot, window, room):
    """Mean correlation of the first of the photographs with the others that show the window; −1 where none does."""
    first, second, corner, shift = room[0], room[1], room[2], room[3]
    reach = 0.5 * (first.shape[0] - 1) * window
    shift[:] = 0.0
    if not window_corners(view, chosen[0], spot, reach, shift, corner):
        return -1.0
    sample_linear(view, chosen[0], corner, first)
    if not normalise(first):
        return -1.0
    total, count = 0.0, 0
    for k in range(1, len(chosen)):
        if chosen[k] < 0 or not window_corners(view, chosen[k], spot, reach, shift, corner):
            continue
        sample_linear(view, chosen[k], corner, second)
        count += 1
        if normalise(second):
            total += product(first, second)
    return total / count if count else -1.0


@kernel
def parallax_per_metre(view, chosen, spot):
    """m of plan that the widest pair with the first photograph sees a metre of height as."""
    centres, widest = view[4], 0.0
    a = chosen[0]
    ax = (spot[0] - centres[a, 0]) / (centres[a, 2] - spot[2])
    ay = (spot[1] - centres[a, 1]) / (centres[a, 2] - spot[2])
    for k in range(1, len(chosen)):
        b = chosen[k]
        if b >= 0:
            bx = (spot[0] - centres[b, 0]) / (centres[b, 2] - spot[2])
            by = (spot[1] - centres[b, 1]) / (centres[b, 2] - spot[2])
            widest = max(widest, np.hypot(bx - ax, by - ay))
    return widest


@kernel
def search(view, chosen, spot, along, low, step, window, room, profile):
    """Correlation at heights low, low + step … on a locus through the spot; the number of the best.

    Parameters
    ----------
    along : (2,) m in x and y per metre of height: 0, 0 on the vertical line. profile : (k,) out.
    """
    best, place = 0, np.empty(5)
    place[3:] = spot[3:]
    for s in range(len(profile)):
        z = low + s * step
        place[0] = spot[0] + along[0] * (z - spot[2])
        place[1] = spot[1] + along[1] * (z - spot[2])
        place[2] = z
        profile[s] = correlation_at(view, chosen, place, window, room)
        if profile[s] > profile[best]:
            best = s
    return best


@kernel
def peak_offset(profile, best):
    """Place of the top of a parabola through the best and its neighbours, in steps from the best."""
    if best == 0 or best == len(profile) - 1:
        return 0.0
    left, top, right = profile[best - 1], profile[best], profile[best + 1]
    bend = left - 2.0 * top + right
    if left < 0.0 or right < 0.0 or not bend < 0.0:
        return 0.0
    return 0.5 * (left - right) / bend


@kernel
def second_peak(profile, best, apart):
    """Largest value of another local maximum at least `apart` steps from the best."""
    second = -1.0
    for s in range(1, len(profile) - 1):
        if abs(s - best) >= apart and profile[s] >= profile[s - 1] and profile[s] >= profile[s + 1]:
            second = max(second, profile[s])
    return second


@kernel
def make_room(n, most):
    """What `correlation_at` and others work in."""
    first, second = np.empty((n, n), np.float32), np.empty((n, n), np.float32)
    return first, second, np.empty((4, 2)), np.zeros(6), np.empty(most)


@kernel
def find_heights(view, nodes, slopes, ranges, chosen, posts, window, step_px, most, heights, scores):
    """Height of best correlation on the vertical line of every node, within a range about its prior height.

    Parameters
    ----------
    nodes : (n, 3) m, x, y and the prior height. slopes : (n, 2). ranges : (n, 2) m, lowest and highest height.
    chosen : (n, m) photographs, the first being the reference, −1 for none.
    posts, window : posts a side and m between them. step_px : of the heights, posts of parallax. most : steps.
    heights, scores : (n,) out; NaN and −1 where there is none.
    """
    room, spot, along = make_room(posts, most), np.empty(5), np.zeros(2)
    for p in range(len(nodes)):
        heights[p], scores[p] = np.nan, -1.0
        if chosen[p, 1] < 0:
            continue
        spot[:3], spot[3:] = nodes[p], slopes[p]
        per_metre = parallax_per_metre(view, chosen[p], spot)
        if not per_metre > SMALLEST_ANGLE:
            continue
        step = step_px * window / per_metre
        count = min(int((ranges[p, 1] - ranges[p, 0]) / step) + 2, most)
        profile = room[4][:count]
        best = search(view, chosen[p], spot, along, ranges[p, 0], step, window, room, profile)
        if profile[best] > 0.0 and 0 < best < count - 1:
            heights[p] = ranges[p, 0] + (best + peak_offset(profile, best)) * step
            scores[p] = profile[best]


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
def match_shift(view, k, spot, e, window, bending, template, other, normal, room, found):
    """Displacement of photograph k's window against the template by least squares, in plan.

    g(u + D(u)) = r0 + r1·f(u), D = (a0 + a1·u + a2·v + a3·u² + a4·uv + a5·v²)·e + b0·e⊥, e the direction of parallax:
    what changes along u and v is slope and curvature of the ground, b0 the y-parallax. a3, a4, a5 are zero within
    their σ [D]: flat ground is matched as if it were plane, rough ground pays in σ for what is not known of it.

    Parameters
    ----------
    bending : m, σ of a3 and a5; that of a4 is 2/√3 of it, as on ground that is rough alike in all directions.
    template : (n + 2, n + 2) grey values of the reference, scaled to a deviation of 1. other : (n, n) room.
    normal : of the template.
    found : (6,) out, a0, b0 m, their variances and covariance m², correlation.

    Returns
    -------
    Whether it converged.
    """
    corner, shift, weights, right, bend, cofactor = room[0], room[1], room[2], room[3], room[6], room[7]
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
    scale = noise / (gain * gain)
    found[2], found[3], found[4] = scale * cofactor[0, 0], scale * cofactor[6, 6], scale * cofactor[0, 6]
    # correlation of the windows where they now lie, without what a further step would gain
    spread = squares - n * n * mean * mean
    template_mean, template_square = normal[7, 8] / (n * n), normal[8, 8]
    covariance = right[8] - n * n * mean * template_mean
    template_spread = template_square - n * n * template_mean**2
    found[5] = covariance / np.sqrt(spread * template_spread) if spread > 0.0 and template_spread > 0.0 else 0.0
    return True


@kernel
def intersect(view, chosen, shifts, used, spot, point, covariance, ideal, weight):
    """Least-squares intersection of the rays of the first and the used photographs; vᵀPv, or −1.

    The variance of a shift between two windows is half that of either one [C]: the first photograph's ray has the mean
    of the halves.

    Parameters
    ----------
    shifts : (m, 6) of `match_shift`, turned into x and y of the plan: dx, dy, their variances, covariance.
    point : (3,), covariance : (3, 3) out. ideal (m, 2), weight (m, 3) room.
    """
    m = len(chosen)
    for k in range(m):
        if not used[k]:
            continue
        x, y = spot[0] + shifts[k, 0], spot[1] + shifts[k, 1]
        ideal[k, 0], ideal[k, 1], _ = project(view[0], 0, chosen[k], x, y, spot[2])
        a0, a1, _, b0, b1, _ = partials(view[0], 0, chosen[k], x, y, spot[2])
        sxx, syy, sxy = 0.5 * shifts[k, 2], 0.5 * shifts[k, 3], 0.5 * shifts[k, 4]
        vx = a0 * a0 * sxx + 2.0 * a0 * a1 * sxy + a1 * a1 * syy
        vy = b0 * b0 * sxx + 2.0 * b0 * b1 * sxy + b1 * b1 * syy
        vxy = a0 * b0 * sxx + (a0 * b1 + a1 * b0) * sxy + a1 * b1 * syy
        determinant = vx * vy - vxy * vxy
        if not determinant > 0.0:
            return -1.0
        weight[k, 0], weight[k, 1], weight[k, 2] = vy / determinant, vx / determinant, -vxy / determinant
    right = np.empty(3)
    point[0], point[1], point[2] = spot[0], spot[1], spot[2]
    total = 0.0
    for _ in range(4):
        covariance[:] = 0.0
        right[:] = 0.0
        total = 0.0
        for k in range(m):
            if not used[k]:
                continue
            x, y, u3 = project(view[0], 0, chosen[k], point[0], point[1], point[2])
            if not u3 < 0.0:
                return -1.0
            gx, gy = ideal[k, 0] - x, ideal[k, 1] - y
            a = partials(view[0], 0, chosen[k], point[0], point[1], point[2])
            wx, wy, wxy = weight[k, 0], weight[k, 1], weight[k, 2]
            total += gx * gx * wx + 2.0 * gx * gy * wxy + gy * gy * wy
            for i in range(3):
                px, py = a[i] * wx + a[3 + i] * wxy, a[i] * wxy + a[3 + i] * wy
                right[i] += px * gx + py * gy
                for j in range(3):
                    covariance[i, j] += px * a[j] + py * a[3 + j]
        scale = covariance[0, 0] + covariance[1, 1] + covariance[2, 2]
        covariance /= scale
        if not invert(covariance, 3):
            return -1.0
        covariance /= scale
        for i in range(3):
            point[i] += covariance[i, 0] * right[0] + covariance[i, 1] * right[1] + covariance[i, 2] * right[2]
    return total


@kernel
def locus_check(view, chosen, one, spot, point_z, rays_px, window, step_px, distinct, room):
    """ACCEPTED, or whether matching along the ray of a photograph ends elsewhere, or as well elsewhere.

    Parameters
    ----------
    chosen : (2,) the pair. one : the photograph whose ray is followed. rays_px : posts searched to either side.
    distinct : share of the best correlation that another place may not reach.
    """
    centres, along = view[4], np.empty(2)
    along[0] = (spot[0] - centres[one, 0]) / (spot[2] - centres[one, 2])
    along[1] = (spot[1] - centres[one, 1]) / (spot[2] - centres[one, 2])
    per_metre = parallax_per_metre(view, chosen, spot)
    step = step_px * window / per_metre
    count = 2 * int(rays_px / step_px) + 1
    profile = room[4][:count]
    middle = count // 2
    best = search(view, chosen, spot, along, spot[2] - middle * step, step, window, room, profile)
    if abs(best - middle) * step_px > 1.0:
        return BACKWARD
    if second_peak(profile, best, int(2.0 / step_px) + 1) > distinct * profile[best]:
        return AMBIGUOUS
    return ACCEPTED


@kernel
def turned_shift(found, e, out):
    """A displacement along and across e, with its covariance, as x and y."""
    a, b, va, vb, c = found[0], found[1], found[2], found[3], found[4]
    out[0], out[1] = a * e[0] - b * e[1], a * e[1] + b * e[0]
    out[2] = e[0] * e[0] * va - 2.0 * e[0] * e[1] * c + e[1] * e[1] * vb
    out[3] = e[1] * e[1] * va + 2.0 * e[0] * e[1] * c + e[0] * e[0] * vb
    out[4] = e[0] * e[1] * (va - vb) + (e[0] * e[0] - e[1] * e[1]) * c
    out[5] = found[5]


@kernel
def measure_one(
    view, chosen, spot, curvature, window, limits, template, other, normal, room, shifts, used, point, covariance,
    numbers,
):  # fmt: skip
    """Shifts of all photographs against the first and their intersection; the status.

    curvature : 1/m, σ of the second derivatives of the ground. limits : correlation threshold, largest σ of a parallax
    in posts. numbers : (4,) out: vᵀPv, redundancy, lowest
    correlation of a ray, σ of the parallax in posts.
    """
    centres, a = view[4], chosen[0]
    corner, shift, weights = room[0], room[1], room[2]
    n, m = other.shape[0], len(chosen)
    shift[:] = 0.0
    used[:] = False
    shifts[:] = 0.0
    if not window_corners(view, a, spot, 0.5 * (n + 1) * window, shift, corner):
        return UNSEEN
    room[6][:] = 0.0
    sample_cubic(view, a, corner, room[6], template, weights)
    total, squares = 0.0, 0.0
    for q in range(n + 2):
        for p in range(n + 2):
            total += template[q, p]
            squares += template[q, p] ** 2
    mean = total / (n + 2) ** 2
    deviation = np.sqrt(max(squares / (n + 2) ** 2 - mean * mean, 0.0))
    if not deviation > 0.0:
        return POOR
    for q in range(n + 2):
        for p in range(n + 2):
            template[q, p] = (template[q, p] - mean) / deviation
    e, found, kept, seen = np.empty(2), np.empty(6), 0, 0
    best, sum_x, sum_y, sum_xy = 0.0, 0.0, 0.0, 0.0
    numbers[2], numbers[3] = 1.0, np.inf
    ax = (spot[0] - centres[a, 0]) / (centres[a, 2] - spot[2])
    ay = (spot[1] - centres[a, 1]) / (centres[a, 2] - spot[2])
    for k in range(1, m):
        b = chosen[k]
        if b < 0:
            continue
        e[0] = (spot[0] - centres[b, 0]) / (centres[b, 2] - spot[2]) - ax
        e[1] = (spot[1] - centres[b, 1]) / (centres[b, 2] - spot[2]) - ay
        length = np.hypot(e[0], e[1])
        if not length > SMALLEST_ANGLE:
            continue
        seen += 1
        e /= length
        bending = 0.5 * curvature * (0.5 * (n - 1) * window) ** 2 * length
        template_normals(template, n, e, window, normal)
        if not match_shift(view, b, spot, e, window, bending, template, other, normal, room, found):
            continue
        best = max(best, found[5])
        if found[5] < limits[0]:
            continue
        turned_shift(found, e, shifts[k])
        used[k] = True
        kept += 1
        numbers[2] = min(numbers[2], found[5])
        numbers[3] = min(numbers[3], np.sqrt(found[2]) / window)
        sum_x, sum_y, sum_xy = sum_x + shifts[k, 2], sum_y + shifts[k, 3], sum_xy + shifts[k, 4]
    if not seen:
        return UNSEEN
    if not kept:
        numbers[2] = best
        return POOR
    if not numbers[3] < limits[1]:
        return WEAK
    used[0] = True
    shifts[0, 2], shifts[0, 3], shifts[0, 4] = sum_x / kept, sum_y / kept, sum_xy / kept
    numbers[0] = intersect(view, chosen, shifts, used, spot, point, covariance, room[4], room[5])
    numbers[1] = 2.0 * (kept + 1) - 3.0
    return ACCEPTED if numbers[0] >= 0.0 else WEAK


@kernel
def measure_pickets(view, nodes, slopes, curvatures, ranges, chosen, aside, posts, window, settings, limits, out):
    """Pickets at nodes, or a little aside where matching fails.

    Parameters
    ----------
    nodes, slopes, ranges, chosen, posts, window : as in `find_heights`. curvatures : (n,) 1/m, σ of the second
        derivatives of the ground.
    aside : (t, 2) m, plan offsets tried one after the other, the first being 0, 0.
    settings : (4,) step of the heights in posts, most steps, posts searched along rays, distinctness.
    limits : (3,) correlation threshold, largest σ of a parallax in posts, correlation of the search below which
        nothing is measured.
    out : status (n,) int8, tries (n,) int16, point (n, 3), covariance (n, 3, 3), used (n, m) bool, numbers (n, 4),
        shifts (n, m, 6).
    """
    status, tries, points, covariances, used, numbers, shifts = out
    step_px, most, rays_px, distinct = settings
    room = make_room(posts, max(int(most), 2 * int(rays_px / step_px) + 1))
    m = chosen.shape[1]
    work = (
        np.empty((4, 2)), np.zeros(6), np.empty((2, 4)), np.empty(UNKNOWNS), np.empty((m, 2)), np.empty((m, 3)),
        np.empty(5), np.empty((UNKNOWNS, UNKNOWNS)),
    )  # fmt: skip
    template, other = np.empty((posts + 2, posts + 2)), np.empty((posts, posts))
    normal = np.empty((UNKNOWNS, UNKNOWNS))
    spot, along, pair = np.empty(5), np.zeros(2), np.empty(2, np.int64)
    for p in range(len(nodes)):
        status[p] = UNSEEN
        for t in range(len(aside)):
            tries[p] = t
            spot[3:] = slopes[p]
            spot[0], spot[1] = nodes[p, 0] + aside[t, 0], nodes[p, 1] + aside[t, 1]
            move = aside[t, 0] * slopes[p, 0] + aside[t, 1] * slopes[p, 1]
            spot[2] = nodes[p, 2] + move
            per_metre = parallax_per_metre(view, chosen[p], spot) if chosen[p, 1] >= 0 else 0.0
            if not per_metre > SMALLEST_ANGLE:
                break
            step = step_px * window / per_metre
            low = ranges[p, 0] + move
            count = min(int((ranges[p, 1] - ranges[p, 0]) / step) + 2, int(most))
            profile = room[4][:count]
            best = search(view, chosen[p], spot, along, low, step, window, room, profile)
            found = UNSEEN
            if profile[best] >= 0.0:
                found = POOR
                numbers[p, 2] = profile[best]
            if profile[best] >= limits[2]:
                found = AT_END
                if 0 < best < count - 1:
                    spot[2] = low + (best + peak_offset(profile, best)) * step
                    found = measure_one(
                        view, chosen[p], spot, curvatures[p], window, limits, template, other, normal, work,
                        shifts[p], used[p], points[p], covariances[p], numbers[p],
                    )  # fmt: skip
            if found == UNSEEN and t > 0:
                continue
            status[p] = found
            if found == ACCEPTED:
                best_k = 1
                for k in range(1, m):
                    if used[p, k] and (not used[p, best_k] or shifts[p, k, 5] > shifts[p, best_k, 5]):
                        best_k = k
                pair[0], pair[1] = chosen[p, 0], chosen[p, best_k]
                for side in range(2):
                    if status[p] == ACCEPTED:
                        status[p] = locus_check(
                            view, pair, pair[1 - side], spot, points[p, 2], rays_px, window, step_px, distinct, room
                        )  # fmt: skip
                break


@kernel
def choose_photographs(view, nodes, candidates, most, chosen):
    """The photographs that show every node, those most upright over it first; −1 where there are fewer.

    nodes : (n, 3). candidates : (k,) photographs. chosen : (n, ≤ most) out.
    """
    centres = view[4]
    distance = np.empty(chosen.shape[1])
    for p in range(len(nodes)):
        count = 0
        for c in candidates:
            if not is_seen(view, c, nodes[p, 0], nodes[p, 1], nodes[p, 2]):
                continue
            away = np.hypot(nodes[p, 0] - centres[c, 0], nodes[p, 1] - centres[c, 1])
            at = count
            while at > 0 and distance[at - 1] > away:
                at -= 1
            if at >= most:
                continue
            last = min(count, most - 1)
            for q in range(last, at, -1):
                chosen[p, q], distance[q] = chosen[p, q - 1], distance[q - 1]
            chosen[p, at], distance[at] = c, away
            count = min(count + 1, most)
        for q in range(count, chosen.shape[1]):
            chosen[p, q] = -1


@kernel
def choose_models(view, nodes, pairs, middles, chosen, number):
    """The model nearest to every node of those whose photographs both show it; the nearer photograph comes first.

    pairs : (k, 2) photographs. middles : (k, 2) m, middles of their bases. chosen : (n, 2) out. number : (n,) out.
    """
    centres = view[4]
    for p in range(len(nodes)):
        number[p], nearest = -1, np.inf
        for k in range(len(pairs)):
            away = np.hypot(nodes[p, 0] - middles[k, 0], nodes[p, 1] - middles[k, 1])
            if away < nearest and is_seen(view, pairs[k, 0], nodes[p, 0], nodes[p, 1], nodes[p, 2]) and is_seen(
                view, pairs[k, 1], nodes[p, 0], nodes[p, 1], nodes[p, 2]
            ):
                number[p], nearest = k, away
        chosen[p, 0] = chosen[p, 1] = -1
        if number[p] >= 0:
            a, b = pairs[number[p], 0], pairs[number[p], 1]
            to_a = np.hypot(nodes[p, 0] - centres[a, 0], nodes[p, 1] - centres[a, 1])
            to_b = np.hypot(nodes[p, 0] - centres[b, 0], nodes[p, 1] - centres[b, 1])
            chosen[p, 0], chosen[p, 1] = (a, b) if to_a <= to_b else (b, a)
