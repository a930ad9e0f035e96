"""Kernels of one object point: partials of its rays, its own normals, and its elimination.

`problem` and `work` are described in `kernel_records`.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment._intersection_kernels import smallest_eigenvalue
from aerotri.adjustment._robust_kernels import robust_factor
from aerotri.adjustment.kernel_records import Work
from aerotri.compiled import inlined, kernel, leaf_kernel
from aerotri.functional_model._kernels import INTERIOR, linearise_ray
from aerotri.functional_model._scan_kernels import place_in_scan, scan_partials

E = 6
"""Elements of exterior orientation of a ray: projection centre and rotation."""
MIN_PIVOT = 1e-14
"""Share of a diagonal element of a point's 3 × 3 below which its pivot is taken for rounding [C]: doubles carry 2e-16;
a larger limit would refuse points of very narrow rays, which `weak_geometry` judges by their σ."""


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
    n_scans, used = rate.shape[0], lens_columns.shape[1]
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
        factor, ray_cost = robust_factor(np.sqrt(ex * ex + ey * ey), estimator, limit)
        weight[ray] = factor
        cost += ray_cost
        for row in range(2):
            f = inv_sigma[ray, row] * np.sqrt(factor)
            whitened[q, row] = residual[ray, row] * f
            for t in range(3):
                by_eo[q, row, t] *= f * eo_free[i, t]
                by_pt[q, row, t] *= f * point_free[p, t]
            d0, d1, d2 = by_eo[q, row, 3], by_eo[q, row, 4], by_eo[q, row, 5]
            for t in range(3):
                turned = d0 * turn[i, 0, t] + d1 * turn[i, 1, t] + d2 * turn[i, 2, t]
                by_eo[q, row, 3 + t] = turned * f * eo_free[i, 3 + t]
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
    for q in range(n_rays):
        for a in range(3):
            p0, p1 = by_pt[q, 0, a], by_pt[q, 1, a]
            for t in range(E):
                couple[q, a, t] = p0 * by_eo[q, 0, t] + p1 * by_eo[q, 1, t]
            for t in range(n_columns[q]):
                couple_shared[a, columns[q, t]] += p0 * by_sh[q, 0, t] + p1 * by_sh[q, 1, t]
        for a in range(3):
            for c in range(a):
                for t in range(E):
                    couple[q, a, t] -= lower[a, c] * couple[q, c, t]
            inverse = 1.0 / lower[a, a]
            for t in range(E):
                couple[q, a, t] *= inverse
    for t in range(n_union):
        for a in range(3):
            for c in range(a):
                couple_shared[a, t] -= lower[a, c] * couple_shared[c, t]
            couple_shared[a, t] /= lower[a, a]
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
