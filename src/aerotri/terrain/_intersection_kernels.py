"""Intersection of the rays of a picket, and which of them agree."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel
from aerotri.functional_model._photo_kernels import partials, project
from aerotri.terrain._shift_kernels import invert

AGREEING_POSTS = 1.0
"""Posts by which a ray may miss the intersection of all."""


@kernel
def intersect(view, chosen, spot, measured, room):
    """Least-squares intersection of the rays of the first and the used photographs; vᵀPv, or −1.

    The variance of a shift between two windows is half that of either one [C]: the first photograph's ray has the mean
    of the halves.

    measured : a `Measured`; its point and covariance are out. room : a `ShiftRoom`.
    """
    m = len(chosen)
    shifts, used, point, covariance = measured.shifts, measured.used, measured.point, measured.covariance
    ideal, weight = room.ideal, room.ray_weight
    for k in range(m):
        if not used[k]:
            continue
        x, y = spot[0] + shifts[k, 0], spot[1] + shifts[k, 1]
        ideal[k, 0], ideal[k, 1], _ = project(view.photos, 0, chosen[k], x, y, spot[2])
        a0, a1, _, b0, b1, _ = partials(view.photos, 0, chosen[k], x, y, spot[2])
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
            x, y, u3 = project(view.photos, 0, chosen[k], point[0], point[1], point[2])
            if not u3 < 0.0:
                return -1.0
            gx, gy = ideal[k, 0] - x, ideal[k, 1] - y
            a = partials(view.photos, 0, chosen[k], point[0], point[1], point[2])
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
def worst_ray(view, chosen, measured, ideal, window):
    """The photograph, of those used but the first, whose ray misses a point most, and by how many posts."""
    used, point, worst, most = measured.used, measured.point, -1, 0.0
    for k in range(1, len(chosen)):
        if used[k]:
            x, y, u3 = project(view.photos, 0, chosen[k], point[0], point[1], point[2])
            away = np.hypot(ideal[k, 0] - x, ideal[k, 1] - y) * abs(u3 / view.photos[0, chosen[k], 12]) / window
            if away > most:
                worst, most = k, away
    return worst, most


@kernel
def agreeing_rays(view, chosen, spot, window, measured, room):
    """Intersect the used rays; those that miss the point are left out one by one. vᵀPv, or −1.

    The first photograph has the mean of the variances of the others.
    """
    shifts, used = measured.shifts, measured.used
    while True:
        kept = 0
        shifts[0, 2:5] = 0.0
        for k in range(1, len(chosen)):
            if used[k]:
                kept += 1
                shifts[0, 2:5] += shifts[k, 2:5]
        if kept == 0:
            return -1.0
        shifts[0, 2:5] /= kept
        used[0] = True
        total = intersect(view, chosen, spot, measured, room)
        if total < 0.0:
            return -1.0
        worst, away = worst_ray(view, chosen, measured, room.ideal, window)
        if away <= AGREEING_POSTS:
            return total
        used[worst] = False
