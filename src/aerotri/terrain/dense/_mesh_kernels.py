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
    """CRS less origin (rows, columns, 3) m of pixels with parallaxes, and m of height a pixel of parallax is.

    value : (rows, columns) px beyond P, NaN unknown.
    """
    rows, columns = value.shape
    t = np.empty(10)
    q = np.empty(3)
    r = rays.rotation
    for i in range(rows):
        for j in range(columns):
            if not np.isfinite(value[i, j]):
                out[i, j, 0] = out[i, j, 1] = out[i, j, 2] = per_pixel[i, j] = np.nan
                continue
            column, row = rays.first[0] + j, rays.first[1] + i
            at = min(max(j - value[i, j], 0.0), columns - 1.001)
            left = int(at)
            by_column = rays.known[i, left + 1] - rays.known[i, left]
            parallax = value[i, j] + rays.known[i, left] + (at - left) * by_column
            depth = rays.f * rays.base / parallax
            if not depth > 0.0:
                out[i, j, 0] = out[i, j, 1] = out[i, j, 2] = per_pixel[i, j] = np.nan
                continue
            u0, u1, u2 = depth * column / rays.f, -depth * row / rays.f, -depth
            for a in range(3):
                q[a] = (rays.centre[a] + r[a, 0] * u0 + r[a, 1] * u1 + r[a, 2] * u2) / rays.reach
            t[0], t[1], t[2], t[3] = 1.0, q[0], q[1], q[2]
            t[4], t[5], t[6] = q[0] * q[0], q[1] * q[1], q[2] * q[2]
            t[7], t[8], t[9] = q[0] * q[1], q[0] * q[2], q[1] * q[2]
            for a in range(3):
                total = 0.0
                for b in range(10):
                    total += rays.to_crs[a, b] * t[b]
                out[i, j, a] = total
            down = r[2, 0] * u0 + r[2, 1] * u1 + r[2, 2] * u2
            per_pixel[i, j] = abs(down) * (1.0 - by_column) / parallax


@leaf_kernel
def _lay_triangle(a, b, c, sa, sb, sc, grid, z, sigma, bend, ba, bb, bc):
    """Heights of the cells whose centres lie in a triangle; the highest surface of one pair counts."""
    left, top, cell = grid
    ax, ay = (a[0] - left) / cell - 0.5, (top - a[1]) / cell - 0.5
    bx, by = (b[0] - left) / cell - 0.5, (top - b[1]) / cell - 0.5
    cx, cy = (c[0] - left) / cell - 0.5, (top - c[1]) / cell - 0.5
    twice = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    if twice == 0.0:
        return
    first_column = max(int(np.ceil(min(ax, bx, cx))), 0)
    last_column = min(int(np.floor(max(ax, bx, cx))), z.shape[1] - 1)
    first_row = max(int(np.ceil(min(ay, by, cy))), 0)
    last_row = min(int(np.floor(max(ay, by, cy))), z.shape[0] - 1)
    for i in range(first_row, last_row + 1):
        for j in range(first_column, last_column + 1):
            wb = ((j - ax) * (cy - ay) - (cx - ax) * (i - ay)) / twice
            wc = ((bx - ax) * (i - ay) - (j - ax) * (by - ay)) / twice
            wa = 1.0 - wb - wc
            if wa >= -1e-9 and wb >= -1e-9 and wc >= -1e-9:
                height = wa * a[2] + wb * b[2] + wc * c[2]
                if not z[i, j] >= height:
                    z[i, j] = height
                    sigma[i, j] = wa * sa + wb * sb + wc * sc
                    bend[i, j] = wa * ba + wb * bb + wc * bc


@kernel
def lay_mesh(xyz, sigma_px, bend_px, per_pixel, value, jump, grid, z, sigma, bend):
    """Heights of the cells of a grid from the triangles between neighbouring pixels.

    xyz : (rows, columns, 3) m. sigma_px, bend_px, value : (rows, columns) px. per_pixel : m of height a px.
    jump : px, largest difference of parallax between neighbours of one surface. grid : left, top, cell, m.
    z, sigma, bend : (rows, columns) m, of the grid, out; NaN before.
    """
    for i in range(value.shape[0] - 1):
        for j in range(value.shape[1] - 1):
            for half in range(2):
                i0, j0 = (i, j) if half == 0 else (i + 1, j + 1)
                i1, j1, i2, j2 = i, j + 1, i + 1, j
                d0, d1, d2 = value[i0, j0], value[i1, j1], value[i2, j2]
                if not (abs(d0 - d1) <= jump and abs(d0 - d2) <= jump and abs(d1 - d2) <= jump):
                    continue
                m0, m1, m2 = per_pixel[i0, j0], per_pixel[i1, j1], per_pixel[i2, j2]
                _lay_triangle(
                    xyz[i0, j0], xyz[i1, j1], xyz[i2, j2],
                    m0 * sigma_px[i0, j0], m1 * sigma_px[i1, j1], m2 * sigma_px[i2, j2], grid, z, sigma, bend,
                    m0 * bend_px[i0, j0], m1 * bend_px[i1, j1], m2 * bend_px[i2, j2],
                )  # fmt: skip


@kernel
def fuse(heights, sigmas, correlation, used, agree, tolerance, z, sigma, members, misfit):
    """One height a cell of those of several pairs, of the largest group that agrees, and its σ.

    heights, sigmas : (pairs, rows, columns) m. correlation : (pairs, pairs) of their noise.
    used : (pairs,) bits of the photographs. agree : σ of a difference within which two heights agree.
    tolerance : m besides. z, sigma, misfit : (rows, columns) m out; misfit the weighted sum of squares of heights about
    their mean over pairs − 1, NaN of one pair. members : (rows, columns) out, bits of the photographs that measured.
    """
    pairs = len(heights)
    member = np.empty(pairs, np.bool_)
    best = np.empty(pairs, np.bool_)
    for i in range(heights.shape[1]):
        for j in range(heights.shape[2]):
            z[i, j] = sigma[i, j] = misfit[i, j] = np.nan
            members[i, j] = 0
            most, highest = 0.0, -np.inf
            for p in range(pairs):
                hp = heights[p, i, j]
                if not np.isfinite(hp):
                    continue
                total = 0.0
                for r in range(pairs):
                    hr = heights[r, i, j]
                    member[r] = False
                    if np.isfinite(hr):
                        bound = agree * np.hypot(sigmas[p, i, j], sigmas[r, i, j]) + tolerance
                        if abs(hp - hr) <= bound:
                            member[r] = True
                            total += 1.0 / sigmas[r, i, j] ** 2
                if total > most * 1.000001 or (total > most * 0.999999 and hp > highest):
                    most, highest = total, hp
                    best[:] = member
            if most <= 0.0:
                continue
            mean, bits, inside = 0.0, 0, 0
            for p in range(pairs):
                if best[p]:
                    mean += heights[p, i, j] / sigmas[p, i, j] ** 2 / most
                    bits |= used[p]
                    inside += 1
            variance, square = 0.0, 0.0
            for p in range(pairs):
                if best[p]:
                    square += ((heights[p, i, j] - mean) / sigmas[p, i, j]) ** 2
                    for r in range(pairs):
                        if best[r]:
                            variance += correlation[p, r] / (sigmas[p, i, j] * sigmas[r, i, j] * most * most)
            z[i, j], sigma[i, j] = mean, np.sqrt(max(variance, 0.0))
            if inside > 1:
                misfit[i, j] = square / (inside - 1)
            members[i, j] = bits
