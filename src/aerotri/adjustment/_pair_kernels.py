"""Kernels that list which photographs share points."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel, leaf_kernel


@kernel
def count_pairs(start, image, first_pair):
    """How many pairs of rays of a point begin with each photograph: in first_pair (n + 1,), zeros, summed up, out."""
    for p in range(len(start) - 1):
        for q in range(start[p], start[p + 1]):
            first_pair[image[q] + 1] += start[p + 1] - 1 - q
    for i in range(len(first_pair) - 1):
        first_pair[i + 1] += first_pair[i]


@leaf_kernel
def sort_first(numbers, count):
    """Sort the first `count` numbers, in place. Numba's own sort would take a second to compile.

    Shell's sort; every gap is four ninths of the one before.
    """
    gap = 1
    while gap * 9 // 4 < count:
        gap = gap * 9 // 4 + 1
    while gap > 0:
        for k in range(gap, count):
            number, at = numbers[k], k
            while at >= gap and numbers[at - gap] > number:
                numbers[at] = numbers[at - gap]
                at -= gap
            numbers[at] = number
        gap = 0 if gap == 1 else max(gap * 4 // 9, 1)


@kernel
def number_pairs(start, image, tied, first_pair, number, tie_number, codes):
    """Numbers of the different pairs of photographs, rising by the first and then by the second.

    Parameters
    ----------
    image : (m,) of the rays, rising within a point. tied : (t, 2) pairs, the smaller first, rising by it.
    first_pair : (n + 1,) as `count_pairs` leaves it.
    number : (pairs of rays,) out, in the order the assembly meets them. tie_number : (t,) out.
    codes : (pairs of rays + t,) out, first·n + second of the different pairs.

    Returns
    -------
    How many different pairs there are.
    """
    n = len(first_pair) - 1
    second, place = np.empty(len(number), np.int64), np.empty(len(number), np.int64)
    next_place = first_pair.copy()
    k = 0
    for p in range(len(start) - 1):
        for q in range(start[p], start[p + 1]):
            for other in range(q + 1, start[p + 1]):
                at = next_place[image[q]]
                second[at], place[at] = image[other], k
                next_place[image[q]] += 1
                k += 1
    number_of = np.full(n, -1, np.int64)
    partners = np.empty(n, np.int64)
    count, tie = 0, 0
    for i in range(n):
        n_partners, first_tie = 0, tie
        for k in range(first_pair[i], first_pair[i + 1]):
            if number_of[second[k]] < 0:
                number_of[second[k]], partners[n_partners] = 0, second[k]
                n_partners += 1
        while tie < len(tied) and tied[tie, 0] == i:
            if number_of[tied[tie, 1]] < 0:
                number_of[tied[tie, 1]], partners[n_partners] = 0, tied[tie, 1]
                n_partners += 1
            tie += 1
        sort_first(partners, n_partners)
        for k in range(n_partners):
            codes[count], number_of[partners[k]] = i * n + partners[k], count
            count += 1
        for k in range(first_pair[i], first_pair[i + 1]):
            number[place[k]] = number_of[second[k]]
        for k in range(first_tie, tie):
            tie_number[k] = number_of[tied[k, 1]]
        for k in range(n_partners):
            number_of[partners[k]] = -1
    return count
