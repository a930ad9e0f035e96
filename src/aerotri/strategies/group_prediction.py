"""Do the image points of a part of the photographs agree with what the other observations say of the shared parameters?

[D] The rays within a group of photographs, its orientations and points eliminated, say N_g·p = N_g·p̂ + h_g of
the shared parameters p, where p̂ is the estimate of the whole block, whose equations say N. What is left of the
block without this says (N − N_g)·p = (N − N_g)·p̂ − h_g, and the two are independent: the columns of p in the
group with its own nuisances eliminated are orthogonal to those nuisances, so cov(h, h_g) = σ²·N_g. The rays of
the group, predicted by everything else, have the density

    −2 ln L_g = r_g·ln σ² + (Ω_g + h_gᵀ·(N − N_g)⁻¹·h_g)/σ² + ln det N − ln det(N − N_g),

with Ω_g the least vᵀPv of the group at p̂ and r_g its redundancy there. It compares sets of parameters by rays that had
no part in their estimation, and counts the uncertainty with which they are predicted. No group is adjusted anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from aerotri.adjustment.carry_over import start_values_at, with_shared
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.ray_status import RayStatus, with_lonely_rays
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor, NotPositiveDefiniteError
from aerotri.adjustment.system import build_system
from aerotri.conventions import InputError
from aerotri.observations import Block
from aerotri.observations.order import ranks_of
from aerotri.statistics.summarise import OF_POINTS, count_observations
from aerotri.strategies.field_estimation import border_marginal
from aerotri.strategies.half_adjustment import of_largest_piece


@dataclass(frozen=True, eq=False)
class GroupPrediction:
    """G groups of photographs, each predicted by the rest of the block; NaN where a group cannot be judged.

    Parameters
    ----------
    deviance : (G,) −2 ln of the predictive density of its image points.
    redundancy : (G,) of its image points with the shared parameters known.
    """

    deviance: np.ndarray
    redundancy: np.ndarray


@dataclass(frozen=True, eq=False)
class _Said:
    """What a group says of the shared parameters `columns` of the whole: N_g, h_g, Ω_g at p̂, r_g."""

    columns: np.ndarray
    normals: np.ndarray
    right: np.ndarray
    omega: float
    redundancy: int


def predict_groups(
    system: NormalSystem,
    solution: Solution,
    factor: Factor,
    status: np.ndarray,
    groups: Sequence[np.ndarray],
    variance: float,
) -> GroupPrediction:
    """Every group of photographs by the block without its image points.

    Parameters
    ----------
    factor : undamped, at the solution. status : (m,) of the rays of the block. groups : each (k,) rows of the block's
        photographs. variance : σ² in units of the weights.
    """
    kinds = np.array(system.unknowns.shared.kinds, dtype=object)
    columns = np.flatnonzero(~np.isin(kinds.astype(str), OF_POINTS))
    deviance, redundancy = np.full(len(groups), np.nan), np.full(len(groups), np.nan)
    try:
        normals = border_marginal(factor, columns)
    except NotPositiveDefiniteError:
        return GroupPrediction(deviance, redundancy)
    for number, images in enumerate(groups):
        said = _said(system, solution, status, images, columns, np.diagonal(normals))
        if said is None:
            continue
        redundancy[number] = said.redundancy
        deviance[number] = said.redundancy * np.log(variance) + _deviance(normals, said, variance)
    return GroupPrediction(deviance, redundancy)


def _deviance(normals: np.ndarray, said: _Said, variance: float) -> float:
    """(Ω_g + h_gᵀ·(N − N_g)⁻¹·h_g)/σ² + ln|N| − ln|N − N_g|; NaN where nothing else determines the parameters."""
    rest = normals.copy()
    rest[np.ix_(said.columns, said.columns)] -= said.normals
    right = np.zeros(len(rest))
    right[said.columns] = said.right
    scale = 1.0 / np.sqrt(np.diagonal(normals))
    try:
        of_rest = cho_factor(rest * scale[:, None] * scale, lower=True)
        whole = np.linalg.cholesky(normals * scale[:, None] * scale)
    except np.linalg.LinAlgError:
        return float("nan")
    moved = float(right * scale @ cho_solve(of_rest, right * scale))
    ratio = 2.0 * float(np.sum(np.log(np.diagonal(whole))) - np.sum(np.log(np.diagonal(of_rest[0]))))
    return (said.omega + moved) / variance + ratio


def _said(
    system: NormalSystem,
    solution: Solution,
    status: np.ndarray,
    images: np.ndarray,
    columns: np.ndarray,
    ridge: np.ndarray,
) -> _Said | None:
    """What the rays among some photographs say, everything but the parameters `columns` eliminated."""
    u = system.unknowns
    rays = _rays_among(u.block, status, images)
    if not (rays == RayStatus.USED).any():
        return None
    start = start_values_at(u, solution.state)
    try:
        own, state = build_system(_by_image_points(u.block), start, rays)
    except InputError:
        return None
    v = own.unknowns
    state = v.with_kept_points(with_shared(v, u, state, solution.state))
    place = {key: k for k, key in enumerate(zip(u.shared.names, u.shared.groups, strict=True))}
    at = np.array([place[key] for key in zip(v.shared.names, v.shared.groups, strict=True)], dtype=np.int64)
    among = np.searchsorted(columns, at)
    # a weight that is taken off again: what the group alone does not determine stays where it is
    weight = np.ascontiguousarray(ridge[among])
    own.priors = replace(own.priors, weight=weight, value=state.shared, fields=(), deviation_priors=())
    equations = own.assemble(state, 0.0, solution.estimator)
    try:
        factor = own.factorise(equations)
    except NotPositiveDefiniteError:
        return None
    x = factor.solve(equations.right)
    step = x[len(x) - len(at) :]
    normals = factor.border_normals()
    right = normals @ step
    least = equations.cost - float(equations.right @ x) - equations.point_decrement
    # the weights that are taken off again count as observations of the parameters
    redundancy = count_observations(own).redundancy
    return _Said(among, normals - np.diag(weight), right, least + float(right @ step), redundancy)


def _by_image_points(block: Block) -> Block:
    """The block with a minimal datum and nothing but image points."""
    adjustment = replace(block.settings.adjustment, datum="minimal", datum_fixed=(), datum_points=())
    settings = replace(block.settings, adjustment=adjustment)
    return replace(block, settings=settings, gnss_ins=None, constraints=None)


def _rays_among(block: Block, status: np.ndarray, images: np.ndarray) -> np.ndarray:
    """The status of the rays among some photographs, those of the largest piece that points tie together."""
    inside = np.zeros(len(block.images), dtype=bool)
    inside[images] = True
    status = status.copy()
    status[(status == RayStatus.USED) & ~inside[block.image_points.image]] = RayStatus.OFF
    return of_largest_piece(block, with_lonely_rays(block, status))


def areas(block: Block, images: np.ndarray, centre: np.ndarray, count: int) -> list[np.ndarray]:
    """Photographs divided into `count` areas of about equal numbers, halved across their longer side again and again.

    Parameters
    ----------
    images : (n,) rows of the block's photographs. centre : (n, 3) m, their projection centres.
    """
    rank = ranks_of(block).image[images]
    pieces = [np.argsort(rank)]
    while len(pieces) < count:
        largest = max(range(len(pieces)), key=lambda k: len(pieces[k]))
        own = pieces.pop(largest)
        plan = centre[own, :2] - centre[own, :2].mean(axis=0)
        axis = np.linalg.svd(plan, full_matrices=False)[2][0]
        # either sign is a singular vector: the one that points north or east
        axis = axis * np.where(axis[np.argmax(np.abs(axis))] < 0.0, -1.0, 1.0)
        order = own[np.argsort(plan @ axis, kind="stable")]
        half = len(order) // 2
        pieces += [np.sort(order[:half]), np.sort(order[half:])]
    return [images[own] for own in pieces]
