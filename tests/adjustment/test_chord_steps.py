"""Steps with the factor of an earlier step: the same minimum with one factor, and a new factor where they fail."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from aerotri.adjustment import chord_steps
from aerotri.adjustment.chord_steps import follow
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.solve import SolveOptions, minimise
from aerotri.adjustment.steps import Trial, Visited
from aerotri.adjustment.unknowns import Step
from aerotri.functional_model.additional_parameters import parse_parameters
from small_blocks import small_block, with_adjustment


class Bowl:
    """Stands for equations whose matrix is `curvature` where the factor is that of 1."""

    def __init__(self, curvature):
        self.curvature = curvature
        self.unknowns = SimpleNamespace(advance=lambda state, move: state + move.shared)

    def right_side(self, state, estimator):
        return SimpleNamespace(
            right=-self.curvature @ state, cost=float(state @ self.curvature @ state), point_decrement=0.0
        )

    def assemble(self, state, damping, estimator):
        return self.right_side(state, estimator)

    def whole_step(self, state, x, damping, estimator):
        return Step(np.zeros((0, 6)), x, np.zeros((0, 3)))


def followed(curvature, start):
    """The steps that follow one to `start`, and where they lead."""
    bowl = Bowl(curvature)
    factor = SimpleNamespace(solve=lambda right: right.copy(), smallest_pivot=1.0)
    side = bowl.right_side(start, LEAST_SQUARES)
    first = Trial(Visited(start, side, LEAST_SQUARES), 1e6 * side.cost, factor, Step(np.zeros(0), start, np.zeros(0)))
    return follow(bowl, first, 1, 30, lambda cost: None)


def test_what_the_matrix_has_changed_is_learnt_from_the_steps():
    """Two directions whose curvature is off by a twelfth: the plain chord gains a factor of 156 in every step."""
    curvature, start = np.diag([1.08, 0.92, 1.0]), np.array([1.0, 1.0, 1.0])
    found = followed(curvature, start)
    gained = -np.diff(np.log10([start @ curvature @ start, *found.costs]))
    assert gained[0] == pytest.approx(2.0 * -np.log10(0.08), abs=0.2)
    assert (gained[2:6] > 4.0).all()
    assert found.settled


def test_steps_that_gain_too_little_are_left():
    found = followed(np.diag([3.0, 0.2]), np.array([1.0, 1.0]))
    assert not found.settled
    assert len(found.costs) <= 2


@pytest.mark.parametrize("parameters", ["none", "bluh:1-4"])
def test_one_factor_leads_to_the_minimum_that_many_lead_to(parameters, monkeypatch):
    """From metres off: where the first step gains what it promised, no other factor is needed."""
    block = with_adjustment(small_block(3)[0], additional_parameters=parse_parameters(parameters))
    prepared = prepare(block)
    system, state = prepared.system, prepared.state
    rng = np.random.default_rng(4)
    off = replace(
        state,
        centre=state.centre + rng.normal(0.0, 0.3, state.centre.shape),
        points=state.points + np.where(system.unknowns.point_held, 0.0, rng.normal(0.0, 0.3, state.points.shape)),
    )
    factors = []
    whole = NormalSystem.factorise
    monkeypatch.setattr(NormalSystem, "factorise", lambda *given: factors.append(1) or whole(*given))
    one = minimise(system, off, 100, SolveOptions())
    with_one = len(factors)
    factors.clear()
    monkeypatch.setattr(chord_steps, "SLOWEST_CONTRACTION", 0.0)
    many = minimise(system, off, 100, SolveOptions())
    assert (one.status, many.status) == ("converged", "converged")
    assert with_one == 1 < len(factors)
    assert one.costs[-1] == pytest.approx(many.costs[-1], rel=1e-10)
    np.testing.assert_allclose(one.state.centre, many.state.centre, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(one.state.points, many.state.points, rtol=0.0, atol=1e-6)
