"""Solutions with lowered weights of all clusters at once, against a factor for each cluster."""

import numpy as np
import pytest

from aerotri.pipeline.chain import adjust_keeping_system
from aerotri.statistics.cluster_influence import LOWERED, influences
from aerotri.statistics.clusters import cluster_schemes
from aerotri.statistics.lowered_weights import (
    MOST_TURNS,
    expanded,
    first_turn,
    lengths,
    next_turn,
    products,
    pulls_of_clusters,
    reduced,
)
from small_blocks import small_block
from statistics_blocks import drone_block


def solved(system, solution, label, m, t):
    """Solutions of the whole block as one part, and how many turns they took."""
    factor = system.factorise(solution.equations)

    def back(sides):
        return expanded(system, solution, factor.solve(reduced(system, solution, sides)), sides)

    scores = pulls_of_clusters(system, solution, label, m)
    plain = back(scores)
    turn = first_turn(scores, plain, pulls_of_clusters(system, solution, label, m, plain))
    at = lengths(products(turn, t), None)
    for k in range(MOST_TURNS):
        if at.arrived:
            return plain, turn.x, k
        turn = next_turn(turn, back(turn.w), at, t)
        w = pulls_of_clusters(system, solution, label, m, turn.z)
        turn = type(turn)(turn.x, turn.p, turn.q, turn.z, turn.r, turn.s, w)
        at = lengths(products(turn, t), at)
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
    every = {share: list(influences(system, solution, factor, clusters, t, share)) for share in (0.0,)}
    plain, x, turns = solved(system, solution, clusters.label, len(clusters), t)
    assert turns < 40
    for c, change in enumerate(every[0.0]):
        expected = np.concatenate([change.images.ravel(), change.shared, change.points.ravel()])
        n = change.images.size
        for own in (slice(0, n), slice(n, n + len(u.shared)), slice(n + len(u.shared), None)):
            if len(expected[own]):
                scale = np.abs(expected[own]).max()
                print(turns, np.abs(x[own, c] - expected[own]).max() / scale)
                assert np.abs(x[own, c] - expected[own]).max() < 1e-5 * scale
