"""Sets of additional parameters side by side, in the same block with the same rays.

A set is judged by what it does where it was not fitted: at check points, and at control points predicted without
themselves. Beside it stand what the image residuals say (σ0, AIC, BIC) and how many of its parameters are significant:
a set can be significant, and check points still do not improve.

AIC = r·ln(Ω/r) + 2k and BIC = r·ln(Ω/r) + k·ln r, with Ω = vᵀPv without the part of observed nodes, r the redundancy
that the block has without additional parameters, and k the number of parameters: the orientation and the points, in
every set the same, are eliminated from either [L: Akaike 1974, Schwarz 1978; the elimination D]. A random field counts
its effective number, the trace of its hat matrix, in AIC; BIC stands for −2 ln of the marginal likelihood, which of a
field is known: ν·ln(Ω/ν) + ln|I + K·N|, see `field_estimation`, and 2·ln r for σ_d and ℓ. Of robust adjustments Ω is
Σρ, and what it says an approximation.

Parameters may also have values for every strip, or every group of a column of images.csv, that scatter about a mean or
drift, see `deviation_estimation`. Such a set is compared where the differences are significant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.carry_over import start_values_at, with_shared
from aerotri.adjustment.defects import checked_factor
from aerotri.adjustment.error_transfer import with_image_errors
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.parallel import blas_threads
from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.sparse_cholesky import Factor, NotPositiveDefiniteError
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import State, Unknowns
from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import format_parameters
from aerotri.observations import Block, DeviationSettings
from aerotri.results.parameter_comparison import Accuracy, Choice, ParameterComparison, SetOutcome
from aerotri.statistics.stated_sigma import sigma0_um
from aerotri.statistics.summarise import count_observations, effective_redundancy, weighted_sum
from aerotri.strategies.control_prediction import control_rows, predict_control
from aerotri.strategies.deviation_estimation import with_estimated_deviations
from aerotri.strategies.field_estimation import ReducedToFields, covariance_in_use, with_estimated_fields
from aerotri.strategies.object_change import object_of
from aerotri.strategies.parameter_evidence import Divisions, divisions_of, evidence_of

SIGNIFICANT_T = 1.96
"""|p|/σ from which a parameter counts as significant: 95 % of the normal distribution, two-sided [L]."""
FIRST_ITERATIONS = 6
"""Iterations at most with the covariance that a random field has to begin with [C]: it is estimated soon after, and one
that is too small holds the field back for tens of iterations."""
NOWHERE = Accuracy.of(np.zeros((0, 3)))
HYPERPARAMETERS = 2
"""Parameters of a random field's covariance that BIC counts: σ_d and the correlation length."""

Progress = Callable[[int, int, str], None]


def set_name(choice: Choice) -> str:
    """The specification of a choice as on the command line."""
    return ",".join(format_parameters(choice)) or "none"


@dataclass(frozen=True)
class Candidate:
    """A set of additional parameters: one for each camera, or one for each group of a column, tied as `kind` says."""

    choice: Choice
    groups: str = ""
    kind: str = "free"

    @property
    def name(self) -> str:
        """As in tables: 'brown:K1+K2', 'brown:K1+K2, by strip'."""
        return set_name(self.choice) + (f", by {self.groups}" if self.groups else "")


class SetComparer:
    """Adjusts one block with one set after the other, each from where the last one ended, or from where one ended.

    Parameters
    ----------
    prepared : the block with any set. folds : of the cross-validation over control points.
    status : (m,) of the rays, where not all that are used shall be. strips : (n,) names of the strips for sets that
        change by strip, where the block names none.
    """

    def __init__(
        self, prepared: Prepared, folds: int, options: SolveOptions, status: np.ndarray | None = None,
        strips: np.ndarray | None = None,
    ) -> None:  # fmt: skip
        u = prepared.system.unknowns
        self._block, self._folds, self._options = u.block, folds, options
        self._status = prepared.ray_status if status is None else status
        self._strips = strips
        self._start, self._last = start_values_at(u, prepared.state), None
        self._divisions: Divisions | None = None
        self._names: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())

    @property
    def rays(self) -> int:
        """Image points of the block."""
        return len(self._status)

    def outcome(self, candidate: Candidate) -> SetOutcome:
        """The block adjusted with a set, and what speaks for it; the next set begins where this one ended."""
        with blas_threads(0.0):
            found, adjusted = self._tried(candidate)
        if adjusted is not None:
            self._last = adjusted
            self._start = start_values_at(adjusted[0].unknowns, adjusted[1])
        return found

    def outcome_from_here(self, candidate: Candidate) -> SetOutcome:
        """The same, and the next set begins where this one began: what comes out depends on no order."""
        with blas_threads(0.0):
            return self._tried(candidate)[0]

    def _tried(self, candidate: Candidate) -> tuple[SetOutcome, tuple[NormalSystem, State] | None]:
        """What a set did, and where its adjustment stands if there is one."""
        try:
            block = with_candidate(self._block, candidate, self._strips)
            system, state = build_system(block, self._start, self._status)
        except InputError as error:
            return _failed(candidate, error.message), None
        if self._last is not None:
            last, ended = self._last
            state = with_shared(system.unknowns, last.unknowns, state, ended)
            state = with_image_errors(system, state, last, ended)
        if self._divisions is None:
            # the same points and divisions for every set
            self._divisions = divisions_of(system.unknowns, state)
            self._names = _check_points(system.unknowns), _control_points(system.unknowns)
        try:
            return self._adjusted(system, state, candidate)
        except NotPositiveDefiniteError:
            return _failed(candidate, "rank deficient: rounding has left no digit of the normal equations"), None

    def comparison(self, outcomes: Sequence[SetOutcome]) -> ParameterComparison:
        """Outcomes together, with what they have in common."""
        check, control = self._names
        folds = min(self._folds, max(len(control), 1))
        return ParameterComparison(str(self._block.name), tuple(outcomes), folds, check, control, self._options.robust)

    def _adjusted(
        self, system: NormalSystem, state: State, candidate: Candidate
    ) -> tuple[SetOutcome, tuple[NormalSystem, State] | None]:
        """What a set did, and where its adjustment stands if there is one."""
        options = self._options
        first = replace(options, max_iterations=min(options.max_iterations, FIRST_ITERATIONS))
        to_start = first if system.priors.fields else options
        system, solution = minimise_at_adjusted(system, state, count_observations(system).redundancy, to_start)
        if solution.defects:
            return _failed(candidate, f"rank deficient: {'; '.join(solution.defects)}"), None
        system, solution = with_estimated_fields(system, solution, options)
        system, solution, deviations = with_estimated_deviations(system, solution, options)
        factor, defects = checked_factor(system, solution.state, solution.equations, solution.estimator)
        if factor is None:
            return _failed(candidate, f"rank deficient: {'; '.join(defects)}"), None
        if solution.status != "converged":
            return _failed(candidate, solution.status), None
        found = self._judged(system, solution, factor, candidate)
        if deviations is not None:
            found = replace(found, p=deviations.p, ratio=deviations.ratio)
        return found, (system, solution.state)

    def _judged(self, system: NormalSystem, solution: Solution, factor: Factor, candidate: Candidate) -> SetOutcome:
        u = system.unknowns
        freedom = effective_redundancy(system, solution)
        sigma0 = float(np.sqrt(weighted_sum(system, solution) / freedom)) if freedom > 0.0 else float("nan")
        predicted = predict_control(system, solution, factor, sigma0, self._folds)
        found = _fitted(system, solution, factor, candidate, sigma0)
        assert self._divisions is not None
        evidence = evidence_of(system, solution, factor, self._status, self._divisions, predicted, sigma0**2)
        check, control = Accuracy.of(_check_differences(u, solution.state)), Accuracy.of(predicted.difference)
        return replace(found, check=check, control=control, evidence=evidence, object=object_of(system, solution))


def with_candidate(block: Block, candidate: Candidate, strips: np.ndarray | None) -> Block:
    """The block with a set of parameters, and with named strips where these have values of their own.

    Parameters
    ----------
    strips : (n,) names of the strips, None where some photograph has none.
    """
    settings = block.settings
    adjustment = replace(settings.adjustment, additional_parameters=candidate.choice, parameters_removed=())
    if candidate.groups:
        adjustment = replace(adjustment, parameter_groups=candidate.groups)
        settings = replace(settings, deviations=DeviationSettings(candidate.kind))
    if candidate.groups == "strip" and strips is not None:
        block = replace(block, images=replace(block.images, strip=strips))
    return replace(block, settings=replace(settings, adjustment=adjustment))


def _fitted(
    system: NormalSystem, solution: Solution, factor: Factor, candidate: Candidate, sigma0: float
) -> SetOutcome:
    """What the observations say that a set was fitted to."""
    u, state, settings = system.unknowns, solution.state, system.unknowns.block.settings
    own = np.flatnonzero(np.array(u.shared.kinds, dtype=object) == "additional")
    cofactor = factor.border_inverse()[np.ix_(own, own)]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.abs(state.shared[own]) / (sigma0 * np.sqrt(np.diagonal(cofactor)))
    effective, omega = float(len(own)), solution.equations.cost
    place = {int(column): k for k, column in enumerate(own)}
    for field in (*system.priors.fields, *system.priors.deviation_priors):
        at = np.array([place[int(c)] for c in field.columns])
        values = state.shared[field.columns]
        effective -= float(np.sum(cofactor[np.ix_(at, at)] * field.weight))
        omega -= float(values @ field.weight @ values)
    redundancy = count_observations(system).redundancy
    without = redundancy + len(own) - sum(f.rank for f in (*system.priors.fields, *system.priors.deviation_priors))
    # a set that leaves no redundancy fits whatever was measured: its residuals are rounding
    judged = redundancy > 0 and without > 0 and omega > 0.0
    deviance = without * float(np.log(omega / without)) if judged else float("nan")
    bic = deviance + effective * float(np.log(max(without, 1)))
    if system.priors.fields and np.isfinite(bic):
        fixed = len(own) - sum(len(field.weight) for field in system.priors.fields) + HYPERPARAMETERS
        reduced = ReducedToFields.of(system, solution, factor)
        log_determinant = reduced.deviance(covariance_in_use(system)) - reduced.freedom * np.log(
            weighted_sum(system, solution)
        )
        bic = without * np.log(solution.equations.cost / without) + log_determinant + fixed * np.log(without)
    known = settings.collocation if system.priors.fields else None
    return SetOutcome(
        name=candidate.name,
        choice=candidate.choice,
        status="converged",
        count=len(own),
        effective=effective,
        significant=int(np.sum(t > SIGNIFICANT_T)),
        sigma0=sigma0,
        sigma0_um=sigma0_um(sigma0, system.unknowns.block, system.unknowns.rays.source),
        aic=deviance + 2.0 * effective,
        bic=float(bic),
        check=NOWHERE,
        control=NOWHERE,
        sigma_um=float("nan") if known is None or known.sigma_um is None else known.sigma_um,
        length_mm=float("nan") if known is None or known.length_mm is None else known.length_mm,
        groups=candidate.groups,
        kind=candidate.kind,
    )


def _failed(candidate: Candidate, status: str) -> SetOutcome:
    nan = float("nan")
    return SetOutcome(
        candidate.name, candidate.choice, status, 0, nan, 0, nan, nan, nan, nan, NOWHERE, NOWHERE,
        groups=candidate.groups, kind=candidate.kind,
    )  # fmt: skip


def _check_points(unknowns: Unknowns) -> tuple[str, ...]:
    """Names of the check points that are adjusted."""
    block = unknowns.block
    point = block.control.point[block.control.is_check]
    return tuple(map(str, block.points[point[np.isin(point, unknowns.points)]]))


def _control_points(unknowns: Unknowns) -> tuple[str, ...]:
    """Names of the points whose coordinates are observed."""
    return tuple(map(str, unknowns.block.points[unknowns.points[control_rows(unknowns)]]))


def _check_differences(unknowns: Unknowns, state: State) -> np.ndarray:
    """(k, 3) m, adjusted − given."""
    block = unknowns.block
    row = np.full(len(block.points), -1)
    row[unknowns.points] = np.arange(len(unknowns.points))
    given = np.flatnonzero(block.control.is_check & (row[block.control.point] >= 0))
    return state.points[row[block.control.point[given]]] + unknowns.origin - block.control.xyz[given]
