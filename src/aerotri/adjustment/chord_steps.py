"""Steps with the factor of the step before: a third of the work of a step with a factor of its own.

After a step within the scatter of the unknowns the matrix hardly changes any more [L: the chord method, Kelley,
Iterative methods for linear and nonlinear equations, 1995, 5.4].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.reduced_equations import NormalEquations, RightSide
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.steps import COST_TOLERANCE, Place, Trial, assembled, place_at
from aerotri.adjustment.stopping import is_negligible

SLOWEST_CONTRACTION = 1e-2
"""Decrement over that of the step before up to which the old factor is kept, a tenth in length: a new factor, three
times the work, would win one such step."""


@dataclass(frozen=True, eq=False)
class Followed:
    """Where the steps with an old factor led: the place, the decrement of the last, the cost after each."""

    place: Place
    decrement: float
    costs: tuple[float, ...] = ()
    settled: bool = False


def follow(system: NormalSystem, first: Trial, redundancy: int, most: int, say: Callable[[float], None]) -> Followed:
    """Steps of least squares with the factor of the step before, as long as each is a tenth of the last or less.

    Parameters
    ----------
    most : number of steps. say : told the cost after each.
    """
    state, decrement, costs, settled = first.place.state, first.decrement, [], False
    side: RightSide = first.equations
    for _ in range(most):
        x = first.factor.solve(side.right)
        next_decrement = abs(float(x @ side.right) + side.point_decrement)
        contraction = next_decrement / max(abs(decrement), 1e-300)
        move = system.whole_step(state, x, 0.0, LEAST_SQUARES) if contraction <= SLOWEST_CONTRACTION else None
        if move is None:
            break
        settled = is_negligible(next_decrement * SLOWEST_CONTRACTION, side.cost, redundancy, side.rounding)
        there = system.unknowns.advance(state, move)
        side = system.assemble(there, 0.0, LEAST_SQUARES) if settled else system.right_side(there, LEAST_SQUARES)
        last = costs[-1] if costs else first.equations.cost
        if not (side.are_numbers and side.cost <= last * (1.0 + COST_TOLERANCE) + side.rounding):
            settled = False
            break
        state, decrement = there, next_decrement
        costs.append(side.cost)
        say(side.cost)
        if settled:
            break
    if not costs:
        return Followed(assembled(system, first.place), first.decrement)
    if settled and isinstance(side, NormalEquations):
        return Followed(Place(state, side, LEAST_SQUARES), decrement, tuple(costs), True)
    return Followed(place_at(system, state, LEAST_SQUARES), decrement, tuple(costs), settled)
