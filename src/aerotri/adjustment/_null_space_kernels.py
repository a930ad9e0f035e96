"""Kernels that measure directions in the space of all unknowns: their effect on the observations, and their size.

Their arguments are described in `kernel_records`.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment._point_kernels import E, linearise_point
from aerotri.compiled import kernel


@kernel
def add_products(first, last, problem, directions, effect, size, work):
    """Products of k directions over the rays and observed coordinates of points first..last.

    directions : images (n, 6, k), shared (s, k), points (P, 3, k). effect (k, k) : VᵀAᵀA·V, size (k, k) : VᵀD·V,
    D the squares of the points' columns; both are added to.
    """
    rays, table, values, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, image = rays.start, rays.image
    prior_weight, point_free = points.prior_weight, points.free
    images, shared, moves = directions.images, directions.shared, directions.points
    by_eo, by_pt, by_sh = work.by_eo, work.by_pt, work.by_sh
    columns, n_columns, union = work.columns, work.n_columns, work.union
    count = moves.shape[2]
    value, square = np.zeros(count), np.zeros(3)
    for p in range(first, last):
        linearise_point(p, rays, table, values, points, weighting, work)
        for t in range(3):
            square[t] = prior_weight[p, t] * point_free[p, t]
        for q in range(start[p + 1] - start[p]):
            i = image[start[p] + q]
            for row in range(2):
                for k in range(count):
                    total = 0.0
                    for t in range(E):
                        total += by_eo[q, row, t] * images[i, t, k]
                    for t in range(3):
                        total += by_pt[q, row, t] * moves[p, t, k]
                    for t in range(n_columns[q]):
                        total += by_sh[q, row, t] * shared[union[columns[q, t]], k]
                    value[k] = total
                for t in range(3):
                    square[t] += by_pt[q, row, t] * by_pt[q, row, t]
                for k in range(count):
                    for other in range(count):
                        effect[k, other] += value[k] * value[other]
        for t in range(3):
            observed = prior_weight[p, t] * point_free[p, t]
            for k in range(count):
                for other in range(count):
                    product = moves[p, t, k] * moves[p, t, other]
                    effect[k, other] += observed * product
                    size[k, other] += square[t] * product
