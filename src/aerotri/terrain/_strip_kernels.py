"""Correlation of pairs along the ray of a photograph, by strips rectified once: the fast search before the exact one.

Along the ray of the first photograph its window stays what it is, and the other's window moves along the direction of
parallax: one strip has them all. What perspective does to it over the range of heights is left to the search that
follows (see `_search_kernels`).
"""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel
from aerotri.terrain._plan_kernels import LANES
from aerotri.terrain._sampling_kernels import mean_of_best, normalise, sample_linear
from aerotri.terrain._view_kernels import SMALLEST_ANGLE, turned_corners

LEAST_RISE = 0.2
"""Least change of the shift along a strip over that on level ground; chosen [C]: 0 would be ground seen edgewise, where
the number of shifts has no bound."""


@kernel
def strip_profile(view, pair, spot, e, window, reach_posts, rooms):
    """Correlation of a pair at shifts of whole posts along the direction e of parallax, −reach … reach, into `of_pair`.

    The first photograph's window is fixed: heights go along its ray. The other's windows are one strip, rectified once
    on the plane of the spot. False where not all of the strip is seen.
    """
    first, corner = rooms.search.first, rooms.search.corner
    strip, sums, profile = rooms.strips.strip, rooms.strips.sums, rooms.strips.of_pair
    n = first.shape[0]
    half = 0.5 * (n - 1) * window
    if not turned_corners(view, pair[0], spot, e, half, half, corner):
        return False
    sample_linear(view, pair[0], corner, first)
    if not turned_corners(view, pair[1], spot, e, half + reach_posts * window, half, corner):
        return False
    places, length = 2 * reach_posts + 1, n + 2 * reach_posts
    lines = strip[: n * length].reshape(n, length)
    sample_linear(view, pair[1], corner, lines)
    profile[:places] = 0.0
    if not normalise(first):
        return True
    product_sum, line = sums[2, : (places + LANES - 1) // LANES * LANES], sums[3]
    product_sum[:] = 0.0
    total, squares = sums[0, :length], sums[1, :length]
    total[:] = 0.0
    squares[:] = 0.0
    middle = lines[n // 2, length // 2]
    for q in range(n):
        for p in range(length):
            value = lines[q, p] - middle
            line[p] = value
            total[p] += value
            squares[p] += value * value
        for p in range(n):
            weight = first[q, p]
            for s in range(len(product_sum)):
                product_sum[s] += weight * line[p + s]
    mean, power = 0.0, 0.0
    for p in range(n):
        mean += total[p]
        power += squares[p]
    for s in range(places):
        spread = power - mean * mean / (n * n)
        if spread > 1e-6 * power and spread > 0.0:
            profile[s] = product_sum[s] / np.sqrt(spread)
        if s < places - 1:
            mean += total[s + n] - total[s]
            power += squares[s + n] - squares[s]
    return True


@kernel
def strip_search(view, chosen, spot, locus, window, rooms, profile):
    """As `search` on the vertical line, along the ray of the first photograph, by strips; −1 where one is not all seen.

    Pairs of the first with every other photograph have profiles of their own, joined height by height: linearly between
    posts of parallax.
    """
    centres, a, low, step = view.centres, chosen[0], locus.low, locus.step
    of_pair, joined = rooms.strips.of_pair, rooms.strips.joined
    pair, e = np.empty(2, np.int64), np.empty(2)
    places, values = len(profile), rooms.search.values
    ax = (spot[0] - centres[a, 0]) / (centres[a, 2] - spot[2])
    ay = (spot[1] - centres[a, 1]) / (centres[a, 2] - spot[2])
    count = 0
    pair[0] = a
    furthest = max(low + (places - 1) * step - spot[2], spot[2] - low)
    for k in range(1, len(chosen)):
        b = chosen[k]
        if b < 0:
            continue
        bx = (spot[0] - centres[b, 0]) / (centres[b, 2] - spot[2])
        by = (spot[1] - centres[b, 1]) / (centres[b, 2] - spot[2])
        length = np.hypot(bx - ax, by - ay)
        if not length > SMALLEST_ANGLE:
            continue
        e[0], e[1] = (bx - ax) / length, (by - ay) / length
        # posts along the sloping strip for a metre of height
        rise = 1.0 + (bx * e[0] + by * e[1]) * (spot[3] * e[0] + spot[4] * e[1])
        per_metre = length / (window * max(rise, LEAST_RISE))
        reach = int(furthest * per_metre) + 1
        pair[1] = b
        if 2 * reach + 1 > len(of_pair) or not strip_profile(view, pair, spot, e, window, reach, rooms):
            return -1
        for s in range(places):
            at = reach + (low + s * step - spot[2]) * per_metre
            left = min(max(int(at), 0), 2 * reach - 1)
            joined[count, s] = of_pair[left] + (at - left) * (of_pair[left + 1] - of_pair[left])
        count += 1
    if count == 0:
        return -1
    best = 0
    for s in range(places):
        for k in range(count):
            values[k] = joined[k, s]
        profile[s] = mean_of_best(values, count)
        if profile[s] > profile[best]:
            best = s
    return best
