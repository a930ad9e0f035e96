"""Which photograph every cell of a grid takes, seams laid where photographs look alike: scalar kernels.

[L: Kolmogorov 2006, TRW-S; Kwatra et al. 2003, cost of a seam] The energy Σ D(p, x) + Σ V(p, q, x, y) over cells p and
neighbours p, q is made small by messages along rows and columns, forwards and backwards. Labels are places in the list
of the photographs that see a cell. V is 0 where both cells take the same photograph, else half the difference of the
two photographs at p and at q, so that a seam costs what one sees of it.
"""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel, leaf_kernel


@kernel
def differences(found, value, most, out):
    """Mean difference over the bands of any two candidates of a cell, at most `most`; (r, c, q, q) float32 out."""
    count, rows, columns = found.shape
    bands = value.shape[1]
    for i in range(rows):
        for j in range(columns):
            for a in range(count):
                out[i, j, a, a] = 0.0
                for b in range(a):
                    total = np.float32(0.0)
                    for band in range(bands):
                        total += abs(value[a, band, i, j] - value[b, band, i, j])
                    out[i, j, a, b] = out[i, j, b, a] = min(total / bands, most)


@leaf_kernel
def _seams(here, there, at_here, at_there, most, least, out):
    """V of all candidates of two neighbours, (q, q) out.

    here, there : (q,) photographs of either. at_here, at_there : (q, q) differences of these.
    """
    count = len(here)
    for b in range(count):
        place = -1
        for a in range(count):
            if here[a] == there[b]:
                place = a
        for a in range(count):
            if here[a] == there[b] or here[a] < 0 or there[b] < 0:
                out[a, b] = 0.0
            else:
                out[a, b] = least + 0.5 * (at_here[a, place] if place >= 0 else most)
    for a in range(count):
        place = -1
        for b in range(count):
            if here[a] == there[b]:
                place = b
        for b in range(count):
            if here[a] != there[b] and here[a] >= 0 and there[b] >= 0:
                out[a, b] += 0.5 * (at_there[place, b] if place >= 0 else most)


@kernel
def seam_costs(found, difference, most, least, right, below):
    """V of all cells and their neighbours to the right and below, (r, c, q, q) float32 out.

    found : (r, c, q) photographs. difference : (r, c, q, q), of `differences`.
    """
    rows, columns, _ = found.shape
    for i in range(rows):
        for j in range(columns):
            right[i, j], below[i, j] = 0.0, 0.0
            own, at = found[i, j], difference[i, j]
            if j + 1 < columns:
                _seams(own, found[i, j + 1], at, difference[i, j + 1], most, least, right[i, j])
            if i + 1 < rows:
                _seams(own, found[i + 1, j], at, difference[i + 1, j], most, least, below[i, j])


@kernel
def _send(belief, back, pair, turned, out):
    """A message: min over x of belief(x)/2 − back(x) + V(x, y), less its smallest."""
    count = len(out)
    smallest = np.inf
    for y in range(count):
        best = np.inf
        for x in range(count):
            cost = pair[y, x] if turned else pair[x, y]
            best = min(best, 0.5 * belief[x] - back[x] + cost)
        out[y] = best
        smallest = min(smallest, best)
    for y in range(count):
        out[y] -= smallest


@kernel
def pass_messages(unary, right, below, messages, backwards):
    """One pass over all cells.

    messages : (4, r, c, q), into a cell from the left, above, the right and below; in and out.
    """
    rows, columns, count = unary.shape
    belief = np.empty(count)
    for step in range(rows * columns):
        at = rows * columns - 1 - step if backwards else step
        i, j = at // columns, at % columns
        for x in range(count):
            belief[x] = unary[i, j, x]
            for side in range(4):
                belief[x] += messages[side, i, j, x]
        if backwards:
            if j > 0:
                _send(belief, messages[0, i, j], right[i, j - 1], True, messages[2, i, j - 1])
            if i > 0:
                _send(belief, messages[1, i, j], below[i - 1, j], True, messages[3, i - 1, j])
        else:
            if j + 1 < columns:
                _send(belief, messages[2, i, j], right[i, j], False, messages[0, i, j + 1])
            if i + 1 < rows:
                _send(belief, messages[3, i, j], below[i, j], False, messages[1, i + 1, j])


@kernel
def decide(unary, right, below, messages, label):
    """The label of every cell after its left and upper neighbours, (r, c) int32 out."""
    rows, columns, count = unary.shape
    for i in range(rows):
        for j in range(columns):
            best, chosen = np.inf, 0
            for x in range(count):
                cost = unary[i, j, x] + messages[2, i, j, x] + messages[3, i, j, x]
                if j > 0:
                    cost += right[i, j - 1, label[i, j - 1], x]
                if i > 0:
                    cost += below[i - 1, j, label[i - 1, j], x]
                if cost < best:
                    best, chosen = cost, x
            label[i, j] = chosen


@kernel
def energy(unary, right, below, label):
    """(Σ D, Σ V) of labels (r, c)."""
    rows, columns, _ = unary.shape
    of_cells, of_seams = 0.0, 0.0
    for i in range(rows):
        for j in range(columns):
            x = label[i, j]
            of_cells += unary[i, j, x]
            if j + 1 < columns:
                of_seams += right[i, j, x, label[i, j + 1]]
            if i + 1 < rows:
                of_seams += below[i, j, x, label[i + 1, j]]
    return of_cells, of_seams
