"""Paper 002 in short: its methods on a strip of 25 photographs; whole in tools/reproduce/reproduce_paper_002.py."""

from __future__ import annotations

import importlib

import numpy as np
import pytest
from scipy.stats import chi2

from places import PROJECT

PHOTOGRAPHS = 25
SEEDS = range(1, 13)


def in_turn(function, shared, seeds):
    """Runs one after the other."""
    return [function(shared, seed) for seed in seeds]


@pytest.fixture(scope="module")
def strip():
    """The modules of the tool."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(PROJECT / "tools" / "reproduce"))
        yield importlib.import_module("paper_002.strip")


@pytest.fixture(scope="module")
def by_method(strip):
    """(case, precision) of every method at the least and the greatest σ of GNSS."""
    cases = importlib.import_module("paper_002.cases").methods(PHOTOGRAPHS)
    chosen = [case for case in cases if case.gnss_m in (None, 0.25, 1.0)]
    return [(case, strip.run(case, SEEDS, in_turn, PHOTOGRAPHS)) for case in chosen]


def test_gnss_alone_leaves_the_roll_free(strip):
    alone = strip.Case("", "", 0.25, wander_m=0.0, exact=True)
    assert "rank deficient" in strip.run(alone, SEEDS, in_turn, PHOTOGRAPHS).failure
    assert "ω" in strip.run(alone, SEEDS, in_turn, PHOTOGRAPHS).failure
    bent = strip.run(strip.Case("", "", 0.25, wander_m=0.0), SEEDS[:1], in_turn, PHOTOGRAPHS)
    assert bent.roll_deg > 1.0
    wandering = strip.run(strip.Case("", "", 0.25), SEEDS[:1], in_turn, PHOTOGRAPHS)
    assert wandering.roll_deg > 0.1


def test_towers_hold_the_roll_without_any_control(strip, by_method):
    """Top against foot to 28 mm over 15 m, by 25 towers: whatever the σ of GNSS and however straight the flight."""
    straight = strip.Case("", "", 0.25, towers=True, wander_m=0.0, exact=True)
    rolls = [found.roll_deg for case, found in by_method if case.method == "2"]
    rolls.append(strip.run(straight, SEEDS, in_turn, PHOTOGRAPHS).roll_deg)
    np.testing.assert_allclose(rolls, np.degrees(0.028 / 15.0 / np.sqrt(PHOTOGRAPHS)), rtol=0.1)


def test_errors_agree_with_their_sigma(by_method):
    """Roll of a photograph and a pass point in the middle: |mean z| < 3.3/√n, variance in the 99.9 % χ² band."""
    n = len(SEEDS)
    low, high = chi2.ppf([0.0005, 0.9995], n) / n
    for case, found in by_method:
        for z in (found.z_roll, *found.z_point.T):
            assert len(z) == n
            assert abs(z.mean()) < 3.3 / np.sqrt(n), case
            assert low < np.mean(z**2) < high, case
        assert (np.abs(np.log(found.practical / found.theoretical)) < np.log(2.0)).all(), case


def test_full_control_has_the_papers_plan_and_not_its_height(strip, by_method):
    """[P] "45, 57, and 197 mm": X and Y with pairs every two bases, Z by its h/b unless few of them have a height."""
    found = by_method[-1][1]
    assert by_method[-1][0].method == "3"
    np.testing.assert_allclose(1e3 * found.theoretical[:2], [45.0, 57.0], rtol=0.15)
    assert 1.4 < found.theoretical[2] / found.theoretical[0] < 1.8
    few = strip.Case("", "", control=strip.pairs_every(2, PHOTOGRAPHS), heights_every=12)
    sparse = strip.run(few, SEEDS[:2], in_turn, PHOTOGRAPHS)
    np.testing.assert_allclose(sparse.theoretical[:2], found.theoretical[:2], rtol=0.1)
    assert 160.0 < 1e3 * sparse.theoretical[2] < 260.0


def test_table_and_plot(by_method):
    text = importlib.import_module("paper_002.table").markdown(by_method, [], [], len(SEEDS), PHOTOGRAPHS)
    assert "(3) full control, no GNSS" in text
    assert "| 45, 57, 197 |" in text
    rows = [line for line in text.splitlines() if line.startswith("| (")]
    assert len(rows) == len(by_method)
    assert {row.count("|") for row in rows} == {13}
    assert len(importlib.import_module("paper_002.plot").precision_plot(by_method).axes) == 3
