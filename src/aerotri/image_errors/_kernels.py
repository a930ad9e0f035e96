"""Resampling of photographs along slowly varying displacements: scalar kernels without checks or objects.

Along a row the displacement is linear between two nodes and hardly changes from pixel to pixel. So runs of pixels lie
between the same source rows and columns; within a run neighbours read neighbours, which the processor does many at a
time, and every pixel gets the weights of its own exact position.
"""

from __future__ import annotations

import numpy as np

from aerotri.compiled import inlined, kernel

PAD = 3
"""Pixels by which the source has to reach beyond the image on every side, for the taps next to the border."""
LONGEST = 1.0e6
LANCZOS_DRIFT = 1.0 / 64.0
"""Pixels by which the position may drift within a run whose Lanczos weights are interpolated between its ends."""


@inlined
def _cubic(t):
    """Weights of the four neighbours at the place t between the inner two: Keys' cubic, a = −½, of third order."""
    half, one = np.float32(0.5), np.float32(1.0)
    first = half * t * (t * (np.float32(2.0) - t) - one)
    third = half * t * (one + t * (np.float32(4.0) - np.float32(3.0) * t))
    fourth = half * t * t * (t - one)
    return first, one - first - third - fourth, third, fourth


@kernel
def cubic_run(r0, r1, r2, r3, out, at, is_integer):
    """A run of pixels by bicubic interpolation.

    Parameters
    ----------
    r0 … r3 : (n + 3,) the four source rows, from the first tap of the first pixel.
    out : (n,). at : (6,) place between columns and its change per pixel, place between rows and its change, smallest
        and largest value of the type of pixel; of the type the sums are to have.
    """
    x, dx, y, dy, low, high = at[0], at[1], at[2], at[3], at[4], at[5]
    for i in range(len(out)):
        k = np.float32(i)
        a = _cubic(x + dx * k)
        b = _cubic(y + dy * k)
        v = b[0] * (a[0] * r0[i] + a[1] * r0[i + 1] + a[2] * r0[i + 2] + a[3] * r0[i + 3])
        v += b[1] * (a[0] * r1[i] + a[1] * r1[i + 1] + a[2] * r1[i + 2] + a[3] * r1[i + 3])
        v += b[2] * (a[0] * r2[i] + a[1] * r2[i + 1] + a[2] * r2[i + 2] + a[3] * r2[i + 3])
        v += b[3] * (a[0] * r3[i] + a[1] * r3[i + 1] + a[2] * r3[i + 2] + a[3] * r3[i + 3])
        if is_integer:
            v = np.floor(min(max(v, low), high) + np.float32(0.5))
        out[i] = v


@kernel
def lanczos_weights(t, weights):
    """(6,) out: Lanczos' windowed sinc of three lobes at the place t between the inner two of six neighbours, sum 1."""
    total = 0.0
    for j in range(6):
        u = np.pi * (t + 2.0 - j)
        weights[j] = 1.0 if abs(u) < 1e-9 else 3.0 * np.sin(u) * np.sin(u / 3.0) / (u * u)
        total += weights[j]
    for j in range(6):
        weights[j] /= total


@inlined
def _six(row, i, a):
    left = a[0] * row[i] + a[1] * row[i + 1] + a[2] * row[i + 2]
    return left + a[3] * row[i + 3] + a[4] * row[i + 4] + a[5] * row[i + 5]


@inlined
def _weights_of(table, row):
    return table[row, 0], table[row, 1], table[row, 2], table[row, 3], table[row, 4], table[row, 5]


@inlined
def _linear(a, change, k):
    """Weights of pixel k of a run from those of its first pixel and their change per pixel."""
    return (
        a[0] + k * change[0],
        a[1] + k * change[1],
        a[2] + k * change[2],
        a[3] + k * change[3],
        a[4] + k * change[4],
        a[5] + k * change[5],
    )


@kernel
def lanczos_run(source, row, column, out, at, weights, is_integer):
    """As `cubic_run` with six taps from `row` and `column` on; weights : (4, 6) scratch of the type of the sums."""
    n, low, high = len(out), at[4], at[5]
    start, end = np.empty(6), np.empty(6)
    for part in range(2):
        lanczos_weights(at[2 * part], start)
        lanczos_weights(at[2 * part] + n * at[2 * part + 1], end)
        for j in range(6):
            weights[2 * part, j] = start[j]
            weights[2 * part + 1, j] = (end[j] - start[j]) / n
    last = column + n + 5
    r0, r1, r2 = source[row, column:last], source[row + 1, column:last], source[row + 2, column:last]
    r3, r4, r5 = source[row + 3, column:last], source[row + 4, column:last], source[row + 5, column:last]
    # numbers of their own, since the table might, for all the compiler knows, lie in the output
    a0, da, b0, db = _weights_of(weights, 0), _weights_of(weights, 1), _weights_of(weights, 2), _weights_of(weights, 3)
    for i in range(n):
        k = np.float32(i)
        a = _linear(a0, da, k)
        b = _linear(b0, db, k)
        v = b[0] * _six(r0, i, a) + b[1] * _six(r1, i, a) + b[2] * _six(r2, i, a)
        v += b[3] * _six(r3, i, a) + b[4] * _six(r4, i, a) + b[5] * _six(r5, i, a)
        if is_integer:
            v = np.floor(min(max(v, low), high) + np.float32(0.5))
        out[i] = v


@inlined
def _stay(place, change):
    """Pixels for which a place that changes by `change` stays within 0 … 1."""
    if change > 0.0:
        return int(min((1.0 - place) / change, LONGEST)) + 1
    if change < 0.0:
        return int(min(place / -change, LONGEST)) + 1
    return int(LONGEST)


@kernel
def resample_run(source, source_row, out, x, dx, y, dy, size, fill, at, weights, is_integer, lanczos):
    """A run of pixels whose source position changes linearly.

    Parameters
    ----------
    source : rows of the image from `source_row` on, `PAD` columns more on either side.
    out : (n,). x, y : source column and row of the first pixel, 0 the centre of the first one; dx, dy : their change
        from pixel to pixel, dx less 1.
    size : (2,) rows and columns of the image. fill : value outside of it.
    at, weights : scratch, at[4:] set.
    """
    done, n, taps = 0, len(out), PAD if lanczos else PAD - 1
    while done < n:
        column, row = int(np.floor(x)), int(np.floor(y))
        many = min(n - done, _stay(x - column, dx), _stay(y - row, dy))
        if column < -1 or row < -1 or column >= size[1] or row >= size[0]:
            out[done : done + many] = fill
        else:
            at[0], at[1], at[2], at[3] = x - column, dx, y - row, dy
            i, j = row - taps + 1 - source_row, column - taps + 1 + PAD
            if lanczos:
                many = min(many, int(min(LANCZOS_DRIFT / (abs(dx) + abs(dy) + 1e-30), LONGEST)) + 1)
                lanczos_run(source, i, j, out[done : done + many], at, weights, is_integer)
            else:
                # every row on its own: only then the compiler knows that neighbours are neighbours in memory
                k = j + many + 3
                r0, r1, r2, r3 = source[i, j:k], source[i + 1, j:k], source[i + 2, j:k], source[i + 3, j:k]
                cubic_run(r0, r1, r2, r3, out[done : done + many], at, is_integer)
            if column < 0 or row < 0 or column >= size[1] - 1 or row >= size[0] - 1:
                for k in range(many):
                    u, v = x + k * (1.0 + dx), y + k * dy
                    if u < -0.5 or v < -0.5 or u > size[1] - 0.5 or v > size[0] - 0.5:
                        out[done + k] = fill
        done += many
        x += many * (1.0 + dx)
        y += many * dy


@kernel
def resample_tile(
    source, source_row, out, out_row, nodes, origin, step, begin, end, top, bottom, size, fill, at, weights, is_integer,
    lanczos,
):  # fmt: skip
    """The pixels of some rows that belong to one tile.

    Parameters
    ----------
    source, source_row, size, fill, at, weights : as in `resample_run`.
    out : rows of the output from `out_row` on.
    nodes : (k, l, 2) px, source less output position (column, row) at nodes every `step` pixels, from pixel `origin`
        (2,) = row, column on.
    begin, end : (rows of out,) first column of the tile and the one after its last.
    top, bottom : (columns,) first row of the tile and the one after its last.
    """
    highest, lowest = top.max(), bottom.min()
    for r in range(len(out)):
        row = out_row + r
        i = min(max((row - origin[0]) // step, 0), nodes.shape[0] - 2)
        t = (row - origin[0]) / step - i
        whole = highest <= row < lowest
        column, last = begin[r], end[r]
        while column < last:
            if not whole and (row < top[column] or row >= bottom[column]):
                column += 1
                continue
            j = min(max((column - origin[1]) // step, 0), nodes.shape[1] - 2)
            first = origin[1] + j * step
            stop = last if j == nodes.shape[1] - 2 else min(last, first + step)
            if not whole:
                until = column + 1
                while until < stop and top[until] <= row < bottom[until]:
                    until += 1
                stop = until
            x = (1.0 - t) * nodes[i, j, 0] + t * nodes[i + 1, j, 0]
            y = (1.0 - t) * nodes[i, j, 1] + t * nodes[i + 1, j, 1]
            dx = ((1.0 - t) * nodes[i, j + 1, 0] + t * nodes[i + 1, j + 1, 0] - x) / step
            dy = ((1.0 - t) * nodes[i, j + 1, 1] + t * nodes[i + 1, j + 1, 1] - y) / step
            x += column + (column - first) * dx
            y += row + (column - first) * dy
            resample_run(
                source, source_row, out[r, column:stop], x, dx, y, dy, size, fill, at, weights, is_integer, lanczos
            )
            column = stop
