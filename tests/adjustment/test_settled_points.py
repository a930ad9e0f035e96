"""With Huber's estimator every point stands where its rays want it when the adjustment ends, gross errors or not."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment import solve, stopping
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.settled_points import SETTLED, settled_points
from aerotri.adjustment.solve import SolveOptions, minimise
from aerotri.statistics.summarise import count_observations, summarise
from small_blocks import LONG_FLIGHT, small_block, with_adjustment, with_gross_errors


@pytest.fixture(scope="module")
def prepared():
    block = small_block(seed=4, parameters="none", flight=LONG_FLIGHT)[0]
    return prepare(with_adjustment(with_gross_errors(block), model_part="off"))


@pytest.fixture(scope="module")
def ended(prepared):
    """The system, where it ends as always, and how it is summarised."""
    counts = count_observations(prepared.system)
    solution = minimise(prepared.system, prepared.state, counts.redundancy, SolveOptions(robust="huber"))
    found = summarise(prepared.system, solution, prepared.system.factorise(solution.equations), prepared.ray_status, ())
    return counts.redundancy, solution, found


def test_all_points_have_settled_at_the_normal_end(prepared, ended, monkeypatch):
    redundancy, solution, found = ended
    # all unknowns together, until the cost has no more digits: some 200 iterations in place of 12
    monkeypatch.setattr(stopping, "ROBUST_COST_TOLERANCE", 1e-13)
    monkeypatch.setattr(solve, "needs_settling", lambda estimator: False)
    options = SolveOptions(robust="huber", max_iterations=1000, step_tolerance=1e-6)
    state = minimise(prepared.system, prepared.state, redundancy, options).state
    sigma = found.points.sigma[prepared.system.unknowns.points]
    apart = np.abs(state.points - solution.state.points) / sigma
    assert apart.max() < 10.0 * SETTLED
    # gross errors are among them: otherwise the test shows nothing
    lengths = prepared.system.residual_lengths(solution.equations)
    assert (lengths > 10.0 * solution.estimator.scale).sum() > 10


def test_points_that_have_settled_stay(prepared, ended):
    redundancy, solution, _ = ended
    variance = solution.equations.cost / redundancy
    again = settled_points(prepared.system, solution.state, solution.estimator, variance)
    # those alone whose last steps were told apart from rounding go on
    assert np.mean((again.points == solution.state.points).all(axis=1)) > 0.95
    assert np.array_equal(again.centre, solution.state.centre)


def test_a_point_that_was_pushed_away_comes_back(prepared, ended):
    redundancy, solution, found = ended
    variance = solution.equations.cost / redundancy
    sigma = found.points.sigma[prepared.system.unknowns.points]
    pushed = replace(solution.state, points=solution.state.points + 3.0 * sigma)
    back = settled_points(prepared.system, pushed, solution.estimator, variance)
    assert np.nanmax(np.abs(back.points - solution.state.points) / sigma) < 10.0 * SETTLED


def test_least_squares_ends_as_before(prepared):
    counts = count_observations(prepared.system)
    solution = minimise(prepared.system, prepared.state, counts.redundancy, SolveOptions())
    assert solution.estimator == LEAST_SQUARES
    variance = solution.equations.cost / counts.redundancy
    there = settled_points(prepared.system, solution.state, solution.estimator, variance)
    assert np.array_equal(there.points, solution.state.points)
