"""Kernels of reliability: tests of rays that are switched off, effects of undetected errors on the unknowns.

Their arguments are described in `kernel_records`.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment._covariance_kernels import couple_point, coupling_scratch, row_cofactor
from aerotri.adjustment._point_kernels import E, linearise_point, reduce_point
from aerotri.adjustment.kernel_records import Elimination, Pattern, RowPlace
from aerotri.compiled import kernel, leaf_kernel


@kernel
def predicted_cofactors(first, last, problem, full, inverse, cofactors, work):
    """Cofactors (P, 3, 3) of points first..last and (m, 3) of the predictions of x with x, x with y, y with y.

    problem : as adjusted, 1/σ of rays switched off set to 0; full : its rays with the 1/σ that all would have.
    cofactors : the two, out.
    """
    rays, table, values, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, image = rays.start, rays.image
    cofactor, predicted = cofactors
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
        linearise_point(p, full, table, values, points, weighting, work)
        for q in range(n_rays):
            for k in range(3):
                predicted[start[p] + q, k] = row_cofactor(
                    q, k // 2, (k + 1) // 2, image[start[p] + q], inverse, work, coupling
                )


@kernel
def ray_effects(first, last, problem, inverse, measures, effects, work):
    """Which unknown an error of each coordinate of the rays of points first..last changes most, and by how much.

    An error of one σ changes the unknowns by ∇x = Q·aᵀ, a the whitened row of the coordinate. Looked at are the
    unknowns that the ray itself depends on: its point, its photograph, the shared parameters that act on it.

    Of a block in an inner datum ∇x − G·(A·∇x).

    measures : `Datum` and `Scale`. effects : out.
    """
    rays, table, values, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, image, kept = rays.start, rays.image, table.kept
    datum, scale = measures
    to_angles, per_image, per_shared, per_point = scale.to_angles, scale.per_image, scale.per_shared, scale.per_point
    columns, n_columns, union = work.columns, work.n_columns, work.union
    size, unknown, height = effects.size, effects.unknown, effects.height
    coupling = coupling_scratch(work)
    pattern = Pattern(start, image, problem.pairs.start, problem.pairs.block)
    lower = np.zeros((3, 3))
    elimination = Elimination(lower, np.zeros(3))
    change = np.empty(9 + columns.shape[1])
    for p in range(first, last):
        n_rays = start[p + 1] - start[p]
        _, n_union = linearise_point(p, rays, table, values, points, weighting, work)
        reduce_point(p, n_rays, n_union, points, 0.0, work, elimination)
        couple_point(p, pattern, inverse, n_union, lower, work, coupling)
        for q in range(n_rays):
            ray = start[p] + q
            i = image[ray]
            for row in range(2):
                row_changes(RowPlace(q, row, p, i), inverse, datum, work, coupling, change)
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


@leaf_kernel
def row_changes(place, inverse, datum, work, coupling, change):
    """∇x = Q·aᵀ of one row: the point's three, the photograph's six unknowns, the shared parameters of the ray."""
    q, row, p, i = place.q, place.row, place.point, place.image
    blocks, border, corner = inverse.blocks, inverse.border, inverse.corner
    columns, union = work.columns, work.union
    h, h_shared, q_pp = coupling.h, coupling.h_shared, coupling.q_pp
    g_images, g_shared, g_points = datum.images, datum.shared, datum.points
    qa_images, qa_shared, qa_points = datum.qa_images, datum.qa_shared, datum.qa_points
    a_r, a_p, a_s, n = work.by_eo[q, row], work.by_pt[q, row], work.by_sh[q, row], work.n_columns[q]
    for b in range(3):
        value = 0.0
        for a in range(3):
            value += q_pp[b, a] * a_p[a]
        for a in range(E):
            value -= h[q, b, a] * a_r[a]
        for t in range(n):
            value -= h_shared[columns[q, t], b] * a_s[t]
        change[b] = value
    for a in range(E):
        value = 0.0
        for b in range(E):
            value += blocks[i, a, b] * a_r[b]
        for b in range(3):
            value -= h[q, b, a] * a_p[b]
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
