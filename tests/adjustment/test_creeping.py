"""Robust adjustments that creep: what they know of the curvature is kept, and what holds them up is looked for."""

from types import SimpleNamespace

import numpy as np
import pytest

from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.solve import SolveOptions, minimise
from aerotri.adjustment.stopping import BENT_STEP_TOLERANCE, ROBUST_COST_TOLERANCE
from aerotri.adjustment.weak_geometry import LONG, _Look
from aerotri.statistics.summarise import count_observations
from small_blocks import small_block, with_adjustment, with_gross_errors


@pytest.fixture(scope="module")
def prepared():
    return prepare(with_adjustment(with_gross_errors(small_block(seed=5)[0]), model_part="off"))


def test_curvature_is_heeded_from_the_first_step_where_steps_led_uphill_before(prepared):
    """The minimum is the same; least squares has no use for it."""
    redundancy = count_observations(prepared.system).redundancy
    plain, bent = (
        minimise(prepared.system, prepared.state, redundancy, SolveOptions(robust="huber", bent=bent))
        for bent in (False, True)
    )
    assert (plain.status, plain.bent, bent.status, bent.bent) == ("converged", False, "converged", True)
    assert bent.step_tolerance == BENT_STEP_TOLERANCE > plain.step_tolerance
    cost = prepared.system.right_side(bent.state, plain.estimator).cost
    assert cost == pytest.approx(plain.equations.cost, rel=ROBUST_COST_TOLERANCE)
    again = minimise(prepared.system, bent.state, redundancy, SolveOptions(robust="huber", bent=bent.bent))
    assert again.iterations <= 2
    squares = minimise(prepared.system, prepared.state, redundancy, SolveOptions(bent=True))
    assert not squares.bent


def looks_of(costs, whole=True):
    """(photographs, in_block) of every look on the way, and its iteration, for the costs after the iterations."""
    asked = _Look(100, whole)
    found = []
    asked.look = lambda system, state, equations, estimator, photographs, in_block: found.append(
        (iteration, photographs, in_block)
    )
    asked.last_cost = 1e9
    for iteration, cost in enumerate(costs, start=1):
        asked(None, None, SimpleNamespace(cost=cost), Estimator(1, 2.0), iteration, False)
    return found


def test_an_adjustment_that_creeps_is_looked_at_within_the_block():
    count = LONG + 1
    falling = 1e6 * 0.9 ** np.arange(count)
    assert looks_of(falling) == [(6, False, False), (LONG, True, False)]
    creeping = 1e6 * (1.0 - 0.1 * ROBUST_COST_TOLERANCE) ** np.arange(count)
    assert looks_of(creeping) == [(6, False, False), (LONG, True, True)]
    assert looks_of(creeping, whole=False) == []
