"""A turn or a scale of all observed positions against control points and photographs.

Control that is tilted or in another scale (grid distances for distances on the ground), positions of another datum:
each fits by itself, and every residual is small. The difference of the two shows in all positions together.

[L: a score test; Rao 1948] As in `common_shift`, with the seven motions of the positions about their middle as unknowns
beside the others. A shift is taken along, so that it is neither a turn nor a scale; where shifts are unknowns already,
the test is of the other four.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.datum import motions_of_points
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.functional_model.observed_unknowns import CentreObservations, Rows
from aerotri.quantiles import chi_square_exceedance
from aerotri.results.common_motion import CommonMotion
from aerotri.statistics.common_shift import DETERMINED, explained_by_others

SHIFTS, OTHERS = np.arange(3), np.arange(3, 7)


def common_motion(system: NormalSystem, solution: Solution, factor: Factor, sigma0: float) -> CommonMotion | None:
    """Turn and scale of the positions; None where nothing else determines them.

    Parameters
    ----------
    factor : of the undamped equations.
    """
    counts = len(system.unknowns.images), len(system.unknowns.shared)
    for extra, rows in zip(system.extras, system.whitened_rows(solution.state), strict=True):
        if isinstance(extra, CentreObservations) and (rows.image >= 0).all():
            return _of_rows(rows, solution.state.centre[rows.image], factor, counts, sigma0)
    return None


def _of_rows(
    rows: Rows, centre: np.ndarray, factor: Factor, counts: tuple[int, int], sigma0: float
) -> CommonMotion | None:
    observed = rows.inv_sigma > 0.0
    if not observed.any(axis=0).all():
        return None
    from_middle = centre - centre.mean(axis=0)
    whitened = rows.inv_sigma[:, :, None] * motions_of_points(from_middle)
    left = whitened - explained_by_others(rows, whitened, factor, counts)
    weight, normals = np.einsum("gak,gak->k", whitened, whitened), np.einsum("gak,gaj->kj", whitened, left)
    scale = np.sqrt(np.maximum(weight, 1e-300))
    chosen = _determined(normals / np.outer(scale, scale))
    if chosen is None:
        return None
    own = normals[np.ix_(chosen, chosen)]
    cofactors = np.linalg.inv(0.5 * (own + own.T))
    value = cofactors @ np.einsum("gak,ga->k", whitened[:, :, chosen], rows.gap)
    # noise larger than stated is not to be taken for a motion
    rest = rows.gap - left[:, :, chosen] @ value
    noise = max(sigma0, float(np.sqrt(np.mean(rest[observed] ** 2))))
    turn, covariance = value[-4:], noise**2 * cofactors[-4:, -4:]
    sigma = np.sqrt(np.diagonal(covariance))
    return CommonMotion(
        turn[:3], sigma[:3], float(turn[3]), float(sigma[3]), _chance(turn, covariance, [0, 1]),
        _chance(turn, covariance, [2]), _chance(turn, covariance, [3]), np.ptp(from_middle, axis=0),
    )  # fmt: skip


def _determined(normals: np.ndarray) -> np.ndarray | None:
    """The motions that are tested: all seven, or those beside the shifts; None where even these are not determined."""
    for chosen in (np.concatenate([SHIFTS, OTHERS]), OTHERS):
        own = normals[np.ix_(chosen, chosen)]
        if np.linalg.eigvalsh(0.5 * (own + own.T))[0] > DETERMINED:
            return chosen
    return None


def _chance(value: np.ndarray, covariance: np.ndarray, rows: list[int]) -> float:
    own = value[rows]
    return chi_square_exceedance(float(own @ np.linalg.solve(covariance[np.ix_(rows, rows)], own)), float(len(rows)))
