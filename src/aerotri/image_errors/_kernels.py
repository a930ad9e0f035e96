"""Resampling of photographs along slowly varying displacements: scalar kernels without checks or objects.

Along a row the displacement is linear between two nodes and hardly changes from pixel to pixel. So runs of pixels lie
between the same source rows and columns; within a run neighbours read neighbours, which the processor does many at a
time, and every pixel gets the weights of its own exact position.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import inlined, kernel

PAD = 3
"""Pixels by which the source has to reach beyond the image on every side, for the taps next to the border."""
LONGEST = 1.0e6
"""px of a run at most [C]: longer than any row, and safe to turn into an integer where a change is nearly zero."""
ONE, TWO, THREE, FOUR, FIVE = np.uintp(1), np.uintp(2), np.uintp(3), np.uintp(4), np.uintp(5)
"""As unsigned integers: sums with unsigned places stay unsigned, so that no negative index is looked for."""
COSINES = np.cos(np.pi * (2.0 - np.arange(6)) / 3.0)
"""Of the six taps of Lanczos-3, π/3 apart: with SINES a single sine and cosine of the position serve them all."""
SINES = np.sin(np.pi * (2.0 - np.arange(6)) / 3.0)
"""See COSINES."""
LANCZOS_DRIFT = 1.0 / 8.0
"""Pixels by which the source position may drift within a run whose Lanczos weights are a parabola through those of its
start, middle and end: wrong by less than 3e-4 then."""


class Sampling(NamedTuple):
    """What is sampled, and how.

    Parameters
    ----------
    pixels : (·, columns + 2·PAD) rows of the image from `first_row` on, of the type of the sums.
    size : (2,) rows and columns of the image.
    limits : (3,) smallest and largest value of a pixel, and the value outside the image; of the type of the sums.
    is_integer : pixels are rounded. lanczos : six by six taps, else four by four.
    weights : (7, 6) room, of the type of the sums. scratch : (3, 6) room of double precision.
    """

    pixels: np.ndarray
    first_row: int
    size: np.ndarray
    limits: np.ndarray
    is_integer: bool
    lanczos: bool
    weights: np.ndarray
    scratch: np.ndarray


class Run(NamedTuple):
    """n pixels of a row from `column` on, whose source position changes linearly.

    Parameters
    ----------
    x, y : source column and row of the first pixel, 0 the centre of the first one; dx, dy : their change from pixel to
        pixel, dx less 1.
    """

    row: int
    column: int
    n: int
    x: float
    dx: float
    y: float
    dy: float


class Tile(NamedTuple):
    """A piece of the image over which displacements are continuous.

    Parameters
    ----------
    nodes : (k, l, 2) px, source less output position (column, row) at nodes every `step` pixels, from pixel `origin`
        (2,) = row, column on.
    begin, end : (rows of the output,) first column of the tile and the one after its last.
    top, bottom : (columns,) first row of the tile and the one after its last.
    """

    nodes: np.ndarray
    origin: np.ndarray
    step: int
    begin: np.ndarray
    end: np.ndarray
    top: np.ndarray
    bottom: np.ndarray


@inlined
def _pixel(value, low, high, is_integer):
    """A sum as a pixel can hold it."""
    return np.floor(min(max(value, low), high) + np.float32(0.5)) if is_integer else value


@inlined
def _cubic(t):
    """Weights of four neighbours at the place t between the inner two: Keys' cubic, a = −½, of third order."""
    half, one = np.float32(0.5), np.float32(1.0)
    first = half * t * (t * (np.float32(2.0) - t) - one)
    third = half * t * (one + t * (np.float32(4.0) - np.float32(3.0) * t))
    fourth = half * t * t * (t - one)
    return first, one - first - third - fourth, third, fourth


@inlined
def _four(source, row, c, a):
    """Four neighbours in a row, weighted."""
    left = a[0] * source[row, c] + a[1] * source[row, c + ONE]
    return left + a[2] * source[row, c + TWO] + a[3] * source[row, c + THREE]


@kernel
def cubic_run(sampling, first, out, to, n):
    """A run of n pixels from four by four taps.

    Parameters
    ----------
    sampling : `Sampling`; the last row of its weights holds x, dx, y, dy: the place of the first pixel between its
        inner taps, and its change from pixel to pixel.
    first : row and column of the first tap of the first pixel.
    out : (rows, columns). to : row and column of the first pixel. Rows and columns are unsigned numbers, which the
        compiler need not look up from the end of the array.
    """
    # numbers of their own, since the tables might, for all the compiler knows, lie in the output
    source, is_integer, low, high = sampling.pixels, sampling.is_integer, sampling.limits[0], sampling.limits[1]
    x, dx, y, dy = sampling.weights[6, 0], sampling.weights[6, 1], sampling.weights[6, 2], sampling.weights[6, 3]
    r0, c0 = first
    r1, r2, r3 = r0 + ONE, r0 + TWO, r0 + THREE
    row, column = to
    for i in range(n):
        k = np.float32(i)
        a, b = _cubic(x + dx * k), _cubic(y + dy * k)
        c = c0 + i
        v = b[0] * _four(source, r0, c, a) + b[1] * _four(source, r1, c, a)
        v += b[2] * _four(source, r2, c, a) + b[3] * _four(source, r3, c, a)
        out[row, column + i] = _pixel(v, low, high, is_integer)


@kernel
def lanczos_weights(t, weights, row):
    """A row out: Lanczos' windowed sinc of three lobes, t the place between the inner two of six neighbours; sum 1."""
    sine, sine_3, cosine_3 = np.sin(np.pi * t), np.sin(np.pi * t / 3.0), np.cos(np.pi * t / 3.0)
    total = 0.0
    for j in range(6):
        u, sign = t + 2.0 - j, 1.0 - 2.0 * (j % 2)
        turned = sine_3 * COSINES[j] + cosine_3 * SINES[j]
        weights[row, j] = 1.0 if abs(u) < 1e-6 else 3.0 * sign * sine * turned / (np.pi * u) ** 2
        total += weights[row, j]
    for j in range(6):
        weights[row, j] /= total


@kernel
def lanczos_parabola(place, drift, n, scratch, weights, row):
    """Rows `row` to `row` + 2 out: weights of pixel k of a run of n are w0 + k·(w1 + k·w2); scratch : (3, 6)."""
    for j in range(3):
        lanczos_weights(place + 0.5 * j * n * drift, scratch, j)
    for j in range(6):
        start, middle, end = scratch[0, j], scratch[1, j], scratch[2, j]
        weights[row, j] = start
        weights[row + 1, j] = (4.0 * middle - 3.0 * start - end) / n
        weights[row + 2, j] = 2.0 * (start - 2.0 * middle + end) / n**2


@inlined
def _six(w, row):
    return w[row, 0], w[row, 1], w[row, 2], w[row, 3], w[row, 4], w[row, 5]


@inlined
def _at(k, a, b, c):
    return (
        a[0] + k * (b[0] + k * c[0]), a[1] + k * (b[1] + k * c[1]), a[2] + k * (b[2] + k * c[2]),
        a[3] + k * (b[3] + k * c[3]), a[4] + k * (b[4] + k * c[4]), a[5] + k * (b[5] + k * c[5]),
    )  # fmt: skip


@inlined
def _sum(source, row, c, a):
    """Six neighbours in a row, weighted."""
    left = a[0] * source[row, c] + a[1] * source[row, c + ONE] + a[2] * source[row, c + TWO]
    return left + a[3] * source[row, c + THREE] + a[4] * source[row, c + FOUR] + a[5] * source[row, c + FIVE]


@kernel
def lanczos_run(sampling, first, out, to, n):
    """As `cubic_run` from six by six taps.

    The weights of `sampling` are those of the columns, three rows as `lanczos_parabola` gives them, and of the rows.
    """
    # numbers of their own, since the tables might, for all the compiler knows, lie in the output
    source, weights, is_integer = sampling.pixels, sampling.weights, sampling.is_integer
    low, high = sampling.limits[0], sampling.limits[1]
    a0, a1, a2 = _six(weights, 0), _six(weights, 1), _six(weights, 2)
    b0, b1, b2 = _six(weights, 3), _six(weights, 4), _six(weights, 5)
    r0, c0 = first
    r1, r2, r3, r4, r5 = r0 + ONE, r0 + TWO, r0 + THREE, r0 + FOUR, r0 + FIVE
    row, column = to
    for i in range(n):
        k = np.float32(i)
        a, b = _at(k, a0, a1, a2), _at(k, b0, b1, b2)
        c = c0 + i
        v = b[0] * _sum(source, r0, c, a) + b[1] * _sum(source, r1, c, a) + b[2] * _sum(source, r2, c, a)
        v += b[3] * _sum(source, r3, c, a) + b[4] * _sum(source, r4, c, a) + b[5] * _sum(source, r5, c, a)
        out[row, column + i] = _pixel(v, low, high, is_integer)


@kernel
def simple_run(sampling, out, run):
    """A bicubic run that stays between the same rows and columns well inside the image, as most do; else False."""
    n, x, dx, y, dy, size = run.n, run.x, run.dx, run.y, run.dy, sampling.size
    column, row = int(np.floor(x)), int(np.floor(y))
    if int(np.floor(x + (n - 1) * (1.0 + dx))) != column + n - 1 or int(np.floor(y + (n - 1) * dy)) != row:
        return False
    if column < 0 or row < 0 or column + n >= size[1] or row >= size[0] - 1:
        return False
    # through the table, since that makes them numbers of the type of the sums
    weights = sampling.weights
    weights[6, 0], weights[6, 1], weights[6, 2], weights[6, 3] = x - column, dx, y - row, dy
    at = np.uintp(row - 1 - sampling.first_row), np.uintp(column - 1 + PAD)
    cubic_run(sampling, at, out, (np.uintp(run.row), np.uintp(run.column)), np.uintp(n))
    return True


@inlined
def _stay(place, change):
    """Pixels for which a place that changes by `change` stays within 0 … 1."""
    if change > 0.0:
        return int(min((1.0 - place) / change, LONGEST)) + 1
    if change < 0.0:
        return int(min(place / -change, LONGEST)) + 1
    return int(LONGEST)


@kernel
def resample_run(sampling, out, run):
    """A run of pixels whose source position changes linearly; out : (rows, columns)."""
    size, limits, weights, scratch = sampling.size, sampling.limits, sampling.weights, sampling.scratch
    source_row, lanczos = sampling.first_row, sampling.lanczos
    r, first, n, x, dx, y, dy = run.row, run.column, run.n, run.x, run.dx, run.y, run.dy
    done = 0
    longest = int(min(LANCZOS_DRIFT / (max(abs(dx), abs(dy)) + 1e-30), LONGEST)) + 1 if lanczos else n
    while done < n:
        column, row = int(np.floor(x)), int(np.floor(y))
        many = min(n - done, longest, _stay(x - column, dx), _stay(y - row, dy))
        # pixel k of the run lies between source columns column + k and column + k + 1
        if row < -1 or row >= size[0] or column < -1 or column >= size[1]:
            if -1 <= row < size[0] and column < -1:
                many = min(many, -1 - column)
            for k in range(many):
                out[r, first + done + k] = limits[2]
        else:
            many = min(many, size[1] - column)
            taps = 2 if lanczos else 1
            at = np.uintp(row - taps - source_row), np.uintp(column - taps + PAD)
            to = np.uintp(r), np.uintp(first + done)
            if lanczos:
                lanczos_parabola(x - column, dx, many, scratch, weights, 0)
                lanczos_parabola(y - row, dy, many, scratch, weights, 3)
                lanczos_run(sampling, at, out, to, np.uintp(many))
            else:
                weights[6, 0], weights[6, 1], weights[6, 2], weights[6, 3] = x - column, dx, y - row, dy
                cubic_run(sampling, at, out, to, np.uintp(many))
        if column < 0 or row < 0 or column + many >= size[1] or row >= size[0] - 1:
            for k in range(many):
                u, v = x + k * (1.0 + dx), y + k * dy
                if u < -0.5 or v < -0.5 or u > size[1] - 0.5 or v > size[0] - 0.5:
                    out[r, first + done + k] = limits[2]
        done += many
        x += many * (1.0 + dx)
        y += many * dy


@kernel
def resample_tile(sampling, out, out_row, tile):
    """The pixels of some rows that belong to one tile; out : rows of the output from `out_row` on."""
    nodes, origin, step = tile.nodes, tile.origin, tile.step
    begin, end, top, bottom = tile.begin, tile.end, tile.top, tile.bottom
    highest, lowest = top.max(), bottom.min()
    cells = nodes.shape[1] - 1
    line = np.empty((cells + 1, 2))
    for r in range(len(out)):
        row = out_row + r
        i = min(max((row - origin[0]) // step, 0), nodes.shape[0] - 2)
        t = (row - origin[0]) / step - i
        for k in range(cells + 1):
            line[k, 0] = (1.0 - t) * nodes[i, k, 0] + t * nodes[i + 1, k, 0]
            line[k, 1] = (1.0 - t) * nodes[i, k, 1] + t * nodes[i + 1, k, 1]
        whole = highest <= row < lowest
        column, last = begin[r], end[r]
        j = min(max((column - origin[1]) // step, 0), cells - 1)
        while column < last:
            first = origin[1] + j * step
            stop = last if j == cells - 1 else min(last, first + step)
            if not whole:
                while column < stop and (row < top[column] or row >= bottom[column]):
                    column += 1
                until = column
                while until < stop and top[until] <= row < bottom[until]:
                    until += 1
                stop = until
            dx, dy = (line[j + 1, 0] - line[j, 0]) / step, (line[j + 1, 1] - line[j, 1]) / step
            x = column + line[j, 0] + (column - first) * dx
            y = row + line[j, 1] + (column - first) * dy
            run = Run(r, column, stop - column, x, dx, y, dy)
            if sampling.lanczos or not simple_run(sampling, out, run):
                resample_run(sampling, out, run)
            column = stop
            if column >= first + step and j < cells - 1:
                j += 1
