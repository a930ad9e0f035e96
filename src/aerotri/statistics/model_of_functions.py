"""The model part of the covariance of functions of the unknowns: of volumes, of points measured later.

[D] With the columns F of `ModelRoot` functions c of the unknowns have CᵀFFᵀC, less what noise explains of it: of the
covariance of the photographs' noise, σ̂0²·Cᵀ(Q − Q·N_0·Q)C, N_0 control and weighted parameters.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import expand_sides
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.unknowns import Unknowns
from aerotri.results.model_part import ModelRoot
from aerotri.statistics.cluster_test import NUMBERS_AT_ONCE
from aerotri.statistics.model_part import positive_part


def model_of_functions(
    system: NormalSystem, solution: Solution, root: ModelRoot, unknowns: np.ndarray, solved: np.ndarray, size: int = 1,
    cofactors: np.ndarray | None = None,
) -> np.ndarray:  # fmt: skip
    """(k/size, size, size) model parts of every `size` functions that follow one another.

    Parameters
    ----------
    unknowns : (6n + s, k) partials C of the functions by the unknowns of the reduced system. solved : Q·C.
    cofactors : (k/size, size, size) CᵀQC in the datum of the block, where it is not that of Q. Of what is known
        beforehand of a free block, as a σ of the principal distance, the datum takes nothing away.
    """
    parts = [_of_part(system, solution, part, unknowns, solved, size, cofactors) for part in root.parts]
    return np.sum(parts, axis=0)


def _of_part(
    system: NormalSystem, solution: Solution, root: ModelRoot, unknowns: np.ndarray, solved: np.ndarray, size: int,
    cofactors: np.ndarray | None,
) -> np.ndarray:  # fmt: skip
    """The same of columns of one cause."""
    n = 6 * len(root.images)
    count = unknowns.shape[1] // size
    along = (root.images.reshape(n, -1).T @ unknowns[:n] + root.shared.T @ unknowns[n:]).reshape(-1, count, size)
    found = np.einsum("mki,mkj->kij", along, along)
    noise = np.zeros_like(found)
    if root.noise > 0.0:
        both = cofactors
        if both is None:
            both = np.einsum(
                "uki,ukj->kij", unknowns.reshape(-1, count, size), solved.reshape(-1, count, size), optimize=True
            )
        known = known_root(system, solution, solved).reshape(-1, count, size)
        noise = root.noise * (both - np.einsum("mki,mkj->kij", known, known))
    return positive_part(found, noise)


def known_root(system: NormalSystem, solution: Solution, solved: np.ndarray) -> np.ndarray:
    """(r, k) R with RᵀR = CᵀQ·N_0·QC, from the solutions QC (6n + s, k) of photographs and shared parameters."""
    u = system.unknowns
    n, k = 6 * len(u.images), solved.shape[1]
    observed = _observed(u)
    at = np.empty((len(observed), 3, k))
    if len(observed):
        at_once = int(np.clip(NUMBERS_AT_ONCE / (3 * len(u.points)), 1, k))
        for first in range(0, k, at_once):
            own = slice(first, min(first + at_once, k))
            images = np.ascontiguousarray(solved[:n, own]).reshape(len(u.images), 6, -1)
            nothing = np.zeros((len(u.points), 3, images.shape[2]))
            points = expand_sides(
                system, solution.state, images, np.ascontiguousarray(solved[n:, own]), nothing, solution.estimator
            )
            at[:, :, own] = points[observed]
    return _weighted(system, solved[n:], at)


def known_root_of(system: NormalSystem, shared: np.ndarray, points: np.ndarray) -> np.ndarray:
    """As `known_root`, from solutions of shared parameters (s, k) and points (P, 3, k)."""
    return _weighted(system, shared, points[_observed(system.unknowns)])


def _observed(unknowns: Unknowns) -> np.ndarray:
    """Rows of the points that are observed, control."""
    return np.flatnonzero((unknowns.prior_weight > 0.0).any(axis=1) & (unknowns.kept < 0))


def _weighted(system: NormalSystem, shared: np.ndarray, observed: np.ndarray) -> np.ndarray:
    weight = np.sqrt(system.unknowns.prior_weight[_observed(system.unknowns)])[:, :, None]
    return np.concatenate([system.priors.root().T @ shared, (weight * observed).reshape(-1, shared.shape[1])])
