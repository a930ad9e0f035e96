"""Steps of the adjustment: solved for, tried, and made to lead downhill."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aerotri.adjustment.damping import LAST_DAMPING, Damping
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.panels import DOUBLE
from aerotri.adjustment.reduced_equations import NormalEquations, RightSide
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.secants import Secants
from aerotri.adjustment.sparse_cholesky import Factor, NotPositiveDefiniteError
from aerotri.adjustment.unknowns import State, Step

COST_TOLERANCE = 1e-9
"""Relative growth of the cost that is taken for rounding: the sum over up to 10⁸ residuals has no more digits."""

LEAST_GAIN = 0.25
"""Gain over promise below which an undamped step is not trusted [L: the quarter of trust region methods, Nocedal and
Wright, Numerical optimization, 2006, algorithm 4.1]."""

FAR_OFF = -3.0
"""Gain over promise below which a step went so far that it tells nothing of the curvature where it began."""

SUSPECT_PIVOT = 1e-11
"""Pivot (relative to a unit diagonal) below which a factor serves for one step only: a hundred times what is taken for
rounding (`sparse_cholesky.PIVOT_LIMIT`)."""

STEEP = 0.9
"""Slope at the end of a step, over that at its beginning, from which on the step was too short [L: the curvature
condition of Wolfe with the c2 of quasi-Newton methods, Nocedal and Wright, 2006, section 3.1]."""

DOUBLINGS = 8
"""Times at most that a step too short is doubled."""

SHORTENINGS, SHORTEST = 4, 0.05
"""Times at most that a whole step that leads too far is shortened, and the least share of it each time."""

LEAST_RATIO, LONGEST_STRETCH = 0.5, 5.0
"""Contraction from which on a step of re-weighting is lengthened: a faster one needs none. And the most it is
lengthened by: beyond a contraction of .8 the ratio of two steps is too uncertain to go by."""


@dataclass(frozen=True, eq=False)
class Visited:
    """Where a step leads: the state, the right side of the undamped equations there, the estimator of their weights."""

    state: State
    equations: RightSide
    estimator: Estimator

    def is_below(self, other: Visited) -> bool:
        """Whether its cost is the lower one, and a step can be had from it."""
        return self.equations.are_numbers and self.equations.cost < other.equations.cost


@dataclass(frozen=True, eq=False)
class Place(Visited):
    """Where the adjustment stands: as `Visited`, with the whole equations."""

    equations: NormalEquations


@dataclass(frozen=True, eq=False)
class Trial:
    """A step that was tried: the place it leads to, the decrement it promised, and what it was solved with."""

    place: Visited
    decrement: float
    factor: Factor
    move: Step
    points_settled: bool = False

    @property
    def equations(self) -> RightSide:
        return self.place.equations

    @property
    def is_suspect(self) -> bool:
        return self.factor.smallest_pivot < SUSPECT_PIVOT

    @property
    def is_within_scatter(self) -> bool:
        """Whether the whole step is no longer than the unknowns scatter, so that its factor serves for the next."""
        return abs(self.decrement) <= self.equations.cost and not self.is_suspect

    @property
    def reduced(self) -> np.ndarray:
        """(6·n + s,) the step of photographs and shared parameters."""
        return np.concatenate([self.move.images.ravel(), self.move.shared])

    def improves(self, before: RightSide) -> bool:
        """Whether the cost is no higher; at the minimum it stands still within rounding."""
        return self.equations.are_numbers and self.equations.cost <= before.cost + _rounding(before)

    def keeps_promise(self, before: RightSide) -> bool:
        """Whether it gains at least a share of what photographs and shared parameters promised, within rounding."""
        gain, promised = before.cost - self.equations.cost, float(self.reduced @ before.right)
        return self.improves(before) and gain >= LEAST_GAIN * promised - _rounding(before)

    def gain_ratio(self, before: RightSide) -> float:
        """The gain over the gain promised, 1 at most."""
        return min((before.cost - self.equations.cost) / max(self.decrement, 1e-300), 1.0)


def _rounding(before: RightSide) -> float:
    """Growth of the cost that is none."""
    return COST_TOLERANCE * before.cost + before.rounding


def take_step(
    system: NormalSystem, at: Place, damping: float, secants: Secants | None, precision: np.dtype[Any] = DOUBLE
) -> Trial | None:
    """Solve for a step, with a factor of a precision, and go there; None where the equations are singular."""
    damped = at.equations if damping == 0.0 else system.assemble(at.state, damping, at.estimator)
    try:
        factor = system.factorise(damped, precision)
    except NotPositiveDefiniteError:
        return None
    return _tried(system, replace(at, equations=damped), factor, damping, secants)


def until_better(
    system: NormalSystem, at: Place, step: Trial | None, damping: Damping, secants: Secants | None
) -> tuple[Trial | None, Damping]:
    """The step, damped more and more until it improves; None where none does."""
    if step is not None and secants is not None and damping.value == 0.0:
        step = _trustworthy(system, at, step, secants)
    while step is None or not step.improves(at.equations):
        if step is not None and secants is None:
            step = _with_settled_points(system, step)
            if step.improves(at.equations):
                break
        damping = damping.raised()
        if damping.value > LAST_DAMPING:
            return None, damping
        step = take_step(system, at, damping.value, secants)
    return step, damping


def stretched(system: NormalSystem, at: Place, step: Trial, last_decrement: float) -> Trial:
    """A step of re-weighting, lengthened to where its slow contraction would lead it, if that is further down.

    Steps that shrink by a factor ρ each sum up to 1/(1 − ρ) of the first (Aitken).
    """
    ratio = np.sqrt(abs(step.decrement) / last_decrement) if 0.0 < last_decrement < np.inf else 0.0
    if not LEAST_RATIO < ratio < 1.0:
        return step
    factor = min(1.0 / (1.0 - ratio), LONGEST_STRETCH)
    move = Step(factor * step.move.images, factor * step.move.shared, factor * step.move.points)
    there = place_at(system, system.unknowns.advance(at.state, move), at.estimator)
    return replace(step, place=there) if there.is_below(step.place) else step


def lengthened(system: NormalSystem, at: Place, step: Trial) -> Trial:
    """A step along which the slope hardly falls off, doubled as long as that leads further down.

    Where the residuals bend the sum of squares against the normal matrix, its steps are too short: from a saddle they
    grow by a few hundredths each.
    """
    slope = float(step.reduced @ at.equations.right)
    for _ in range(DOUBLINGS):
        if float(step.reduced @ step.equations.right) <= STEEP * slope:
            break
        further = _at_share(system, at, step, 2.0)
        if not further.place.is_below(step.place):
            break
        step, slope = further, 2.0 * slope
    return step


def place_at(system: NormalSystem, state: State, estimator: Estimator) -> Place:
    """The place of a state, its equations assembled."""
    return Place(state, system.assemble(state, 0.0, estimator), estimator)


def assembled(system: NormalSystem, visited: Visited) -> Place:
    """The place with its whole equations, assembled where they are not."""
    return visited if isinstance(visited, Place) else place_at(system, visited.state, visited.estimator)


def _tried(system: NormalSystem, at: Place, factor: Factor, damping: float, secants: Secants | None) -> Trial | None:
    """The step by this factor; with secants an undamped one heeds them, and the points are led to their minimum."""
    right = at.equations.right
    x = secants.solve(factor, right) if secants is not None and damping == 0.0 else factor.solve(right)
    decrement = float(x @ right) + at.equations.point_decrement
    move = system.whole_step(at.state, x, damping, at.estimator)
    if move is None:
        return None
    there = system.unknowns.advance(at.state, move)
    if secants is not None:
        there = system.settle_points(there, at.estimator)
    # a step with the same factor follows: it needs no matrix
    chord = secants is None and damping == 0.0 and not at.estimator.is_robust
    if chord and abs(decrement) <= at.equations.cost - decrement and factor.smallest_pivot >= SUSPECT_PIVOT:
        side = system.right_side(there, at.estimator)
        return Trial(Visited(there, side, at.estimator), decrement, factor, move)
    return Trial(place_at(system, there, at.estimator), decrement, factor, move, secants is not None)


def _trustworthy(system: NormalSystem, at: Place, step: Trial, secants: Secants) -> Trial | None:
    """An undamped step that keeps enough of its promise; None where it has to be damped.

    One that does not is taken anew, first with what it told itself about the curvature, then with the normal matrix
    alone.
    """
    tried: Trial | None = step
    learns = len(secants) > 0 and step.gain_ratio(at.equations) > FAR_OFF
    if not step.keeps_promise(at.equations) and learns:
        secants.learn(step.reduced, at.equations.right, step.equations.right)
        tried = _tried(system, at, step.factor, 0.0, secants)
    if (tried is None or not tried.keeps_promise(at.equations)) and len(secants):
        secants.forget()
        tried = _tried(system, at, step.factor, 0.0, secants)
    if tried is None or tried.keeps_promise(at.equations):
        return tried
    return _shortened(system, at, tried)


def _shortened(system: NormalSystem, at: Place, step: Trial) -> Trial | None:
    """The part of a step that keeps its promise, looked for where a parabola through what is known has its minimum."""
    whole, slope, share = step, float(step.reduced @ at.equations.right), 1.0
    for _ in range(SHORTENINGS):
        bend = step.equations.cost - at.equations.cost + 2.0 * share * slope
        least = share * share * slope / bend if np.isfinite(bend) and bend > 0.0 else 0.0
        share = float(np.clip(least, SHORTEST * share, 0.5 * share))
        step = _at_share(system, at, whole, share)
        if step.equations.are_numbers and at.equations.cost - step.equations.cost >= LEAST_GAIN * share * slope:
            return step
    return None


def _at_share(system: NormalSystem, at: Place, step: Trial, share: float) -> Trial:
    """A step of another length, points at their minimum."""
    move = Step(share * step.move.images, share * step.move.shared, share * step.move.points)
    there = system.settle_points(system.unknowns.advance(at.state, move), step.place.estimator)
    return replace(step, place=place_at(system, there, step.place.estimator), move=move)


def _with_settled_points(system: NormalSystem, step: Trial) -> Trial:
    """A step too long for some points (weak rays, gross errors), with these led back to their own minimum."""
    estimator = step.place.estimator
    state = system.settle_points(step.place.state, estimator)
    return replace(step, place=place_at(system, state, estimator), points_settled=True)
