"""Correlation along loci in object space: the vertical line of a node, the ray of a photograph."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel
from aerotri.terrain._sampling_kernels import mean_of_best, normalise, product, sample_linear
from aerotri.terrain._strip_kernels import make_strips, strip_search
from aerotri.terrain._view_kernels import SMALLEST_ANGLE, parallax_per_metre, window_corners

AROUND = 3
"""Steps to either side of what strips found that are searched again."""


@kernel
def correlation_at(view, chosen, spot, window, room):
    """Correlation of the first of the photographs with others that show the window, `mean_of_best`; −1: none does."""
    first, second, corner, shift, values = room[0], room[1], room[2], room[3], room[5]
    reach = 0.5 * (first.shape[0] - 1) * window
    shift[:] = 0.0
    if not window_corners(view, chosen[0], spot, reach, shift, corner):
        return -1.0
    sample_linear(view, chosen[0], corner, first)
    if not normalise(first):
        return -1.0
    count = 0
    for k in range(1, len(chosen)):
        if chosen[k] < 0 or not window_corners(view, chosen[k], spot, reach, shift, corner):
            continue
        sample_linear(view, chosen[k], corner, second)
        values[count] = product(first, second) if normalise(second) else 0.0
        count += 1
    return mean_of_best(values, count) if count else -1.0


@kernel
def search(view, chosen, spot, along, low, step, window, room, profile):
    """Correlation at heights low, low + step … on a locus through the spot; the number of the best.

    Parameters
    ----------
    along : (2,) m in x and y per metre of height: 0, 0 on the vertical line. profile : (k,) out.
    """
    best, place = 0, np.empty(5)
    place[3:] = spot[3:]
    for s in range(len(profile)):
        z = low + s * step
        place[0] = spot[0] + along[0] * (z - spot[2])
        place[1] = spot[1] + along[1] * (z - spot[2])
        place[2] = z
        profile[s] = correlation_at(view, chosen, place, window, room)
        if profile[s] > profile[best]:
            best = s
    return best


@kernel
def peak_offset(profile, best):
    """Place of the top of a parabola through the best and its neighbours, in steps from the best."""
    if best == 0 or best == len(profile) - 1:
        return 0.0
    left, top, right = profile[best - 1], profile[best], profile[best + 1]
    bend = left - 2.0 * top + right
    if left < 0.0 or right < 0.0 or not bend < 0.0:
        return 0.0
    return 0.5 * (left - right) / bend


@kernel
def second_peak(profile, best, apart):
    """Largest value of another local maximum at least `apart` steps from the best."""
    second = -1.0
    for s in range(1, len(profile) - 1):
        if abs(s - best) >= apart and profile[s] >= profile[s - 1] and profile[s] >= profile[s + 1]:
            second = max(second, profile[s])
    return second


@kernel
def off_line(view, k, spot, z):
    """m of plan between the vertical line and the ray of photograph k through a spot, at a height."""
    centre = view[4][k]
    return np.hypot(spot[0] - centre[0], spot[1] - centre[1]) * abs(z - spot[2]) / (centre[2] - spot[2])


@kernel
def make_room(n, most, photographs):
    """What `correlation_at` and others work in."""
    first, second = np.empty((n, n), np.float32), np.empty((n, n), np.float32)
    return first, second, np.empty((4, 2)), np.zeros(6), np.empty(most), np.empty(photographs)


@kernel
def find_heights(view, nodes, slopes, ranges, chosen, posts, window, step_px, most, heights, scores):
    """Height of best correlation on the vertical line of every node, within a range about its prior height.

    Parameters
    ----------
    nodes : (n, 3) m, x, y and the prior height. slopes : (n, 2). ranges : (n, 2) m, lowest and highest height.
    chosen : (n, m) photographs, the first being the reference, −1 for none.
    posts, window : posts a side and m between them. step_px : of the heights, posts of parallax. most : steps.
    heights, scores : (n,) out; NaN and −1 where there is none.
    """
    room, spot, along = make_room(posts, most, chosen.shape[1]), np.empty(5), np.zeros(2)
    strips = make_strips(posts, most, chosen.shape[1])
    for p in range(len(nodes)):
        heights[p], scores[p] = np.nan, -1.0
        if chosen[p, 1] < 0:
            continue
        spot[:3], spot[3:] = nodes[p], slopes[p]
        per_metre = parallax_per_metre(view, chosen[p], spot)
        if not per_metre > SMALLEST_ANGLE:
            continue
        step = step_px * window / per_metre
        count = min(int((ranges[p, 1] - ranges[p, 0]) / step) + 2, most)
        profile = room[4][:count]
        low = ranges[p, 0]
        best = strip_search(view, chosen[p], spot, low, step, window, room, strips, profile)
        if best < 0:
            best = search(view, chosen[p], spot, along, low, step, window, room, profile)
        elif 0 < best < count - 1 and off_line(view, chosen[p, 0], spot, low + best * step) > window:
            # along the ray of the first photograph that was: once more from the vertical line
            spot[2] = low + best * step
            low, profile = spot[2] - AROUND * step, room[4][: 2 * AROUND + 1]
            again = strip_search(view, chosen[p], spot, low, step, window, room, strips, profile)
            best = again if again >= 0 else AROUND
        if profile[best] > 0.0 and 0 < best < len(profile) - 1:
            heights[p] = low + (best + peak_offset(profile, best)) * step
            scores[p] = profile[best]
