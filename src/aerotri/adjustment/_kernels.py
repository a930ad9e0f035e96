"""Kernels over object points: normal equations with the points eliminated, and back substitution.

All take a range of points, so that a fixed number of chunks runs in parallel threads and sums repeat bit for bit.
Their arguments are described in `kernel_records`.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment._point_kernels import E, linearise_point, point_normals, reduce_point, solve_transposed
from aerotri.adjustment.kernel_records import Elimination
from aerotri.compiled import inlined, kernel


@inlined
def add_own_block(block, e, c):
    """block += eᵀ·e − cᵀ·c, e (2, 6), c (3, 6). Written out: the arrays might overlap for all the compiler knows."""
    x0, x1, x2, x3, x4, x5 = e[0, 0], e[0, 1], e[0, 2], e[0, 3], e[0, 4], e[0, 5]
    y0, y1, y2, y3, y4, y5 = e[1, 0], e[1, 1], e[1, 2], e[1, 3], e[1, 4], e[1, 5]
    subtract_rank_three(block, c, c)
    for a in range(E):
        x, y = e[0, a], e[1, a]
        row = block[a]
        v0, v1, v2 = row[0] + x * x0 + y * y0, row[1] + x * x1 + y * y1, row[2] + x * x2 + y * y2
        v3, v4, v5 = row[3] + x * x3 + y * y3, row[4] + x * x4 + y * y4, row[5] + x * x5 + y * y5
        row[0], row[1], row[2], row[3], row[4], row[5] = v0, v1, v2, v3, v4, v5


@inlined
def add_own_side(right, squares, e, c, whitened, y):
    """right += eᵀ·whitened − cᵀ·y and squares += the squared columns of e; right, squares (6,), e (2, 6), c (3, 6)."""
    w0, w1, y0, y1, y2 = whitened[0], whitened[1], y[0], y[1], y[2]
    for a in range(E):
        e0, e1 = e[0, a], e[1, a]
        side = right[a] + e0 * w0 + e1 * w1 - c[0, a] * y0 - c[1, a] * y1 - c[2, a] * y2
        square = squares[a] + e0 * e0 + e1 * e1
        right[a], squares[a] = side, square


@inlined
def subtract_rank_three(block, c, o):
    """block −= cᵀ·o, c and o (3, 6); see `add_rank_two`."""
    x0, x1, x2, x3, x4, x5 = o[0, 0], o[0, 1], o[0, 2], o[0, 3], o[0, 4], o[0, 5]
    y0, y1, y2, y3, y4, y5 = o[1, 0], o[1, 1], o[1, 2], o[1, 3], o[1, 4], o[1, 5]
    z0, z1, z2, z3, z4, z5 = o[2, 0], o[2, 1], o[2, 2], o[2, 3], o[2, 4], o[2, 5]
    for a in range(E):
        x, y, z = c[0, a], c[1, a], c[2, a]
        row = block[a]
        v0, v1 = row[0] - x * x0 - y * y0 - z * z0, row[1] - x * x1 - y * y1 - z * z1
        v2, v3 = row[2] - x * x2 - y * y2 - z * z2, row[3] - x * x3 - y * y3 - z * z3
        v4, v5 = row[4] - x * x4 - y * y4 - z * z4, row[5] - x * x5 - y * y5 - z * z5
        row[0], row[1], row[2], row[3], row[4], row[5] = v0, v1, v2, v3, v4, v5


@inlined
def add_own_border(rows, union, columns, n_columns, e, by_shared):
    """rows[column] += eᵀ·(the ray's column) for the columns that act at the ray; rows (s, 6), e (2, 6)."""
    x0, x1, x2, x3, x4, x5 = e[0, 0], e[0, 1], e[0, 2], e[0, 3], e[0, 4], e[0, 5]
    y0, y1, y2, y3, y4, y5 = e[1, 0], e[1, 1], e[1, 2], e[1, 3], e[1, 4], e[1, 5]
    for t in range(n_columns):
        row, x, y = rows[union[columns[t]]], by_shared[0, t], by_shared[1, t]
        v0, v1, v2 = row[0] + x * x0 + y * y0, row[1] + x * x1 + y * y1, row[2] + x * x2 + y * y2
        v3, v4, v5 = row[3] + x * x3 + y * y3, row[4] + x * x4 + y * y4, row[5] + x * x5 + y * y5
        row[0], row[1], row[2], row[3], row[4], row[5] = v0, v1, v2, v3, v4, v5


@inlined
def subtract_border(rows, union, n_union, c, couple_shared):
    """rows[column] −= cᵀ·(coupling of the column) for all columns of the point; rows (s, 6), c (3, 6)."""
    x0, x1, x2, x3, x4, x5 = c[0, 0], c[0, 1], c[0, 2], c[0, 3], c[0, 4], c[0, 5]
    y0, y1, y2, y3, y4, y5 = c[1, 0], c[1, 1], c[1, 2], c[1, 3], c[1, 4], c[1, 5]
    z0, z1, z2, z3, z4, z5 = c[2, 0], c[2, 1], c[2, 2], c[2, 3], c[2, 4], c[2, 5]
    for t in range(n_union):
        row, x, y, z = rows[union[t]], couple_shared[0, t], couple_shared[1, t], couple_shared[2, t]
        v0, v1 = row[0] - x * x0 - y * y0 - z * z0, row[1] - x * x1 - y * y1 - z * z1
        v2, v3 = row[2] - x * x2 - y * y2 - z * z2, row[3] - x * x3 - y * y3 - z * z3
        v4, v5 = row[4] - x * x4 - y * y4 - z * z4, row[5] - x * x5 - y * y5 - z * z5
        row[0], row[1], row[2], row[3], row[4], row[5] = v0, v1, v2, v3, v4, v5


@kernel
def assemble(first, last, problem, places, sums, work):
    """Reduced normal equations of points first..last, added to `sums` at their `places`.

    Returns the cost, the part of the Newton decrement that belongs to the points, and the number of a point that its
    rays do not determine (−1 when all are).
    """
    rays, table, values, points, weighting, damping = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting, problem.damping,
    )  # fmt: skip
    start, image = rays.start, rays.image
    pair_start, pair_block = problem.pairs.start, problem.pairs.block
    blocks, border, corner = sums.blocks, sums.border, sums.corner
    right, right_shared, squares, squares_shared = sums.right, sums.right_shared, sums.squares, sums.squares_shared
    place_of_image, place_of_block = places.image, places.block
    by_eo, by_sh, whitened, columns, n_columns = work.by_eo, work.by_sh, work.whitened, work.columns, work.n_columns
    union, couple, couple_shared = work.union, work.couple, work.couple_shared
    misclosure = np.zeros(3)
    elimination = Elimination(np.zeros((3, 3)), misclosure)
    cost, decrement, undetermined = 0.0, 0.0, -1
    for p in range(first, last):
        n_rays = start[p + 1] - start[p]
        ray_cost, n_union = linearise_point(p, rays, table, values, points, weighting, work)
        prior_cost, ok = reduce_point(p, n_rays, n_union, points, damping, work, elimination)
        if not ok:
            undetermined = p
        cost += ray_cost + prior_cost
        y0, y1, y2 = misclosure[0], misclosure[1], misclosure[2]
        decrement += y0 * y0 + y1 * y1 + y2 * y2
        pair = pair_start[p]
        for q in range(n_rays):
            i = place_of_image[image[start[p] + q]]
            add_own_block(blocks[place_of_block[image[start[p] + q]]], by_eo[q], couple[q])
            add_own_side(right[i], squares[i], by_eo[q], couple[q], whitened[q], misclosure)
            if n_union:
                add_own_border(border[i], union, columns[q], n_columns[q], by_eo[q], by_sh[q])
                subtract_border(border[i], union, n_union, couple[q], couple_shared)
            for other in range(q + 1, n_rays):
                subtract_rank_three(blocks[place_of_block[pair_block[pair]]], couple[q], couple[other])
                pair += 1
            for t in range(n_columns[q]):
                column, s0, s1 = union[columns[q, t]], by_sh[q, 0, t], by_sh[q, 1, t]
                right_shared[column] += s0 * whitened[q, 0] + s1 * whitened[q, 1]
                squares_shared[column] += s0 * s0 + s1 * s1
                for c in range(t + 1):
                    corner[column, union[columns[q, c]]] += s0 * by_sh[q, 0, c] + s1 * by_sh[q, 1, c]
        for t in range(n_union):
            row, s0, s1, s2 = corner[union[t]], couple_shared[0, t], couple_shared[1, t], couple_shared[2, t]
            right_shared[union[t]] -= s0 * y0 + s1 * y1 + s2 * y2
            for c in range(t + 1):
                row[union[c]] -= s0 * couple_shared[0, c] + s1 * couple_shared[1, c] + s2 * couple_shared[2, c]
    return cost, decrement, undetermined


@kernel
def reduce_right_side(first, last, problem, place_of_image, right, right_shared, work):
    """The right side alone of `assemble`: what is left of every misclosure when the point has taken its own step.

    right (·, 6), at the places (n,) of the photographs, and right_shared (s,) are added to. Returns as `assemble` does.
    """
    rays, table, values, points, weighting, damping = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting, problem.damping,
    )  # fmt: skip
    start, image = rays.start, rays.image
    by_eo, by_pt, by_sh, whitened = work.by_eo, work.by_pt, work.by_sh, work.whitened
    columns, n_columns, union = work.columns, work.n_columns, work.union
    lower, d = np.zeros((3, 3)), np.zeros(3)
    elimination = Elimination(lower, d)
    cost, decrement, undetermined = 0.0, 0.0, -1
    for p in range(first, last):
        n_rays = start[p + 1] - start[p]
        ray_cost, _ = linearise_point(p, rays, table, values, points, weighting, work)
        prior_cost, ok = point_normals(p, n_rays, points, damping, work, elimination)
        if not ok:
            undetermined = p
        cost += ray_cost + prior_cost
        decrement += d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        solve_transposed(lower, d)
        for q in range(n_rays):
            i = place_of_image[image[start[p] + q]]
            for row in range(2):
                own = by_pt[q, row, 0] * d[0] + by_pt[q, row, 1] * d[1] + by_pt[q, row, 2] * d[2]
                left = whitened[q, row] - own
                for a in range(E):
                    right[i, a] += by_eo[q, row, a] * left
                for t in range(n_columns[q]):
                    right_shared[union[columns[q, t]]] += by_sh[q, row, t] * left
    return cost, decrement, undetermined


@kernel
def back_substitute(first, last, problem, step, work):
    """Steps of the points first..last (P, 3), out, from those of the photographs (n, 6) and shared parameters (s,).

    Each ray's misclosure is shortened by what the photograph and the shared parameters explain; what is left belongs to
    the point.
    """
    rays, table, values, points, weighting, damping = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting, problem.damping,
    )  # fmt: skip
    start, image = rays.start, rays.image
    images, shared, moves = step.images, step.shared, step.points
    by_eo, by_sh, whitened = work.by_eo, work.by_sh, work.whitened
    columns, n_columns, union = work.columns, work.n_columns, work.union
    lower, d = np.zeros((3, 3)), np.zeros(3)
    elimination = Elimination(lower, d)
    for p in range(first, last):
        n_rays = start[p + 1] - start[p]
        linearise_point(p, rays, table, values, points, weighting, work)
        for q in range(n_rays):
            i = image[start[p] + q]
            for row in range(2):
                explained = 0.0
                for t in range(E):
                    explained += by_eo[q, row, t] * images[i, t]
                for t in range(n_columns[q]):
                    explained += by_sh[q, row, t] * shared[union[columns[q, t]]]
                whitened[q, row] -= explained
        point_normals(p, n_rays, points, damping, work, elimination)
        solve_transposed(lower, d)
        for a in range(3):
            moves[p, a] = d[a]
