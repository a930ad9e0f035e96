"""How residuals answer to errors of the observations: products with R = Q_vv·P, which is never formed.

R = I − A·N⁻¹·Aᵀ in units of σ is symmetric and idempotent [L]. A product with it is one step of the adjustment with the
errors added to the observations, and the difference of the residuals before and after: two assemblies and a solution
with the factor.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.solve import Solution
from aerotri.functional_model.observed_unknowns import Rows
from aerotri.observations.order import ranks_of
from aerotri.statistics.observation_groups import EXTRA_GROUPS, control_groups, image_groups_of

EXACT = 32
"""Observations up to which a group is computed exactly: what is drawn at random says too little of so few."""
SMALL = 1e-3
"""Size, in σ, of the errors that are put in: far below any curvature, far above rounding."""


class ResidualResponse:
    """Products R·z at a solution, with its final weights.

    The N observations in order: x and y of every ray, X, Y and Z of every point whether they are given or not, the rows
    beside them whether observed or not; what is not observed answers 0.
    """

    def __init__(self, system: NormalSystem, solution: Solution):
        unknowns, self._state = system.unknowns, solution.state
        rays = unknowns.rays
        # the final weights of a robust adjustment, as σ
        inv_sigma = rays.inv_sigma * np.sqrt(solution.equations.weight)[:, None]
        self._unknowns = replace(unknowns, rays=replace(rays, inv_sigma=inv_sigma))
        self._system = copy(system)
        self._system.unknowns = self._unknowns
        self._rows = self._system.whitened_rows(self._state)
        self._factor = self._system.factorise(self._system.assemble(self._state, 0.0, LEAST_SQUARES))
        self._sizes = [inv_sigma.size, unknowns.prior_weight.size, *(rows.gap.size for rows in self._rows)]
        self._at_rest = self._after_a_step(np.zeros(sum(self._sizes)))

    @property
    def places(self) -> np.ndarray:
        """(N,) of the observations within their groups, in an order that does not depend on rows or names."""
        u, ranks = self._unknowns, ranks_of(self._unknowns.block)
        places = [2 * ranks.ray[u.rays.source][:, None] + np.arange(2)]
        places.append(3 * ranks.point[u.points][:, None] + np.arange(3))
        for rows in self._rows:
            own = np.where(rows.image >= 0, ranks.image[u.images[rows.image]], np.arange(len(rows.image)))
            places.append(own[:, None] * rows.gap.shape[1] + np.arange(rows.gap.shape[1]))
        return np.concatenate([part.ravel() for part in places])

    @property
    def groups(self) -> np.ndarray:
        """(N,) str, the group of every observation, '' where it belongs to none or is not observed."""
        u = self._unknowns
        names = [np.repeat(image_groups_of(u.block)[u.images][u.rays.image], 2)]
        names.append(np.where(u.prior_weight > 0.0, control_groups(u.prior_weight.shape), "").ravel())
        for rows in self._rows:
            of_row = np.array([EXTRA_GROUPS.get((rows.name, c), "") for c in rows.components], dtype=object)
            names.append(np.where(rows.inv_sigma > 0.0, of_row, "").ravel())
        return np.concatenate(names)

    def __call__(self, errors: np.ndarray) -> np.ndarray:
        """(N,) change of the residuals, in σ, for errors (N,) of the observations, in σ."""
        return (self._after_a_step(SMALL * errors) - self._at_rest) / SMALL

    def _after_a_step(self, errors: np.ndarray) -> np.ndarray:
        """Residuals (observed less predicted) in σ, one step after the errors were put in."""
        of_rays, of_points, *of_rows = np.split(errors, np.cumsum(self._sizes)[:-1])
        u, system, state = self._unknowns, self._system, self._state
        of_points = of_points.reshape(-1, 3)
        of_rows = [part.reshape(rows.gap.shape) for part, rows in zip(of_rows, self._rows, strict=True)]
        xy = u.rays.xy + of_rays.reshape(-1, 2) * _inverse(u.rays.inv_sigma)
        root = np.sqrt(u.prior_weight)
        prior_xyz = u.prior_xyz + of_points * _inverse(root)
        system.unknowns = replace(u, rays=replace(u.rays, xy=xy), prior_xyz=prior_xyz)
        right = system.right_side(state, LEAST_SQUARES).right.copy()
        for rows, part in zip(self._rows, of_rows, strict=True):
            _add_rows(right, len(u.images), rows, part)
        # points that are not eliminated stand with the shared parameters
        columns = 6 * len(u.images) + u.kept_columns
        right[columns] += (root * of_points)[u.kept_rows]
        step = system.back_substitute(state, self._factor.solve(right), 0.0, LEAST_SQUARES)
        there = u.advance(state, step)
        residual = system.right_side(there, LEAST_SQUARES).residual
        gaps = [rows.gap + part for rows, part in zip(system.whitened_rows(there), of_rows, strict=True)]
        parts = [residual * u.rays.inv_sigma, root * (prior_xyz - there.points), *gaps]
        return np.concatenate([part.ravel() for part in parts])


def _inverse(values: np.ndarray) -> np.ndarray:
    return np.divide(1.0, values, out=np.zeros_like(values), where=values > 0.0)


def _add_rows(right: np.ndarray, images: int, rows: Rows, errors: np.ndarray) -> None:
    """Add to the right side (6·n + s,) what errors (g, k) of whitened rows bring."""
    own = rows.image >= 0
    of_images, of_shared = right[: 6 * images].reshape(-1, 6), right[6 * images :]
    np.add.at(of_images, rows.image[own], np.einsum("gka,gk->ga", rows.by_image[own], errors[own]))
    there = rows.columns >= 0
    np.add.at(of_shared, rows.columns[there], np.einsum("gkc,gk->gc", rows.by_shared, errors)[there])


def cross_redundancy(response: ResidualResponse, names: tuple[str, ...], probes: int) -> np.ndarray:
    """S with S_gh = Σ R_ij² over the observations i of group g and j of group h; its rows sum to the redundancy of g.

    A group of no more than `EXACT` observations is computed exactly, the others from random signs (Hutchinson): the
    mean of |R·z|² over h, z of signs ±1 on g.

    Parameters
    ----------
    names : of the groups. probes : products for each group.
    """
    groups = response.groups
    members = [np.flatnonzero(groups == name) for name in names]
    places = response.places
    members = [own[np.argsort(places[own], kind="stable")] for own in members]
    rng = np.random.default_rng(0)
    s = np.zeros((len(names), len(names)))
    for g, own in enumerate(members):
        exact = len(own) <= max(probes, EXACT)
        for k in range(len(own) if exact else probes):
            errors = np.zeros(len(groups))
            if exact:
                errors[own[k]] = 1.0
            else:
                errors[own] = rng.choice([-1.0, 1.0], size=len(own)) / np.sqrt(probes)
            answer = response(errors) ** 2
            s[g] += [answer[other].sum() for other in members]
    return (s + s.T) / 2.0
