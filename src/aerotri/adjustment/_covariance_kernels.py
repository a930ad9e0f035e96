"""Kernels of the covariance: points and rays from the inverse on the pattern of the reduced normal matrix.

Their arguments are described in `kernel_records`.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment._point_kernels import E, linearise_point, reduce_point
from aerotri.adjustment.kernel_records import Coupling, Elimination, Pattern
from aerotri.compiled import inlined, kernel, leaf_kernel


@leaf_kernel
def solve_lower_transposed(lower, rhs):
    """L⁻ᵀ·rhs in place, rhs (3, k)."""
    for t in range(rhs.shape[1]):
        for a in range(2, -1, -1):
            for c in range(a + 1, 3):
                rhs[a, t] -= lower[c, a] * rhs[c, t]
            rhs[a, t] /= lower[a, a]


@inlined
def add_row(out, row, factor):
    """out += factor·row, (6,). Written out: the arrays might overlap for all the compiler knows."""
    v0, v1, v2 = out[0] + factor * row[0], out[1] + factor * row[1], out[2] + factor * row[2]
    v3, v4, v5 = out[3] + factor * row[3], out[4] + factor * row[4], out[5] + factor * row[5]
    out[0], out[1], out[2], out[3], out[4], out[5] = v0, v1, v2, v3, v4, v5


@inlined
def set_products(h, block, g):
    """h := g·block, h and g (3, 6), block (6, 6) symmetric."""
    for b in range(3):
        factor, row = g[b, 0], block[0]
        h[b, 0], h[b, 1], h[b, 2] = factor * row[0], factor * row[1], factor * row[2]
        h[b, 3], h[b, 4], h[b, 5] = factor * row[3], factor * row[4], factor * row[5]
        for a in range(1, E):
            add_row(h[b], block[a], g[b, a])


@inlined
def add_products(h, h_other, block, g, g_other):
    """h += g_other·blockᵀ and h_other += g·block; (3, 6) all but block (6, 6)."""
    for a in range(E):
        row = block[a]
        r0, r1, r2, r3, r4, r5 = row[0], row[1], row[2], row[3], row[4], row[5]
        for b in range(3):
            x = g_other[b]
            h[b, a] += (r0 * x[0] + r1 * x[1] + r2 * x[2]) + (r3 * x[3] + r4 * x[4] + r5 * x[5])
    for b in range(3):
        x, out = g[b], h_other[b]
        x0, x1, x2, x3, x4, x5 = x[0], x[1], x[2], x[3], x[4], x[5]
        for a in range(E):
            low = x0 * block[0, a] + x1 * block[1, a] + x2 * block[2, a]
            out[a] += low + x3 * block[3, a] + x4 * block[4, a] + x5 * block[5, a]


@kernel
def point_cofactors(first, last, problem, inverse, cofactor, redundancy, work):
    """Cofactors (P, 3, 3) of points first..last and redundancy numbers (m, 2) of their rays."""
    rays, table, values, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, image = rays.start, rays.image
    coupling = coupling_scratch(work)
    q_pp = coupling.q_pp
    pattern = Pattern(start, image, problem.pairs.start, problem.pairs.block)
    lower = np.zeros((3, 3))
    elimination = Elimination(lower, np.zeros(3))
    for p in range(first, last):
        n_rays = start[p + 1] - start[p]
        _, n_union = linearise_point(p, rays, table, values, points, weighting, work)
        reduce_point(p, n_rays, n_union, points, 0.0, work, elimination)
        couple_point(p, pattern, inverse, n_union, lower, work, coupling)
        for a in range(3):
            for b in range(3):
                cofactor[p, a, b] = q_pp[a, b]
        for q in range(n_rays):
            for row in range(2):
                explained = row_cofactor(q, row, row, image[start[p] + q], inverse, work, coupling)
                redundancy[start[p] + q, row] = 1.0 - explained


@kernel
def coupling_scratch(work):
    """Room for what `couple_point` fills in."""
    return Coupling(np.empty((work.by_eo.shape[0], 3, E)), np.empty((len(work.union), 3)), np.empty((3, 3)))


@leaf_kernel
def couple_point(p, pattern, inverse, n_union, lower, work, coupling):
    """G in place of L⁻¹·N_pr in `work`, H and Q_pp of point p.

    With the point eliminated, x_p = N⁻¹(b − N_pr·x_r), G = N⁻¹·N_pr and H = Q_rr·Gᵀ: Q_pp = N⁻¹ + G·H, Q_rp = −H.
    """
    couple, couple_shared, h, h_shared = work.couple, work.couple_shared, coupling.h, coupling.h_shared
    q_pp = coupling.q_pp
    n_rays = pattern.start[p + 1] - pattern.start[p]
    for q in range(n_rays):
        solve_lower_transposed(lower, couple[q])
    solve_lower_transposed(lower, couple_shared[:, :n_union])
    _coupled_cofactors(p, n_union, pattern, inverse, work, coupling)
    for a in range(3):
        for b in range(3):
            q_pp[a, b] = 1.0 if a == b else 0.0
    _solve_lower(lower, q_pp)
    solve_lower_transposed(lower, q_pp)
    for a in range(3):
        for b in range(3):
            value = q_pp[a, b]
            for q in range(n_rays):
                for t in range(E):
                    value += couple[q, a, t] * h[q, b, t]
            for t in range(n_union):
                value += couple_shared[a, t] * h_shared[t, b]
            q_pp[a, b] = value


@leaf_kernel
def row_cofactor(q, row, other, i, inverse, work, coupling):
    """Cofactor between the predictions of the coordinates `row` and `other` of ray q in photograph i.

    Rows (a_r, a_p) and (b_r, b_p) have a_r·Q_rr·b_rᵀ − a_r·H·b_pᵀ − a_p·Hᵀ·b_rᵀ + a_p·Q_pp·b_pᵀ.
    """
    blocks, border, corner = inverse.blocks, inverse.border, inverse.corner
    by_eo, by_pt, by_sh = work.by_eo, work.by_pt, work.by_sh
    columns, n_columns, union = work.columns, work.n_columns, work.union
    h, h_shared, q_pp = coupling.h, coupling.h_shared, coupling.q_pp
    a_p, b_p = by_pt[q, row], by_pt[q, other]
    explained = 0.0
    for a in range(E):
        inner, mirrored = 0.0, 0.0
        for b in range(E):
            inner += blocks[i, a, b] * by_eo[q, other, b]
        for t in range(n_columns[q]):
            inner += border[i, union[columns[q, t]], a] * by_sh[q, other, t]
            mirrored += border[i, union[columns[q, t]], a] * by_sh[q, row, t]
        for b in range(3):
            inner -= h[q, b, a] * b_p[b]
            mirrored -= h[q, b, a] * a_p[b]
        explained += by_eo[q, row, a] * inner + by_eo[q, other, a] * mirrored
    for t in range(n_columns[q]):
        column = columns[q, t]
        inner = 0.0
        for c in range(n_columns[q]):
            inner += corner[union[column], union[columns[q, c]]] * by_sh[q, other, c]
        for b in range(3):
            inner -= h_shared[column, b] * b_p[b]
            explained -= h_shared[column, b] * a_p[b] * by_sh[q, other, t]
        explained += by_sh[q, row, t] * inner
    for a in range(3):
        for b in range(3):
            explained += a_p[a] * q_pp[a, b] * b_p[b]
    return explained


@leaf_kernel
def _solve_lower(lower, rhs):
    """L⁻¹·rhs in place, rhs (3, k)."""
    for t in range(rhs.shape[1]):
        for a in range(3):
            for c in range(a):
                rhs[a, t] -= lower[a, c] * rhs[c, t]
            rhs[a, t] /= lower[a, a]


@leaf_kernel
def _coupled_cofactors(p, n_union, pattern, inverse, work, coupling):
    """H = Q_rr·Gᵀ over the photographs and the shared parameters of point p; G lies in the couplings of `work`."""
    start, image, pair_block = pattern.start, pattern.image, pattern.pair_block
    blocks, border, corner = inverse.blocks, inverse.border, inverse.corner
    union, g, g_shared, h, h_shared = work.union, work.couple, work.couple_shared, coupling.h, coupling.h_shared
    first_ray, n_rays, pair = start[p], start[p + 1] - start[p], pattern.pair_start[p]
    for t in range(n_union):
        for b in range(3):
            value = 0.0
            for c in range(n_union):
                value += corner[union[t], union[c]] * g_shared[b, c]
            h_shared[t, b] = value
    for q in range(n_rays):
        i = image[first_ray + q]
        set_products(h[q], blocks[i], g[q])
        for t in range(n_union):
            row = border[i, union[t]]
            for b in range(3):
                value = 0.0
                for a in range(E):
                    value += row[a] * g[q, b, a]
                h_shared[t, b] += value
                add_row(h[q, b], row, g_shared[b, t])
    for q in range(n_rays):
        for other in range(q + 1, n_rays):
            add_products(h[q], h[other], blocks[pair_block[pair]], g[q], g[other])
            pair += 1


@kernel
def reduce_point_sides(first, last, problem, sides, right, right_shared, work):
    """Right sides of the reduced system for right sides of the points: right −= N_rp·N_pp⁻¹·side.

    sides : (P, 3, k); right : (n, 6, k); right_shared : (s, k).
    """
    rays, table, values, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, image = rays.start, rays.image
    union, couple, couple_shared = work.union, work.couple, work.couple_shared
    lower = np.zeros((3, 3))
    elimination = Elimination(lower, np.zeros(3))
    for p in range(first, last):
        n_rays = start[p + 1] - start[p]
        _, n_union = linearise_point(p, rays, table, values, points, weighting, work)
        reduce_point(p, n_rays, n_union, points, 0.0, work, elimination)
        side = sides[p].copy()
        _solve_lower(lower, side)
        for k in range(side.shape[1]):
            for q in range(n_rays):
                i = image[start[p] + q]
                for t in range(E):
                    for a in range(3):
                        right[i, t, k] -= couple[q, a, t] * side[a, k]
            for t in range(n_union):
                for a in range(3):
                    right_shared[union[t], k] -= couple_shared[a, t] * side[a, k]


@kernel
def expand_point_sides(first, last, problem, sides, x, work):
    """Solution of the points, out, for right sides of the points (P, 3, k): x_p = N_pp⁻¹(side − N_pr·x_r)."""
    rays, table, values, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, image = rays.start, rays.image
    x_images, x_shared, x_points = x.images, x.shared, x.points
    union, couple, couple_shared = work.union, work.couple, work.couple_shared
    lower = np.zeros((3, 3))
    elimination = Elimination(lower, np.zeros(3))
    for p in range(first, last):
        n_rays = start[p + 1] - start[p]
        _, n_union = linearise_point(p, rays, table, values, points, weighting, work)
        reduce_point(p, n_rays, n_union, points, 0.0, work, elimination)
        side = sides[p].copy()
        _solve_lower(lower, side)
        for k in range(side.shape[1]):
            for a in range(3):
                for q in range(n_rays):
                    i = image[start[p] + q]
                    for t in range(E):
                        side[a, k] -= couple[q, a, t] * x_images[i, t, k]
                for t in range(n_union):
                    side[a, k] -= couple_shared[a, t] * x_shared[union[t], k]
        solve_lower_transposed(lower, side)
        # by elements: assigning a slice costs seconds of compilation
        for a in range(3):
            for k in range(side.shape[1]):
                x_points[p, a, k] = side[a, k]
