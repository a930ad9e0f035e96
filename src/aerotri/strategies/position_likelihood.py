"""What a block says of the errors of its observed positions, everything else eliminated: their restricted likelihood.

[L: Patterson and Thompson 1971; D for the block] With white positions of σ as in the table the whitened residuals b of
p observed coordinates have the cofactors G = I − E·Q·Eᵀ, E their rows of the design matrix. For errors with covariance
σ0²·C, C = k²·I + K in units of σ of the table, K of the Gauss-Markov process, and with everything else eliminated

    −2 ln L = ν·ln Ω + ln|I + M·G|,   Ω = vᵀPv − bᵀ(I + M·G)⁻¹·M·b,   M = C − I,

ν the redundancy. So any k, σ_c and τ are had from G and b alone, without going back to the observations. M need not be
positive; G and b are first brought to a noise of LEAST_NOISE, from where it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.optimize import minimize

from aerotri.adjustment.exposures import Exposures, exposures_of
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.functional_model.observed_unknowns import CentreObservations, Rows
from aerotri.statistics.summarise import effective_redundancy, weighted_sum

LEAST_NOISE, MOST_NOISE = 0.05, 20.0
"""Factors of the σ of the table looked at."""
CHUNK = 256
"""Columns solved for at a time."""
SHORTEST = 0.3
"""Shortest correlation time looked at, in usual times between exposures: there neighbours correlate by 0.04."""
LEAST_SHARE, MOST_SHARE = 1e-3, 100.0
"""σ of the process looked at, in median σ of the table."""
RUNS = 5
"""A sample of the exposures is so many runs of neighbours, evenly spread over the flight."""
PLAN, HEIGHT = 0, 1


@dataclass(frozen=True)
class ErrorModel:
    """Errors of observed positions beside the σ of the table.

    Parameters
    ----------
    noise : factor of the table's σ, plan and height. sigma : σ of the process, m, of X, Y and Z. time : τ.
    """

    noise: tuple[float, float] = (1.0, 1.0)
    sigma: tuple[float, float, float] = (0.0, 0.0, 0.0)
    time: float = 1.0


@dataclass(frozen=True)
class Given:
    """What of an `ErrorModel` is given; None: to be estimated."""

    noise: tuple[float, float] | None = (1.0, 1.0)
    sigma: tuple[float, float, float] | None = None
    time: float | None = None


@dataclass(frozen=True, eq=False)
class ReducedToPositions:
    """What a block says of the errors of p observed coordinates.

    Parameters
    ----------
    exposures : of the g positions looked at.
    row, axis : (p,) position and coordinate. sigma : (p,) m, of the table.
    cofactor : (p, p) G, residual : (p,) b, whitened. omega : vᵀPv. freedom : ν.
    """

    exposures: Exposures
    row: np.ndarray
    axis: np.ndarray
    sigma: np.ndarray
    cofactor: np.ndarray
    residual: np.ndarray
    omega: float
    freedom: float

    @classmethod
    def of(cls, system: NormalSystem, solution: Solution, factor: Factor, most: int) -> ReducedToPositions | None:
        """From a solution without errors that stay; None where no position was observed.

        Parameters
        ----------
        factor : of the undamped equations. most : exposures looked at.
        """
        found = observed_rows(system, solution)
        if found is None:
            return None
        rows, image = found
        u = system.unknowns
        exposures = exposures_of(u.block, u.images[image], solution.state.centre[image])
        chosen = sample(exposures, most)
        known = rows.inv_sigma[chosen] > 0.0
        row, axis = np.nonzero(known)
        cofactor = residual_cofactors(rows, chosen[row], axis, factor, (len(u.images), len(u.shared)))
        return cls(
            exposures.taken(chosen), row, axis, 1.0 / rows.inv_sigma[chosen][known], cofactor, rows.gap[chosen][known],
            weighted_sum(system, solution), effective_redundancy(system, solution),
        )  # fmt: skip

    @property
    def usual_sigma(self) -> float:
        return float(np.median(self.sigma))

    @cached_property
    def _at_least_noise(self) -> tuple[np.ndarray, np.ndarray, float]:
        """G, b and Ω as if the noise were LEAST_NOISE of the table's."""
        taken = 1.0 - LEAST_NOISE**2
        inside = cho_factor(np.eye(len(self.row)) - taken * self.cofactor)
        cofactor = cho_solve(inside, self.cofactor)
        residual = cho_solve(inside, self.residual)
        return 0.5 * (cofactor + cofactor.T), residual, self.omega + taken * float(self.residual @ residual)

    @cached_property
    def _apart(self) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """Every coordinate with its rows and the times between them, inf between flights."""
        out = []
        for axis in range(3):
            own = np.flatnonzero(self.axis == axis)
            if len(own):
                flight, time = self.exposures.flight[self.row[own]], self.exposures.time[self.row[own]]
                apart = np.abs(time[:, None] - time)
                apart[flight[:, None] != flight] = np.inf
                out.append((axis, own, apart))
        return out

    def deviance(self, model: ErrorModel) -> float:
        """−2 ln L of a model, but for a constant."""
        cofactor, residual, omega = self._at_least_noise
        normals, log_determinant = cofactor.copy(), 0.0
        for axis, own, apart in self._apart:
            extra = model.noise[HEIGHT if axis == 2 else PLAN] ** 2 - LEAST_NOISE**2
            covariance = np.exp(-apart / model.time)
            scale = model.sigma[axis] / self.sigma[own]
            covariance *= scale[:, None] * scale
            covariance[np.diag_indices_from(covariance)] += max(extra, 1e-12)
            lower = cholesky(covariance, lower=True)
            log_determinant += 2.0 * float(np.sum(np.log(np.diagonal(lower))))
            normals[np.ix_(own, own)] += cho_solve((lower, True), np.eye(len(own)))
        lower = cholesky(normals, lower=True, overwrite_a=True)
        explained = solve_triangular(lower, residual, lower=True)
        left = max(omega - float(explained @ explained), 1e-300)
        log_determinant += 2.0 * float(np.sum(np.log(np.diagonal(lower))))
        return self.freedom * float(np.log(left)) + log_determinant

    def decorrelated(self, noise: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """Gradient (p,) and its cofactors (p, p) where positions have white noise of another size."""
        extra = np.where(self.axis == 2, noise[HEIGHT], noise[PLAN]) ** 2 - LEAST_NOISE**2
        cofactor, residual, _ = self._at_least_noise
        inside = np.eye(len(extra)) + cofactor * np.maximum(extra, 0.0)
        both = np.linalg.solve(inside, np.column_stack([cofactor, residual]))
        return both[:, -1], 0.5 * (both[:, :-1] + both[:, :-1].T)


def observed_rows(system: NormalSystem, solution: Solution) -> tuple[Rows, np.ndarray] | None:
    """The whitened rows of the observed positions and the photographs they belong to."""
    for extra, rows in zip(system.extras, system.whitened_rows(solution.state), strict=True):
        if isinstance(extra, CentreObservations):
            return rows, extra.image
    return None


def sample(exposures: Exposures, most: int) -> np.ndarray:
    """Rows of all exposures, or of `most` in runs of neighbours."""
    order = exposures.order
    if len(order) <= most:
        return order
    length = most // RUNS
    begin = np.round(np.linspace(0, len(order) - length, RUNS)).astype(int)
    return order[np.unique((begin[:, None] + np.arange(length)).ravel())]


def residual_cofactors(
    rows: Rows, row: np.ndarray, axis: np.ndarray, factor: Factor, counts: tuple[int, int]
) -> np.ndarray:
    """(p, p) I − E·Q·Eᵀ of single components of whitened rows.

    Parameters
    ----------
    counts : of the photographs and the shared parameters.
    """
    by_image, by_shared = rows.by_image[row, axis], rows.by_shared[row, axis]
    columns, p = np.where(rows.columns[row] >= 0, rows.columns[row], 0), len(row)
    first_shared, size = 6 * counts[0], 6 * counts[0] + counts[1]
    at_image = 6 * rows.image[row][:, None] + np.arange(6)
    cofactor = np.empty((p, p))
    for first in range(0, p, CHUNK):
        own = np.arange(first, min(first + CHUNK, p))
        right = np.zeros((size, len(own)))
        k = np.arange(len(own))
        right[at_image[own], k[:, None]] = by_image[own]
        if counts[1]:
            np.add.at(right, (first_shared + columns[own], k[:, None]), by_shared[own])
        x = factor.solve(right)
        found = np.einsum("pa,pak->pk", by_image, x[at_image])
        if counts[1]:
            found += np.einsum("pc,pck->pk", by_shared, x[first_shared + columns])
        cofactor[:, own] = -found
    cofactor[np.diag_indices(p)] += 1.0
    return 0.5 * (cofactor + cofactor.T)


def best_noise(reduced: ReducedToPositions, given: Given) -> tuple[ErrorModel, float]:
    """The model without errors that stay, and its −2 ln L: noise as estimated, or as given and larger."""
    least = (np.log(1.01 * LEAST_NOISE),) * 2 if given.noise is None else np.log(given.noise)
    bounds = [(float(low), float(np.log(MOST_NOISE))) for low in least]

    def model(x: np.ndarray) -> ErrorModel:
        return ErrorModel((float(np.exp(x[0])), float(np.exp(x[1]))))

    return _best(reduced, model, bounds, [np.array([max(0.0, low) for low, _ in bounds])])


def best_process(reduced: ReducedToPositions, given: Given, noise: ErrorModel) -> tuple[ErrorModel, float]:
    """The model with errors that stay, and its −2 ln L.

    Parameters
    ----------
    noise : the best without them, where the search begins.
    """
    e, usual = reduced.exposures, reduced.usual_sigma
    shortest = SHORTEST * e.usual_step
    longest = max(e.longest_flight, 10.0 * shortest)
    bounds = [(np.log(1.01 * LEAST_NOISE), np.log(MOST_NOISE))] * 2 if given.noise is None else []
    if given.sigma is None:
        bounds += [(np.log(LEAST_SHARE * usual), np.log(MOST_SHARE * usual))] * 2
    if given.time is None:
        bounds += [(np.log(shortest), np.log(longest))]
    if not bounds:
        known = _model(np.zeros(0), given)
        return known, reduced.deviance(known)
    starts = []
    for time in (4.0 * e.usual_step, 0.15 * longest):
        start = [np.log(0.8 * factor) for factor in noise.noise] if given.noise is None else []
        start += [np.log(0.5 * factor * usual) for factor in noise.noise] if given.sigma is None else []
        start += [np.log(time)] if given.time is None else []
        starts.append(np.array(start))

    def model(x: np.ndarray) -> ErrorModel:
        return _model(x, given)

    return _best(reduced, model, bounds, starts if given.time is None else starts[:1])


def _model(x: np.ndarray, given: Given) -> ErrorModel:
    """The model of a vector of logarithms of what is not given."""
    values = np.exp(x).tolist()
    noise = (values.pop(0), values.pop(0)) if given.noise is None else given.noise
    sigma = given.sigma
    if sigma is None:
        plan, height = values.pop(0), values.pop(0)
        sigma = (plan, plan, height)
    return ErrorModel(noise, sigma, values.pop(0) if given.time is None else given.time)


def _best(
    reduced: ReducedToPositions, model: Callable[[np.ndarray], ErrorModel], bounds: Sequence[tuple[float, float]],
    starts: Sequence[np.ndarray],
) -> tuple[ErrorModel, float]:  # fmt: skip
    low, high = np.array(bounds).T
    found = []
    for start in starts:
        begin = np.clip(start, low, high)
        zero = reduced.deviance(model(begin))

        def above(x: np.ndarray, zero: float = zero) -> float:
            return reduced.deviance(model(x)) - zero

        end = minimize(
            above, begin, method="L-BFGS-B", bounds=bounds, options={"eps": 1e-4, "ftol": 1e-7, "maxiter": 40}
        )
        found.append((model(end.x), float(end.fun) + zero))
    return found[int(np.argmin([deviance for _, deviance in found]))]
