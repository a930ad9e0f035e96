"""Covariance of the image error as a random field, estimated from the block itself by restricted maximum likelihood.

[L: Patterson and Thompson 1971; D for the block] With everything but the nodes p eliminated, the block says of them
N·p = b with Ω₀ = vᵀPv at p = 0. Neither N nor b knows the covariance σ0²·K of the nodes, K = σ_d²·R(ℓ), so that

    −2 ln L = ν·ln Ω + ln|K⁻¹ + N| + ln|K|,   Ω = Ω₀ − bᵀ(N + K⁻¹)⁻¹b,

ν the redundancy without the field, is had for any σ_d and ℓ from matrices of the nodes alone, without going back to the
observations. All fields of a block have the same σ_d and ℓ [C].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import minimize

from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.field_prior import known_or_first
from aerotri.adjustment.joint_prior import JointPrior
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.parallel import blas_threads
from aerotri.adjustment.shared_parameters import RandomField
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.sparse_cholesky import Factor, NotPositiveDefiniteError
from aerotri.observations import CollocationSettings, PhotographFieldSettings
from aerotri.statistics.summarise import count_observations, effective_redundancy, weighted_sum

SETTLED = 0.1
"""Change of −2 ln L below which σ_d and ℓ stand: far below what would tell one from another."""
MOST_ROUNDS = 5
"""Estimates of σ_d and ℓ, each with a new adjustment [C]: what they change at the linearisation point is small; the
bound ends two that alternate."""
LENGTHS = (0.1, 5.0)
"""Correlation lengths looked at, in half diagonals of the format; at the upper end σ_d²/ℓ alone has a meaning."""
MOST_CHANGE = 30.0
"""Factor by which σ_d may change in one round."""


@dataclass(frozen=True)
class FieldCovariance:
    """σ_d and correlation length of random fields, beside the a-priori σ of the image coordinates."""

    sigma_um: float
    length_mm: float


@dataclass(frozen=True, eq=False)
class ReducedToFields:
    """What a block says of the p nodes of its random fields, everything else eliminated and without their prior.

    Parameters
    ----------
    fields : in the order of the nodes.
    normals : (p, p), right : (p,) N and b. omega : Ω₀. freedom : ν.
    """

    fields: tuple[RandomField, ...]
    normals: np.ndarray
    right: np.ndarray
    omega: float
    freedom: float

    @classmethod
    def of(cls, system: NormalSystem, solution: Solution, factor: Factor) -> ReducedToFields:
        """From a solution and the factor of its undamped equations."""
        return cls.of_fields(system, solution, factor, system.unknowns.shared.fields, system.priors.fields)

    @classmethod
    def of_fields(
        cls,
        system: NormalSystem,
        solution: Solution,
        factor: Factor,
        fields: Sequence[RandomField],
        priors: Sequence[JointPrior],
    ) -> ReducedToFields:
        """Of some fields with their priors; others are eliminated with theirs."""
        nodes = np.concatenate([prior.columns for prior in priors])
        normals = border_marginal(factor, nodes)
        values, at = solution.state.shared[nodes], 0
        right = normals @ values
        for prior in priors:
            own = slice(at, at + len(prior.weight))
            normals[own, own] -= prior.weight
            at = own.stop
        omega = weighted_sum(system, solution) + float(right @ values)
        return cls(tuple(fields), normals, right, omega, effective_redundancy(system, solution))

    def deviance(self, known: FieldCovariance) -> float:
        """−2 ln L of σ_d and ℓ; infinite where rounding hides what so weak a prior leaves undetermined."""
        normals, log_determinant, at = self.normals.copy(), 0.0, 0
        alike: dict[tuple[str, int], tuple[np.ndarray, float]] = {}
        for field in self.fields:
            own = slice(at, at + len(field.items))
            key = field.camera.name, field.held.shape[1]
            if field.held.size or key not in alike:
                alike[key] = field.prior_weight(known.sigma_um, known.length_mm)
            weight, of_field = alike[key]
            normals[own, own] += weight
            log_determinant += of_field
            at = own.stop
        try:
            lower = cholesky(normals, lower=True, overwrite_a=True)
        except np.linalg.LinAlgError:
            # what neither the block nor so weak a prior determines, as a shift beside a free principal point
            return float("inf")
        explained = solve_triangular(lower, self.right, lower=True)
        omega = max(self.omega - float(explained @ explained), 1e-300)
        log_determinant += 2.0 * float(np.sum(np.log(np.diagonal(lower))))
        return self.freedom * float(np.log(omega)) + log_determinant


def with_estimated_fields(
    system: NormalSystem, solution: Solution, options: SolveOptions
) -> tuple[NormalSystem, Solution]:
    """The adjustment with the covariance of its random fields estimated, as far as the settings do not give it.

    The observations are linearised anew after each estimate; where the equations are singular all stays as it is.
    """
    settings = system.unknowns.block.settings
    given, redundancy = settings.collocation, count_observations(system).redundancy
    if not system.priors.fields or None not in (given.sigma_um, given.length_mm):
        return system, solution
    for _ in range(MOST_ROUNDS):
        before = covariance_in_use(system)
        # hundreds of factors of some hundred nodes: threads of BLAS would wait for one another most of the time
        with blas_threads(0.0):
            try:
                reduced = ReducedToFields.of(system, solution, system.factorise(solution.equations))
            except NotPositiveDefiniteError:
                # what is not determined is named where the result is factorised
                break
            found = estimate_covariance(reduced, given, before)
            gain = reduced.deviance(before) - reduced.deviance(found)
        collocation = CollocationSettings(found.sigma_um, found.length_mm)
        system = system.with_settings(replace(system.unknowns.block.settings, collocation=collocation))
        system, again = minimise_at_adjusted(system, solution.state, redundancy, options)
        solution = replace(again, iterations=solution.iterations + again.iterations)
        if gain < SETTLED:
            break
    return system, solution


def border_marginal(factor: Factor, columns: np.ndarray) -> np.ndarray:
    """(k, k) normals of some shared parameters, photographs, points and the other shared parameters eliminated.

    Raises
    ------
    NotPositiveDefiniteError
        Where rounding has left no digit of them.
    """
    normals = factor.border_normals()
    others = np.setdiff1d(np.arange(len(normals)), columns)
    own = normals[np.ix_(columns, columns)]
    if not len(others):
        return own
    try:
        lower = np.linalg.cholesky(normals[np.ix_(others, others)])
    except np.linalg.LinAlgError:
        # equations that hardly hold a block have kept their digits in the cofactors
        return _inverse(factor.border_inverse()[np.ix_(columns, columns)])
    mixed = solve_triangular(lower, normals[np.ix_(others, columns)], lower=True)
    return own - mixed.T @ mixed


def _inverse(cofactors: np.ndarray) -> np.ndarray:
    """Of a positive definite matrix."""
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = 1.0 / np.sqrt(np.diagonal(cofactors))
    scaled = cofactors * np.outer(scale, scale)
    try:
        if not np.isfinite(scaled).all():
            raise NotPositiveDefiniteError
        root = solve_triangular(np.linalg.cholesky(scaled), np.eye(len(scaled)), lower=True)
    except np.linalg.LinAlgError as error:
        raise NotPositiveDefiniteError from error
    return root.T @ root * np.outer(scale, scale)


def estimate_covariance(
    reduced: ReducedToFields, given: CollocationSettings | PhotographFieldSettings, start: FieldCovariance
) -> FieldCovariance:
    """σ_d and ℓ with the greatest restricted likelihood; what is given stays.

    Looked for in ln(σ_d²/ℓ), which decides what happens from node to node and is well known, and ln ℓ, which is not.
    """
    half = max(field.camera.r_max_mm for field in reduced.fields)

    def covariance(x: np.ndarray) -> FieldCovariance:
        length = given.length_mm or float(np.exp(np.clip(x[1], *np.log(np.array(LENGTHS) * half))))
        sigma = float(np.exp(0.5 * x[0])) * float(np.sqrt(length))
        bounds = start.sigma_um / MOST_CHANGE, start.sigma_um * MOST_CHANGE
        return FieldCovariance(given.sigma_um or float(np.clip(sigma, *bounds)), length)

    def deviance(x: np.ndarray) -> float:
        return reduced.deviance(covariance(x))

    first = np.array([np.log(start.sigma_um**2 / start.length_mm), np.log(start.length_mm)])
    corners = first + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.7]])
    options = {"initial_simplex": corners, "xatol": 0.02, "fatol": 0.02, "maxfev": 120}
    found = minimize(deviance, first, method="Nelder-Mead", options=options)
    return covariance(found.x)


def covariance_in_use(system: NormalSystem) -> FieldCovariance:
    """σ_d and ℓ that an adjustment's fields have."""
    u = system.unknowns
    return FieldCovariance(*known_or_first(u.shared.fields[0], u.block.settings))
