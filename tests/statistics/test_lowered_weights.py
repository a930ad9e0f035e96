"""Solutions with lowered weights of all clusters at once, against a factor for each cluster."""

import numpy as np
import pytest

from aerotri.pipeline.chain import adjust_keeping_system
from aerotri.statistics.cluster_influence import LOWERED, influences
from aerotri.statistics.clusters import cluster_schemes
from aerotri.statistics.lowered_weights import (
    MOST_TURNS,
    SMALL,
    first_turn,
    lengths,
    lowered_sides,
    next_turn,
    products,
    with_points,
)
from small_blocks import small_block
from statistics_blocks import drone_block


def solved(system, solution, label, m, t):
    """Solutions of the whole block as one part, and how many turns they took."""
    factor = system.factorise(solution.equations)
    scores = lowered_sides(system, solution, label, m, t)
    turn = first_turn(scores, factor.solve(scores), scores)
    turn = turn.with_pulled(lowered_sides(system, solution, label, m, t, turn.z))
    at = lengths(products(turn), None)
    for k in range(MOST_TURNS):
        if at.arrived:
            return with_points(system, solution, label, t, turn.x), k
        turn = next_turn(turn, factor.solve(turn.w), at)
        turn = turn.with_pulled(lowered_sides(system, solution, label, m, t, turn.z))
        at = lengths(products(turn), at)
    raise AssertionError("no end")


GNSS = {"gnss": {"sigma_m": [0.05, 0.05, 0.08], "shift_sigma_m": [0.2, 0.2, 0.2]}}


@pytest.mark.parametrize("which", ["strips", "with parameters and positions"])
@pytest.mark.parametrize("t", [0.3, LOWERED])
def test_they_are_those_of_a_factor_for_each(which, t):
    block = drone_block(1, 2.0)[0] if which == "strips" else small_block(5, "bluh:1-2", **GNSS)[0]
    found = adjust_keeping_system(block)
    system, solution = found.system, found.solution
    u = system.unknowns
    clusters = cluster_schemes(u.block, u.images, solution.state.centre)[0]
    factor = system.factorise(solution.equations)
    lowered = list(influences(system, solution, factor, clusters, t, 0.0))
    x, turns = solved(system, solution, clusters.label, len(clusters), t)
    # the error falls by (1 - sqrt(1 - t)) / (1 + sqrt(1 - t)) a turn at least
    root = np.sqrt(1.0 - t)
    assert turns <= 1 + np.log(2.0 / SMALL) / np.log((1.0 + root) / (1.0 - root))
    # where an adjustment ends, the scores of all clusters do not add up to nothing: both differ by that
    for c, change in enumerate(lowered):
        for expected, values in zip(change, x, strict=True):
            assert np.abs(values[..., c] - expected).max(initial=0.0) <= 1e-6 * np.abs(expected).max(initial=0.0)


def test_clusters_without_a_score_stand_still():
    gamma = np.array([1.0, 0.0])
    at = lengths(np.stack([gamma, 0.5 * gamma]), None)
    assert np.array_equal(at.alpha, [2.0, 0.0])
    assert not at.arrived
    assert lengths(np.stack([1e-30 * gamma, 1e-30 * gamma]), at).arrived
