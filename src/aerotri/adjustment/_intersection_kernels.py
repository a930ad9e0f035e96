"""Kernel of the forward intersection used for start values."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel, leaf_kernel

ITERATIONS = 6
"""Solutions of a point, each with the weights of the one before, the first with equal ones [C]: with fewer a wrong ray
still pulls, more change a start value by nothing that matters."""


@leaf_kernel
def smallest_eigenvalue(a):
    """Of a symmetric 3 × 3 matrix, in closed form."""
    mean = (a[0, 0] + a[1, 1] + a[2, 2]) / 3.0
    off = a[0, 1] * a[0, 1] + a[0, 2] * a[0, 2] + a[1, 2] * a[1, 2]
    spread = (a[0, 0] - mean) ** 2 + (a[1, 1] - mean) ** 2 + (a[2, 2] - mean) ** 2 + 2.0 * off
    if spread <= 1e-300:
        return mean
    p = np.sqrt(spread / 6.0)
    b00, b11, b22 = (a[0, 0] - mean) / p, (a[1, 1] - mean) / p, (a[2, 2] - mean) / p
    b01, b02, b12 = a[0, 1] / p, a[0, 2] / p, a[1, 2] / p
    half = 0.5 * (b00 * (b11 * b22 - b12 * b12) - b01 * (b01 * b22 - b12 * b02) + b02 * (b01 * b12 - b11 * b02))
    angle = np.arccos(min(1.0, max(-1.0, half))) / 3.0
    return mean + 2.0 * p * np.cos(angle + 2.0 * np.pi / 3.0)


@leaf_kernel
def solve_three(a, b, x):
    """x = a⁻¹·b for a symmetric positive definite 3 × 3 matrix, by its adjugate."""
    c00 = a[1, 1] * a[2, 2] - a[1, 2] * a[1, 2]
    c01 = a[0, 2] * a[1, 2] - a[0, 1] * a[2, 2]
    c02 = a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1]
    c11 = a[0, 0] * a[2, 2] - a[0, 2] * a[0, 2]
    c12 = a[0, 1] * a[0, 2] - a[0, 0] * a[1, 2]
    c22 = a[0, 0] * a[1, 1] - a[0, 1] * a[0, 1]
    det = a[0, 0] * c00 + a[0, 1] * c01 + a[0, 2] * c02
    x[0] = (c00 * b[0] + c01 * b[1] + c02 * b[2]) / det
    x[1] = (c01 * b[0] + c11 * b[1] + c12 * b[2]) / det
    x[2] = (c02 * b[0] + c12 * b[1] + c22 * b[2]) / det


@kernel
def median(values, n, ordered):
    """Of the first n > 0 values; ordered : scratch of that length. np.median costs a second of compilation."""
    for k in range(n):
        place = k
        while place > 0 and ordered[place - 1] > values[k]:
            ordered[place] = ordered[place - 1]
            place -= 1
        ordered[place] = values[k]
    return 0.5 * (ordered[(n - 1) // 2] + ordered[n // 2])


@kernel
def intersect_points(start, centre, ray, tolerance, limit, xyz):
    """The point nearest to its rays, for rays in point order; NaN where they do not meet under a real angle.

    Distances are angular (a ray's distance over its length); a ray off by more than its tolerance, or by more than the
    point's median, loses weight. Coordinates are reduced to the first centre.

    start : (P + 1,); centre, ray : (m, 3), unit rays; tolerance : (m,); limit : smallest eigenvalue per ray.
    """
    normal, right, x, gap = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    most = 1
    for p in range(len(start) - 1):
        most = max(most, start[p + 1] - start[p])
    weight, angle, ordered = np.empty(most), np.empty(most), np.empty(most)
    for p in range(len(start) - 1):
        first, n = start[p], start[p + 1] - start[p]
        xyz[p, 0] = xyz[p, 1] = xyz[p, 2] = np.nan
        if n < 2:
            continue
        for q in range(n):
            weight[q] = 1.0
        ok, behind = True, 0
        for iteration in range(ITERATIONS):
            normal[:] = 0.0
            right[:] = 0.0
            total = 0.0
            for q in range(n):
                total += weight[q]
                d = ray[first + q]
                along = 0.0
                for a in range(3):
                    along += d[a] * (centre[first + q, a] - centre[first, a])
                for a in range(3):
                    right[a] += weight[q] * (centre[first + q, a] - centre[first, a] - d[a] * along)
                    for b in range(3):
                        normal[a, b] -= weight[q] * d[a] * d[b]
                    normal[a, a] += weight[q]
            if not smallest_eigenvalue(normal) > limit * total:
                ok = False
                break
            solve_three(normal, right, x)
            behind = 0
            for q in range(n):
                d, along, length = ray[first + q], 0.0, 0.0
                for a in range(3):
                    gap[a] = x[a] + centre[first, a] - centre[first + q, a]
                    along += gap[a] * d[a]
                    length += gap[a] * gap[a]
                across = max(length - along * along, 0.0)
                angle[q] = np.sqrt(across / length)
                weight[q] = 1.0 / length
                if along < 0.0:
                    behind += 1
            if n > 2 and iteration < ITERATIONS - 1:
                middle = median(angle, n, ordered)
                for q in range(n):
                    scale = max(3.0 * tolerance[first + q], middle)
                    weight[q] /= 1.0 + (angle[q] / scale) ** 2
            largest = 0.0
            for q in range(n):
                largest = max(largest, weight[q])
            for q in range(n):
                weight[q] /= largest
        if ok and 2 * behind <= n:
            for a in range(3):
                xyz[p, a] = x[a] + centre[first, a]
