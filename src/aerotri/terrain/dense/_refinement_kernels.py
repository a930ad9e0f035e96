"""Shift of windows by least squares, of all pixels of an epipolar pair.

Sums over windows run along: a row is added and the one that leaves the window taken off. Columns are worked in parts
whose sums stay in the processor's nearest memory; that is three times as fast as OpenCV's boxFilter of every product.
"""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel, leaf_kernel

HALF = 3
"""Pixels of a window on either side of its middle."""
PART = 512
"""Columns that are worked together; what is kept of them is 180 kB, and fewer columns are more ends of loops."""
SPARE = 8
"""Columns more that are kept, of windows that reach beyond the part; 64 bytes, so that rows begin alike in memory."""
KEPT_ROWS = 8
"""Rows kept, one more than a window has."""
SIGNALS, SUMS = 4, 14
"""D = L − R, the gradients X and Y of both images' mean, R; their sums, then those of DD, DX, DY, DR, XX, XY, XR, YY,
YR, RR."""


@kernel
def shift_windows(left, right, level, known, shift, across, variance, variance_across, correlation):
    """L = R + o + g·R − u·X + v·Y over a window: u along the base, v across it, gain and offset.

    left, right : (rows, columns) float32. level : float32, a mean grey value, taken off R. known : (rows, columns).
    shift, across, their variances, px², correlation (of L and R) : out, float32; NaN where not known, where the texture
    does not tell and at the edge of the images.
    """
    rows, columns = left.shape
    side = 2 * HALF + 1
    kept = np.zeros((KEPT_ROWS, SIGNALS, PART + SPARE), np.float32)
    sums, means = np.zeros((SUMS, PART + SPARE)), np.zeros((SUMS, PART + SPARE))
    for out in (shift, across, variance, variance_across, correlation):
        out[:] = np.nan
    above, below, start, end = _known_part(known)
    above, below = max(above - HALF, 1), min(below + HALF, rows - 1)
    end = min(end, columns - HALF - 1)
    for first in range(max(start, HALF + 1), end, PART):
        n = min(PART, end - first)
        part = slice(first, first + n)
        sums[:] = 0.0
        kept[:] = 0.0
        for i in range(above, below):
            new, old = kept[i % KEPT_ROWS], kept[(i - side) % KEPT_ROWS]
            _signals(left, right, level, i, first - HALF, n + 2 * HALF, new)
            _move_sums(new, old, n + 2 * HALF, sums)
            if i < above + side - 1:
                continue
            _means(sums, n, means)
            at = i - HALF
            _solve(
                known[at, part], means, shift[at, part], across[at, part], variance[at, part],
                variance_across[at, part], correlation[at, part],
            )  # fmt: skip


@leaf_kernel
def _known_part(known):
    """First row and the one after the last that have a pixel that is known, and first and last columns."""
    rows, columns = known.shape
    above, below, start, end = rows, 0, columns, 0
    for i in range(rows):
        first = 0
        while first < columns and not known[i, first]:
            first += 1
        if first == columns:
            continue
        last = columns - 1
        while not known[i, last]:
            last -= 1
        above, below = min(above, i), i + 1
        start, end = min(start, first), max(end, last + 1)
    return above, below, start, end


@leaf_kernel
def _signals(left, right, level, i, first, n, out):
    """Of n pixels of row i; gradients by Scharr's weights.

    Rows are cut out first: a column that may be negative, as far as the compiler knows, keeps it from working several
    pixels at once.
    """
    near, middle = np.float32(3.0 / 64.0), np.float32(10.0 / 64.0)
    part = slice(first - 1, first + n + 1)
    l0, l1, l2 = left[i - 1, part], left[i, part], left[i + 1, part]
    r0, r1, r2 = right[i - 1, part], right[i, part], right[i + 1, part]
    for j in range(n):
        out[0, j] = l1[j + 1] - r1[j + 1]
        out[3, j] = r1[j + 1] - level
    for j in range(n):
        a, b, d, e = l0[j] + r0[j], l0[j + 2] + r0[j + 2], l2[j] + r2[j], l2[j + 2] + r2[j + 2]
        x = (l1[j + 2] + r1[j + 2]) - (l1[j] + r1[j])
        y = (l2[j + 1] + r2[j + 1]) - (l0[j + 1] + r0[j + 1])
        out[1, j] = near * ((b - a) + (e - d)) + middle * x
        out[2, j] = near * ((d - a) + (e - b)) + middle * y


@leaf_kernel
def _move_sums(new, old, n, sums):
    """Sums over the rows of a window, one row on."""
    for k in range(SIGNALS):
        total, a, b = sums[k], new[k], old[k]
        for j in range(n):
            total[j] = total[j] + a[j] - b[j]
    k = SIGNALS
    for one in range(SIGNALS):
        for other in range(one, SIGNALS):
            total, a, b, c, d = sums[k], new[one], new[other], old[one], old[other]
            for j in range(n):
                total[j] = total[j] + a[j] * b[j] - c[j] * d[j]
            k += 1


@leaf_kernel
def _means(sums, n, out):
    """Over whole windows: sums of two columns first, which windows share."""
    share = 1.0 / (2 * HALF + 1) ** 2
    for k in range(SUMS):
        s, to = sums[k], out[k]
        for j in range(n + 4):
            to[j] = s[j] + s[j + 1]
        for j in range(n):
            to[j] = share * ((to[j] + to[j + 2]) + (to[j + 4] + s[j + 6]))


@leaf_kernel
def _solve(known, means, shift, across, variance, variance_across, correlation):
    """Of the windows of a part of a row, without a branch: so several pixels are solved at once."""
    nothing = np.float32(np.nan)
    count = (2 * HALF + 1) ** 2
    for j in range(known.shape[0]):
        d, x, y, r = means[0, j], means[1, j], means[2, j], means[3, j]
        dd = means[4, j] - d * d
        b0, b1, b2 = d * x - means[5, j], means[6, j] - d * y, means[7, j] - d * r
        n00, n11, n22 = means[8, j] - x * x, means[11, j] - y * y, means[13, j] - r * r
        n01, n02, n12 = x * y - means[9, j], x * r - means[10, j], means[12, j] - y * r
        q00, q11, q22 = n11 * n22 - n12 * n12, n00 * n22 - n02 * n02, n00 * n11 - n01 * n01
        q01, q02, q12 = n02 * n12 - n01 * n22, n01 * n12 - n02 * n11, n01 * n02 - n00 * n12
        determinant = n00 * q00 + n01 * q01 + n02 * q02
        told = (n00 > 1e-3) & (n11 > 1e-3) & (n22 > 1e-2) & (determinant > 1e-4 * n00 * n11 * n22) & known[j]
        share = 1.0 / (determinant if told else 1.0)
        u = (q00 * b0 + q01 * b1 + q02 * b2) * share
        v = (q01 * b0 + q11 * b1 + q12 * b2) * share
        g = (q02 * b0 + q12 * b1 + q22 * b2) * share
        noise = max(dd - u * b0 - v * b1 - g * b2, 0.0) * share / (count - 4.0)
        # L = D + R: its variance and what it shares with R, before the shift
        own = dd + 2.0 * b2 + n22
        alike = (b2 + n22) / np.sqrt(max(own * n22, 1e-12))
        shift[j] = u if told else nothing
        across[j] = v if told else nothing
        variance[j] = noise * q00 if told else nothing
        variance_across[j] = noise * q11 if told else nothing
        correlation[j] = alike if told else nothing


@kernel
def keep_seen(found, lowest, left_known, right_known, out):
    """Parallaxes that OpenCV gives in sixteenths as px; NaN where there is none or a pixel of the two is not known.

    found : (rows, columns) int16. lowest : px, the least that was tried. out : float32.
    """
    for i in range(found.shape[0]):
        for j in range(found.shape[1]):
            value = found[i, j] / 16.0
            at = int(np.rint(j - value))
            seen = value >= lowest and left_known[i, j] and 0 <= at < found.shape[1] and right_known[i, at]
            out[i, j] = value if seen else np.nan
