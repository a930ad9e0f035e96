"""How much parameters differ from group to group, estimated from the block by restricted maximum likelihood.

[L: Patterson and Thompson 1971; D for the block] With everything else eliminated the block says N·p = b of the values p
of all groups, Ω₀ = vᵀPv at p = 0. With the weight W(s) = Σ pattern_t·(size_t/s_t)² of the deviations, a mean of each
parameter that nothing is known of, and ν the redundancy, in which that mean counts as an unknown and the deviations do
not,

    −2 ln L = ν·ln Ω + ln|N + W| + 2·Σ rank_t·ln s_t,   Ω = Ω₀ − bᵀ(N + W)⁻¹b,

with the derivatives  rank_t − pᵀW_t·p·ν/Ω − tr((N + W)⁻¹W_t)  by ln s_t². At its minimum the sum of squares of the
deviations of a parameter is σ̂0² times the number of them that the block determines: Förstner's and Helmert's estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.deviations import Deviation
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.sparse_cholesky import Factor, NotPositiveDefiniteError
from aerotri.quantiles import chi_square_exceedance
from aerotri.results.deviations import Deviations, FoundDeviation
from aerotri.statistics.summarise import count_observations, effective_redundancy, weighted_sum
from aerotri.strategies.field_estimation import border_marginal

SETTLED = 0.5
"""Change of −2 ln L below which the sizes stand [C]: far below what would tell one size from another."""
MOST_ROUNDS = 4
"""Estimates of the sizes, each with a new adjustment [C]."""
LEAST, LARGEST = 0.003, 30.0
"""Bounds of a size in σ of an image coordinate [C]: at the lower one there is no deviation that anything would notice,
and it is reported as 0."""
START = 0.3, 0.03
"""Sizes from which the search begins, in σ of an image coordinate; the better end counts [C]: a likelihood may have two
maxima."""
STEPS = 80


@dataclass(frozen=True, eq=False)
class ReducedToGroups:
    """What a block says of the values of all groups, everything else eliminated and without what ties them.

    Parameters
    ----------
    deviations : one record a parameter, its values at `places` among the p.
    normals : (p, p), right : (p,) N and b. omega : Ω₀. freedom : ν.
    """

    deviations: tuple[Deviation, ...]
    places: tuple[np.ndarray, ...]
    normals: np.ndarray
    right: np.ndarray
    omega: float
    freedom: float

    @classmethod
    def of(cls, system: NormalSystem, solution: Solution, factor: Factor) -> ReducedToGroups:
        """From a solution and the factor of its undamped equations."""
        columns = np.concatenate([one.columns for one in system.priors.deviations])
        ends = np.cumsum([0, *(len(one.columns) for one in system.priors.deviations)])
        places = tuple(np.arange(a, b) for a, b in pairwise(ends.tolist()))
        normals = border_marginal(factor, columns)
        values = solution.state.shared[columns]
        right = normals @ values
        for own, prior in zip(places, system.priors.deviation_priors, strict=True):
            normals[np.ix_(own, own)] -= prior.weight
        omega = weighted_sum(system, solution) + float(right @ values)
        return cls(system.priors.deviations, places, normals, right, omega, effective_redundancy(system, solution))

    def alone(self, k: int) -> ReducedToGroups:
        """What the block says of the groups' values of parameter k where all others have one value for all groups."""
        own, count = self.places[k], len(self.right)
        means = [
            np.isin(np.arange(count), at).astype(float)
            for one, at in zip(self.deviations, self.places, strict=True)
            if one is not self.deviations[k] and not one.about_zero
        ]
        columns = np.column_stack([np.eye(count)[:, own], *means])
        return replace(
            self, deviations=(self.deviations[k],), places=(np.arange(len(own)),),
            normals=columns.T @ self.normals @ columns, right=columns.T @ self.right,
        )  # fmt: skip

    def deviance(self, log_variance: np.ndarray) -> tuple[float, np.ndarray]:
        """−2 ln L of the logarithms (t,) of the squares of the sizes in µm, and its derivatives by them."""
        normals, weights = self.normals.copy(), []
        for one, own, x in zip(self.deviations, self.places, log_variance, strict=True):
            weights.append(one.weight(float(np.exp(0.5 * x))))
            normals[np.ix_(own, own)] += weights[-1] + one.of_mean
        scale = 1.0 / np.sqrt(np.diagonal(normals))
        try:
            factor = cho_factor(normals * scale[:, None] * scale, lower=True, overwrite_a=True)
        except np.linalg.LinAlgError:
            return float("inf"), np.zeros(len(log_variance))
        cofactor = cho_solve(factor, np.eye(len(scale)), overwrite_b=True) * scale[:, None] * scale
        values = cofactor @ self.right
        omega = max(self.omega - float(self.right @ values), 1e-300)
        log_determinant = 2.0 * float(np.sum(np.log(np.diagonal(factor[0])) - np.log(scale)))
        total = self.freedom * float(np.log(omega)) + log_determinant
        slopes = np.empty(len(log_variance))
        for k, (one, own, weight) in enumerate(zip(self.deviations, self.places, weights, strict=True)):
            total += one.rank * float(log_variance[k])
            squares = float(values[own] @ weight @ values[own])
            trace = float(np.sum(cofactor[np.ix_(own, own)] * weight))
            slopes[k] = one.rank - squares * self.freedom / omega - trace
        return total, slopes


def with_estimated_deviations(
    system: NormalSystem, solution: Solution, options: SolveOptions
) -> tuple[NormalSystem, Solution, Deviations | None]:
    """The adjustment with the sizes of the deviations estimated, as far as the settings do not give them.

    The observations are linearised anew after each estimate; where the equations are singular all stays as it is.

    Returns
    -------
    System, solution, and what was found; None where no parameter has several groups.
    """
    if not system.priors.deviations or solution.status != "converged":
        return system, solution, None
    settings = system.unknowns.block.settings
    given = settings.deviations.sigma_um
    redundancy, reduced, x = count_observations(system).redundancy, None, None
    for round_ in range(MOST_ROUNDS):
        try:
            reduced = ReducedToGroups.of(system, solution, system.factorise(solution.equations))
        except NotPositiveDefiniteError:
            # what is not determined is named where the result is factorised
            return system, solution, None
        if given:
            break
        before = x
        x = _estimated(reduced, settings.image_sigma_um, x)
        if before is not None and reduced.deviance(before)[0] - reduced.deviance(x)[0] < SETTLED:
            break
        sizes = zip(system.priors.deviations, np.exp(0.5 * x).tolist(), strict=True)
        tied = replace(settings.deviations, sigma_um={one.name: size for one, size in sizes})
        system = system.with_settings(replace(system.unknowns.block.settings, deviations=tied))
        system, again = minimise_at_adjusted(system, solution.state, redundancy, options)
        solution = replace(again, iterations=solution.iterations + again.iterations)
        if solution.status != "converged" or round_ == MOST_ROUNDS - 1:
            break
    assert reduced is not None
    return system, solution, found_deviations(system, reduced)


def _estimated(reduced: ReducedToGroups, sigma_um: float, start: np.ndarray | None) -> np.ndarray:
    """Logarithms of the squares of the sizes with the greatest restricted likelihood."""
    count = len(reduced.deviations)
    low, high = _bounds(sigma_um)
    starts = [np.full(count, 2.0 * np.log(share * sigma_um)) for share in START] if start is None else [start]
    ends = [
        minimize(
            reduced.deviance, first, jac=True, method="L-BFGS-B", bounds=[(low, high)] * count,
            options={"maxiter": STEPS, "ftol": 1e-11},
        )
        for first in starts
    ]  # fmt: skip
    values = [float(end.fun) for end in ends]
    return ends[int(np.argmin(values))].x


def _bounds(sigma_um: float) -> tuple[float, float]:
    return 2.0 * float(np.log(LEAST * sigma_um)), 2.0 * float(np.log(LARGEST * sigma_um))


def found_deviations(system: NormalSystem, reduced: ReducedToGroups) -> Deviations:
    """The sizes in use, and the tests whether they are needed."""
    settings = system.unknowns.block.settings
    known, sigma_um = settings.deviations.sigma_um or {}, settings.image_sigma_um
    low = _bounds(sigma_um)[0]
    x = np.array([2.0 * np.log(known[one.name]) for one in reduced.deviations])
    deviance, nothing = reduced.deviance(x)[0], np.full(len(x), low)
    ratio = max(reduced.deviance(nothing)[0] - deviance, 0.0)
    p, found = _probability(reduced, sigma_um), []
    for k, one in enumerate(reduced.deviations):
        seen = x[k] > low + 1e-6
        without = np.where(np.arange(len(x)) == k, low, x)
        gain = max(reduced.deviance(without)[0] - deviance, 0.0) if seen else 0.0
        size = float(np.exp(0.5 * x[k])) if seen else 0.0
        found.append(FoundDeviation(one.name, len(one.groups), size, 1e-3 * size / one.size_mm, gain))
    total = float(np.sqrt(sum(one.sigma_um**2 for one in found)))
    return Deviations(settings.deviations.kind, tuple(found), total, ratio, p, p < settings.adjustment.alpha)


def _probability(reduced: ReducedToGroups, sigma_um: float) -> float:
    """Of what the block shows where nothing deviates: all parameters by one common size, or one of them alone.

    So many tests, and the smallest of their probabilities counts as many times [L: Bonferroni].
    """
    count = len(reduced.deviations)
    tested = [reduced, *(reduced.alone(k) for k in range(count) if count > 1)]
    ratio = max(_common_ratio(one, sigma_um) for one in tested)
    return min(0.5 * float(chi_square_exceedance(ratio, 1.0)) * len(tested), 1.0) if ratio > 0.0 else 1.0


def _common_ratio(reduced: ReducedToGroups, sigma_um: float) -> float:
    """−2·ln of the likelihood ratio of deviations of one common size against none.

    One size at the border of its range: half the time 0, else χ² of one degree of freedom [L: Self and Liang 1987].
    """
    low, high = _bounds(sigma_um)
    count = len(reduced.deviations)
    none = reduced.deviance(np.full(count, low))[0]
    tried = [reduced.deviance(np.full(count, x))[0] for x in np.linspace(low, high, 40)]
    return max(none - min(tried), 0.0)
