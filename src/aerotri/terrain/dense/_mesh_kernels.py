"""Parallaxes to heights of cells, and the heights of several pairs to one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel, leaf_kernel

MOST_PAIRS = 8
"""Pairs of a tile at most."""


class Rays(NamedTuple):
    """How a left epipolar image looks at the ground, and the grid that it is laid on.

    f : px. base : m. first : column, row of the first pixel. known : (rows, columns) px, parallaxes P that were taken
    out. centre : (3,), rotation : (3, 3) of the image. reach : m.
    to_grid : (3, 10) column and row of the grid, whole at centres of cells, and height, m: coefficients of 1, a, b, d,
        a², b², d², ab, ad, bd, where (a, b, d) is a place in units of `reach`.
    """

    f: float
    base: float
    first: tuple[int, int]
    known: np.ndarray
    centre: np.ndarray
    rotation: np.ndarray
    to_grid: np.ndarray
    reach: float


@kernel
def place_of_pixels(rays, value, out, per_pixel):
    """Column and row of the grid and height, m, (3, rows, columns) of pixels, and m of height a pixel of parallax is.

    value : (rows, columns) px beyond P, NaN unknown.
    """
    bend, whole = np.empty(value.shape[1], np.float32), np.empty(value.shape[1])
    for i in range(value.shape[0]):
        _whole_parallaxes(value[i], rays.known[i], bend, whole)
        _place_of_row(rays, i, bend, whole, out[0, i], out[1, i], out[2, i], per_pixel[i])


@leaf_kernel
def _whole_parallaxes(value, known, bend, whole):
    """Parallaxes of a row with those taken out, and by how much these change there from a column to the next.

    In two loops: the first one works several pixels at once, the second reads here and there.
    """
    last = len(value) - 1.001
    for j in range(len(value)):
        found = value[j]
        whole[j] = min(max(j - (found if found == found else 0.0), 0.0), last)
    for j in range(len(value)):
        at = whole[j]
        left = int(at)
        bend[j] = known[left + 1] - known[left]
        whole[j] = value[j] + known[left] + (at - left) * bend[j]


@leaf_kernel
def _place_of_row(rays, i, bend, whole, x, y, z, per_pixel):
    """Of the pixels of row i, without a branch: so several are computed at once.

    A ray is linear in the column p, so what it reaches at a depth t is t·(e + p·g) beyond the centre, and a coordinate
    is a polynomial in t and p.
    """
    r, share = rays.rotation, 1.0 / rays.reach
    up = -(rays.first[1] + i) / rays.f
    e = share * (r[0, 1] * up - r[0, 2]), share * (r[1, 1] * up - r[1, 2]), share * (r[2, 1] * up - r[2, 2])
    g = share * r[0, 0], share * r[1, 0], share * r[2, 0]
    start = share * rays.centre[0], share * rays.centre[1], share * rays.centre[2]
    x0, x1, x2, x3, x4, x5 = _along_row(rays.to_grid[0], start, e, g)
    y0, y1, y2, y3, y4, y5 = _along_row(rays.to_grid[1], start, e, g)
    z0, z1, z2, z3, z4, z5 = _along_row(rays.to_grid[2], start, e, g)
    down, aside = e[2] * rays.reach, g[2] * rays.reach
    scale, per = rays.f * rays.base, 1.0 / rays.f
    for j in range(len(whole)):
        inverse = 1.0 / whole[j]
        t = scale * inverse
        t = t if t > 0.0 else np.nan
        p = (rays.first[0] + j) * per
        x[j] = x0 + t * (x1 + x2 * p + t * (x3 + p * (x4 + p * x5)))
        y[j] = y0 + t * (y1 + y2 * p + t * (y3 + p * (y4 + p * y5)))
        z[j] = z0 + t * (z1 + z2 * p + t * (z3 + p * (z4 + p * z5)))
        per_pixel[j] = abs(t * (down + aside * p)) * (1.0 - bend[j]) * inverse


@leaf_kernel
def _along_row(m, start, e, g):
    """Of a quadratic m (10,) at start + t·(e + p·g): coefficients of 1, t, t·p, t², t²·p, t²·p²."""
    (a, b, d), (ea, eb, ed), (ga, gb, gd) = start, e, g
    by_a = m[1] + 2.0 * m[4] * a + m[7] * b + m[8] * d
    by_b = m[2] + 2.0 * m[5] * b + m[7] * a + m[9] * d
    by_d = m[3] + 2.0 * m[6] * d + m[8] * a + m[9] * b
    return (
        m[0] + m[1] * a + m[2] * b + m[3] * d + _square_part(m, a, b, d),
        by_a * ea + by_b * eb + by_d * ed,
        by_a * ga + by_b * gb + by_d * gd,
        _square_part(m, ea, eb, ed),
        _square_part(m, ea + ga, eb + gb, ed + gd) - _square_part(m, ea, eb, ed) - _square_part(m, ga, gb, gd),
        _square_part(m, ga, gb, gd),
    )


@leaf_kernel
def _square_part(m, a, b, d):
    return m[4] * a * a + m[5] * b * b + m[6] * d * d + m[7] * a * b + m[8] * a * d + m[9] * b * d


@kernel
def lay_mesh(place, sigma_px, per_pixel, value, jump, z, sigma):
    """Heights of the cells of a grid from the triangles between neighbouring pixels.

    place : (3, rows, columns) column and row of the grid, whole at centres of cells, and height, m.
    sigma_px, value : (rows, columns) px. per_pixel : m of height a px.
    jump : px, largest difference of parallax between neighbours of one surface.
    z, sigma : (rows, columns) m, of the grid, out; NaN before.
    """
    _lay_rows(place, sigma_px, per_pixel, value, jump, np.empty(value.shape[1] - 1, np.bool_), z, sigma)


@leaf_kernel
def _lay_rows(place, sigma_px, per_pixel, value, jump, reaches, z, sigma):
    for i in range(value.shape[0] - 1):
        _reach_cells(place[:, i], place[:, i + 1], value[i], value[i + 1], jump, reaches)
        for j in range(value.shape[1] - 1):
            if not reaches[j]:
                continue
            # four pixels are cut along a diagonal of one surface: where one of them is not known, or lies on another
            # surface, the other three are a triangle
            a, b = (i, j + 1), (i + 1, j)
            p, q = (i, j), (i + 1, j + 1)
            if not abs(value[a] - value[b]) <= jump:
                a, b, p, q = p, q, a, b
            d1, d2 = value[a], value[b]
            for corner in (p, q):
                d0 = value[corner]
                if abs(d0 - d1) <= jump and abs(d0 - d2) <= jump and abs(d1 - d2) <= jump:
                    _lay_triangle(corner, a, b, place, sigma_px, per_pixel, z, sigma)


@leaf_kernel
def _reach_cells(above, below, value_above, value_below, jump, reaches):
    """Whether the centre of a cell may lie between four pixels; of all between two rows, several at once."""
    for j in range(reaches.shape[0]):
        a, b, c, d = above[0, j], above[0, j + 1], below[0, j], below[0, j + 1]
        columns = np.floor(max(max(a, b), max(c, d))) >= np.ceil(min(min(a, b), min(c, d)))
        a, b, c, d = above[1, j], above[1, j + 1], below[1, j], below[1, j + 1]
        rows = np.floor(max(max(a, b), max(c, d))) >= np.ceil(min(min(a, b), min(c, d)))
        all_four = (value_above[j] + value_above[j + 1]) + (value_below[j] + value_below[j + 1])
        one = abs(value_above[j + 1] - value_below[j]) <= jump
        other = abs(value_above[j] - value_below[j + 1]) <= jump
        # where one corner is not known the triangle of the others is looked at
        reaches[j] = ((columns & rows) | (all_four != all_four)) & (one | other)


@leaf_kernel
def _lay_triangle(p, q, r, place, sigma_px, per_pixel, z, sigma):
    """Heights of the cells whose centres lie in a triangle; the highest surface of one pair counts."""
    ax, ay, bx, by = place[0, p[0], p[1]], place[1, p[0], p[1]], place[0, q[0], q[1]], place[1, q[0], q[1]]
    cx, cy = place[0, r[0], r[1]], place[1, r[0], r[1]]
    twice = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    first_column = max(int(np.ceil(min(ax, bx, cx))), 0)
    last_column = min(int(np.floor(max(ax, bx, cx))), z.shape[1] - 1)
    first_row = max(int(np.ceil(min(ay, by, cy))), 0)
    last_row = min(int(np.floor(max(ay, by, cy))), z.shape[0] - 1)
    if first_row > last_row or first_column > last_column or twice == 0.0:
        return
    za, zb, zc = place[2, p[0], p[1]], place[2, q[0], q[1]], place[2, r[0], r[1]]
    ma, mb, mc = per_pixel[p[0], p[1]], per_pixel[q[0], q[1]], per_pixel[r[0], r[1]]
    for i in range(first_row, last_row + 1):
        for j in range(first_column, last_column + 1):
            wb = ((j - ax) * (cy - ay) - (cx - ax) * (i - ay)) / twice
            wc = ((bx - ax) * (i - ay) - (j - ax) * (by - ay)) / twice
            wa = 1.0 - wb - wc
            if wa >= -1e-9 and wb >= -1e-9 and wc >= -1e-9:
                height = wa * za + wb * zb + wc * zc
                if not z[i, j] >= height:
                    z[i, j] = height
                    of = wa * ma * sigma_px[p[0], p[1]] + wb * mb * sigma_px[q[0], q[1]]
                    sigma[i, j] = of + wc * mc * sigma_px[r[0], r[1]]


@kernel
def fuse(heights, sigmas, correlation, used, agree, tolerance, z, sigma, members, misfit):
    """One height a cell of those of several pairs, of the largest group that agrees, and its σ.

    heights, sigmas : (pairs, rows, columns) m. correlation : (pairs, pairs) of their noise.
    used : (pairs,) bits of the photographs. agree : σ of a difference within which two heights agree.
    tolerance : m besides. z, sigma, misfit : (rows, columns) m out; misfit the weighted sum of squares of heights about
    their mean over pairs − 1, NaN of one pair. members : (rows, columns) out, bits of the photographs that measured.
    """
    pairs = len(heights)
    at = np.empty(pairs, np.int64)
    height, share = np.empty(pairs), np.empty(pairs)
    for i in range(heights.shape[1]):
        for j in range(heights.shape[2]):
            z[i, j] = sigma[i, j] = misfit[i, j] = np.nan
            members[i, j] = 0
            n = 0
            for p in range(pairs):
                if np.isfinite(heights[p, i, j]) and np.isfinite(sigmas[p, i, j]):
                    at[n], height[n], share[n] = p, heights[p, i, j], 1.0 / sigmas[p, i, j]
                    n += 1
            if n == 0:
                continue
            most, best = _largest_group(height[:n], share[:n], agree, tolerance)
            mean, variance, square, bits, inside = 0.0, 0.0, 0.0, 0, 0
            for p in range(n):
                if best >> p & 1:
                    mean += height[p] * share[p] ** 2
                    bits |= used[at[p]]
                    inside += 1
            mean /= most
            for p in range(n):
                if best >> p & 1:
                    square += ((height[p] - mean) * share[p]) ** 2
                    for r in range(n):
                        if best >> r & 1:
                            variance += correlation[at[p], at[r]] * share[p] * share[r]
            z[i, j], sigma[i, j] = mean, np.sqrt(max(variance, 0.0)) / most
            if inside > 1:
                misfit[i, j] = square / (inside - 1)
            members[i, j] = bits


@leaf_kernel
def _largest_group(height, share, agree, tolerance):
    """Sum of 1/σ² of the heights (n,) that agree with one of them, the largest there is, and their bits.

    share : (n,) 1/σ. Of groups as large the one about the highest counts.
    """
    most, highest, best = 0.0, -np.inf, 0
    for p in range(len(height)):
        total, members = 0.0, 0
        for r in range(len(height)):
            beyond = abs(height[p] - height[r]) - tolerance
            if beyond <= 0.0 or (beyond / agree) ** 2 <= share[p] ** -2 + share[r] ** -2:
                members |= 1 << r
                total += share[r] ** 2
        if total > most * 1.000001 or (total > most * 0.999999 and height[p] > highest):
            most, highest, best = total, height[p], members
    return most, best
