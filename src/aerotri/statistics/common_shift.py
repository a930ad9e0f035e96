"""A shift that all observed positions have in common against the control points, where none is an unknown.

Receivers without corrections, another datum or a wrong antenna offset shift all positions of a flight alike. Taken for
independent errors, a hundred positions seem to know their mean ten times better than one does. They then pull the block
away from its control points: it tilts, since the positions lie a flying height above the points.

[L: a score test; Rao 1948] With a shift s as an unknown beside the others, S its columns and E the rows of the
positions, both whitened, and b the whitened residuals without it,

    N_s = SᵀS − SᵀE·Q·EᵀS,   s = N_s⁻¹·Sᵀb,   sᵀN_s·s/σ0² = χ² with three degrees of freedom where there is none.

So the adjustment need not be made anew. N_s vanishes where nothing but the positions holds the block.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.functional_model.observed_unknowns import CentreObservations, Rows
from aerotri.quantiles import chi_square_exceedance
from aerotri.results.common_shift import CommonShift

DETERMINED = 1e-6
"""Share of a shift's weight that has to be left when all else is eliminated; less is rounding."""


def common_shift(system: NormalSystem, solution: Solution, factor: Factor, sigma0: float) -> CommonShift | None:
    """The shift of the positions; None where it is an unknown already, or where nothing else holds the block.

    Parameters
    ----------
    factor : of the undamped equations.
    """
    for extra, rows in zip(system.extras, system.whitened_rows(solution.state), strict=True):
        if isinstance(extra, CentreObservations) and (extra.shift < 0).all():
            return _of_rows(rows, factor, (len(system.unknowns.images), len(system.unknowns.shared)), sigma0)
    return None


def _of_rows(rows: Rows, factor: Factor, counts: tuple[int, int], sigma0: float) -> CommonShift | None:
    whitened = rows.inv_sigma[:, :, None] * np.eye(3)
    left = whitened - explained_by_others([(rows, whitened)], factor, counts)
    weight, normals = np.einsum("gak,gak->k", whitened, whitened), np.einsum("gak,gaj->kj", whitened, left)
    scale = np.sqrt(weight)
    if not weight.all() or np.linalg.eigvalsh(normals / scale[:, None] / scale)[0] < DETERMINED:
        return None
    cofactors = np.linalg.inv(0.5 * (normals + normals.T))
    shift = cofactors @ np.einsum("gak,ga->k", whitened, rows.gap)
    # noise larger than stated is not to be taken for a shift
    rest, observed = rows.gap - left @ shift, rows.inv_sigma > 0.0
    noise = max(sigma0, float(np.sqrt(np.mean(rest[observed] ** 2))))
    p = chi_square_exceedance(float(shift @ normals @ shift) / noise**2, 3.0)
    return CommonShift(shift, noise * np.sqrt(np.diagonal(cofactors)), p)


def explained_by_others(
    parts: Sequence[tuple[Rows, np.ndarray]], factor: Factor, counts: tuple[int, int]
) -> np.ndarray:
    """(g, 3, k) E·Q·Eᵀ of k columns (g, 3, k), of the rows and columns of all parts together.

    Parameters
    ----------
    parts : whitened observations, and columns of theirs. counts : of the photographs and the shared parameters.
    """
    n, s = counts
    k = parts[0][1].shape[2]
    images, shared = np.zeros((n, 6, k)), np.zeros((s, k))
    for rows, columns in parts:
        there = rows.columns >= 0
        np.add.at(images, rows.image, np.einsum("gat,gak->gtk", rows.by_image, columns))
        pulls = np.einsum("gac,gak->gck", rows.by_shared, columns)
        np.add.at(shared, rows.columns[there], pulls[there])
    x = factor.solve(np.concatenate([images.reshape(6 * n, k), shared]))
    return np.concatenate([_predicted(rows, x[: 6 * n].reshape(n, 6, k), x[6 * n :]) for rows, _ in parts])


def _predicted(rows: Rows, images: np.ndarray, shared: np.ndarray) -> np.ndarray:
    """(g, 3, k) what photographs (n, 6, k) and shared parameters (s, k) change of the observations."""
    there = rows.columns >= 0
    at_shared = np.zeros((*rows.columns.shape, images.shape[2]))
    at_shared[there] = shared[rows.columns[there]]
    changes = np.einsum("gat,gtk->gak", rows.by_image, images[rows.image])
    return changes + np.einsum("gac,gck->gak", rows.by_shared, at_shared)
