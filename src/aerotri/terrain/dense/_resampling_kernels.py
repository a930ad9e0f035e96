"""Images between their pixels: cubic B-splines, and cubic convolution across the base.

OpenCV's cubic (a = −0.75) moves a ramp by up to 0.047 px and knows 32 places between two pixels only, which is more
than matching may lose. Keys' (1981) a = −0.5 is exact for polynomials of second order, cubic splines for those of third
order (see `spline`).
"""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel, leaf_kernel

ONE, HALF, SQUARE, CUBE, SIXTH, MOST = (np.float32(number) for number in (1.0, 0.5, 2.5, 1.5, 1.0 / 6.0, 2.0 / 3.0))
"""Numbers of the weights, in single precision: places of pixels are known no better."""


@leaf_kernel
def _weights(t):
    """Of the four pixels around, the place being t (float32) beyond the second."""
    s = ONE - t
    return (
        -HALF * t * s * s,
        ONE + t * t * (CUBE * t - SQUARE),
        ONE + s * s * (CUBE * s - SQUARE),
        -HALF * s * t * t,
    )


@leaf_kernel
def _spline_weights(t):
    """Of the coefficients of the four pixels around, the place being t (float32) beyond the second."""
    s = ONE - t
    return SIXTH * s * s * s, MOST - t * t * (ONE - HALF * t), MOST - s * s * (ONE - HALF * s), SIXTH * t * t * t


@kernel
def resample(pixels, first, x, y, known, out):
    """Grey values at places, column x and row y of pixel centres; at the edge its pixels go on. Unknown ones are 0.

    pixels : (·, ·) float32, coefficients of a spline surface from column and row `first` of a photograph on, two more
    about all places. x, y, known, out : (rows, columns); x, y and out of float32.
    """
    last_row, last_column = pixels.shape[0] - 1, pixels.shape[1] - 1
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
            if not known[i, j]:
                continue
            left, above = np.floor(x[i, j]), np.floor(y[i, j])
            column, row = int(left) - first[0], int(above) - first[1]
            a, b, c, d = _spline_weights(x[i, j] - left)
            across = _spline_weights(y[i, j] - above)
            total = np.float32(0.0)
            if 1 <= column < last_column - 1 and 1 <= row < last_row - 1:
                for k in range(4):
                    line = pixels[row - 1 + k]
                    value = (a * line[column - 1] + b * line[column]) + (c * line[column + 1] + d * line[column + 2])
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
def move_rows(right, across, parallax, out):
    """The right epipolar image moved across the base, so that its rows are those of the left one.

    across : (6,) px, right row − left row: coefficients of 1, x, y, x², xy, y², x and y from −1 to 1 over columns and
    rows of the left image. parallax : px, left column − right column, of all pixels: `across` changes slowly enough.
    out : (rows, columns) float32.
    """
    rows, columns = out.shape
    down = np.empty(columns, np.float32)
    for i in range(rows):
        y = 2.0 * i / (rows - 1.0) - 1.0
        level, slope, bend = across[0] + y * (across[2] + y * across[5]), across[1] + y * across[4], across[3]
        for j in range(columns):
            x = 2.0 * (j + parallax) / (columns - 1.0) - 1.0
            down[j] = level + x * (slope + x * bend)
        first = 0
        while first < columns:  # columns whose four rows are the same
            whole = np.floor(down[first])
            end = first + 1
            while end < columns and np.floor(down[end]) == whole:
                end += 1
            row, last, part = i + int(whole), rows - 1, slice(first, end)
            _between_rows(
                right[min(max(row - 1, 0), last), part], right[min(max(row, 0), last), part],
                right[min(max(row + 1, 0), last), part], right[min(max(row + 2, 0), last), part],
                down[part], whole, out[i, part],
            )  # fmt: skip
            first = end


@leaf_kernel
def _between_rows(above, upper, lower, below, down, whole, out):
    for j in range(len(out)):
        a, b, c, d = _weights(down[j] - whole)
        out[j] = (a * above[j] + b * upper[j]) + (c * lower[j] + d * below[j])


@kernel
def align(right, value, known, left, out):
    """The right epipolar image where the left one's pixels have their parallaxes; the left one's where not known.

    right : (rows, columns) float32, coefficients of splines along its rows.
    value : (rows, columns) float32 px, left column − right column. out : float32.
    """
    for i in range(out.shape[0]):
        _align_row(right[i], value[i], known[i], left[i], out[i])


@leaf_kernel
def _align_row(right, value, known, left, out):
    """Without a branch: so several pixels are worked at once."""
    for j in range(len(out)):
        whole = np.ceil(value[j])
        place = j - int(whole)
        inside = known[j] and place >= 1 and place < len(out) - 2
        column = place if inside else 1
        a, b, c, d = _spline_weights(whole - value[j])
        found = (a * right[column - 1] + b * right[column]) + (c * right[column + 1] + d * right[column + 2])
        out[j] = found if inside else left[j]
