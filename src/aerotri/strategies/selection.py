"""Selection of additional parameters: one goes at a time, and the block is adjusted anew after each.

Free parameters take part; one observed with a σ of its own is somebody's statement, and the nodes of a grid or random
field are one set: these stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.carry_over import reference_state, start_values_at, with_shared
from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.sparse_cholesky import NotPositiveDefiniteError
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import Unknowns
from aerotri.functional_model.additional_parameters import Parameter, is_grid
from aerotri.observations import Block
from aerotri.results.adjusted_block import SharedParameters
from aerotri.results.removal import Removal
from aerotri.statistics.summarise import count_observations, effective_redundancy, weighted_sum
from aerotri.strategies.significance import ParameterTests, partner, worst


@dataclass(frozen=True, eq=False)
class Selected:
    """What the selection led to: the block without what was removed, its adjustment, and the removals in order."""

    prepared: Prepared
    solution: Solution
    removals: tuple[Removal, ...]


def select(prepared: Prepared, solution: Solution, options: SolveOptions) -> Selected:
    """Take out additional parameters until all that are left pass their tests.

    Parameters
    ----------
    solution : of `prepared`.
    """
    removals: list[Removal] = []
    while True:
        found = _next_removal(prepared, solution)
        if found is None:
            return Selected(prepared, solution, tuple(removals))
        removals.append(found)
        prepared, solution = _without(prepared, solution, found, options)


def candidates(unknowns: Unknowns) -> np.ndarray:
    """Columns of the shared parameters that the selection may take out."""
    shared = unknowns.shared
    free = np.isinf(np.array(shared.sigma).reshape(-1))
    return np.array(
        [
            k
            for k, (name, kind) in enumerate(zip(shared.names, shared.kinds, strict=True))
            if kind == "additional" and free[k] and not is_grid(Parameter.of(name).family)
        ],
        dtype=np.int64,
    )


def _next_removal(prepared: Prepared, solution: Solution) -> Removal | None:
    system = prepared.system
    shared, settings = system.unknowns.shared, system.unknowns.block.settings.adjustment
    columns = candidates(system.unknowns)
    freedom = effective_redundancy(system, solution)
    if not len(columns) or freedom <= 0.0:
        return None
    try:
        cofactor = system.factorise(solution.equations).border_inverse()[np.ix_(columns, columns)]
    except NotPositiveDefiniteError:
        # what is not determined is named where the result is factorised
        return None
    sigma0 = float(np.sqrt(weighted_sum(system, solution) / freedom))
    value = solution.state.shared[columns]
    tests = ParameterTests.of(value, cofactor, sigma0)
    found = worst(tests, settings.t_limit, settings.correlation_limit)
    if found is None:
        return None
    k, reason = found
    column, other = columns[k], columns[partner(tests, k)]
    several = len(set(shared.groups[c] for c in columns)) > 1
    label = f"{shared.names[other]} ({shared.groups[other]})" if several else shared.names[other]
    return Removal(
        name=shared.names[column],
        group=shared.groups[column],
        mark=shared.marks[column],
        value=float(value[k]),
        sigma=float(sigma0 * np.sqrt(cofactor[k, k])),
        correlation=float(tests.correlation[k, partner(tests, k)]),
        correlation_with=label if len(columns) > 1 else "",
        total_correlation=float(tests.total[k]),
        sigma0=sigma0,
        reason=reason.format(label),
    )


def _without(
    prepared: Prepared, solution: Solution, removal: Removal, options: SolveOptions
) -> tuple[Prepared, Solution]:
    """The block without a parameter, adjusted from where it stands."""
    old, state = prepared.system.unknowns, solution.state
    block = without_parameters(old.block, [(removal.name, removal.group)])
    row, axis = np.nonzero(old.point_held)
    held = list(zip(old.points[row].tolist(), axis.tolist(), strict=True)) if len(row) else None
    system, start = build_system(block, start_values_at(old, state), prepared.ray_status, held)
    left = Prepared(system, start, prepared.ray_status, prepared.warnings)
    new = system.unknowns
    begin = with_shared(new, old, start, state)
    system, again = minimise_at_adjusted(system, begin, count_observations(system).redundancy, options)
    left = replace(left, system=system)
    reference = reference_state(new, old, start, prepared.state)
    return replace(left, state=reference), replace(again, iterations=solution.iterations + again.iterations)


def with_findings_of(block: Block, used: Block) -> Block:
    """A block with what the adjustment of another form of it found.

    Parameters removed, where they are evaluated, the covariance of fields and of errors of positions and photographs,
    how much groups differ, and how cameras move on weighted rigs.
    """
    found = used.settings.adjustment
    adjustment = replace(
        block.settings.adjustment, parameters_removed=found.parameters_removed,
        parameter_position=found.parameter_position,
    )  # fmt: skip
    settings = replace(
        block.settings,
        adjustment=adjustment,
        collocation=used.settings.collocation,
        deviations=used.settings.deviations,
        photograph_fields=used.settings.photograph_fields,
        gnss=used.settings.gnss,
    )
    return replace(block, settings=settings, rigs=used.rigs)


def without_parameters(block: Block, names: Sequence[tuple[str, str]]) -> Block:
    """The block with some more additional parameters left out, (name, group) pairs."""
    if not names:
        return block
    adjustment = block.settings.adjustment
    adjustment = replace(adjustment, parameters_removed=(*adjustment.parameters_removed, *names))
    return replace(block, settings=replace(block.settings, adjustment=adjustment))


def with_removed(parameters: SharedParameters, removals: Sequence[Removal]) -> SharedParameters:
    """The record with the parameters removed behind the others: as they last stood, status 'removed'."""
    if not removals:
        return parameters
    s, k = len(parameters), len(removals)
    covariance = np.zeros((s + k, s + k))
    covariance[:s, :s] = parameters.covariance
    covariance[np.arange(s, s + k), np.arange(s, s + k)] = [r.sigma**2 for r in removals]

    def longer(column: np.ndarray, values: Sequence[object]) -> np.ndarray:
        return np.concatenate([column, np.array(values, dtype=column.dtype)])

    p = parameters
    return SharedParameters(
        names=longer(p.names, [r.name for r in removals]),
        groups=longer(p.groups, [r.group for r in removals]),
        kinds=longer(p.kinds, ["additional"] * k),
        marks=longer(p.marks, [r.mark for r in removals]),
        value=longer(p.value, [r.value for r in removals]),
        covariance=covariance,
        max_correlation=longer(p.max_correlation, [r.correlation for r in removals]),
        max_correlation_with=longer(p.max_correlation_with, [r.correlation_with for r in removals]),
        total_correlation=longer(p.total_correlation, [r.total_correlation for r in removals]),
        status=longer(p.status, ["removed"] * k),
        reason=longer(p.reason, [f"{number}: {r.reason}" for number, r in enumerate(removals, start=1)]),
    )
