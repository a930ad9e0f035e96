"""A turn or a scale of all observed positions against control points and photographs.

Control that is tilted or in another scale (grid distances for distances on the ground), positions of another datum:
each fits by itself, and every residual is small. The difference of the two shows in all positions together.

[L: a score test; Rao 1948] As in `common_shift`, with the seven motions of the positions about their middle as unknowns
beside the others. A shift is taken along, so that it is neither a turn nor a scale; where shifts are unknowns already,
the test is of the other four.

[D] Where attitudes are observed too, control that is tilted contradicts both: attitudes hold the block as positions do,
and neither of the two alone seems turned. The motion of positions and attitudes together is tested besides, and the
more unlikely of the two is told.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.datum import motions_of_points
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.functional_model.observed_unknowns import AttitudeObservations, CentreObservations, Rows
from aerotri.quantiles import chi_square_exceedance
from aerotri.results.common_motion import CommonMotion
from aerotri.statistics.common_shift import DETERMINED, explained_by_others

SHIFTS, OTHERS = np.arange(3), np.arange(3, 7)


@dataclass(frozen=True, eq=False)
class _Moved:
    """Whitened observations (g, 3) and what the seven motions change of them, (g, 3, 7)."""

    rows: Rows
    motions: np.ndarray


def common_motion(system: NormalSystem, solution: Solution, factor: Factor, sigma0: float) -> CommonMotion | None:
    """Turn and scale of the positions, or of positions and attitudes; None where nothing else determines them.

    Parameters
    ----------
    factor : of the undamped equations.
    """
    counts = len(system.unknowns.images), len(system.unknowns.shared)
    whitened = list(zip(system.extras, system.whitened_rows(solution.state), strict=True))
    centres = [rows for extra, rows in whitened if isinstance(extra, CentreObservations) and (rows.image >= 0).all()]
    attitudes = [_turned(rows) for extra, rows in whitened if isinstance(extra, AttitudeObservations)]
    if not centres:
        return None
    from_middle = solution.state.centre[centres[0].image]
    from_middle = from_middle - from_middle.mean(axis=0)
    positions = _Moved(centres[0], centres[0].inv_sigma[:, :, None] * motions_of_points(from_middle))
    if not (positions.rows.inv_sigma > 0.0).any(axis=0).all():
        return None
    extent = np.ptp(from_middle, axis=0)
    alone = _of([positions], extent, factor, counts, sigma0)
    if not attitudes:
        return alone
    together = _of([positions, *attitudes], extent, factor, counts, sigma0)
    there = [motion for motion in (together, alone) if motion is not None]
    return min(there, key=lambda motion: motion.least_chance, default=None)


def _turned(rows: Rows) -> _Moved:
    """Attitudes, which turn with the positions and mind neither a shift nor a scale."""
    motions = np.zeros((len(rows.image), 3, 7))
    motions[:, :, 3:6] = rows.by_image[:, :, 3:]
    return _Moved(rows, motions)


def _of(
    moved: list[_Moved], extent: np.ndarray, factor: Factor, counts: tuple[int, int], sigma0: float
) -> CommonMotion | None:
    """The motion that these observations have in common."""
    motions, gap = (np.concatenate(parts) for parts in ([m.motions for m in moved], [m.rows.gap for m in moved]))
    observed = np.concatenate([m.rows.inv_sigma > 0.0 for m in moved])
    left = motions - explained_by_others([(m.rows, m.motions) for m in moved], factor, counts)
    weight, normals = np.einsum("gak,gak->k", motions, motions), np.einsum("gak,gaj->kj", motions, left)
    scale = np.sqrt(np.maximum(weight, 1e-300))
    chosen = _determined(normals / np.outer(scale, scale))
    if chosen is None:
        return None
    own = normals[np.ix_(chosen, chosen)]
    cofactors = np.linalg.inv(0.5 * (own + own.T))
    value = cofactors @ np.einsum("gak,ga->k", motions[:, :, chosen], gap)
    # noise larger than stated is not to be taken for a motion
    rest = gap - left[:, :, chosen] @ value
    noise = max(sigma0, float(np.sqrt(np.mean(rest[observed] ** 2))))
    turn, covariance = value[-4:], noise**2 * cofactors[-4:, -4:]
    sigma = np.sqrt(np.diagonal(covariance))
    return CommonMotion(
        turn[:3], sigma[:3], float(turn[3]), float(sigma[3]), _chance(turn, covariance, [0, 1]),
        _chance(turn, covariance, [2]), _chance(turn, covariance, [3]), extent, with_attitudes=len(moved) > 1,
        tilt_correlation=float(covariance[0, 1] / (sigma[0] * sigma[1])),
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
