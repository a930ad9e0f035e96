"""What the residuals of control points say of errors that σ of the noise does not explain, and of the model part.

[D] With the weights W² of the k control coordinates, their cofactors H = W·Q·W and the whitened residuals r = W(l − x̂)
white noise gives Cov(r) = σ0²·R, R = I − H, and rᵀR⁺r/σ0² is χ² with the rank of R as degrees of freedom: what the
control points contradict one another and the photographs, beyond what holds the datum. Left out, coordinates I miss by
R_II⁻¹·r_I, whose covariance is σ0²·R_II⁻¹: every control point left out in turn without a new adjustment.

A model part M of the points adds γ·W·M·W to the covariance of r. Its size γ is known beforehand from ν degrees of
freedom, γ ~ ν/χ²_ν, so that errors over √M follow Student's t. With the residuals of control [L: Bayes; Gelman et al.,
Bayesian Data Analysis, ch. 3]

    p(γ | r) ~ p(γ)·|R + γ·M_w|^(−½)·exp(−½·rᵀ(R + γ·M_w)⁺r),   M_w = W·M·W/σ0².

Scaled by the factor of `scale_of_model`, ± 1.96 total σ hold the truth in 95 % of the cases, as without
control. Control
that agrees makes the factor smaller, also because the size is better known then; control that contradicts makes
it larger. The factor is told, and σ is left as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import erf

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import solve_sides
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.quantiles import chi_square_exceedance
from aerotri.results.model_part import ControlEvidence, ModelRoot
from aerotri.statistics.cluster_test import NUMBERS_AT_ONCE, spread
from aerotri.statistics.model_of_functions import known_root_of
from aerotri.statistics.model_part import COVERED, positive_part

DETERMINED = 1e-6
"""Eigenvalue of R from which residuals are more than rounding: the datum itself has none."""
SIZES = np.geomspace(1e-3, 1e3, 121)
"""γ looked at."""
FREEDOM_OF_FIELDS = 4
"""ν of the size of random fields [C]: from the residuals of three strips it is known to a factor of two."""
HALVINGS = 40
"""Steps of the search for a quantile."""


@dataclass(frozen=True, eq=False)
class ControlEquations:
    """The control coordinates of some points, as many as `cluster_test.SAMPLE` at most.

    Parameters
    ----------
    rows, axes : (k,) points as in `Unknowns`, and X, Y or Z of them. weight : (k,) 1/m, W.
    residual : (k,) r. cofactors : (k, k) H. known : (k, k) W·Q·N_0·Q·W, N_0 the observations of no photograph.
    """

    rows: np.ndarray
    axes: np.ndarray
    weight: np.ndarray
    residual: np.ndarray
    cofactors: np.ndarray
    known: np.ndarray


def control_equations(system: NormalSystem, solution: Solution, factor: Factor) -> ControlEquations | None:
    """What the control points say; None where nothing is known of a point with a σ.

    Parameters
    ----------
    factor : undamped, at the solution.
    """
    u = system.unknowns
    observed = np.flatnonzero((u.prior_weight > 0.0).any(axis=1) & (u.kept < 0))
    if not len(observed):
        return None
    chosen = observed[spread(solution.state.points[observed, :2])]
    row, axes = np.nonzero(u.prior_weight[chosen] > 0.0)
    rows, size = chosen[row], len(row)
    weight, cofactors, known = np.sqrt(u.prior_weight[rows, axes]), np.zeros((size, size)), []
    at_once = int(np.clip(NUMBERS_AT_ONCE / (3 * len(u.points)), 1, size))
    for first in range(0, size, at_once):
        own = np.arange(first, min(first + at_once, size))
        sides = np.zeros((len(u.points), 3, len(own)))
        sides[rows[own], axes[own], np.arange(len(own))] = weight[own]
        _, shared, points = solve_sides(system, solution.state, factor, sides, solution.estimator, rows=observed)
        cofactors[:, own] = weight[:, None] * points[rows, axes]
        known.append(known_root_of(system, shared, points))
    of_known = np.concatenate(known, axis=1)
    residual = weight * (u.prior_xyz - solution.state.points)[rows, axes]
    return ControlEquations(
        rows, axes, weight, residual, 0.5 * (cofactors + cofactors.T), of_known.T @ of_known
    )  # fmt: skip


def model_of_control(equations: ControlEquations, root: ModelRoot | None, widening: float, sigma0: float) -> np.ndarray:
    """(k, k) M_w of the residuals.

    Parameters
    ----------
    root : of the model part, None where there is none. widening : of the variances, that it contains already.
    """
    found = np.zeros_like(equations.cofactors)
    for part in () if root is None else root.parts:
        columns = equations.weight[:, None] * part.points[equations.rows, equations.axes].astype(float)
        noise = part.noise * (equations.cofactors - equations.known)
        found += positive_part((columns @ columns.T)[None], noise[None])[0]
    return found / (widening * sigma0**2)


def along_model(equations: ControlEquations, of_model: np.ndarray, sigma0: float) -> tuple[np.ndarray, np.ndarray]:
    """Variances (f,) that a model part M_w gives to the residuals along its patterns, whitened, and their squares."""
    values, vectors = np.linalg.eigh(np.eye(len(equations.rows)) - equations.cofactors)
    there = values > DETERMINED
    values, vectors = values[there], vectors[:, there]
    z = (vectors.T @ equations.residual) / np.sqrt(values) / sigma0
    turned = (vectors.T @ of_model @ vectors) / np.sqrt(values[:, None] * values)
    power, patterns = np.linalg.eigh(0.5 * (turned + turned.T))
    return np.maximum(power, 0.0), (patterns.T @ z) ** 2


def scale_of_model(power: np.ndarray, squares: np.ndarray, freedom: float) -> float:
    """What the variances of a model part are multiplied with because of the residuals of control.

    (q/t)², q the quantile of an error over √M given the residuals, t that of Student's t.

    Parameters
    ----------
    power, squares : as from `along_model`. freedom : ν, that the size of the model part was known from.
    """
    variance = 1.0 + SIZES[:, None] * power
    likelihood = -0.5 * np.sum(np.log(variance) + squares / variance, axis=1)
    prior = -0.5 * freedom * (np.log(SIZES) + 1.0 / SIZES)
    before, after = (np.exp(log - np.max(log)) for log in (prior, prior + likelihood))
    return (_quantile(after) / _quantile(before)) ** 2


def evidence(equations: ControlEquations, of_model: np.ndarray, sigma0: float) -> ControlEvidence:
    """The test of the residuals against σ and the model part, and the misses of points left out in turn.

    Parameters
    ----------
    of_model : (k, k) M_w, scaled and widened as it stands in total σ.
    """
    count, nothing = len(equations.rows), np.zeros_like(of_model)
    freedom, ratio, p = _against(equations, nothing, sigma0)
    if not freedom:
        return ControlEvidence(count)
    _, ratio_total, p_total = _against(equations, of_model, sigma0)
    left_out, left_out_total = (left_out_over_sigma(equations, model, sigma0) for model in (nothing, of_model))
    return ControlEvidence(count, freedom, ratio, p, ratio_total, p_total, left_out, left_out_total)


def _against(equations: ControlEquations, of_model: np.ndarray, sigma0: float) -> tuple[int, float, float]:
    """Degrees of freedom of the contradictions, their RMS over what M_w explains beside the noise, its probability."""
    power, squares = along_model(equations, of_model, sigma0)
    freedom, total = len(squares), float(np.sum(squares / (1.0 + power)))
    return freedom, float(np.sqrt(total / max(freedom, 1))), chi_square_exceedance(total, max(freedom, 1))


def left_out_over_sigma(equations: ControlEquations, of_model: np.ndarray, sigma0: float) -> float:
    """RMS of the misses of control points left out in turn, over their σ with a model part; NaN where none can be.

    [D] With M_w the misses R_II⁻¹·r_I have the covariance σ0²·R_II⁻¹·(R + M_w)_II·R_II⁻¹.
    """
    rest, squares = np.eye(len(equations.rows)) - equations.cofactors, []
    for point in np.unique(equations.rows):
        own = np.flatnonzero(equations.rows == point)
        part = rest[np.ix_(own, own)]
        if np.linalg.eigvalsh(part)[0] > DETERMINED:
            inverse = np.linalg.inv(part)
            variance = inverse @ (part + of_model[np.ix_(own, own)]) @ inverse
            squares.extend((inverse @ equations.residual[own]) ** 2 / np.diagonal(variance))
    return float(np.sqrt(np.mean(squares)) / sigma0) if squares else float("nan")


def _quantile(share: np.ndarray) -> float:
    """Of an error that has the variance SIZES with these probabilities, not normed."""
    upper, low, high = 0.5 + 0.5 * COVERED, 0.0, 1e3
    roots = np.sqrt(2.0 * SIZES)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        below = np.array([0.5 + 0.5 * erf(ratio) for ratio in (middle / roots).tolist()])
        low, high = (middle, high) if np.sum(share * below) < upper * np.sum(share) else (low, middle)
    return 0.5 * (low + high)
