"""A block with other settings, adjusted from where it stands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.carry_over import reference_state, start_values_at, with_shared
from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.system import build_system
from aerotri.observations import Settings
from aerotri.statistics.summarise import count_observations


def readjusted(
    prepared: Prepared, solution: Solution, options: SolveOptions, settings: Settings
) -> tuple[Prepared, Solution]:
    """The block with settings that change its unknowns, adjusted from where it stands."""
    old, state = prepared.system.unknowns, solution.state
    block = replace(old.block, settings=settings)
    row, axis = np.nonzero(old.point_held)
    held = list(zip(old.points[row].tolist(), axis.tolist(), strict=True)) if len(row) else None
    system, start = build_system(block, start_values_at(old, state), prepared.ray_status, held)
    begin = with_shared(system.unknowns, old, start, state)
    system, again = minimise_at_adjusted(system, begin, count_observations(system).redundancy, options)
    reference = reference_state(system.unknowns, old, start, prepared.state)
    left = replace(prepared, system=system, state=reference)
    return left, replace(again, iterations=solution.iterations + again.iterations)
