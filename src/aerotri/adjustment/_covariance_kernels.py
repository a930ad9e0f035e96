"""Kernels of the covariance: points and rays from the inverse on the pattern of the reduced normal matrix."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment._kernels import E, linearise_point, reduce_point
from aerotri.compiled import kernel


@kernel
def solve_lower_transposed(lower, rhs):
    """L⁻ᵀ·rhs in place, rhs (3, k)."""
    for t in range(rhs.shape[1]):
        for a in range(2, -1, -1):
            for c in range(a + 1, 3):
                rhs[a, t] -= lower[c, a] * rhs[c, t]
            rhs[a, t] /= lower[a, a]


@kernel
def point_cofactors(
    first, last, rays, pattern, table, state, estimator, limit, inverse, cofactor, redundancy, residual, weight, work
):
    """Cofactors (P, 3, 3) of points first..last and redundancy numbers (m, 2) of their rays.

    With the point eliminated, x_p = N⁻¹(b − N_pr·x_r), G = N⁻¹·N_pr and H = Q_rr·Gᵀ: Q_pp = N⁻¹ + G·H, and the row
    (a_r, a_p) of a ray has the cofactor a_r·Q_rr·a_rᵀ − 2·a_r·H·a_pᵀ + a_p·Q_pp·a_pᵀ.

    inverse : blocks (nb, 6, 6), border (n, s, 6), corner (s, s) of the inverse on the pattern.
    """
    start, image = rays[0], rays[1]
    pair_start, pair_block = pattern
    blocks, border, corner = inverse
    by_eo, by_pt, by_sh, _, columns, n_columns, union, _, couple, couple_shared, _, _ = work
    max_rays, n_shared = by_eo.shape[0], len(union)
    h, h_shared = np.empty((max_rays, E, 3)), np.empty((n_shared, 3))
    lower, misclosure = np.zeros((3, 3)), np.zeros(3)
    for p in range(first, last):
        n_rays = start[p + 1] - start[p]
        _, n_union = linearise_point(p, rays, table, state, estimator, limit, weight, residual, work)
        reduce_point(p, n_rays, n_union, table, state[2], 0.0, work, lower, misclosure)
        for q in range(n_rays):
            solve_lower_transposed(lower, couple[q])
        solve_lower_transposed(lower, couple_shared[:, :n_union])
        _coupled_cofactors(
            start[p], n_rays, n_union, image, pair_start[p], pair_block, blocks, border, corner, couple, couple_shared,
            union, h, h_shared,
        )  # fmt: skip
        q_pp = cofactor[p]
        own = np.eye(3)
        _solve_lower(lower, own)
        solve_lower_transposed(lower, own)
        for a in range(3):
            for b in range(3):
                value = own[a, b]
                for q in range(n_rays):
                    for t in range(E):
                        value += couple[q, a, t] * h[q, t, b]
                for t in range(n_union):
                    value += couple_shared[a, t] * h_shared[t, b]
                q_pp[a, b] = value
        for q in range(n_rays):
            i = image[start[p] + q]
            for row in range(2):
                a_p = by_pt[q, row]
                explained = 0.0
                for a in range(E):
                    inner = 0.0
                    for b in range(E):
                        inner += blocks[i, a, b] * by_eo[q, row, b]
                    for t in range(n_columns[q]):
                        inner += 2.0 * border[i, union[columns[q, t]], a] * by_sh[q, row, t]
                    for b in range(3):
                        inner -= 2.0 * h[q, a, b] * a_p[b]
                    explained += by_eo[q, row, a] * inner
                for t in range(n_columns[q]):
                    column = columns[q, t]
                    inner = 0.0
                    for c in range(n_columns[q]):
                        inner += corner[union[column], union[columns[q, c]]] * by_sh[q, row, c]
                    for b in range(3):
                        inner -= 2.0 * h_shared[column, b] * a_p[b]
                    explained += by_sh[q, row, t] * inner
                for a in range(3):
                    for b in range(3):
                        explained += a_p[a] * q_pp[a, b] * a_p[b]
                redundancy[start[p] + q, row] = 1.0 - explained


@kernel
def _solve_lower(lower, rhs):
    """L⁻¹·rhs in place, rhs (3, k)."""
    for t in range(rhs.shape[1]):
        for a in range(3):
            for c in range(a):
                rhs[a, t] -= lower[a, c] * rhs[c, t]
            rhs[a, t] /= lower[a, a]


@kernel
def _coupled_cofactors(
    first_ray, n_rays, n_union, image, pair, pair_block, blocks, border, corner, g, g_shared, union, h, h_shared
):
    """H = Q_rr·Gᵀ over the photographs (n_rays, 6, 3) and the shared parameters (n_union, 3) of one point."""
    for t in range(n_union):
        for b in range(3):
            value = 0.0
            for c in range(n_union):
                value += corner[union[t], union[c]] * g_shared[b, c]
            h_shared[t, b] = value
    for q in range(n_rays):
        i = image[first_ray + q]
        for a in range(E):
            for b in range(3):
                value = 0.0
                for c in range(E):
                    value += blocks[i, a, c] * g[q, b, c]
                h[q, a, b] = value
        for t in range(n_union):
            row = border[i, union[t]]
            for b in range(3):
                value = 0.0
                for a in range(E):
                    h[q, a, b] += row[a] * g_shared[b, t]
                    value += row[a] * g[q, b, a]
                h_shared[t, b] += value
    for q in range(n_rays):
        for other in range(q + 1, n_rays):
            block = blocks[pair_block[pair]]
            pair += 1
            for a in range(E):
                for b in range(3):
                    value, mirrored = 0.0, 0.0
                    for c in range(E):
                        value += block[a, c] * g[other, b, c]
                        mirrored += block[c, a] * g[q, b, c]
                    h[q, a, b] += value
                    h[other, a, b] += mirrored


@kernel
def reduce_point_sides(
    first, last, rays, table, state, estimator, limit, sides, right, right_shared, residual, weight, work
):
    """Right sides of the reduced system for right sides of the points: right −= N_rp·N_pp⁻¹·side.

    sides : (P, 3, k); right : (n, 6, k); right_shared : (s, k).
    """
    start, image = rays[0], rays[1]
    union, couple, couple_shared = work[6], work[8], work[9]
    lower, misclosure = np.zeros((3, 3)), np.zeros(3)
    for p in range(first, last):
        n_rays = start[p + 1] - start[p]
        _, n_union = linearise_point(p, rays, table, state, estimator, limit, weight, residual, work)
        reduce_point(p, n_rays, n_union, table, state[2], 0.0, work, lower, misclosure)
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
def expand_point_sides(
    first, last, rays, table, state, estimator, limit, sides, x, x_shared, x_points, residual, weight, work
):
    """Solution of the points for right sides of the points: x_p = N_pp⁻¹(side − N_pr·x_r), (P, 3, k)."""
    start, image = rays[0], rays[1]
    union, couple, couple_shared = work[6], work[8], work[9]
    lower, misclosure = np.zeros((3, 3)), np.zeros(3)
    for p in range(first, last):
        n_rays = start[p + 1] - start[p]
        _, n_union = linearise_point(p, rays, table, state, estimator, limit, weight, residual, work)
        reduce_point(p, n_rays, n_union, table, state[2], 0.0, work, lower, misclosure)
        side = sides[p].copy()
        _solve_lower(lower, side)
        for k in range(side.shape[1]):
            for a in range(3):
                for q in range(n_rays):
                    i = image[start[p] + q]
                    for t in range(E):
                        side[a, k] -= couple[q, a, t] * x[i, t, k]
                for t in range(n_union):
                    side[a, k] -= couple_shared[a, t] * x_shared[union[t], k]
        solve_lower_transposed(lower, side)
        x_points[p] = side
