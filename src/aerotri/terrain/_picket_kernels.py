"""Pickets: search, shifts in all photographs, intersection of the rays, matching backwards."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel
from aerotri.terrain._intersection_kernels import agreeing_rays
from aerotri.terrain._plan_kernels import (
    LEAST_CORRELATION,
    REDUNDANCY,
    SIGMA_POSTS,
    VTPV,
    Locus,
    Measured,
    make_rooms,
)
from aerotri.terrain._sampling_kernels import sample_cubic
from aerotri.terrain._search_kernels import AROUND, peak_offset, search, second_peak
from aerotri.terrain._shift_kernels import match_shift, template_normals, turned_shift
from aerotri.terrain._strip_kernels import strip_search
from aerotri.terrain._view_kernels import SMALLEST_ANGLE, parallax_per_metre, window_corners
from aerotri.terrain.picket_status import PicketStatus

ACCEPTED, UNSEEN, POOR, AT_END, WEAK, BACKWARD, AMBIGUOUS = (
    int(PicketStatus.ACCEPTED), int(PicketStatus.NOT_SEEN), int(PicketStatus.LOW_CORRELATION),
    int(PicketStatus.AT_END), int(PicketStatus.NO_TEXTURE), int(PicketStatus.BACKWARD), int(PicketStatus.AMBIGUOUS),
)  # fmt: skip
"""Compiled code takes plain numbers."""
SURELY_POOR = 0.7
"""Share of the least correlation below which, between whole posts, no height is looked for more closely."""
FIRST_PHOTOGRAPHS = 3
"""Photographs that are tried as the one the others are matched to."""


class MeasuredNodes(NamedTuple):
    """What became of n nodes.

    status : (n,) int8, number of a `PicketStatus`. tries : (n,) int16 steps aside. The others are those of `Measured`,
    with a first index for the node.
    """

    status: np.ndarray
    tries: np.ndarray
    point: np.ndarray
    covariance: np.ndarray
    used: np.ndarray
    numbers: np.ndarray
    shifts: np.ndarray


@kernel
def locus_check(view, pair, one, spot, plan, room):
    """ACCEPTED, or whether matching along the ray of a photograph ends elsewhere, or as well elsewhere.

    pair : (2,) photographs. one : the one whose ray is followed. room : a `SearchRoom`.
    """
    centres = view.centres
    along_x = (spot[0] - centres[one, 0]) / (spot[2] - centres[one, 2])
    along_y = (spot[1] - centres[one, 1]) / (spot[2] - centres[one, 2])
    per_metre = parallax_per_metre(view, pair, spot)
    step = plan.step * plan.window / per_metre
    count = 2 * int(plan.along_ray / plan.step) + 1
    profile = room.profile[:count]
    middle = count // 2
    locus = Locus(along_x, along_y, spot[2] - middle * step, step)
    best = search(view, pair, spot, locus, plan.window, room, profile)
    if abs(best - middle) * plan.step > 1.0:
        return BACKWARD
    if second_peak(profile, best, int(2.0 / plan.step) + 1) > plan.distinct * profile[best]:
        return AMBIGUOUS
    return ACCEPTED


@kernel
def take_template(view, k, spot, window, room):
    """Grey values of photograph k's window, scaled to a deviation of 1; ACCEPTED, or why there are none."""
    template, corner, shift, weights, bend = room.template, room.corner, room.shift, room.weights, room.bend
    n = template.shape[0]
    shift[:] = 0.0
    if not window_corners(view, k, spot, 0.5 * (n - 1) * window, shift, corner):
        return UNSEEN
    bend[:] = 0.0
    sample_cubic(view, k, corner, bend, template, weights)
    total, squares = 0.0, 0.0
    for q in range(n):
        for p in range(n):
            total += template[q, p]
            squares += template[q, p] ** 2
    mean = total / n**2
    deviation = np.sqrt(max(squares / n**2 - mean * mean, 0.0))
    if not deviation > 0.0:
        return POOR
    for q in range(n):
        for p in range(n):
            template[q, p] = (template[q, p] - mean) / deviation
    return ACCEPTED


@kernel
def all_shifts(view, chosen, spot, curvature, plan, room, measured):
    """Shifts of all photographs against the first, whose template has been taken; how many there are to be matched.

    The correlation of a shift is 0 where the photograph does not show the window.
    """
    shifts, parallax, e, found, window = measured.shifts, measured.parallax, room.e, room.found, plan.window
    least = min(plan.correlation, plan.agreeing)
    centres, a, n, seen = view.centres, chosen[0], room.other.shape[0], 0
    shifts[:] = 0.0
    parallax[:] = np.inf
    ax = (spot[0] - centres[a, 0]) / (centres[a, 2] - spot[2])
    ay = (spot[1] - centres[a, 1]) / (centres[a, 2] - spot[2])
    for k in range(1, len(chosen)):
        b = chosen[k]
        if b < 0:
            continue
        e[0] = (spot[0] - centres[b, 0]) / (centres[b, 2] - spot[2]) - ax
        e[1] = (spot[1] - centres[b, 1]) / (centres[b, 2] - spot[2]) - ay
        length = np.hypot(e[0], e[1])
        if not length > SMALLEST_ANGLE:
            continue
        seen += 1
        e /= length
        bending = 0.5 * curvature * (0.5 * (n - 1) * window) ** 2 * length
        template_normals(room.template, n, e, window, room.normal)
        if match_shift(view, b, spot, window, bending, room):
            turned_shift(found, e, shifts[k])
            if found[4] >= least:
                parallax[k] = np.sqrt(found[2])
    return seen


@kernel
def measure_one(view, chosen, spot, curvature, plan, room, measured):
    """Shifts of all photographs against the first and their intersection; the status.

    Two photographs are enough where their correlation reaches the threshold. Three and more vouch for one another where
    their rays meet: a lower correlation is enough.

    curvature : 1/m, σ of the second derivatives of the ground. room : a `ShiftRoom`. measured : out.
    """
    shifts, used, parallax, numbers = measured.shifts, measured.used, measured.parallax, measured.numbers
    used[:] = False
    status = take_template(view, chosen[0], spot, plan.window, room)
    if status != ACCEPTED:
        return status
    if not all_shifts(view, chosen, spot, curvature, plan, room, measured):
        return UNSEEN
    best, kept = shifts[1:, 5].max(), 0
    for k in range(1, len(chosen)):
        used[k] = np.isfinite(parallax[k])
        kept += used[k]
    numbers[LEAST_CORRELATION] = best
    if kept == 0 or (kept == 1 and best < plan.correlation):
        return POOR
    if not parallax.min() < plan.largest_sigma * plan.window:
        return WEAK
    numbers[VTPV] = agreeing_rays(view, chosen, spot, plan.window, measured, room)
    left = used.sum() - 1
    if numbers[VTPV] < 0.0 or left < min(kept, 2):
        return POOR
    numbers[REDUNDANCY], numbers[LEAST_CORRELATION], numbers[SIGMA_POSTS] = 2.0 * (left + 1) - 3.0, 1.0, np.inf
    for k in range(1, len(chosen)):
        if used[k]:
            numbers[LEAST_CORRELATION] = min(numbers[LEAST_CORRELATION], shifts[k, 5])
            numbers[SIGMA_POSTS] = min(numbers[SIGMA_POSTS], parallax[k] / plan.window)
    return ACCEPTED


@kernel
def matched_back(view, chosen, spot, plan, room, measured):
    """ACCEPTED, or in which way matching along the rays of the best pair ends elsewhere."""
    shifts, used = measured.shifts, measured.used
    pair, best = np.empty(2, np.int64), 1
    for k in range(1, len(chosen)):
        if used[k] and (not used[best] or shifts[k, 5] > shifts[best, 5]):
            best = k
    pair[0], pair[1] = chosen[0], chosen[best]
    status = ACCEPTED
    for side in range(2):
        if status == ACCEPTED:
            status = locus_check(view, pair, pair[1 - side], spot, plan, room)
    return status


@kernel
def measure_at(view, chosen, spot, ground, plan, rooms, measured):
    """Search the vertical line of a spot, measure there, match backwards; the status.

    ground : lowest and highest height, m; σ of the second derivatives of the ground, 1/m.
    """
    low, high, curvature = ground
    room, window = rooms.search, plan.window
    per_metre = parallax_per_metre(view, chosen, spot)
    if not per_metre > SMALLEST_ANGLE:
        return UNSEEN
    step = plan.step * window / per_metre
    count = min(int((high - low) / step) + 2, plan.most_steps)
    profile = room.profile[:count]
    locus = Locus(0.0, 0.0, low, step)
    best = strip_search(view, chosen, spot, locus, window, rooms, profile)
    if best >= 0 and profile[best] < SURELY_POOR * plan.searched:
        measured.numbers[LEAST_CORRELATION] = profile[best]
        return POOR
    near = best - AROUND
    count_near = 2 * AROUND + 1
    found = 0
    if 0 < near < count - count_near:
        profile = room.profile[:count_near]
        found = search(view, chosen, spot, Locus(0.0, 0.0, low + near * step, step), window, room, profile)
    if 0 < found < count_near - 1:
        low, count, best = low + near * step, count_near, found
    else:
        profile = room.profile[:count]
        best = search(view, chosen, spot, locus, window, room, profile)
    if not profile[best] >= 0.0:
        return UNSEEN
    measured.numbers[LEAST_CORRELATION] = profile[best]
    if profile[best] < plan.searched:
        return POOR
    if not 0 < best < count - 1:
        return AT_END
    spot[2] = low + (best + peak_offset(profile, best)) * step
    status = measure_one(view, chosen, spot, curvature, plan, rooms.shifts, measured)
    return matched_back(view, chosen, spot, plan, room, measured) if status == ACCEPTED else status


@kernel
def measure_pickets(view, nodes, curvatures, aside, plan, out):
    """Pickets at nodes, with another photograph as the first, or a little aside, where matching fails.

    Parameters
    ----------
    nodes : `Nodes`; the first of `chosen` may be exchanged with another.
    curvatures : (n,) 1/m, σ of the second derivatives of the ground.
    aside : (t, 2) m, plan offsets tried one after the other, the first being 0, 0.
    out : a `MeasuredNodes`.
    """
    m = nodes.chosen.shape[1]
    profile = max(plan.most_steps, 2 * int(plan.along_ray / plan.step) + 1)
    rooms = make_rooms(plan.posts, profile, plan.most_steps, m)
    spot, parallax, status = np.empty(5), np.empty(m), out.status
    for p in range(len(nodes.places)):
        place, slopes, chosen = nodes.places[p], nodes.slopes[p], nodes.chosen[p]
        measured = Measured(
            out.shifts[p], out.used[p], parallax, out.point[p], out.covariance[p], out.numbers[p]
        )  # fmt: skip
        status[p] = UNSEEN
        if chosen[1] < 0:
            continue
        for t in range(len(aside)):
            out.tries[p] = t
            move = aside[t, 0] * slopes[0] + aside[t, 1] * slopes[1]
            ground = nodes.ranges[p, 0] + move, nodes.ranges[p, 1] + move, curvatures[p]
            for first in range(min(m, FIRST_PHOTOGRAPHS) if t == 0 else 1):
                if chosen[first] < 0:
                    break
                chosen[0], chosen[first] = chosen[first], chosen[0]
                spot[0], spot[1], spot[2] = place[0] + aside[t, 0], place[1] + aside[t, 1], place[2] + move
                spot[3:] = slopes
                found = measure_at(view, chosen, spot, ground, plan, rooms, measured)
                if found == ACCEPTED or found >= BACKWARD:
                    break
                chosen[0], chosen[first] = chosen[first], chosen[0]
            if found != UNSEEN or t == 0:
                status[p] = found
            if found == ACCEPTED or found >= BACKWARD:
                break
