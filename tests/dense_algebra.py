"""The design matrix of a small adjustment written out in full, for comparison with the sparse algebra."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.scanned_rays import linearise_unknown_rays

TINY = {
    "flight": {
        "gsd_m": 0.1, "strips": 2, "images_per_strip": 4, "end_lap": 0.6, "side_lap": 0.3, "heading_deg": 20.0,
        "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0],
    },
    "tie_points": {"per_image": 25, "probability": 1.0, "sigma_um": 2.0},
}  # fmt: skip


def dense_design(adjustment):
    """Whitened design matrix over (photographs, shared parameters, points), written out from the linearised rays."""
    system, state = adjustment.system, adjustment.solution.state
    u = system.unknowns
    rays, n, s, count = u.rays, len(u.images), len(u.shared), len(u.points)
    ray_point = np.repeat(np.arange(count), np.diff(rays.start))
    partials, in_scan, by_scan = linearise_unknown_rays(u, state, np.arange(len(rays.image)))
    rows = []
    for k in range(len(rays.image)):
        block = np.zeros((2, 6 * n + s + 3 * count))
        by_eo = partials.by_orientation[k].copy()
        by_eo[:, 3:] = by_eo[:, 3:] @ u.turn(state)[rays.image[k]]
        block[:, 6 * rays.image[k] : 6 * rays.image[k] + 6] = by_eo * u.eo_free[rays.image[k]]
        for t, column in enumerate(u.lens.columns[rays.lens_row[k]]):
            if column >= 0:
                block[:, 6 * n + column] += partials.by_interior[k, :, t]
        for t in range(rays.ap_index.shape[1]):
            block[:, 6 * n + rays.ap_index[k, t]] += rays.ap_value[k, :, t]
        for column, by_column in zip(in_scan[k], by_scan[k].T, strict=True):
            if column >= 0:
                block[:, 6 * n + column] += by_column
        p = ray_point[k]
        if u.kept[p] >= 0:
            block[:, 6 * n + u.kept[p] : 6 * n + u.kept[p] + 3] = partials.by_point[k]
        at = 6 * n + s + 3 * p
        block[:, at : at + 3] = partials.by_point[k] * u.point_free[p]
        rows.append(block * (rays.inv_sigma[k] * np.sqrt(adjustment.solution.equations.weight[k]))[:, None])
    design = np.concatenate(rows)
    extra = [*_observed(system, n, s, design.shape[1]), *_beside(system, state, n, design.shape[1])]
    return np.concatenate([design, np.array(extra)]) if extra else design


def _observed(system, n: int, s: int, size: int):
    """Rows of observed coordinates, shared parameters and random fields."""
    u = system.unknowns
    for point, axis in zip(*np.nonzero(u.prior_weight * (u.kept < 0)[:, None]), strict=True):
        row = np.zeros(size)
        row[6 * n + s + 3 * point + axis] = np.sqrt(u.prior_weight[point, axis])
        yield row
    for column, sigma in enumerate(u.shared.sigma):
        if np.isfinite(sigma):
            row = np.zeros(size)
            row[6 * n + column] = 1.0 / sigma
            yield row
    for field in system.priors.joint:
        rows = np.zeros((field.rank, size))
        rows[:, 6 * n + field.columns] = field.root().T
        yield from rows


def _beside(system, state, n: int, size: int):
    """Rows of the observations beside image points and control."""
    for kind in system.extras:
        rows = kind.rows(state.centre, state.rotation, state.shared)
        for g, axis in zip(*np.nonzero(rows.inv_sigma), strict=True):
            row = np.zeros(size)
            if rows.image[g] >= 0:
                row[6 * rows.image[g] : 6 * rows.image[g] + 6] = rows.by_image[g, axis]
            for column, partial in zip(rows.columns[g], rows.by_shared[g, axis], strict=True):
                if column >= 0:
                    row[6 * n + column] += partial
            yield row * rows.inv_sigma[g, axis]
