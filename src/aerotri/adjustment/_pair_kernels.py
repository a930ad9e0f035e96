"""Kernels that list which photographs share points."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel, leaf_kernel


@kernel
def order_by(key, place, items, order):
    """The items in order of their keys, those of one key as they come, in order (m,), out.

    Parameters
    ----------
    key : of every item. place : (number of keys,) where the items of each begin; where they end, out.
    """
    for k in range(len(items)):
        item = items[k]
        at = place[key[item]]
        order[at] = item
        place[key[item]] = at + 1


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
def number_pairs(rays, tied, first_number, number, tie_number, codes):
    """Numbers of the different pairs of photographs, rising by the first and then by the second.

    Parameters
    ----------
    tied : (t, 2) pairs, the smaller first, rising by it. first_number : of the first pair.
    number : (pairs of rays,) out, in the order the assembly meets them. tie_number : (t,) out.
    codes : (pairs of rays + t,) out, first·n + second of the different pairs.

    Returns
    -------
    How many different pairs there are.
    """
    start, image, point, pair_start = rays.start, rays.image, rays.point, rays.pair_start
    by_image, first_ray = rays.by_image, rays.first_ray
    n = len(first_ray) - 1
    number_of = np.full(n, -1, np.int64)
    partners = np.empty(n, np.int64)
    count, tie = 0, 0
    for i in range(n):
        n_partners, first_tie = 0, tie
        for k in range(first_ray[i], first_ray[i + 1]):
            ray = by_image[k]
            for other in range(ray + 1, start[point[ray] + 1]):
                if number_of[image[other]] < 0:
                    number_of[image[other]], partners[n_partners] = 0, image[other]
                    n_partners += 1
        while tie < len(tied) and tied[tie, 0] == i:
            if number_of[tied[tie, 1]] < 0:
                number_of[tied[tie, 1]], partners[n_partners] = 0, tied[tie, 1]
                n_partners += 1
            tie += 1
        sort_first(partners, n_partners)
        for k in range(n_partners):
            codes[count], number_of[partners[k]] = i * n + partners[k], first_number + count
            count += 1
        for k in range(first_ray[i], first_ray[i + 1]):
            ray = by_image[k]
            p = point[ray]
            before = ray - start[p]
            # of the rays of the point before this one, each with all that follow it
            at = pair_start[p] + before * (start[p + 1] - start[p]) - before * (before + 1) // 2
            for other in range(ray + 1, start[p + 1]):
                number[at] = number_of[image[other]]
                at += 1
        for k in range(first_tie, tie):
            tie_number[k] = number_of[tied[k, 1]]
        for k in range(n_partners):
            number_of[partners[k]] = -1
    return count
