"""Tests of given coordinates that are held: control with σ = 0, which has no residual.

[D] With σ → 0 the residual of a given coordinate vanishes, and so does its redundancy number, but its test
w = −v/(σ·√r) tends to (given − predicted)/σ_predicted, the prediction by everything else. At the solution the rays of
the point pull at a held coordinate i with λ_i = Σ aᵀPv, and free it would move by λ_i/S_i, S_i the normal equations
reduced to it, S_i = N_ii − N_if·Q_ff·N_fi; so w_i = −λ_i/√S_i and σ_predicted = 1/√S_i. The others stay held.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.scanned_rays import linearise_unknown_rays
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor

NOT_PREDICTED = 1e-9
"""Share of a coordinate's own normal equation below which the rest does not determine it."""
COLUMNS_AT_ONCE = 96
"""Right sides solved together [C]: more need more memory, a row of each for every unknown; fewer go through the factor
more often."""


@dataclass(frozen=True, eq=False)
class HeldTests:
    """Of the held coordinates (P, 3), in the order of the system's points; NaN where there is no test.

    Parameters
    ----------
    w : test of the coordinate, σ a priori. sigma : m, a priori, of the coordinate as all others predict it.
    """

    w: np.ndarray
    sigma: np.ndarray


def no_held_tests(system: NormalSystem) -> HeldTests:
    """Of a block that holds no coordinates of control."""
    nothing = np.full((len(system.unknowns.points), 3), np.nan)
    return HeldTests(nothing, nothing)


def held_tests(system: NormalSystem, solution: Solution, factor: Factor) -> HeldTests:
    """Tests of the coordinates of control that are held.

    Parameters
    ----------
    factor : undamped, at the solution.
    """
    u = system.unknowns
    w, sigma = np.full((len(u.points), 3), np.nan), np.full((len(u.points), 3), np.nan)
    rows, axes = np.nonzero(u.control_held & u.point_held)
    turn = u.turn(solution.state)
    for first in range(0, len(rows), COLUMNS_AT_ONCE):
        own = slice(first, first + COLUMNS_AT_ONCE)
        sides = [_side(system, solution, turn, row, axis) for row, axis in zip(rows[own], axes[own], strict=True)]
        coupled = np.stack([side for side, _, _ in sides], axis=1)
        pull, alone = (np.array([side[k] for side in sides]) for k in (1, 2))
        reduced = alone - np.einsum("ik,ik->k", coupled, factor.solve(coupled.copy()))
        known = reduced > NOT_PREDICTED * alone
        root = np.sqrt(np.where(known, reduced, np.nan))
        w[rows[own], axes[own]] = -pull / root
        sigma[rows[own], axes[own]] = 1.0 / root
    return HeldTests(w, sigma)


def _side(
    system: NormalSystem, solution: Solution, turn: np.ndarray, row: int, axis: int
) -> tuple[np.ndarray, float, float]:
    """N_fi (6·n + s,) with the point's own free coordinates eliminated, the pull λ_i, and N_ii reduced likewise."""
    u, state = system.unknowns, solution.state
    rays = np.arange(int(u.rays.start[row]), int(u.rays.start[row + 1]))
    image, lens = u.rays.image[rays], u.rays.lens_row[rays]
    partials, in_scan, by_scan = linearise_unknown_rays(u, state, rays)
    weight = u.rays.inv_sigma[rays] * np.sqrt(solution.equations.weight[rays])[:, None]
    gap = (solution.equations.residual[rays] * weight).ravel()
    by_point = (partials.by_point * weight[:, :, None]).reshape(-1, 3)
    free = u.point_free[row]
    own = by_point[:, axis]
    if free.any():
        among = by_point[:, free]
        normal = among.T @ among + np.diag(u.prior_weight[row, free])
        own = own - among @ np.linalg.solve(normal, among.T @ own)
    at_rays = (own.reshape(-1, 2) * weight)[:, :, None]
    side = np.zeros(6 * len(u.images) + len(u.shared))
    by_image = partials.by_orientation.copy()
    by_image[:, :, 3:] = by_image[:, :, 3:] @ turn[image]
    of_images = side[: 6 * len(u.images)].reshape(-1, 6)
    np.add.at(of_images, image, np.sum(by_image * at_rays, axis=1) * u.eo_free[image])
    of_shared = side[6 * len(u.images) :]
    columns = u.lens.columns[lens]
    there = columns >= 0
    by_interior = np.sum(partials.by_interior * at_rays, axis=1)
    np.add.at(of_shared, columns[there], by_interior[there])
    by_patterns = np.sum(u.rays.ap_value[rays].reshape(len(image), 2, -1) * at_rays, axis=1)
    index = u.rays.ap_index[rays]
    np.add.at(of_shared, index[index >= 0], by_patterns[index >= 0])
    np.add.at(of_shared, in_scan[in_scan >= 0], np.sum(by_scan * at_rays, axis=1)[in_scan >= 0])
    return side, float(by_point[:, axis] @ gap), float(by_point[:, axis] @ own)
