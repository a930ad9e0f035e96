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
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.carry_over import start_values_at, with_shared
from aerotri.adjustment.defects import checked_factor
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import State, Unknowns
from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import format_parameters
from aerotri.observations import Block
from aerotri.results.parameter_comparison import Accuracy, Choice, ParameterComparison, SetOutcome
from aerotri.statistics.summarise import count_observations, effective_redundancy, weighted_sum
from aerotri.strategies.control_prediction import predict_control
from aerotri.strategies.field_estimation import ReducedToFields, covariance_in_use, with_estimated_fields

SIGNIFICANT_T = 1.96
"""|p|/σ from which a parameter counts as significant: 95 % of the normal distribution, two-sided [L]."""
HYPERPARAMETERS = 2
"""Parameters of a random field's covariance that BIC counts: σ_d and the correlation length."""

Progress = Callable[[int, int, str], None]


def set_name(choice: Choice) -> str:
    """The specification of a choice as on the command line."""
    return ",".join(format_parameters(choice)) or "none"


def compare_sets(
    prepared: Prepared, choices: Sequence[Choice], folds: int, options: SolveOptions, progress: Progress | None = None
) -> ParameterComparison:
    """Adjust a block with every set, each from where the last one ended.

    Parameters
    ----------
    prepared : the block with any set. folds : of the cross-validation over control points.
    progress : called before each set with its number from 1, how many there are, and its name.
    """
    u = prepared.system.unknowns
    start, last = start_values_at(u, prepared.state), None
    outcomes = []
    for number, choice in enumerate(choices, start=1):
        if progress is not None:
            progress(number, len(choices), set_name(choice))
        block = _with_choice(u.block, choice)
        try:
            system, state = build_system(block, start, prepared.ray_status)
        except InputError as error:
            outcomes.append(_failed(choice, error.message))
            continue
        if last is not None:
            state = with_shared(system.unknowns, last[0], state, last[1])
        outcome, adjusted = _outcome(system, state, choice, folds, options)
        outcomes.append(outcome)
        if adjusted is not None:
            last = adjusted
            start = start_values_at(*adjusted)
    control = u.block.points[_control_points(u.block, u)]
    check = u.block.points[_check_points(u.block, u)]
    return ParameterComparison(
        str(u.block.name), tuple(outcomes), min(folds, max(len(control), 1)), tuple(map(str, check)),
        tuple(map(str, control)), options.robust,
    )  # fmt: skip


def _with_choice(block: Block, choice: Choice) -> Block:
    adjustment = replace(block.settings.adjustment, additional_parameters=choice, parameters_removed=())
    return replace(block, settings=replace(block.settings, adjustment=adjustment))


def _outcome(
    system: NormalSystem, state: State, choice: Choice, folds: int, options: SolveOptions
) -> tuple[SetOutcome, tuple[Unknowns, State] | None]:
    """What a set did, and where its adjustment stands if there is one."""
    system, solution = minimise_at_adjusted(system, state, count_observations(system).redundancy, options)
    if solution.defects:
        return _failed(choice, f"rank deficient: {'; '.join(solution.defects)}"), None
    system, solution = with_estimated_fields(system, solution, options)
    factor, defects = checked_factor(system, solution.state, solution.equations, solution.estimator)
    if factor is None:
        return _failed(choice, f"rank deficient: {'; '.join(defects)}"), None
    where = system.unknowns, solution.state
    if solution.status != "converged":
        return _failed(choice, solution.status), None
    return _judged(system, solution, factor, choice, folds), where


def _judged(system: NormalSystem, solution: Solution, factor: Factor, choice: Choice, folds: int) -> SetOutcome:
    u, state, settings = system.unknowns, solution.state, system.unknowns.block.settings
    own = np.flatnonzero(np.array(u.shared.kinds, dtype=object) == "additional")
    cofactor = factor.border_inverse()[np.ix_(own, own)]
    freedom = effective_redundancy(system, solution)
    sigma0 = float(np.sqrt(weighted_sum(system, solution) / freedom)) if freedom > 0.0 else float("nan")
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.abs(state.shared[own]) / (sigma0 * np.sqrt(np.diagonal(cofactor)))
    effective, omega = float(len(own)), solution.equations.cost
    place = {int(column): k for k, column in enumerate(own)}
    for field in (*system.priors.fields, *system.priors.deviation_priors):
        at = np.array([place[int(c)] for c in field.columns])
        values = state.shared[field.columns]
        effective -= float(np.sum(cofactor[np.ix_(at, at)] * field.weight))
        omega -= float(values @ field.weight @ values)
    without = (
        count_observations(system).redundancy
        + len(own)
        - sum(f.rank for f in (*system.priors.fields, *system.priors.deviation_priors))
    )
    deviance = without * float(np.log(omega / without)) if without > 0 and omega > 0.0 else float("nan")
    bic = deviance + effective * float(np.log(max(without, 1)))
    if system.priors.fields and np.isfinite(bic):
        fixed = len(own) - sum(len(field.weight) for field in system.priors.fields) + HYPERPARAMETERS
        reduced = ReducedToFields.of(system, solution, factor)
        log_determinant = reduced.deviance(covariance_in_use(system)) - reduced.freedom * np.log(
            weighted_sum(system, solution)
        )
        bic = without * np.log(solution.equations.cost / without) + log_determinant + fixed * np.log(without)
    predicted = predict_control(system, solution, factor, sigma0, folds)
    known = settings.collocation if system.priors.fields else None
    return SetOutcome(
        name=set_name(choice),
        choice=choice,
        status="converged",
        count=len(own),
        effective=effective,
        significant=int(np.sum(t > SIGNIFICANT_T)),
        sigma0=sigma0,
        sigma0_um=sigma0 * settings.image_sigma_um,
        aic=deviance + 2.0 * effective,
        bic=float(bic),
        check=Accuracy.of(_check_differences(u, state)),
        control=Accuracy.of(predicted.difference),
        sigma_um=float("nan") if known is None or known.sigma_um is None else known.sigma_um,
        length_mm=float("nan") if known is None or known.length_mm is None else known.length_mm,
    )


def _failed(choice: Choice, status: str) -> SetOutcome:
    nan, nothing = float("nan"), Accuracy.of(np.zeros((0, 3)))
    return SetOutcome(set_name(choice), choice, status, 0, nan, 0, nan, nan, nan, nan, nothing, nothing)


def _check_points(block: Block, unknowns: Unknowns) -> np.ndarray:
    """Index of the check points that are adjusted."""
    point = block.control.point[block.control.is_check]
    return point[np.isin(point, unknowns.points)]


def _control_points(block: Block, unknowns: Unknowns) -> np.ndarray:
    return unknowns.points[np.flatnonzero((unknowns.prior_weight > 0.0).any(axis=1))]


def _check_differences(unknowns: Unknowns, state: State) -> np.ndarray:
    """(k, 3) m, adjusted − given."""
    block = unknowns.block
    row = np.full(len(block.points), -1)
    row[unknowns.points] = np.arange(len(unknowns.points))
    given = np.flatnonzero(block.control.is_check & (row[block.control.point] >= 0))
    return state.points[row[block.control.point[given]]] + unknowns.origin - block.control.xyz[given]
