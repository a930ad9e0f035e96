"""Errors of positions that stay for a while: estimated where asked for, tested, and put into the adjustment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.adjustment.exposures import exposures_of
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.position_errors import KIND
from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.sparse_cholesky import Factor, NotPositiveDefiniteError
from aerotri.observations.settings import GnssSettings
from aerotri.quantiles import chi_square_exceedance
from aerotri.results.position_errors import CHECK_LEVEL, PositionErrors
from aerotri.strategies.position_likelihood import (
    ErrorModel,
    Given,
    ReducedToPositions,
    best_noise,
    best_process,
    observed_rows,
)
from aerotri.strategies.readjusting import readjusted

LEVEL = 0.01
"""Probability with which white noise alone is taken for errors that stay."""
MOST_EXPOSURES = 400
"""Exposures that the estimate looks at [C]: in larger blocks runs of neighbours; σ is then known to some 10 %."""
MOST_CHECKED = 150
"""Exposures that the warning looks at: a correlation of neighbours of 0.2 is then seen."""
NEAR = 5.0
"""Usual times between exposures over which the warning looks for errors in common [C]."""
FEWEST = 15
"""Exposures below which nothing is estimated or tested."""


def with_position_errors(
    prepared: Prepared, solution: Solution, options: SolveOptions
) -> tuple[Prepared, Solution, PositionErrors | None]:
    """The adjustment with the errors that stay estimated, as far as the settings ask and do not give them.

    Where the test sees no need of them positions stay independent. None: nothing was estimated.
    """
    system = prepared.system
    settings = system.unknowns.block.settings.gnss
    if not settings.to_estimate:
        return prepared, solution, None
    try:
        factor = system.factorise(solution.equations)
    except NotPositiveDefiniteError:
        # what is not determined is named where the result is factorised
        return prepared, solution, None
    reduced = ReducedToPositions.of(system, solution, factor, MOST_EXPOSURES)
    if reduced is None or len(reduced.exposures) < FEWEST:
        reason = f"fewer than {FEWEST} photographs have positions"
        return _without(prepared, solution, options, settings, PositionErrors(reason=reason))
    model, found = estimate(reduced, settings)
    if not found.counts:
        return _without(prepared, solution, options, replace(settings, noise_factor=model.noise), found)
    used = replace(settings, correlated_sigma_m=model.sigma, correlation_time_s=model.time, noise_factor=model.noise)
    return *_adjusted(prepared, solution, options, used), found


def estimate(reduced: ReducedToPositions, settings: GnssSettings) -> tuple[ErrorModel, PositionErrors]:
    """The model of greatest restricted likelihood with its test; the model of white noise where the test sees no need.

    σ in the record are without σ̂0 of the final adjustment.
    """
    given = Given(settings.noise_factor, settings.correlated_sigma_m, settings.correlation_time_s)
    white, without = best_noise(reduced, given)
    model, with_errors = best_process(reduced, given, white)
    gain = max(without - with_errors, 0.0)
    p = chance(gain)
    stated = None not in (given.sigma, given.time)
    needed = stated or p < LEVEL
    kept = model if needed else ErrorModel(white.noise if given.noise is None else given.noise)
    e = reduced.exposures
    found = PositionErrors(
        source="given" if stated else "estimated" if needed else "",
        plan_m=model.sigma[0] if needed else 0.0,
        height_m=model.sigma[2] if needed else 0.0,
        time=model.time if needed else float("nan"),
        time_unit=e.unit,
        noise_factor_plan=kept.noise[0],
        noise_factor_height=kept.noise[1],
        likelihood_ratio=gain,
        p=p,
        level=LEVEL,
    )
    return kept, found


def chance(gain: float) -> float:
    """Probability of a gain in −2 ln L by white noise.

    Without errors that stay σ of plan and of height lie at their bound 0 and τ means nothing. In simulations the gain
    is below 0.1 in half of all cases, 1.4 with the noise estimated; χ² of two
    and three degrees of freedom in equal shares is a careful bound [C].
    """
    if gain <= 0.0:
        return 1.0
    return 0.5 * (chi_square_exceedance(gain, 2.0) + chi_square_exceedance(gain, 3.0))


def _without(
    prepared: Prepared, solution: Solution, options: SolveOptions, settings: GnssSettings, found: PositionErrors
) -> tuple[Prepared, Solution, PositionErrors]:
    """Positions stay independent; adjusted anew where their noise has another size than it had."""
    noise = settings.noise_factor or (1.0, 1.0)
    used = replace(settings, correlated="off", noise_factor=noise)
    return *_adjusted(prepared, solution, options, used), found


def _adjusted(
    prepared: Prepared, solution: Solution, options: SolveOptions, used: GnssSettings
) -> tuple[Prepared, Solution]:
    """The block with other settings of its positions, adjusted from where it stands."""
    settings = prepared.system.unknowns.block.settings
    return readjusted(prepared, solution, options, replace(settings, gnss=used))


def position_errors_of(
    system: NormalSystem, solution: Solution, factor: Factor, sigma0: float, found: PositionErrors | None
) -> PositionErrors | None:
    """What is said of the errors of positions in the result; None where no position was observed.

    Where the model takes positions for independent the residuals of neighbouring exposures are tested.

    Parameters
    ----------
    factor : of the undamped equations. found : what the estimate said, None where there was none.
    """
    rows = observed_rows(system, solution)
    if rows is None:
        return None
    u = system.unknowns
    settings, shared = u.block.settings.gnss, u.shared
    exposures = exposures_of(u.block, u.images[rows[1]], solution.state.centre[rows[1]])
    counts = {"exposures": len(exposures), "flights": len(np.unique(exposures.flight)), "time_unit": exposures.unit}
    noise = settings.noise_factor or (1.0, 1.0)
    counts |= {"noise_factor_plan": noise[0], "noise_factor_height": noise[1]}
    if shared.position_errors and settings.correlated_sigma_m is not None:
        found = found or PositionErrors(source="given", time=settings.correlation_time_s or float("nan"))
        sigma = settings.correlated_sigma_m
        axes = sum(s > 0.0 for s in sigma)
        size = {"plan_m": sigma0 * float(np.hypot(*sigma[:2]) / np.sqrt(2.0)), "height_m": sigma0 * sigma[2]}
        return replace(found, **counts, **size, nodes=shared.kinds.count(KIND) // axes)
    found = replace(found or PositionErrors(), **counts)
    if len(exposures) < FEWEST:
        return replace(found, reason=f"fewer than {FEWEST} photographs have positions")
    reduced = ReducedToPositions.of(system, solution, factor, MOST_CHECKED)
    correlation, p = (float("nan"), float("nan")) if reduced is None else neighbours(reduced)
    tested = found.likelihood_ratio == found.likelihood_ratio
    return replace(found, neighbours=correlation, neighbours_p=p, level=found.level if tested else CHECK_LEVEL)


def neighbours(reduced: ReducedToPositions) -> tuple[float, float]:
    """Correlation of the errors of neighbouring exposures, and the probability of one as large by white noise.

    [D] With white noise of the size that fits best, the decorrelated residuals r have the cofactors R. z = r/√R_ii;
    S = zᵀ·W·z with W = ½·exp(−|t − t'|/(NEAR usual steps)) between different exposures has the expectation tr(W·C),
    the variance 2·tr(W·C)² and the third moment 8·tr(W·C)³, C_ij = R_ij/√(R_ii·R_jj): what the adjustment itself makes
    alike is taken off. Its chance is that of the χ² with the same three moments [L: Pearson 1959]. The correlation is
    that of direct neighbours.
    """
    white, _ = best_noise(reduced, Given(None))
    r, cofactor = reduced.decorrelated(white.noise)
    scale = np.sqrt(np.diagonal(cofactor))
    z, correlation = r / scale, cofactor / (scale[:, None] * scale)
    size = float(np.mean(z**2))
    near, direct = _nearness(reduced)
    pairs = int(direct.sum())
    if pairs < FEWEST:
        return float("nan"), float("nan")
    product = near @ correlation
    gain = float(z @ near @ z) / size - float(np.trace(product))
    neighbour = float(z @ direct @ z) / size - float(np.sum(direct * correlation))
    squared = product @ product
    second, third = float(np.trace(squared)), float(np.sum(squared * product.T))
    freedom = second**3 / third**2
    statistic = freedom + gain / np.sqrt(2.0 * second) * np.sqrt(2.0 * freedom)
    return neighbour / pairs, chi_square_exceedance(max(statistic, 0.0), freedom)


def _nearness(reduced: ReducedToPositions) -> tuple[np.ndarray, np.ndarray]:
    """(p, p) W, and 1 for pairs of one coordinate at exposures that follow one another in a flight."""
    e, p = reduced.exposures, len(reduced.row)
    rank = np.empty(len(e), dtype=np.int64)
    rank[e.order] = np.arange(len(e))
    kernel = 0.5 * e.correlation(NEAR * e.usual_step)
    near, direct = np.zeros((p, p)), np.zeros((p, p))
    for axis in range(3):
        own = np.flatnonzero(reduced.axis == axis)
        own = own[np.argsort(rank[reduced.row[own]])]
        row = reduced.row[own]
        near[np.ix_(own, own)] = kernel[np.ix_(row, row)]
        step = e.time[row[1:]] - e.time[row[:-1]]
        # what lies between the runs of a sample, and turns of the flight, are no neighbours
        follows = (e.flight[row[1:]] == e.flight[row[:-1]]) & (step <= 3.0 * e.usual_step)
        direct[own[:-1][follows], own[1:][follows]] = 1.0
    np.fill_diagonal(near, 0.0)
    return near, direct
