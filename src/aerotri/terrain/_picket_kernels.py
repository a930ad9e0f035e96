"""Pickets: search, shifts in all photographs, intersection of the rays, matching backwards."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel
from aerotri.terrain._intersection_kernels import agreeing_rays
from aerotri.terrain._sampling_kernels import sample_cubic
from aerotri.terrain._search_kernels import AROUND, make_room, peak_offset, search, second_peak
from aerotri.terrain._shift_kernels import UNKNOWNS, match_shift, template_normals, turned_shift
from aerotri.terrain._strip_kernels import make_strips, strip_search
from aerotri.terrain._view_kernels import SMALLEST_ANGLE, parallax_per_metre, window_corners

ACCEPTED, UNSEEN, POOR, AT_END, WEAK = 0, 1, 2, 3, 4
BACKWARD, AMBIGUOUS = 5, 6
"""Status of a picket; from `BACKWARD` on it was measured and is in error."""
SURELY_POOR = 0.7
"""Share of the least correlation below which, between whole posts, no height is looked for more closely."""
FIRST_PHOTOGRAPHS = 3
"""Photographs that are tried as the one the others are matched to."""


@kernel
def locus_check(view, chosen, one, spot, point_z, rays_px, window, step_px, distinct, room):
    """ACCEPTED, or whether matching along the ray of a photograph ends elsewhere, or as well elsewhere.

    Parameters
    ----------
    chosen : (2,) the pair. one : the photograph whose ray is followed. rays_px : posts searched to either side.
    distinct : share of the best correlation that another place may not reach.
    """
    centres, along = view[4], np.empty(2)
    along[0] = (spot[0] - centres[one, 0]) / (spot[2] - centres[one, 2])
    along[1] = (spot[1] - centres[one, 1]) / (spot[2] - centres[one, 2])
    per_metre = parallax_per_metre(view, chosen, spot)
    step = step_px * window / per_metre
    count = 2 * int(rays_px / step_px) + 1
    profile = room[4][:count]
    middle = count // 2
    best = search(view, chosen, spot, along, spot[2] - middle * step, step, window, room, profile)
    if abs(best - middle) * step_px > 1.0:
        return BACKWARD
    if second_peak(profile, best, int(2.0 / step_px) + 1) > distinct * profile[best]:
        return AMBIGUOUS
    return ACCEPTED


@kernel
def take_template(view, k, spot, window, template, room):
    """Grey values of photograph k's window, scaled to a deviation of 1; ACCEPTED, or why there are none."""
    corner, shift, weights, bend = room[0], room[1], room[2], room[6]
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
def all_shifts(view, chosen, spot, curvature, window, least, work, shifts, parallax):
    """Shifts of all photographs against the first, whose template has been taken; how many there are to be matched.

    Parameters
    ----------
    least : correlation below which a shift is none.
    shifts : (m, 6) of `intersect`, then the correlation, 0 where the photograph does not show the window.
    parallax : (m,) m, σ of the shifts along the base, ∞ where there is none.
    """
    template, other, normal, room, e, found = work
    centres, a, n, seen = view[4], chosen[0], other.shape[0], 0
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
        template_normals(template, n, e, window, normal)
        if match_shift(view, b, spot, e, window, bending, template, other, normal, room, found):
            turned_shift(found, e, shifts[k])
            if found[4] >= least:
                parallax[k] = np.sqrt(found[2])
    return seen


@kernel
def measure_one(
    view, chosen, spot, curvature, window, limits, work, shifts, used, parallax, point, covariance, numbers
):  # fmt: skip
    """Shifts of all photographs against the first and their intersection; the status.

    Two photographs are enough where their correlation reaches the threshold. Three and more vouch for one another where
    their rays meet: a lower correlation is enough.

    curvature : 1/m, σ of the second derivatives of the ground. limits : correlation threshold, the same for photographs
    that agree, largest σ of a parallax in posts. numbers : (4,) out: vᵀPv, redundancy, lowest correlation of a ray, σ
    of the parallax in posts.
    """
    template, room = work[0], work[3]
    used[:] = False
    status = take_template(view, chosen[0], spot, window, template, room)
    if status != ACCEPTED:
        return status
    least = min(limits[0], limits[1])
    if not all_shifts(view, chosen, spot, curvature, window, least, work, shifts, parallax):
        return UNSEEN
    best, kept = shifts[1:, 5].max(), 0
    for k in range(1, len(chosen)):
        used[k] = np.isfinite(parallax[k])
        kept += used[k]
    numbers[2] = best
    if kept == 0 or (kept == 1 and best < limits[0]):
        return POOR
    if not parallax.min() < limits[2] * window:
        return WEAK
    numbers[0] = agreeing_rays(view, chosen, shifts, used, spot, window, room, point, covariance)
    left = used.sum() - 1
    if numbers[0] < 0.0 or left < min(kept, 2):
        return POOR
    numbers[1], numbers[2], numbers[3] = 2.0 * (left + 1) - 3.0, 1.0, np.inf
    for k in range(1, len(chosen)):
        if used[k]:
            numbers[2] = min(numbers[2], shifts[k, 5])
            numbers[3] = min(numbers[3], parallax[k] / window)
    return ACCEPTED


@kernel
def matched_back(view, chosen, shifts, used, spot, point_z, settings, window, room):
    """ACCEPTED, or in which way matching along the rays of the best pair ends elsewhere."""
    step_px, _, rays_px, distinct = settings
    pair, best = np.empty(2, np.int64), 1
    for k in range(1, len(chosen)):
        if used[k] and (not used[best] or shifts[k, 5] > shifts[best, 5]):
            best = k
    pair[0], pair[1] = chosen[0], chosen[best]
    status = ACCEPTED
    for side in range(2):
        if status == ACCEPTED:
            status = locus_check(view, pair, pair[1 - side], spot, point_z, rays_px, window, step_px, distinct, room)
    return status


@kernel
def measure_at(
    view, chosen, spot, curvature, low, high, window, settings, limits, room, strips, work, shifts, used, parallax,
    point, covariance, numbers,
):  # fmt: skip
    """Search the vertical line of a spot from low to high, measure there, match backwards; the status."""
    per_metre = parallax_per_metre(view, chosen, spot)
    if not per_metre > SMALLEST_ANGLE:
        return UNSEEN
    along = np.zeros(2)
    step = settings[0] * window / per_metre
    count = min(int((high - low) / step) + 2, int(settings[1]))
    profile = room[4][:count]
    best = strip_search(view, chosen, spot, low, step, window, room, strips, profile)
    if best >= 0 and profile[best] < SURELY_POOR * limits[3]:
        numbers[2] = profile[best]
        return POOR
    near = best - AROUND
    count_near = 2 * AROUND + 1
    found = 0
    if 0 < near < count - count_near:
        profile = room[4][:count_near]
        found = search(view, chosen, spot, along, low + near * step, step, window, room, profile)
    if 0 < found < count_near - 1:
        low, count, best = low + near * step, count_near, found
    else:
        profile = room[4][:count]
        best = search(view, chosen, spot, along, low, step, window, room, profile)
    if not profile[best] >= 0.0:
        return UNSEEN
    numbers[2] = profile[best]
    if profile[best] < limits[3]:
        return POOR
    if not 0 < best < count - 1:
        return AT_END
    spot[2] = low + (best + peak_offset(profile, best)) * step
    status = measure_one(
        view, chosen, spot, curvature, window, limits, work, shifts, used, parallax, point, covariance, numbers
    )  # fmt: skip
    if status == ACCEPTED:
        return matched_back(view, chosen, shifts, used, spot, point[2], settings, window, room)
    return status


@kernel
def measure_pickets(view, nodes, slopes, curvatures, ranges, chosen, aside, posts, window, settings, limits, out):
    """Pickets at nodes, with another photograph as the first, or a little aside, where matching fails.

    Parameters
    ----------
    nodes, slopes, ranges, chosen, posts, window : as in `find_heights`; the first of `chosen` may be exchanged with
        another. curvatures : (n,) 1/m, σ of the second derivatives of the ground.
    aside : (t, 2) m, plan offsets tried one after the other, the first being 0, 0.
    settings : (4,) step of the heights in posts, most steps, posts searched along rays, distinctness.
    limits : (4,) of `measure_one`, and the correlation of the search below which nothing is measured.
    out : status (n,) int8, tries (n,) int16, point (n, 3), covariance (n, 3, 3), used (n, m) bool, numbers (n, 4),
        shifts (n, m, 6).
    """
    status, tries, points, covariances, used, numbers, shifts = out
    m = chosen.shape[1]
    room = make_room(posts, max(int(settings[1]), 2 * int(settings[2] / settings[0]) + 1), m)
    strips = make_strips(posts, int(settings[1]), m)
    of_shifts = (
        np.empty((4, 2)), np.zeros(6), np.empty((2, 4)), np.empty(UNKNOWNS), np.empty((m, 2)), np.empty((m, 3)),
        np.empty(5), np.empty((UNKNOWNS, UNKNOWNS)),
    )  # fmt: skip
    work = (
        np.empty((posts + 2, posts + 2)), np.empty((posts, posts)), np.empty((UNKNOWNS, UNKNOWNS)), of_shifts,
        np.empty(2), np.empty(5),
    )  # fmt: skip
    spot, parallax = np.empty(5), np.empty(m)
    for p in range(len(nodes)):
        status[p] = UNSEEN
        if chosen[p, 1] < 0:
            continue
        for t in range(len(aside)):
            tries[p] = t
            move = aside[t, 0] * slopes[p, 0] + aside[t, 1] * slopes[p, 1]
            for first in range(min(m, FIRST_PHOTOGRAPHS) if t == 0 else 1):
                if chosen[p, first] < 0:
                    break
                chosen[p, 0], chosen[p, first] = chosen[p, first], chosen[p, 0]
                spot[0], spot[1], spot[2] = nodes[p, 0] + aside[t, 0], nodes[p, 1] + aside[t, 1], nodes[p, 2] + move
                spot[3:] = slopes[p]
                found = measure_at(
                    view, chosen[p], spot, curvatures[p], ranges[p, 0] + move, ranges[p, 1] + move, window, settings,
                    limits, room, strips, work, shifts[p], used[p], parallax, points[p], covariances[p], numbers[p],
                )  # fmt: skip
                if found == ACCEPTED or found >= BACKWARD:
                    break
                chosen[p, 0], chosen[p, first] = chosen[p, first], chosen[p, 0]
            if found != UNSEEN or t == 0:
                status[p] = found
            if found == ACCEPTED or found >= BACKWARD:
                break
