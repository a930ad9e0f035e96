"""Kernels over object points for equations in which the weights of one cluster of photographs are lowered to 1 − t.

`label` (n,) has the cluster of every photograph; column c of sides and solutions belongs to cluster c. Only a point
that photographs of the cluster see differs from what it is with all weights.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment._point_kernels import E, linearise_point, solve_transposed
from aerotri.compiled import kernel, leaf_kernel


@leaf_kernel
def first_of_cluster(q, first_ray, image, label):
    """Whether no ray of the point before ray q is of its cluster."""
    before = 0
    for other in range(q):
        if label[image[first_ray + other]] == label[image[first_ray + q]]:
            before += 1
    return before == 0


@leaf_kernel
def solve_with_weights(p, weights, points, work, side, lower):
    """side := N⁻¹·side, N the 3 × 3 normals of point p with `weights` (q,) of its rays; lower (3, 3) is room."""
    by_pt, prior_weight, point_free = work.by_pt, points.prior_weight, points.free
    for a in range(3):
        for b in range(a + 1):
            value = 0.0
            for q in range(weights.shape[0]):
                value += weights[q] * (by_pt[q, 0, a] * by_pt[q, 0, b] + by_pt[q, 1, a] * by_pt[q, 1, b])
            lower[a, b] = value
        lower[a, a] += prior_weight[p, a] * point_free[p, a]
        if point_free[p, a] == 0.0:
            lower[a, a] = 1.0
    for a in range(3):
        for b in range(a + 1):
            value = lower[a, b]
            for c in range(b):
                value -= lower[a, c] * lower[b, c]
            lower[a, b] = np.sqrt(value) if a == b else value / lower[b, b]
    for a in range(3):
        for c in range(a):
            side[a] -= lower[a, c] * side[c]
        side[a] /= lower[a, a]
    solve_transposed(lower, side)


@leaf_kernel
def changes_of_rays(n_rays, first_ray, image, y, c, work, values):
    """Whitened changes (q, 2), out, of the rays of a point along column c of y, its own coordinates held."""
    by_eo, by_sh, columns, n_columns, union = work.by_eo, work.by_sh, work.columns, work.n_columns, work.union
    images, shared = y.images, y.shared
    for q in range(n_rays):
        i = image[first_ray + q]
        for row in range(2):
            value = 0.0
            for t in range(E):
                value += by_eo[q, row, t] * images[i, t, c]
            for t in range(n_columns[q]):
                value += by_sh[q, row, t] * shared[union[columns[q, t]], c]
            values[q, row] = value


@leaf_kernel
def add_sides(n_rays, first_ray, image, values, c, work, sides):
    """Add AᵀP·values (q, 2) of the rays of a point to column c of the sides."""
    by_eo, by_sh, columns, n_columns, union = work.by_eo, work.by_sh, work.columns, work.n_columns, work.union
    of_images, of_shared = sides.images, sides.shared
    for q in range(n_rays):
        i = image[first_ray + q]
        for row in range(2):
            value = values[q, row]
            for t in range(E):
                of_images[i, t, c] += by_eo[q, row, t] * value
            for t in range(n_columns[q]):
                of_shared[union[columns[q, t]], c] += by_sh[q, row, t] * value


@leaf_kernel
def less_of_point(p, weights, values, points, work, side, lower):
    """values := W·(values − B·N⁻¹·BᵀW·values) with weights W (q,): what is left when the point takes its share."""
    by_pt = work.by_pt
    for a in range(3):
        side[a] = 0.0
        for q in range(weights.shape[0]):
            side[a] += weights[q] * (by_pt[q, 0, a] * values[q, 0] + by_pt[q, 1, a] * values[q, 1])
    solve_with_weights(p, weights, points, work, side, lower)
    for q in range(weights.shape[0]):
        for row in range(2):
            own = by_pt[q, row, 0] * side[0] + by_pt[q, row, 1] * side[1] + by_pt[q, row, 2] * side[2]
            values[q, row] = weights[q] * (values[q, row] - own)


@kernel
def lowered_sides(first, last, problem, label, t, y, sides, work):
    """(N − N(c))·y_c of every cluster c, the points first..last eliminated, N(c) with the weights of cluster c lowered.

    Where `y` has no columns, the scores A_cᵀPv with the points eliminated from N(c). Added to `sides`.
    """
    rays, table, at, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, image, by_pt, whitened = rays.start, rays.image, work.by_pt, work.whitened
    most = work.by_eo.shape[0]
    values, other, weights, ones = np.empty((most, 2)), np.empty((most, 2)), np.empty(most), np.ones(most)
    side, lower = np.empty(3), np.zeros((3, 3))
    for p in range(first, last):
        first_ray, n_rays = start[p], start[p + 1] - start[p]
        linearise_point(p, rays, table, at, points, weighting, work)
        for k in range(n_rays):
            if not first_of_cluster(k, first_ray, image, label):
                continue
            c = label[image[first_ray + k]]
            for q in range(n_rays):
                weights[q] = 1.0 - t if label[image[first_ray + q]] == c else 1.0
            own = weights[:n_rays]
            if y.images.shape[2]:
                changes_of_rays(n_rays, first_ray, image, y, c, work, values)
                other[:n_rays] = values[:n_rays]
                less_of_point(p, ones[:n_rays], values, points, work, side, lower)
                less_of_point(p, own, other, points, work, side, lower)
                for q in range(n_rays):
                    values[q, 0] -= other[q, 0]
                    values[q, 1] -= other[q, 1]
            else:
                for a in range(3):
                    side[a] = 0.0
                for q in range(n_rays):
                    if label[image[first_ray + q]] == c:
                        for a in range(3):
                            side[a] += by_pt[q, 0, a] * whitened[q, 0] + by_pt[q, 1, a] * whitened[q, 1]
                solve_with_weights(p, own, points, work, side, lower)
                for q in range(n_rays):
                    share = 1.0 if label[image[first_ray + q]] == c else 0.0
                    for row in range(2):
                        moved = by_pt[q, row, 0] * side[0] + by_pt[q, row, 1] * side[1] + by_pt[q, row, 2] * side[2]
                        values[q, row] = share * whitened[q, row] - weights[q] * moved
            add_sides(n_rays, first_ray, image, values, c, work, sides)


@kernel
def lowered_points(first, last, problem, label, t, y, work):
    """The points first..last of the solutions of N(c)·y_c = A_cᵀPv, into `y`, of the clusters that see them."""
    rays, table, at, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, image, by_pt, whitened, found = rays.start, rays.image, work.by_pt, work.whitened, y.points
    most = work.by_eo.shape[0]
    values, weights, side, lower = np.empty((most, 2)), np.empty(most), np.empty(3), np.zeros((3, 3))
    for p in range(first, last):
        first_ray, n_rays = start[p], start[p + 1] - start[p]
        linearise_point(p, rays, table, at, points, weighting, work)
        for k in range(n_rays):
            if not first_of_cluster(k, first_ray, image, label):
                continue
            c = label[image[first_ray + k]]
            changes_of_rays(n_rays, first_ray, image, y, c, work, values)
            for a in range(3):
                side[a] = 0.0
            for q in range(n_rays):
                inside = label[image[first_ray + q]] == c
                weights[q] = 1.0 - t if inside else 1.0
                for row in range(2):
                    left = (whitened[q, row] if inside else 0.0) - weights[q] * values[q, row]
                    for a in range(3):
                        side[a] += by_pt[q, row, a] * left
            solve_with_weights(p, weights[:n_rays], points, work, side, lower)
            for a in range(3):
                found[p, a, c] = side[a]
