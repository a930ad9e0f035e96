"""How much of σ of the object points is one error that all have in common, and how much is local.

Points beside one another err alike: a block is tilted, bent like a bowl, too high as a whole. [D] With orthonormal
columns C of modes over the points (a shift, tilts and bends of the heights, a shift, a turn and a change of scale in
plan) an error e of all heights is C·Cᵀe, common, and the rest, local, and their squares add up. So do the variances,

    tr Σ = tr CᵀΣC + local,   Σ = σ0²·Q + model part.

CᵀQC needs one solution a mode.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import solve_sides
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.results.model_part import CommonPart, ModelRoot
from aerotri.statistics.cluster_test import NUMBERS_AT_ONCE, thinned
from aerotri.statistics.model_of_functions import known_root_of
from aerotri.statistics.model_part import positive_part

HEIGHT = {"shift": 1, "tilt": 2, "bend": 3}
PLAN = {"shift": 2, "turn and scale": 2}
"""Modes, and how many columns each has."""
USUAL = 3.0
"""σ over their median up to which points count [C]: a point far away would bend the modes to itself."""
FEWEST_POINTS = 20
"""Points from which modes are told from what is local [C]."""


def usual_points(system: NormalSystem, solution: Solution, sigma: np.ndarray) -> np.ndarray:
    """Rows of the adjusted points that the parts are taken over, thinned by name where there are very many.

    Parameters
    ----------
    sigma : (P, 3) m, in total.
    """
    u = system.unknowns
    rows = np.flatnonzero(np.isfinite(sigma).all(axis=1) & ~u.point_held.any(axis=1) & (u.kept < 0))
    size = np.column_stack([np.hypot(*sigma[rows, :2].T), sigma[rows, 2]])
    rows = rows[(size <= USUAL * np.median(size, axis=0)).all(axis=1)] if len(rows) else rows
    return rows[thinned(u.block.points[u.points[rows]])]


def modes(xyz: np.ndarray) -> np.ndarray:
    """(k, 3, 10) orthonormal columns over points (k, 3): six of the heights, four in plan, in the order named."""
    x, y = ((xyz - xyz.mean(axis=0))[:, :2] / max(float(np.std(xyz[:, :2])), 1e-300)).T
    nothing, one = np.zeros_like(x), np.ones_like(x)
    heights = np.linalg.qr(np.column_stack([one, x, y, x * x, x * y, y * y]))[0]
    plan = np.stack([np.column_stack(pair) for pair in ((one, nothing, -y, x), (nothing, one, x, y))], axis=1)
    plan = np.linalg.qr(plan.reshape(-1, 4))[0].reshape(len(x), 2, 4)
    columns = np.zeros((len(x), 3, 10))
    columns[:, 2, :6], columns[:, :2, 6:] = heights, plan
    return columns


def common_parts(
    system: NormalSystem, solution: Solution, factor: Factor, covariance: np.ndarray, sigma0: float,
    model: tuple[ModelRoot, np.ndarray] | None = None,
) -> tuple[CommonPart, ...]:  # fmt: skip
    """The parts, RMS over the points; none where there are too few points.

    Parameters
    ----------
    factor : undamped, at the solution. covariance : (P, 3, 3) m², of the noise.
    model : root and (P, 3, 3) of the model part; None where there is none.
    """
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    of_model = np.zeros_like(variance) if model is None else np.diagonal(model[1], axis1=1, axis2=2)
    rows = usual_points(system, solution, np.sqrt(variance + of_model))
    if len(rows) < FEWEST_POINTS:
        return ()
    columns = modes(solution.state.points[rows])
    noise, known = _of_modes(system, solution, factor, rows, columns)
    total = sigma0**2 * noise
    for part in () if model is None else model[0].parts:
        along = np.einsum("pia,pim->am", columns, part.points[rows].astype(float))
        total = total + positive_part((along @ along.T)[None], part.noise * (noise - known)[None])[0]
    parts, count = [], len(rows)
    sums = (sigma0**2 * np.diagonal(noise) / count, np.diagonal(total) / count)
    whole = [values[rows].mean(axis=0) for values in (variance, variance + of_model)]
    for name, names, first, axes in (("height", HEIGHT, 0, [2]), ("plan", PLAN, 6, [0, 1])):
        left, begun = [float(values[axes].sum()) for values in whole], first
        for mode, size in names.items():
            own = [float(values[begun : begun + size].sum()) for values in sums]
            left, begun = [a - b for a, b in zip(left, own, strict=True)], begun + size
            parts.append(CommonPart(f"{name}: {mode}", *(float(np.sqrt(value)) for value in own)))
        # groups that agree better than the noise from point to point take nothing from it
        noise_left, total_left = max(left[0], 0.0), max(*left, 0.0)
        parts.append(CommonPart(f"{name}: local", float(np.sqrt(noise_left)), float(np.sqrt(total_left))))
    return tuple(parts)


def _of_modes(
    system: NormalSystem, solution: Solution, factor: Factor, rows: np.ndarray, columns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """CᵀQC and CᵀQ·N_0·QC of modes C (k, 3, m) of the points `rows`."""
    u, m = system.unknowns, columns.shape[2]
    observed = np.flatnonzero((u.prior_weight > 0.0).any(axis=1) & (u.kept < 0))
    wanted = np.union1d(rows, observed)
    q, known = np.zeros((m, m)), []
    at_once = int(np.clip(NUMBERS_AT_ONCE / (3 * len(u.points)), 1, m))
    for first in range(0, m, at_once):
        own = slice(first, min(first + at_once, m))
        sides = np.zeros((len(u.points), 3, own.stop - first))
        sides[rows] = columns[:, :, own]
        _, shared, points = solve_sides(system, solution.state, factor, sides, solution.estimator, rows=wanted)
        q[:, own] = np.einsum("pia,pib->ab", columns, points[rows])
        known.append(known_root_of(system, shared, points))
    root = np.concatenate(known, axis=1)
    return 0.5 * (q + q.T), root.T @ root
