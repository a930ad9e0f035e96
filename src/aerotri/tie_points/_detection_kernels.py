"""Loops over the pixels of a scale space: extrema of differences of Gaussians, and directions of gradients."""

from __future__ import annotations

import math

import numpy as np

from aerotri.compiled import kernel, leaf_kernel

BINS = 36
"""Of the histogram of directions [L]."""
STEPS = 5
"""Of the search for the extremum between the pixels [L]."""


@leaf_kernel
def _difference(g, layer, i, j):
    return g[layer + 1, i, j] - g[layer, i, j]


@leaf_kernel
def _is_extremum(g, layer, i, j):
    """Whether a difference of Gaussians is the largest, or the smallest, of the 27 around."""
    value = _difference(g, layer, i, j)
    sign = 1.0 if value > 0.0 else -1.0
    for k in (layer, layer - 1, layer + 1):
        for a in range(i - 1, i + 2):
            for b in range(j - 1, j + 2):
                if sign * _difference(g, k, a, b) > sign * value:
                    return False
    return True


@leaf_kernel
def _refined(g, layer, i, j, edge, border, out):
    """The extremum of the parabola through the 27 values (Brown and Lowe 2002): column, row, layer, value to `out`.

    False where it lies outside or on an edge.
    """
    x = y = s = 0.0
    for step in range(STEPS):
        v = _difference(g, layer, i, j)
        dx = 0.5 * (_difference(g, layer, i, j + 1) - _difference(g, layer, i, j - 1))
        dy = 0.5 * (_difference(g, layer, i + 1, j) - _difference(g, layer, i - 1, j))
        ds = 0.5 * (_difference(g, layer + 1, i, j) - _difference(g, layer - 1, i, j))
        xx = _difference(g, layer, i, j + 1) + _difference(g, layer, i, j - 1) - 2.0 * v
        yy = _difference(g, layer, i + 1, j) + _difference(g, layer, i - 1, j) - 2.0 * v
        ss = _difference(g, layer + 1, i, j) + _difference(g, layer - 1, i, j) - 2.0 * v
        xy = 0.25 * (
            _difference(g, layer, i + 1, j + 1) - _difference(g, layer, i + 1, j - 1)
            - _difference(g, layer, i - 1, j + 1) + _difference(g, layer, i - 1, j - 1)
        )  # fmt: skip
        xs = 0.25 * (
            _difference(g, layer + 1, i, j + 1) - _difference(g, layer + 1, i, j - 1)
            - _difference(g, layer - 1, i, j + 1) + _difference(g, layer - 1, i, j - 1)
        )  # fmt: skip
        ys = 0.25 * (
            _difference(g, layer + 1, i + 1, j) - _difference(g, layer + 1, i - 1, j)
            - _difference(g, layer - 1, i + 1, j) + _difference(g, layer - 1, i - 1, j)
        )  # fmt: skip
        # the inverse of the symmetric matrix of second derivatives, by cofactors
        a, b, c = yy * ss - ys * ys, ys * xs - xy * ss, xy * ys - yy * xs
        determinant = xx * a + xy * b + xs * c
        if determinant == 0.0:
            return False
        x = -(a * dx + b * dy + c * ds) / determinant
        y = -(b * dx + (xx * ss - xs * xs) * dy + (xy * xs - xx * ys) * ds) / determinant
        s = -(c * dx + (xy * xs - xx * ys) * dy + (xx * yy - xy * xy) * ds) / determinant
        if abs(x) < 0.5 and abs(y) < 0.5 and abs(s) < 0.5:
            out[0], out[1], out[2] = j + x, i + y, layer + s
            out[3] = v + 0.5 * (dx * x + dy * y + ds * s)
            return xx * yy - xy * xy > 0.0 and (xx + yy) ** 2 * edge < (edge + 1.0) ** 2 * (xx * yy - xy * xy)
        if step == STEPS - 1 or not max(abs(x), abs(y), abs(s)) < 1e6:
            return False
        j, i, layer = j + round(x), i + round(y), layer + round(s)
        if layer < 1 or layer > g.shape[0] - 3:
            return False
        if i < border or j < border or i >= g.shape[1] - border or j >= g.shape[2] - border:
            return False
    return False


@kernel
def extrema(g, contrast, edge, border, found):
    """Extrema of one octave: rows (column, row, layer, value) of `found`; how many there are, also beyond its length.

    g (layers + 3, rows, columns) Gaussians; contrast the least absolute value; edge the largest ratio of curvatures.
    """
    count = 0
    one = np.empty(4)
    # what lies between the pixels is somewhat larger than what lies on them
    least = 0.8 * contrast
    for layer in range(1, g.shape[0] - 2):
        for i in range(border, g.shape[1] - border):
            for j in range(border, g.shape[2] - border):
                if abs(g[layer + 1, i, j] - g[layer, i, j]) < least or not _is_extremum(g, layer, i, j):
                    continue
                if _refined(g, layer, i, j, edge, border, one) and abs(one[3]) >= contrast:
                    if count < found.shape[0]:
                        found[count] = one
                    count += 1
    return count


@leaf_kernel
def _turn(x, y):
    """Direction of (x, y), 0 … 1 of a turn, to 2e-5: for a histogram of directions."""
    a, b = abs(x), abs(y)
    small, large = min(a, b), max(a, b)
    t = small / (large + np.float32(1e-20))
    # Abramowitz and Stegun 4.4.49, in turns
    u = t * t
    found = t * (0.15914 + u * (-0.05256 + u * (0.02866 - 0.01025 * u)))
    if b > a:
        found = 0.25 - found
    if x < 0.0:
        found = 0.5 - found
    return 1.0 - found if y < 0.0 else found


@kernel
def directions(g, column, row, layer, sigma, angle):
    """Main direction of the gradients around keypoints of one octave, degrees as OpenCV counts them, to `angle`.

    column, row, layer, sigma (k,), in pixels of the octave.
    """
    histogram, smooth = np.empty(BINS), np.empty(BINS)
    for k in range(len(column)):
        j0, i0, image = int(column[k] + 0.5), int(row[k] + 0.5), g[layer[k]]
        spread = 1.5 * sigma[k]
        radius = int(3.0 * spread + 0.5)
        weight = np.exp(-(np.arange(-radius, radius + 1) ** 2) / (2.0 * spread**2))
        histogram[:] = 0.0
        for i in range(max(i0 - radius, 1), min(i0 + radius, image.shape[0] - 2) + 1):
            for j in range(max(j0 - radius, 1), min(j0 + radius, image.shape[1] - 2) + 1):
                dx, dy = image[i, j + 1] - image[i, j - 1], image[i - 1, j] - image[i + 1, j]
                size = math.sqrt(dx * dx + dy * dy) * weight[i - i0 + radius] * weight[j - j0 + radius]
                histogram[int(_turn(dx, dy) * BINS + 0.5) % BINS] += size
        for n in range(BINS):
            near = histogram[(n - 1) % BINS] + histogram[(n + 1) % BINS]
            far = histogram[(n - 2) % BINS] + histogram[(n + 2) % BINS]
            smooth[n] = (6.0 * histogram[n] + 4.0 * near + far) / 16.0
        best = np.argmax(smooth)
        before, after = smooth[(best - 1) % BINS], smooth[(best + 1) % BINS]
        bend = before - 2.0 * smooth[best] + after
        place = best + (0.5 * (before - after) / bend if bend < 0.0 else 0.0)
        angle[k] = (360.0 - 360.0 / BINS * place) % 360.0
