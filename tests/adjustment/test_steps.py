"""How long a step along a known direction is taken, on functions of one unknown."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from aerotri.adjustment.damping import Damping
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.reduced_equations import RightSide
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.secants import Secants
from aerotri.adjustment.steps import Place, Trial, lengthened, until_better
from aerotri.adjustment.unknowns import Step
from small_blocks import small_block


class Valley:
    """Stands for the equations of a function f of one unknown; the normal matrix is said to be 1."""

    def __init__(self, cost, slope):
        self.cost, self.slope = cost, slope
        self.unknowns = SimpleNamespace(advance=lambda state, move: state + float(move.shared[0]))

    def assemble(self, state, damping, estimator):
        right = np.array([-0.5 * self.slope(state)])
        return RightSide(right, self.cost(state), 0.0, np.zeros((0, 2)), np.zeros(0), -1, right, 0.0)

    def settle_points(self, state, estimator):
        return state

    def whole_step(self, state, x, damping, estimator):
        return move(float(x[0]))


def move(length):
    return Step(np.zeros((0, 6)), np.array([length]), np.zeros((0, 3)))


def tried(valley, start, length):
    """The place of a start and the step of a length from there."""
    at = Place(start, valley.assemble(start, 0.0, None), None)
    there = Place(start + length, valley.assemble(start + length, 0.0, None), None)
    factor = SimpleNamespace(solve=lambda right: right, smallest_pivot=1.0)
    return at, Trial(there, float(at.equations.right[0]) * length, factor, move(length), True)


@pytest.mark.parametrize("steepness", [3.0, 30.0, 300.0])
def test_step_that_leads_too_far_is_shortened(steepness):
    """Where the function bends up far more than the normal matrix says, damping is not what is needed."""
    valley = Valley(lambda x: 1.0 + steepness * x**2, lambda x: 2.0 * steepness * x)
    start = 1.0
    at, step = tried(valley, start, -steepness * start)
    found, damping = until_better(valley, at, step, Damping(), Secants())
    assert damping.value == 0.0
    assert found.equations.cost < 0.5 * at.equations.cost
    # along a parabola the first that is tried is the minimum, if the whole step was not farther than twenty times
    if steepness <= 20.0:
        assert found.place.state == pytest.approx(0.0, abs=1e-12)


def test_step_along_which_the_slope_does_not_fall_off_is_doubled():
    """From beside a saddle: downhill ever steeper until far out."""
    valley = Valley(lambda x: 20.0 - x**2 + 0.01 * x**4, lambda x: -2.0 * x + 0.04 * x**3)
    at, step = tried(valley, 0.1, 0.1)
    found = lengthened(valley, at, step)
    assert found.equations.cost < step.equations.cost
    assert found.place.state > 3.0
    # it is a step of that length for what is learnt from it
    assert 0.1 + found.reduced[-1] == pytest.approx(found.place.state)


def test_step_to_a_minimum_stays_as_it_is():
    valley = Valley(lambda x: 1.0 + x**2, lambda x: 2.0 * x)
    at, step = tried(valley, 1.0, -1.0)
    assert lengthened(valley, at, step) is step


def test_step_that_nothing_shortens_is_damped():
    """Uphill in any length: the caller has to damp."""
    valley = Valley(lambda x: 1.0 + abs(x - 1.0), lambda x: 2.0)
    at, step = tried(valley, 1.0, -1.0)
    valley.factorise = lambda equations, precision: SimpleNamespace(solve=lambda right: right, smallest_pivot=1.0)
    found, damping = until_better(valley, at, step, Damping(), Secants())
    assert found is None
    assert damping.value > 0.0


@pytest.mark.parametrize("cost", [np.inf, np.nan])
def test_step_to_what_is_no_number_is_none(cost):
    valley = Valley(lambda x: cost if x < 0.5 else 1.0 + x**2, lambda x: 2.0 * x)
    at, step = tried(valley, 1.0, -1.0)
    assert not step.improves(at.equations)
    assert not step.place.is_below(at)


def test_step_to_equations_that_overflow_is_none():
    """The cost is a number, and lower, but nothing could be solved there."""
    valley = Valley(lambda x: x**2, lambda x: np.inf if x < 0.5 else 2.0 * x)
    at, step = tried(valley, 1.0, -1.0)
    assert not step.improves(at.equations)


def test_step_beyond_all_places_is_none():
    prepared = prepare(small_block(4)[0])
    system, state = prepared.system, prepared.state
    size = 6 * len(state.centre) + len(state.shared)
    near, far = np.zeros(size), np.zeros(size)
    near[0], far[0] = 1.0, 1e40
    assert system.whole_step(state, near, 0.0, LEAST_SQUARES) is not None
    assert system.whole_step(state, far, 0.0, LEAST_SQUARES) is None


def test_growth_by_rounding_is_none():
    """Of a function whose minimum is 0, where every place differs from it by rounding."""
    valley = Valley(lambda x: 1e-22 * (1.0 + x), lambda x: 0.0)
    at, step = tried(valley, 0.0, 1.0)
    assert not step.improves(at.equations)
    assert step.improves(replace(at.equations, rounding=1e-21))
