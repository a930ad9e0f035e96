"""Shift of windows by least squares, of all pixels of an epipolar pair, from sums over windows."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel


@kernel
def solve_shifts(known, means, products, count, shift, across, variance, variance_across, correlation):
    """L = R + o + g·R − u·R_x + v·R_y over a window: u along the base, v across it, gain and offset.

    known : (rows, columns). means : (4, rows, columns) of D = L − R, R_x, R_y, R over the windows.
    products : (10, rows, columns) means of DD, D·R_x, D·R_y, D·R, xx, xy, xR, yy, yR, RR.
    count : pixels of a window. shift, across, their variances, px², correlation (of L and R) : out; NaN where the
    texture does not tell.
    """
    n = np.empty((3, 3))
    q = np.empty((3, 3))
    b = np.empty(3)
    for i in range(known.shape[0]):
        for j in range(known.shape[1]):
            shift[i, j] = across[i, j] = variance[i, j] = variance_across[i, j] = correlation[i, j] = np.nan
            if not known[i, j]:
                continue
            d, x, y, r = means[0, i, j], means[1, i, j], means[2, i, j], means[3, i, j]
            p = products[:, i, j]
            dd = p[0] - d * d
            b[0], b[1], b[2] = -(p[1] - d * x), p[2] - d * y, p[3] - d * r
            n[0, 0], n[1, 1], n[2, 2] = p[4] - x * x, p[7] - y * y, p[9] - r * r
            n[0, 1] = n[1, 0] = -(p[5] - x * y)
            n[0, 2] = n[2, 0] = -(p[6] - x * r)
            n[1, 2] = n[2, 1] = p[8] - y * r
            if not (n[0, 0] > 1e-3 and n[1, 1] > 1e-3 and n[2, 2] > 1e-2):
                continue
            q[0, 0] = n[1, 1] * n[2, 2] - n[1, 2] * n[1, 2]
            q[0, 1] = n[0, 2] * n[1, 2] - n[0, 1] * n[2, 2]
            q[0, 2] = n[0, 1] * n[1, 2] - n[0, 2] * n[1, 1]
            q[1, 1] = n[0, 0] * n[2, 2] - n[0, 2] * n[0, 2]
            q[1, 2] = n[0, 1] * n[0, 2] - n[0, 0] * n[1, 2]
            q[2, 2] = n[0, 0] * n[1, 1] - n[0, 1] * n[0, 1]
            determinant = n[0, 0] * q[0, 0] + n[0, 1] * q[0, 1] + n[0, 2] * q[0, 2]
            if not determinant > 1e-4 * n[0, 0] * n[1, 1] * n[2, 2]:
                continue
            u = (q[0, 0] * b[0] + q[0, 1] * b[1] + q[0, 2] * b[2]) / determinant
            v = (q[0, 1] * b[0] + q[1, 1] * b[1] + q[1, 2] * b[2]) / determinant
            g = (q[0, 2] * b[0] + q[1, 2] * b[1] + q[2, 2] * b[2]) / determinant
            left = max(dd - u * b[0] - v * b[1] - g * b[2], 0.0)
            shift[i, j], across[i, j] = u, v
            noise = left / (count - 4.0)
            variance[i, j], variance_across[i, j] = noise * q[0, 0] / determinant, noise * q[1, 1] / determinant
            # L = D + R: its variance and what it shares with R, before the shift
            own = dd + 2.0 * b[2] + n[2, 2]
            correlation[i, j] = (b[2] + n[2, 2]) / np.sqrt(max(own * n[2, 2], 1e-12))
