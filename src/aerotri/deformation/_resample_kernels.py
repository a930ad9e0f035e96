"""The corrected surface of a DEM, its cells at their true places, evaluated on the cells of the DEM: scalar kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel

FIXED_POINTS = 30
"""Steps to the place of a cell at most [C]: each shrinks by the slope of dXY, far below 1 where a model is smooth;
where they do not settle, at a seam, the surface goes on as a plane."""
N_SUMS = 14
"""Of `resample`: cells corrected, without data, outside the models, shifted beyond the halo; Σ and Σ² of dZ, smallest
and largest dZ; Σ of Z before and after; smallest and largest Z before, and after."""


class Corrected(NamedTuple):
    """A corrected window.

    z, dz : (h − 2·halo, w − 2·halo) corrected height and dZ, m. sums : (N_SUMS,) zero, ±∞ for extremes at first.
    """

    z: np.ndarray
    dz: np.ndarray
    sums: np.ndarray


@kernel
def slope_of_corrected(z, dz, i, j, down, right):
    """Change of the corrected height from a cell to the next one, taken from the other side where there is none."""
    here, rows, columns = z[i, j] - dz[i, j], z.shape[0], z.shape[1]
    if 0 <= i + down < rows and 0 <= j + right < columns:
        there = z[i + down, j + right] - dz[i + down, j + right]
        if there == there:
            return there - here
    if 0 <= i - down < rows and 0 <= j - right < columns:
        there = z[i - down, j - right] - dz[i - down, j - right]
        if there == there:
            return here - there
    return 0.0


@kernel
def resample(z, moves, halo, tolerance, corrected):
    """The corrected surface on the cells of a window.

    The cells of the DEM at their true places, X − dX, Y − dY, Z − dZ, make a surface of bilinear patches. It is met at
    a cell (X, Y) by the fixed point (X_w, Y_w) = (X, Y) + dXY(X_w, Y_w). Next to cells without data it goes on as a
    plane through the cell and its neighbours.

    Parameters
    ----------
    z : (h, w) with `halo` cells around the window. moves : `Moves` of the same cells.
    tolerance : (2,) columns and rows, of the fixed point.
    corrected : out.
    """
    du, dv, dz = moves.du, moves.dv, moves.dz
    out, out_dz, sums = corrected.z, corrected.dz, corrected.sums
    rows, columns = z.shape
    limit_u, limit_v = tolerance[0], tolerance[1]
    no_data = outside = escaped = 0
    sum_d = sum_d2 = sum_before = sum_after = 0.0
    least_d = least_before = least_after = np.inf
    most_d = most_before = most_after = -np.inf
    for i in range(out.shape[0]):
        r = i + halo
        for j in range(out.shape[1]):
            c = j + halo
            before, d = float(z[r, c]), float(dz[r, c])
            if d != d:
                out[i, j] = out_dz[i, j] = np.nan
                no_data += before != before
                outside += before == before
                continue
            a, b = float(du[r, c]), float(dv[r, c])
            after, found = 0.0, False
            for _ in range(FIXED_POINTS):
                u, v = c + a, r + b
                ku, kv = int(np.floor(u)), int(np.floor(v))
                if not (0 <= ku < columns - 1 and 0 <= kv < rows - 1):
                    escaped += 1
                    break
                s, t = u - ku, v - kv
                w00, w01, w10, w11 = (1.0 - t) * (1.0 - s), (1.0 - t) * s, t * (1.0 - s), t * s
                a_new = w00 * du[kv, ku] + w01 * du[kv, ku + 1] + w10 * du[kv + 1, ku] + w11 * du[kv + 1, ku + 1]
                b_new = w00 * dv[kv, ku] + w01 * dv[kv, ku + 1] + w10 * dv[kv + 1, ku] + w11 * dv[kv + 1, ku + 1]
                if abs(a_new - a) <= limit_u and abs(b_new - b) <= limit_v:
                    d = w00 * dz[kv, ku] + w01 * dz[kv, ku + 1] + w10 * dz[kv + 1, ku] + w11 * dz[kv + 1, ku + 1]
                    after = w00 * z[kv, ku] + w01 * z[kv, ku + 1] + w10 * z[kv + 1, ku] + w11 * z[kv + 1, ku + 1] - d
                    found = True
                    break
                if a_new != a_new:
                    break
                a, b = a_new, b_new
            if not found:
                after = before - d + du[r, c] * slope_of_corrected(z, dz, r, c, 0, 1)
                after += dv[r, c] * slope_of_corrected(z, dz, r, c, 1, 0)
            out[i, j], out_dz[i, j] = after, d
            sum_d += d
            sum_d2 += d * d
            sum_before += before
            sum_after += after
            least_d, most_d = min(least_d, d), max(most_d, d)
            least_before, most_before = min(least_before, before), max(most_before, before)
            least_after, most_after = min(least_after, after), max(most_after, after)
    sums[0] += out.size - no_data - outside
    sums[1] += no_data
    sums[2] += outside
    sums[3] += escaped
    sums[4] += sum_d
    sums[5] += sum_d2
    sums[6], sums[7] = min(sums[6], least_d), max(sums[7], most_d)
    sums[8] += sum_before
    sums[9] += sum_after
    sums[10], sums[11] = min(sums[10], least_before), max(sums[11], most_before)
    sums[12], sums[13] = min(sums[12], least_after), max(sums[13], most_after)
