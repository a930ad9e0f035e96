"""Parallaxes to heights of cells, and the heights of several pairs to one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel, leaf_kernel

MOST_PAIRS = 8
"""Pairs of a tile at most."""


class Rays(NamedTuple):
    """How a left epipolar image looks at the ground; q and the CRS as of `Place`.

    f : px. base : m. first : column, row of the first pixel. known : (rows, columns) px, parallaxes P that were taken
    out. centre : (3,). rotation : (3, 3). to_crs : (3, 10). reach : m.
    """

    f: float
    base: float
    first: tuple[int, int]
    known: np.ndarray
    centre: np.ndarray
    rotation: np.ndarray
    to_crs: np.ndarray
    reach: float


@kernel
def place_of_pixels(rays, value, out, per_pixel):
    """CRS less origin (3, rows, columns) m of pixels with parallaxes, and m of height a pixel of parallax is.

    value : (rows, columns) px beyond P, NaN unknown.
    """
    for i in range(value.shape[0]):
        _place_of_row(rays, i, value[i], rays.known[i], out[0, i], out[1, i], out[2, i], per_pixel[i])


@leaf_kernel
def _place_of_row(rays, i, value, known, x, y, z, per_pixel):
    """Of the pixels of row i, without a branch: so several are computed at once."""
    r, c, m = rays.rotation, rays.centre, rays.to_crs
    columns = value.shape[0]
    share = 1.0 / rays.reach
    up = -(rays.first[1] + i) / rays.f
    for j in range(columns):
        found = value[j]
        at = min(max(j - (found if found == found else 0.0), 0.0), columns - 1.001)
        left = int(at)
        by_column = known[left + 1] - known[left]
        parallax = found + known[left] + (at - left) * by_column
        depth = rays.f * rays.base / parallax
        depth = depth if depth > 0.0 else np.nan
        u0, u1, u2 = depth * ((rays.first[0] + j) / rays.f), depth * up, -depth
        down = r[2, 0] * u0 + r[2, 1] * u1 + r[2, 2] * u2
        a = (c[0] + r[0, 0] * u0 + r[0, 1] * u1 + r[0, 2] * u2) * share
        b = (c[1] + r[1, 0] * u0 + r[1, 1] * u1 + r[1, 2] * u2) * share
        d = (c[2] + down) * share
        aa, bb, dd, ab, ad, bd = a * a, b * b, d * d, a * b, a * d, b * d
        x[j] = (
            m[0, 0] + m[0, 1] * a + m[0, 2] * b + m[0, 3] * d + m[0, 4] * aa + m[0, 5] * bb + m[0, 6] * dd
            + m[0, 7] * ab + m[0, 8] * ad + m[0, 9] * bd
        )  # fmt: skip
        y[j] = (
            m[1, 0] + m[1, 1] * a + m[1, 2] * b + m[1, 3] * d + m[1, 4] * aa + m[1, 5] * bb + m[1, 6] * dd
            + m[1, 7] * ab + m[1, 8] * ad + m[1, 9] * bd
        )  # fmt: skip
        z[j] = (
            m[2, 0] + m[2, 1] * a + m[2, 2] * b + m[2, 3] * d + m[2, 4] * aa + m[2, 5] * bb + m[2, 6] * dd
            + m[2, 7] * ab + m[2, 8] * ad + m[2, 9] * bd
        )  # fmt: skip
        per_pixel[j] = abs(down) * (1.0 - by_column) / parallax


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
