"""Points that the block does not fix in distance: how many it takes to doubt a block, and that their names are said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.diagnosis import judge
from aerotri.diagnosis.left_out import of_loose_points
from aerotri.pipeline import adjust
from ten_photographs import ten_photographs


@pytest.fixture(scope="module")
def adjusted():
    return adjust(ten_photographs())


def with_loose(adjusted, share):
    """The result with so many of its points as little fixed as half the way to the photographs."""
    covariance = adjusted.points.covariance.copy()
    there = np.flatnonzero(adjusted.points.rays > 0)
    loose = there[: round(share * len(there))]
    covariance[loose, 2, 2] = (0.5 * np.ptp(adjusted.images.centre, axis=0).max() + 1e3) ** 2
    return replace(adjusted, points=replace(adjusted.points, covariance=covariance)), loose


@pytest.mark.parametrize(
    ("share", "verdict"), [(0.0, "accepted"), (0.05, "accepted"), (0.2, "doubtful"), (0.6, "rejected")]
)
def test_verdict_on_points_that_are_not_fixed(adjusted, share, verdict):
    found, loose = with_loose(adjusted, share)
    judged = judge(found)
    assert judged.level == verdict
    said = [reason for reason in judged.reasons if "not fixed in distance" in reason]
    assert bool(said) == (verdict != "accepted")
    if said:
        assert str(found.block.points[loose[0]]) in said[0]
        assert f"{len(loose)} of " in said[0]
    assert bool(of_loose_points(found)) == bool(said)
