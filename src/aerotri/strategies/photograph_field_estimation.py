"""Smooth errors of single photographs: their covariance estimated by restricted likelihood, and the test of need.

As for the field of a camera (`field_estimation`). In large blocks the likelihood looks at the nodes of some photographs
that follow one another, all others with the covariance of the round before [C].
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.field_prior import known_of_photographs
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.sparse_cholesky import Factor, NotPositiveDefiniteError
from aerotri.functional_model.additional_parameters.grid import grid_size
from aerotri.observations import PhotographFieldSettings
from aerotri.quantiles import chi_square_exceedance
from aerotri.results.photograph_fields import PhotographFields
from aerotri.statistics.summarise import count_observations
from aerotri.strategies.field_estimation import (
    MOST_ROUNDS,
    SETTLED,
    FieldCovariance,
    ReducedToFields,
    estimate_covariance,
)
from aerotri.strategies.readjusting import readjusted

LEVEL = 0.01
"""Probability with which white noise alone is taken for such errors."""
MOST_NODES = 1600
"""Nodes that the likelihood looks at [C]: the covariance is then known to a few per cent."""


def with_photograph_fields(
    prepared: Prepared, solution: Solution, options: SolveOptions
) -> tuple[Prepared, Solution, PhotographFields | None]:
    """The adjustment with these errors estimated, as far as the settings ask and do not give them.

    Where the test sees no need of them the image points stay independent. None: nobody asked.
    """
    system = prepared.system
    if not system.priors.photograph_fields or solution.status != "converged":
        return prepared, solution, None
    settings = system.unknowns.block.settings.photograph_fields
    if settings.is_given:
        return prepared, solution, PhotographFields(source="given")
    try:
        system, solution, reduced = _estimated(system, solution, options, settings)
    except NotPositiveDefiniteError:
        # what is not determined is named where the result is factorised
        return prepared, solution, PhotographFields(reason="the block is not determined")
    known = FieldCovariance(*known_of_photographs(reduced.fields[0], system.unknowns.block.settings))
    gain = max(reduced.freedom * float(np.log(reduced.omega)) - reduced.deviance(known), 0.0)
    found = PhotographFields(likelihood_ratio=gain, p=chance(gain), level=LEVEL)
    if found.p < LEVEL:
        return replace(prepared, system=system), solution, replace(found, source="estimated")
    block = system.unknowns.block
    without = replace(block.settings, photograph_fields=PhotographFieldSettings())
    return *readjusted(replace(prepared, system=system), solution, options, without), found


def _estimated(
    system: NormalSystem, solution: Solution, options: SolveOptions, given: PhotographFieldSettings
) -> tuple[NormalSystem, Solution, ReducedToFields]:
    """σ and ℓ of the greatest likelihood, the observations linearised anew after each estimate."""
    redundancy = count_observations(system).redundancy
    reduced = _reduced(system, solution, system.factorise(solution.equations))
    for _ in range(MOST_ROUNDS):
        settings = system.unknowns.block.settings
        before = FieldCovariance(*known_of_photographs(reduced.fields[0], settings))
        found = estimate_covariance(reduced, given, before)
        fields = replace(given, sigma_um=found.sigma_um, length_mm=found.length_mm)
        system = system.with_settings(replace(settings, photograph_fields=fields))
        system, again = minimise_at_adjusted(system, solution.state, redundancy, options)
        solution = replace(again, iterations=solution.iterations + again.iterations)
        small = reduced.deviance(before) - reduced.deviance(found) < SETTLED
        reduced = _reduced(system, solution, system.factorise(solution.equations))
        if small:
            break
    return system, solution, reduced


def _reduced(system: NormalSystem, solution: Solution, factor: Factor) -> ReducedToFields:
    """What the block says of the fields of the first photographs, as many as the likelihood looks at."""
    fields, priors = system.unknowns.shared.photograph_fields, system.priors.photograph_fields
    count = max(1, MOST_NODES // max(len(field.items) for field in fields))
    return ReducedToFields.of_fields(system, solution, factor, fields[:count], priors[:count])


def chance(gain: float) -> float:
    """Probability of a gain in −2 ln L by white noise.

    Without such errors σ lies at its bound 0 and ℓ means nothing: χ² of one and two degrees of freedom in equal shares
    is a careful bound [C; L: Self and Liang 1987 for σ alone].
    """
    if gain <= 0.0:
        return 1.0
    return 0.5 * (chi_square_exceedance(gain, 1.0) + chi_square_exceedance(gain, 2.0))


def photograph_fields_of(
    system: NormalSystem, sigma0: float, found: PhotographFields | None
) -> PhotographFields | None:
    """What is said of them in the result, with their sizes; None where nobody asked."""
    shared = system.unknowns.shared
    if not shared.photograph_fields or found is None:
        return found
    first = shared.photograph_fields[0]
    sigma, length = known_of_photographs(first, system.unknowns.block.settings)
    nodes = grid_size(first.items)
    return replace(
        found, sigma_um=sigma0 * sigma, length_mm=length, nodes_x=nodes[0], nodes_y=nodes[1],
        photographs=len(shared.photograph_fields),
    )  # fmt: skip
