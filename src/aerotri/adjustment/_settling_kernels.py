"""Kernel that leads single points to where their rays want them while the photographs stand still.

`problem` and `work` are described in `kernel_records`.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment._point_kernels import FARTHEST, linearise_point, point_normals, solve_transposed
from aerotri.adjustment.kernel_records import Elimination
from aerotri.compiled import kernel

NEARLY = -1.0
"""As limit: the points only follow photographs that have moved, until a step gains little."""
FIRST_DAMPING, GROWTH, LITTLE = 1e-4, 30.0, 1e-3
"""Of points that follow: damping of the first step, its growth uphill, share of the cost that ends their way."""
LEAST_DAMPING, MOST_DAMPING = 1e-6, 1e6
"""Of points that are led to a limit: of a step that leads uphill; beyond the greater one only rounding is left."""


@kernel
def settle_points(first, last, problem, rounds, limit, work):
    """Move the points first..last, in place; each goes its own damped way and only downhill.

    Until what is left of their way is no longer than √limit of their σ: with weights that follow the residuals steps
    shrink by a factor ρ each, and ρ/(1 − ρ) of the last one is left. Points that are there already stay. With NEARLY as
    limit until a step gains little. rounds : steps at most.
    """
    rays, table, values, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, xyz, prior_xyz, prior_weight = rays.start, points.xyz, points.prior_xyz, points.prior_weight
    lower, d, old = np.zeros((3, 3)), np.zeros(3), np.zeros(3)
    elimination, led = Elimination(lower, d), limit >= 0.0
    for p in range(first, last):
        n_rays = start[p + 1] - start[p]
        before, _ = linearise_point(p, rays, table, values, points, weighting, work)
        for a in range(3):
            before += prior_weight[p, a] * (prior_xyz[p, a] - xyz[p, a]) ** 2
        damping, last_square = 0.0 if led else FIRST_DAMPING, np.inf
        for _ in range(rounds):
            point_normals(p, n_rays, points, damping, work, elimination)
            square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
            if led and damping == 0.0:
                ratio = np.sqrt(square / last_square) if last_square < np.inf else 0.0
                left = max(1.0, ratio / max(1.0 - ratio, 1e-3))
                if not square * left * left > limit:
                    break
            solve_transposed(lower, d)
            within = True
            for a in range(3):
                old[a] = xyz[p, a]
                xyz[p, a] += d[a]
                within = within and abs(xyz[p, a]) < FARTHEST
            after, _ = linearise_point(p, rays, table, values, points, weighting, work)
            for a in range(3):
                after += prior_weight[p, a] * (prior_xyz[p, a] - xyz[p, a]) ** 2
            if within and (after < before or (led and after == before)):
                ends = not led and before - after < LITTLE * before
                before, last_square = after, square if damping == 0.0 else np.inf
                damping = 0.0 if led and damping <= LEAST_DAMPING else 0.1 * damping
            else:
                for a in range(3):
                    xyz[p, a] = old[a]
                linearise_point(p, rays, table, values, points, weighting, work)
                damping = max(10.0 * damping, LEAST_DAMPING) if led else GROWTH * damping
                ends = led and damping > MOST_DAMPING
            if ends:
                break
