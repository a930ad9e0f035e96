"""Cubic convolution that keeps straight lines where they are.

OpenCV's cubic (a = −0.75) moves a ramp by up to 0.047 px and knows 32 places between two pixels only, which is more
than matching may lose. Keys' (1981) a = −0.5 is exact for polynomials of second order.
"""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel, leaf_kernel


@leaf_kernel
def _weights(t):
    """Of the four pixels around, the place being t beyond the second."""
    s = 1.0 - t
    return (
        -0.5 * t * s * s,
        1.0 + t * t * (1.5 * t - 2.5),
        1.0 + s * s * (1.5 * s - 2.5),
        -0.5 * s * t * t,
    )


@kernel
def resample(pixels, x, y, known, out):
    """Grey values at places, column x and row y of pixel centres; at the edge its pixels go on. Unknown ones are 0.

    pixels : (·, ·). x, y, known, out : (rows, columns); out of float32.
    """
    last_row, last_column = pixels.shape[0] - 1, pixels.shape[1] - 1
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
            if not known[i, j]:
                continue
            column, row = int(np.floor(x[i, j])), int(np.floor(y[i, j]))
            a, b, c, d = _weights(x[i, j] - column)
            across = _weights(y[i, j] - row)
            total = 0.0
            if 1 <= column < last_column - 1 and 1 <= row < last_row - 1:
                for k in range(4):
                    line = pixels[row - 1 + k]
                    value = a * line[column - 1] + b * line[column] + c * line[column + 1] + d * line[column + 2]
                    total += across[k] * value
            else:
                for k in range(4):
                    line = pixels[min(max(row - 1 + k, 0), last_row)]
                    value = (
                        a * line[min(max(column - 1, 0), last_column)]
                        + b * line[min(max(column, 0), last_column)]
                        + c * line[min(max(column + 1, 0), last_column)]
                        + d * line[min(max(column + 2, 0), last_column)]
                    )
                    total += across[k] * value
            out[i, j] = total


@kernel
def within(x, y, low, high, known):
    """Whether places (column x, row y) lie between (column, row) low and high: (rows, columns) out."""
    for i in range(known.shape[0]):
        for j in range(known.shape[1]):
            a, b = x[i, j], y[i, j]
            known[i, j] = a >= low[0] and a <= high[0] and b >= low[1] and b <= high[1]


@kernel
def align(right, value, across, known, left, out):
    """The right epipolar image where the left one's pixels have their parallaxes; the left one's where not known.

    value : (rows, columns) px, left column − right column. across : (6,) px, right row − left row: coefficients of 1,
    x, y, x², xy, y², x and y from −1 to 1 over columns and rows. out : float32.
    """
    rows, columns = out.shape
    for i in range(rows):
        y = 2.0 * i / (rows - 1.0) - 1.0
        level, slope, bend = across[0] + y * (across[2] + y * across[5]), across[1] + y * across[4], across[3]
        for j in range(columns):
            out[i, j] = left[i, j]
            if not known[i, j]:
                continue
            place = j - value[i, j]
            column = int(np.floor(place))
            if not (1 <= column < columns - 2):
                continue
            x = 2.0 * j / (columns - 1.0) - 1.0
            down = i + level + x * (slope + x * bend)
            row = int(np.floor(down))
            a, b, c, d = _weights(place - column)
            vertical = _weights(down - row)
            total = 0.0
            for k in range(4):
                line = right[min(max(row - 1 + k, 0), rows - 1)]
                total += vertical[k] * (
                    a * line[column - 1] + b * line[column] + c * line[column + 1] + d * line[column + 2]
                )
            out[i, j] = total
