"""Kernels of one object point: partials of its rays, its own normals, and its elimination.

`problem` and `work` are described in `kernel_records`.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment._intersection_kernels import smallest_eigenvalue
from aerotri.adjustment._robust_kernels import NONE, robust_factor
from aerotri.adjustment.kernel_records import Work
from aerotri.compiled import inlined, kernel, leaf_kernel
from aerotri.functional_model._kernels import INTERIOR, linearise_ray
from aerotri.functional_model._scan_kernels import place_in_scan, scan_partials

E = 6
"""Elements of exterior orientation of a ray: projection centre and rotation."""
MIN_PIVOT = 1e-14
"""Share of a diagonal element of a point's 3 × 3 below which its pivot is taken for rounding [C]: doubles carry 2e-16;
a larger limit would refuse points of very narrow rays, which `weak_geometry` judges by their σ."""

FARTHEST = 1e30
"""Coordinate, m, and size of a step beyond which nothing is gone to [C]: farther than anything that can be
photographed, and so near that squares and fourth powers of it, and of their inverse, are still numbers."""


@kernel
def scratch(max_rays, max_columns, n_shared):
    """Arrays one thread needs for a point: whitened partials of its rays, their columns, and the point's own 3 × ·."""
    return Work(
        np.empty((max_rays, 2, E)),
        np.empty((max_rays, 2, 3)),
        np.empty((max_rays, 2, max_columns)),
        np.empty((max_rays, 2)),
        np.empty((max_rays, max_columns), np.int64),
        np.empty(max_rays, np.int64),
        np.empty(n_shared, np.int64),
        np.full(n_shared, -1, np.int64),
        np.empty((max_rays, 3, E)),
        np.empty((3, n_shared)),
        np.empty((2, INTERIOR)),
        np.empty(2),
        np.empty(3),
        np.empty((3, 3)),
    )


@inlined
def turn_row(by_eo, turn):
    """Partials (6,) by small rotations about other axes; turn (3, 3)."""
    d0, d1, d2 = by_eo[3], by_eo[4], by_eo[5]
    t0 = d0 * turn[0, 0] + d1 * turn[1, 0] + d2 * turn[2, 0]
    t1 = d0 * turn[0, 1] + d1 * turn[1, 1] + d2 * turn[2, 1]
    t2 = d0 * turn[0, 2] + d1 * turn[1, 2] + d2 * turn[2, 2]
    by_eo[3], by_eo[4], by_eo[5] = t0, t1, t2


@inlined
def whiten_row(by_eo, by_pt, f, eo_free, point_free):
    """One row's partials times f, 0 where a value is held; by_eo and eo_free (6,), by_pt and point_free (3,).

    Written out: the compiler cannot know that the arrays do not overlap.
    """
    e0, e1, e2 = by_eo[0] * f * eo_free[0], by_eo[1] * f * eo_free[1], by_eo[2] * f * eo_free[2]
    e3, e4, e5 = by_eo[3] * f * eo_free[3], by_eo[4] * f * eo_free[4], by_eo[5] * f * eo_free[5]
    p0, p1, p2 = by_pt[0] * f * point_free[0], by_pt[1] * f * point_free[1], by_pt[2] * f * point_free[2]
    by_eo[0], by_eo[1], by_eo[2], by_eo[3], by_eo[4], by_eo[5] = e0, e1, e2, e3, e4, e5
    by_pt[0], by_pt[1], by_pt[2] = p0, p1, p2


@leaf_kernel
def linearise_point(p, rays, table, values, points, weighting, work):
    """Whitened partials and misclosures of the rays of point p into `work`; its residuals and weights out.

    Returns the cost of its rays and the number of shared parameters that act on them.
    """
    residual, weight, estimator, limit = weighting.residual, weighting.weight, weighting.estimator, weighting.limit
    start, image, xy, at, inv_sigma = rays.start, rays.image, rays.xy, rays.at, rays.inv_sigma
    ap_index, ap_value = rays.ap_index, rays.ap_value
    lens_columns, eo_free, turn, kept = table.lens_columns, table.eo_free, table.turn, table.kept
    xyz, point_free = points.xyz, points.free
    by_eo, by_pt, by_sh, whitened = work.by_eo, work.by_pt, work.by_sh, work.whitened
    columns, n_columns, union, place = work.columns, work.n_columns, work.union, work.place
    by_interior, prediction, moved, rolled = work.by_interior, work.prediction, work.moved, work.turned
    scans = values.scans
    rate, readout, velocity, spin, scan_columns = (
        scans.rate, scans.readout, scans.velocity, scans.spin, scans.columns,
    )  # fmt: skip
    n_scans, used, turns = rate.shape[0], lens_columns.shape[1], turn.shape[0] > 0
    rotation, centre, interior, shared = values.rotation, values.centre, values.interior, values.shared
    lens_row = rays.lens_row
    cost, n_union = 0.0, 0
    for q in range(start[p + 1] - start[p]):
        ray = start[p] + q
        i, lens = image[ray], lens_row[ray]
        of_rotation, of_centre, per_ms, tau = rotation[i], centre[i], 0.0, 0.0
        if n_scans:
            per_ms = rate[i, 0] * at[ray, 0] + rate[i, 1] * at[ray, 1]
            tau = per_ms * readout[i]
            if tau != 0.0:
                place_in_scan(tau, rotation[i], centre[i], velocity[i], spin[i], moved, rolled)
                of_rotation, of_centre = rolled, moved
        linearise_ray(
            of_rotation, of_centre, xyz[p], interior[lens], at[ray, 0], at[ray, 1],
            prediction, by_eo[q], by_pt[q], by_interior, used,
        )  # fmt: skip
        n = 0
        if n_scans and per_ms != 0.0:
            n = scan_partials(
                per_ms, tau, rotation[i], velocity[i], spin[i], by_eo[q], scan_columns[i], by_sh[q], columns[q], 0,
            )  # fmt: skip
        for t in range(used):
            if lens_columns[lens, t] >= 0:
                columns[q, n] = lens_columns[lens, t]
                by_sh[q, 0, n], by_sh[q, 1, n] = by_interior[0, t], by_interior[1, t]
                n += 1
        for t in range(ap_index.shape[1]):
            if ap_value[ray, 0, t] != 0.0 or ap_value[ray, 1, t] != 0.0:
                columns[q, n] = ap_index[ray, t]
                by_sh[q, 0, n], by_sh[q, 1, n] = ap_value[ray, 0, t], ap_value[ray, 1, t]
                prediction[0] += ap_value[ray, 0, t] * shared[ap_index[ray, t]]
                prediction[1] += ap_value[ray, 1, t] * shared[ap_index[ray, t]]
                n += 1
        if kept[p] >= 0:
            for t in range(3):
                columns[q, n] = kept[p] + t
                by_sh[q, 0, n], by_sh[q, 1, n] = by_pt[q, 0, t], by_pt[q, 1, t]
                n += 1
        n_columns[q] = n
        residual[ray, 0], residual[ray, 1] = xy[ray, 0] - prediction[0], xy[ray, 1] - prediction[1]
        ex, ey = residual[ray, 0] * inv_sigma[ray, 0], residual[ray, 1] * inv_sigma[ray, 1]
        factor, root = 1.0, 1.0
        if estimator == NONE:
            cost += ex * ex + ey * ey
        else:
            factor, ray_cost = robust_factor(np.sqrt(ex * ex + ey * ey), estimator, limit)
            root = np.sqrt(factor)
            cost += ray_cost
        weight[ray] = factor
        whitened[q, 0], whitened[q, 1] = ex * root, ey * root
        for row in range(2):
            f = inv_sigma[ray, row] * root
            if turns:
                turn_row(by_eo[q, row], turn[i])
            whiten_row(by_eo[q, row], by_pt[q, row], f, eo_free[i], point_free[p])
            for t in range(n):
                by_sh[q, row, t] *= f
        for t in range(n):
            column = columns[q, t]
            if place[column] < 0:
                place[column] = n_union
                union[n_union] = column
                n_union += 1
            columns[q, t] = place[column]
    for t in range(n_union):
        place[union[t]] = -1
    return cost, n_union


@leaf_kernel
def point_normals(p, n_rays, points, damping, work, elimination):
    """Cholesky factor of the 3 × 3 normals of point p, and its right side times its inverse, into `elimination`.

    Returns the cost of the coordinates observed, and False where the rays do not determine the point.
    """
    xyz, prior_xyz, prior_weight, point_free = points.xyz, points.prior_xyz, points.prior_weight, points.free
    by_pt, whitened, lower, misclosure = work.by_pt, work.whitened, elimination.lower, elimination.misclosure
    cost = 0.0
    n00, n10, n11, n20, n21, n22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    y0, y1, y2 = 0.0, 0.0, 0.0
    for q in range(n_rays):
        for row in range(2):
            p0, p1, p2, e = by_pt[q, row, 0], by_pt[q, row, 1], by_pt[q, row, 2], whitened[q, row]
            n00 += p0 * p0
            n10 += p1 * p0
            n11 += p1 * p1
            n20 += p2 * p0
            n21 += p2 * p1
            n22 += p2 * p2
            y0 += p0 * e
            y1 += p1 * e
            y2 += p2 * e
    lower[0, 0], lower[1, 0], lower[1, 1], lower[2, 0], lower[2, 1], lower[2, 2] = n00, n10, n11, n20, n21, n22
    misclosure[0], misclosure[1], misclosure[2] = y0, y1, y2
    for t in range(3):
        if prior_weight[p, t] > 0.0:
            gap = prior_xyz[p, t] - xyz[p, t]
            cost += prior_weight[p, t] * gap * gap
            lower[t, t] += prior_weight[p, t] * point_free[p, t]
            misclosure[t] += prior_weight[p, t] * gap * point_free[p, t]
        if point_free[p, t] == 0.0:
            lower[t, t] = 1.0
    ok = True
    for a in range(3):
        lower[a, a] *= 1.0 + damping
        diagonal = lower[a, a]
        for b in range(a + 1):
            value = lower[a, b]
            for c in range(b):
                value -= lower[a, c] * lower[b, c]
            if b < a:
                lower[a, b] = value / lower[b, b]
            else:
                if not value > MIN_PIVOT * diagonal:
                    ok = False
                    value = 1.0
                lower[a, a] = np.sqrt(value)
    for a in range(3):
        for c in range(a):
            misclosure[a] -= lower[a, c] * misclosure[c]
        misclosure[a] /= lower[a, a]
    return cost, ok


@inlined
def solve_transposed(lower, d):
    """d := L⁻ᵀ·d; lower (3, 3), d (3)."""
    for a in range(2, -1, -1):
        for c in range(a + 1, 3):
            d[a] -= lower[c, a] * d[c]
        d[a] /= lower[a, a]


@inlined
def combine_rows(row, e, x, y):
    """row := x·e[0] + y·e[1]; row (6,), e (2, 6)."""
    v0, v1, v2 = x * e[0, 0] + y * e[1, 0], x * e[0, 1] + y * e[1, 1], x * e[0, 2] + y * e[1, 2]
    v3, v4, v5 = x * e[0, 3] + y * e[1, 3], x * e[0, 4] + y * e[1, 4], x * e[0, 5] + y * e[1, 5]
    row[0], row[1], row[2], row[3], row[4], row[5] = v0, v1, v2, v3, v4, v5


@leaf_kernel
def reduce_point(p, n_rays, n_union, points, damping, work, elimination):
    """Eliminate point p: `point_normals`, and the couplings L⁻¹·N_pe and L⁻¹·N_ps into `work`."""
    by_eo, by_pt, by_sh, columns, n_columns = work.by_eo, work.by_pt, work.by_sh, work.columns, work.n_columns
    couple, couple_shared = work.couple, work.couple_shared
    lower = elimination.lower
    cost, ok = point_normals(p, n_rays, points, damping, work, elimination)
    for t in range(n_union):
        for a in range(3):
            couple_shared[a, t] = 0.0
    l10, l20, l21 = lower[1, 0], lower[2, 0], lower[2, 1]
    i0, i1, i2 = 1.0 / lower[0, 0], 1.0 / lower[1, 1], 1.0 / lower[2, 2]
    for q in range(n_rays):
        x0, x1, x2 = by_pt[q, 0, 0] * i0, by_pt[q, 0, 1], by_pt[q, 0, 2]
        y0, y1, y2 = by_pt[q, 1, 0] * i0, by_pt[q, 1, 1], by_pt[q, 1, 2]
        x1, y1 = (x1 - l10 * x0) * i1, (y1 - l10 * y0) * i1
        x2, y2 = (x2 - l20 * x0 - l21 * x1) * i2, (y2 - l20 * y0 - l21 * y1) * i2
        combine_rows(couple[q, 0], by_eo[q], x0, y0)
        combine_rows(couple[q, 1], by_eo[q], x1, y1)
        combine_rows(couple[q, 2], by_eo[q], x2, y2)
        for t in range(n_columns[q]):
            column, s0, s1 = columns[q, t], by_sh[q, 0, t], by_sh[q, 1, t]
            c0, c1, c2 = couple_shared[0, column], couple_shared[1, column], couple_shared[2, column]
            c0, c1, c2 = c0 + x0 * s0 + y0 * s1, c1 + x1 * s0 + y1 * s1, c2 + x2 * s0 + y2 * s1
            couple_shared[0, column], couple_shared[1, column], couple_shared[2, column] = c0, c1, c2
    return cost, ok


@kernel
def looseness(first, last, problem, work, loose):
    """σ of the points first..last in their worst direction over the distance to their nearest photograph.

    Of the point's own weighted 3 × 3 normals, the photographs held; a held or kept point has 0. loose : (P,) out.
    """
    rays, table, values, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, image, centre = rays.start, rays.image, values.centre
    xyz, prior_weight, point_free = points.xyz, points.prior_weight, points.free
    by_pt, normal = work.by_pt, np.empty((3, 3))
    for p in range(first, last):
        linearise_point(p, rays, table, values, points, weighting, work)
        normal[:] = 0.0
        nearest = np.inf
        for q in range(start[p + 1] - start[p]):
            i, squares = image[start[p] + q], 0.0
            for a in range(3):
                squares += (xyz[p, a] - centre[i, a]) ** 2
                for b in range(3):
                    normal[a, b] += by_pt[q, 0, a] * by_pt[q, 0, b] + by_pt[q, 1, a] * by_pt[q, 1, b]
            nearest = min(nearest, squares)
        held = 0
        for a in range(3):
            normal[a, a] += prior_weight[p, a]
            if point_free[p, a] == 0.0:
                held += 1
                normal[a, a] = np.inf
        if held == 3:
            loose[p] = 0.0
            continue
        # a held coordinate is known: as well as the best direction, times a million
        largest = 0.0
        for a in range(3):
            if normal[a, a] < np.inf:
                largest = max(largest, normal[a, a])
        for a in range(3):
            if normal[a, a] == np.inf:
                normal[a, a] = 1e6 * largest
        loose[p] = 1.0 / np.sqrt(max(smallest_eigenvalue(normal), 1e-16 * largest) * nearest)
