"""Correlation along loci in object space: the vertical line of a node, the ray of a photograph."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel
from aerotri.terrain._plan_kernels import Locus, make_rooms
from aerotri.terrain._sampling_kernels import mean_of_best, normalise, product, sample_linear
from aerotri.terrain._strip_kernels import strip_search
from aerotri.terrain._view_kernels import SMALLEST_ANGLE, parallax_per_metre, window_corners

AROUND = 3
"""Steps to either side of what strips found that are searched again."""


@kernel
def correlation_at(view, chosen, spot, window, room):
    """Correlation of the first of the photographs with others that show the window, `mean_of_best`; −1: none does."""
    first, second, corner, shift, values = room.first, room.second, room.corner, room.shift, room.values
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
def search(view, chosen, spot, locus, window, room, profile):
    """Correlation at the heights of a locus through the spot; the number of the best. profile : (k,) out."""
    best, place = 0, np.empty(5)
    place[3:] = spot[3:]
    for s in range(len(profile)):
        z = locus.low + s * locus.step
        place[0] = spot[0] + locus.along_x * (z - spot[2])
        place[1] = spot[1] + locus.along_y * (z - spot[2])
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
    centre = view.centres[k]
    return np.hypot(spot[0] - centre[0], spot[1] - centre[1]) * abs(z - spot[2]) / (centre[2] - spot[2])


@kernel
def find_heights(view, nodes, plan, heights, scores):
    """Height of best correlation on the vertical line of every node, within a range about its prior height.

    heights, scores : (n,) out; NaN and −1 where there is none.
    """
    m = nodes.chosen.shape[1]
    rooms, spot = make_rooms(plan.posts, plan.most_steps, plan.most_steps, m), np.empty(5)
    room, window = rooms.search, plan.window
    for p in range(len(nodes.places)):
        chosen, ranges = nodes.chosen[p], nodes.ranges[p]
        heights[p], scores[p] = np.nan, -1.0
        if chosen[1] < 0:
            continue
        spot[:3], spot[3:] = nodes.places[p], nodes.slopes[p]
        per_metre = parallax_per_metre(view, chosen, spot)
        if not per_metre > SMALLEST_ANGLE:
            continue
        step = plan.step * window / per_metre
        count = min(int((ranges[1] - ranges[0]) / step) + 2, plan.most_steps)
        profile = room.profile[:count]
        locus = Locus(0.0, 0.0, ranges[0], step)
        best = strip_search(view, chosen, spot, locus, window, rooms, profile)
        if best < 0:
            best = search(view, chosen, spot, locus, window, room, profile)
        elif 0 < best < count - 1 and off_line(view, chosen[0], spot, locus.low + best * step) > window:
            # along the ray of the first photograph that was: once more from the vertical line
            spot[2] = locus.low + best * step
            locus, profile = Locus(0.0, 0.0, spot[2] - AROUND * step, step), room.profile[: 2 * AROUND + 1]
            again = strip_search(view, chosen, spot, locus, window, rooms, profile)
            best = again if again >= 0 else AROUND
        if profile[best] > 0.0 and 0 < best < len(profile) - 1:
            heights[p] = locus.low + (best + peak_offset(profile, best)) * step
            scores[p] = profile[best]
