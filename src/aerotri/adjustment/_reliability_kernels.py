"""Kernels of reliability: tests of rays that are switched off, effects of undetected errors on the unknowns.

Arguments as in `_kernels` and `_covariance_kernels`.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment._covariance_kernels import couple_point, coupling_scratch, row_cofactor
from aerotri.adjustment._point_kernels import E, linearise_point, reduce_point
from aerotri.adjustment._robust_kernels import NONE
from aerotri.compiled import kernel


@kernel
def predicted_cofactors(
    first, last, rays, full, pattern, table, state, inverse, cofactor, predicted, residual, weight, work
):
    """Cofactors (P, 3, 3) of points first..last and (m, 3) of the predictions of x with x, x with y, y with y.

    rays : as adjusted, 1/σ of rays switched off set to 0; full : the same with the 1/σ that all would have.
    """
    start, image = rays[0], rays[1]
    h, h_shared = coupling_scratch(work)
    lower, misclosure = np.zeros((3, 3)), np.zeros(3)
    for p in range(first, last):
        n_rays = start[p + 1] - start[p]
        _, n_union = linearise_point(p, rays, table, state, NONE, 0.0, weight, residual, work)
        reduce_point(p, n_rays, n_union, table, state[2], 0.0, work, lower, misclosure)
        couple_point(p, rays, pattern, inverse, n_union, lower, work, h, h_shared, cofactor[p])
        linearise_point(p, full, table, state, NONE, 0.0, weight, residual, work)
        for q in range(n_rays):
            for k in range(3):
                predicted[start[p] + q, k] = row_cofactor(
                    q, k // 2, (k + 1) // 2, image[start[p] + q], inverse, work, h, h_shared, cofactor[p]
                )


@kernel
def ray_effects(
    first, last, rays, pattern, table, state, estimator, limit, inverse, datum, scale, size, unknown, height, residual,
    weight, work,
):  # fmt: skip
    """Which unknown an error of each coordinate of the rays of points first..last changes most, and by how much.

    An error of one σ changes the unknowns by ∇x = Q·aᵀ, a the whitened row of the coordinate. Looked at are the
    unknowns that the ray itself depends on: its point, its photograph, the shared parameters that act on it.

    datum : motions of photographs (n, 6, d), shared (s, d), points (P, 3, d), and the columns Q·Aᵀ of the same shapes,
        of a block in an inner datum: ∇x − G·(A·∇x); d = 0 for the others.
    scale : to_angles (n, 3, 3) from the rotation unknowns to ω, φ, κ; 1/σ of photographs (n, 6), shared (s), points
        (P, 3), 0 for an unknown that is held.
    size : (m, 2) out, the largest |∇x|/σ. unknown : (m, 2) out, which: 0–2 of the point, 3–8 of the photograph, from 9
        on a shared parameter, −1 for none. height : (m, 2) out, ∇Z of the point, m.
    """
    start, image = rays[0], rays[1]
    kept = table[6]
    to_angles, per_image, per_shared, per_point = scale
    columns, n_columns, union = work[4], work[5], work[6]
    h, h_shared = coupling_scratch(work)
    lower, misclosure, q_pp = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3))
    change = np.empty(9 + len(work[4][0]))
    for p in range(first, last):
        n_rays = start[p + 1] - start[p]
        _, n_union = linearise_point(p, rays, table, state, estimator, limit, weight, residual, work)
        reduce_point(p, n_rays, n_union, table, state[2], 0.0, work, lower, misclosure)
        couple_point(p, rays, pattern, inverse, n_union, lower, work, h, h_shared, q_pp)
        for q in range(n_rays):
            ray = start[p] + q
            i = image[ray]
            for row in range(2):
                row_changes(q, row, p, i, inverse, datum, work, h, h_shared, q_pp, change)
                w0, w1, w2 = change[6], change[7], change[8]
                largest, which, up = 0.0, -1, change[2]
                for t in range(9 + n_columns[q]):
                    value = change[t]
                    if t < 3:
                        ratio = value * per_point[p, t]
                    elif t < 6:
                        ratio = value * per_image[i, t - 3]
                    elif t < 9:
                        value = to_angles[i, t - 6, 0] * w0 + to_angles[i, t - 6, 1] * w1 + to_angles[i, t - 6, 2] * w2
                        ratio = value * per_image[i, t - 3]
                    else:
                        column = union[columns[q, t - 9]]
                        ratio = value * per_shared[column]
                        if kept[p] >= 0 and column == kept[p] + 2:
                            up = value
                    if abs(ratio) > largest:
                        largest, which = abs(ratio), t if t < 9 else 9 + union[columns[q, t - 9]]
                size[ray, row], unknown[ray, row], height[ray, row] = largest, which, up


@kernel
def row_changes(q, row, p, i, inverse, datum, work, h, h_shared, q_pp, change):
    """∇x = Q·aᵀ of one row: the point's three, the photograph's six unknowns, the shared parameters of the ray."""
    blocks, border, corner = inverse
    by_eo, by_pt, by_sh, _, columns, n_columns, union, _, _, _, _, _ = work
    g_images, g_shared, g_points, qa_images, qa_shared, qa_points = datum
    a_r, a_p, a_s, n = by_eo[q, row], by_pt[q, row], by_sh[q, row], n_columns[q]
    for b in range(3):
        value = 0.0
        for a in range(3):
            value += q_pp[b, a] * a_p[a]
        for a in range(E):
            value -= h[q, a, b] * a_r[a]
        for t in range(n):
            value -= h_shared[columns[q, t], b] * a_s[t]
        change[b] = value
    for a in range(E):
        value = 0.0
        for b in range(E):
            value += blocks[i, a, b] * a_r[b]
        for b in range(3):
            value -= h[q, a, b] * a_p[b]
        for t in range(n):
            value += border[i, union[columns[q, t]], a] * a_s[t]
        change[3 + a] = value
    for t in range(n):
        column = union[columns[q, t]]
        value = 0.0
        for a in range(E):
            value += border[i, column, a] * a_r[a]
        for b in range(3):
            value -= h_shared[columns[q, t], b] * a_p[b]
        for c in range(n):
            value += corner[column, union[columns[q, c]]] * a_s[c]
        change[9 + t] = value
    for d in range(g_points.shape[2]):
        share = 0.0
        for a in range(3):
            share += qa_points[p, a, d] * a_p[a]
        for a in range(E):
            share += qa_images[i, a, d] * a_r[a]
        for t in range(n):
            share += qa_shared[union[columns[q, t]], d] * a_s[t]
        for b in range(3):
            change[b] -= g_points[p, b, d] * share
        for a in range(E):
            change[3 + a] -= g_images[i, a, d] * share
        for t in range(n):
            change[9 + t] -= g_shared[union[columns[q, t]], d] * share
