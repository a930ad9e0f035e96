"""Pickets: search, shifts in all photographs, intersection of the rays, matching backwards."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel
from aerotri.deformation._kernels import partials, project
from aerotri.terrain._sampling_kernels import sample_cubic
from aerotri.terrain._search_kernels import SMALLEST_ANGLE, make_room, peak_offset, search, second_peak
from aerotri.terrain._shift_kernels import UNKNOWNS, invert, match_shift, template_normals, turned_shift
from aerotri.terrain._view_kernels import parallax_per_metre, window_corners

ACCEPTED, UNSEEN, POOR, AT_END, WEAK = 0, 1, 2, 3, 4
BACKWARD, AMBIGUOUS = 5, 6
"""Status of a picket; from `BACKWARD` on it was measured and is in error."""


@kernel
def intersect(view, chosen, shifts, used, spot, point, covariance, ideal, weight):
    """Least-squares intersection of the rays of the first and the used photographs; vᵀPv, or −1.

    The variance of a shift between two windows is half that of either one [C]: the first photograph's ray has the mean
    of the halves.

    Parameters
    ----------
    shifts : (m, 6) of `match_shift`, turned into x and y of the plan: dx, dy, their variances, covariance.
    point : (3,), covariance : (3, 3) out. ideal (m, 2), weight (m, 3) room.
    """
    m = len(chosen)
    for k in range(m):
        if not used[k]:
            continue
        x, y = spot[0] + shifts[k, 0], spot[1] + shifts[k, 1]
        ideal[k, 0], ideal[k, 1], _ = project(view[0], 0, chosen[k], x, y, spot[2])
        a0, a1, _, b0, b1, _ = partials(view[0], 0, chosen[k], x, y, spot[2])
        sxx, syy, sxy = 0.5 * shifts[k, 2], 0.5 * shifts[k, 3], 0.5 * shifts[k, 4]
        vx = a0 * a0 * sxx + 2.0 * a0 * a1 * sxy + a1 * a1 * syy
        vy = b0 * b0 * sxx + 2.0 * b0 * b1 * sxy + b1 * b1 * syy
        vxy = a0 * b0 * sxx + (a0 * b1 + a1 * b0) * sxy + a1 * b1 * syy
        determinant = vx * vy - vxy * vxy
        if not determinant > 0.0:
            return -1.0
        weight[k, 0], weight[k, 1], weight[k, 2] = vy / determinant, vx / determinant, -vxy / determinant
    right = np.empty(3)
    point[0], point[1], point[2] = spot[0], spot[1], spot[2]
    total = 0.0
    for _ in range(4):
        covariance[:] = 0.0
        right[:] = 0.0
        total = 0.0
        for k in range(m):
            if not used[k]:
                continue
            x, y, u3 = project(view[0], 0, chosen[k], point[0], point[1], point[2])
            if not u3 < 0.0:
                return -1.0
            gx, gy = ideal[k, 0] - x, ideal[k, 1] - y
            a = partials(view[0], 0, chosen[k], point[0], point[1], point[2])
            wx, wy, wxy = weight[k, 0], weight[k, 1], weight[k, 2]
            total += gx * gx * wx + 2.0 * gx * gy * wxy + gy * gy * wy
            for i in range(3):
                px, py = a[i] * wx + a[3 + i] * wxy, a[i] * wxy + a[3 + i] * wy
                right[i] += px * gx + py * gy
                for j in range(3):
                    covariance[i, j] += px * a[j] + py * a[3 + j]
        scale = covariance[0, 0] + covariance[1, 1] + covariance[2, 2]
        covariance /= scale
        if not invert(covariance, 3):
            return -1.0
        covariance /= scale
        for i in range(3):
            point[i] += covariance[i, 0] * right[0] + covariance[i, 1] * right[1] + covariance[i, 2] * right[2]
    return total


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
def measure_one(
    view, chosen, spot, curvature, window, limits, template, other, normal, room, shifts, used, point, covariance,
    numbers,
):  # fmt: skip
    """Shifts of all photographs against the first and their intersection; the status.

    curvature : 1/m, σ of the second derivatives of the ground. limits : correlation threshold, largest σ of a parallax
    in posts. numbers : (4,) out: vᵀPv, redundancy, lowest
    correlation of a ray, σ of the parallax in posts.
    """
    centres, a = view[4], chosen[0]
    corner, shift, weights = room[0], room[1], room[2]
    n, m = other.shape[0], len(chosen)
    shift[:] = 0.0
    used[:] = False
    shifts[:] = 0.0
    if not window_corners(view, a, spot, 0.5 * (n + 1) * window, shift, corner):
        return UNSEEN
    room[6][:] = 0.0
    sample_cubic(view, a, corner, room[6], template, weights)
    total, squares = 0.0, 0.0
    for q in range(n + 2):
        for p in range(n + 2):
            total += template[q, p]
            squares += template[q, p] ** 2
    mean = total / (n + 2) ** 2
    deviation = np.sqrt(max(squares / (n + 2) ** 2 - mean * mean, 0.0))
    if not deviation > 0.0:
        return POOR
    for q in range(n + 2):
        for p in range(n + 2):
            template[q, p] = (template[q, p] - mean) / deviation
    e, found, kept, seen = np.empty(2), np.empty(6), 0, 0
    best, sum_x, sum_y, sum_xy = 0.0, 0.0, 0.0, 0.0
    numbers[2], numbers[3] = 1.0, np.inf
    ax = (spot[0] - centres[a, 0]) / (centres[a, 2] - spot[2])
    ay = (spot[1] - centres[a, 1]) / (centres[a, 2] - spot[2])
    for k in range(1, m):
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
        if not match_shift(view, b, spot, e, window, bending, template, other, normal, room, found):
            continue
        best = max(best, found[5])
        if found[5] < limits[0]:
            continue
        turned_shift(found, e, shifts[k])
        used[k] = True
        kept += 1
        numbers[2] = min(numbers[2], found[5])
        numbers[3] = min(numbers[3], np.sqrt(found[2]) / window)
        sum_x, sum_y, sum_xy = sum_x + shifts[k, 2], sum_y + shifts[k, 3], sum_xy + shifts[k, 4]
    if not seen:
        return UNSEEN
    if not kept:
        numbers[2] = best
        return POOR
    if not numbers[3] < limits[1]:
        return WEAK
    used[0] = True
    shifts[0, 2], shifts[0, 3], shifts[0, 4] = sum_x / kept, sum_y / kept, sum_xy / kept
    numbers[0] = intersect(view, chosen, shifts, used, spot, point, covariance, room[4], room[5])
    numbers[1] = 2.0 * (kept + 1) - 3.0
    return ACCEPTED if numbers[0] >= 0.0 else WEAK


@kernel
def measure_pickets(view, nodes, slopes, curvatures, ranges, chosen, aside, posts, window, settings, limits, out):
    """Pickets at nodes, or a little aside where matching fails.

    Parameters
    ----------
    nodes, slopes, ranges, chosen, posts, window : as in `find_heights`. curvatures : (n,) 1/m, σ of the second
        derivatives of the ground.
    aside : (t, 2) m, plan offsets tried one after the other, the first being 0, 0.
    settings : (4,) step of the heights in posts, most steps, posts searched along rays, distinctness.
    limits : (3,) correlation threshold, largest σ of a parallax in posts, correlation of the search below which
        nothing is measured.
    out : status (n,) int8, tries (n,) int16, point (n, 3), covariance (n, 3, 3), used (n, m) bool, numbers (n, 4),
        shifts (n, m, 6).
    """
    status, tries, points, covariances, used, numbers, shifts = out
    step_px, most, rays_px, distinct = settings
    room = make_room(posts, max(int(most), 2 * int(rays_px / step_px) + 1))
    m = chosen.shape[1]
    work = (
        np.empty((4, 2)), np.zeros(6), np.empty((2, 4)), np.empty(UNKNOWNS), np.empty((m, 2)), np.empty((m, 3)),
        np.empty(5), np.empty((UNKNOWNS, UNKNOWNS)),
    )  # fmt: skip
    template, other = np.empty((posts + 2, posts + 2)), np.empty((posts, posts))
    normal = np.empty((UNKNOWNS, UNKNOWNS))
    spot, along, pair = np.empty(5), np.zeros(2), np.empty(2, np.int64)
    for p in range(len(nodes)):
        status[p] = UNSEEN
        for t in range(len(aside)):
            tries[p] = t
            spot[3:] = slopes[p]
            spot[0], spot[1] = nodes[p, 0] + aside[t, 0], nodes[p, 1] + aside[t, 1]
            move = aside[t, 0] * slopes[p, 0] + aside[t, 1] * slopes[p, 1]
            spot[2] = nodes[p, 2] + move
            per_metre = parallax_per_metre(view, chosen[p], spot) if chosen[p, 1] >= 0 else 0.0
            if not per_metre > SMALLEST_ANGLE:
                break
            step = step_px * window / per_metre
            low = ranges[p, 0] + move
            count = min(int((ranges[p, 1] - ranges[p, 0]) / step) + 2, int(most))
            profile = room[4][:count]
            best = search(view, chosen[p], spot, along, low, step, window, room, profile)
            found = UNSEEN
            if profile[best] >= 0.0:
                found = POOR
                numbers[p, 2] = profile[best]
            if profile[best] >= limits[2]:
                found = AT_END
                if 0 < best < count - 1:
                    spot[2] = low + (best + peak_offset(profile, best)) * step
                    found = measure_one(
                        view, chosen[p], spot, curvatures[p], window, limits, template, other, normal, work,
                        shifts[p], used[p], points[p], covariances[p], numbers[p],
                    )  # fmt: skip
            if found == UNSEEN and t > 0:
                continue
            status[p] = found
            if found == ACCEPTED:
                best_k = 1
                for k in range(1, m):
                    if used[p, k] and (not used[p, best_k] or shifts[p, k, 5] > shifts[p, best_k, 5]):
                        best_k = k
                pair[0], pair[1] = chosen[p, 0], chosen[p, best_k]
                for side in range(2):
                    if status[p] == ACCEPTED:
                        status[p] = locus_check(
                            view, pair, pair[1 - side], spot, points[p, 2], rays_px, window, step_px, distinct, room
                        )  # fmt: skip
                break
