"""Selection of additional parameters: the rule, the result, and how often parameters go that are zero in truth."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.results.adjustment import write_result
from aerotri.formats.results.solution import read_solution, write_solution
from aerotri.image_errors import field_on_grid
from aerotri.observations import Prior
from aerotri.pipeline import adjust, adjust_keeping_system, reopen
from aerotri.strategies.significance import ParameterTests, worst
from small_blocks import small_block, with_adjustment

ZERO_RATE = 0.6827
"""Share of parameters, zero in truth, with t < 1."""


def three_tests(t, r01, r12):
    """Tests of three parameters with given t and correlations of the first and the last with the middle one."""
    q = np.eye(3)
    q[0, 1] = q[1, 0] = r01
    q[1, 2] = q[2, 1] = r12
    return ParameterTests.of(np.array(t, dtype=float), q, 1.0)


def test_t_goes_before_correlation_and_correlation_before_total_correlation():
    found = worst(three_tests([0.9, 5.0, 0.5], 0.95, 0.0), 1.0, 0.85)
    assert found == (2, "t = 0.50, below 1")
    found = worst(three_tests([9.0, 5.0, 3.0], 0.95, 0.0), 1.0, 0.85)
    assert found is not None
    assert found[0] == 1
    assert found[1].startswith("r = +0.95 with")
    # neither correlation is beyond the limit, both together make the middle one replaceable: B = 0.65² + 0.65²
    found = worst(three_tests([9.0, 5.0, 3.0], 0.65, 0.65), 1.0, 0.80)
    assert found is not None
    assert found[0] == 1
    assert found[1].startswith("total correlation B = 0.8")
    assert worst(three_tests([9.0, 5.0, 3.0], 0.65, 0.65), 1.0, 0.85) is None
    assert worst(ParameterTests.of(np.zeros(0), np.zeros((0, 0)), 1.0), 1.0, 0.85) is None


def selected(seed: int = 3, **settings):
    block, _ = small_block(seed, "bluh:1-12", camera={"ucd": {"preset": "ultracam_d", "errors": ERRORS}})
    return with_adjustment(block, parameter_selection="on", **settings)


ERRORS = {"parameters": {"bluh.1": 1e-4, "bluh.9": -2e-8}}


def test_what_is_left_passes_and_equals_an_adjustment_without_the_rest():
    result = adjust(selected())
    p = result.parameters
    gone = p.status == "removed"
    assert gone.any()
    assert {"bluh.1", "bluh.9"} <= set(p.names[~gone])
    assert (p.t[~gone] >= 1.0).all()
    assert (np.abs(p.max_correlation[~gone]) <= 0.85).all()
    assert (p.total_correlation[~gone] <= 0.85).all()
    assert [str(n) for n in p.names[gone]] == [r.name for r in result.removals]
    assert all(reason.startswith(f"{k + 1}: ") for k, reason in enumerate(p.reason[gone]))
    left = tuple(item for item in map(str, range(1, 13)) if f"bluh.{item}" in set(p.names[~gone]))
    plain = adjust(with_adjustment(result.block, additional_parameters=(("bluh", left),), parameter_selection="off",
                                   parameters_removed=()))  # fmt: skip
    np.testing.assert_allclose(p.value[~gone], plain.parameters.value, rtol=1e-6)
    np.testing.assert_allclose(p.sigma[~gone], plain.parameters.sigma, rtol=1e-6)
    np.testing.assert_allclose(result.points.xyz, plain.points.xyz, atol=1e-6)
    assert result.outcome.unknowns == plain.outcome.unknowns
    np.testing.assert_allclose(field_on_grid(result, "ucd").d, field_on_grid(plain, "ucd").d, atol=1e-9)


def test_each_removal_stands_as_it_was_removed():
    """The first one: t of the adjustment with all parameters."""
    block = selected()
    first = adjust(block).removals[0]
    p = adjust(with_adjustment(block, parameter_selection="off")).parameters
    row = list(p.names).index(first.name)
    assert row == int(np.argmin(p.t))
    assert first.value == pytest.approx(p.value[row], rel=1e-5)
    assert first.sigma == pytest.approx(p.sigma[row], rel=1e-5)
    assert first.correlation == pytest.approx(p.max_correlation[row], abs=1e-5)


def test_files_and_reopened(tmp_path):
    a = adjust_keeping_system(selected())
    write_result(a.result, tmp_path)
    content = json.loads((tmp_path / "adjustment.json").read_text())
    removed = [p for p in content["additional_parameters"] if p["status"] == "removed"]
    assert removed
    assert all(p["reason"] for p in removed)
    assert "removed" in (tmp_path / "parameters.csv").read_text()
    write_block(a.result.block, tmp_path / "block")
    write_solution(tmp_path / "solution.npz", a.system, a.solution, a.local)
    again = reopen(read_block(tmp_path / "block"), read_solution(tmp_path / "solution.npz"))
    np.testing.assert_allclose(again.result.parameters.covariance, a.result.parameters.covariance, rtol=1e-8)
    np.testing.assert_array_equal(again.result.parameters.reason, a.result.parameters.reason)


def test_groups_lose_parameters_one_by_one():
    """Two days of one camera: what goes on one day may stay on the other; the weighted one always stays."""
    flight = {"gsd_m": 0.1, "strips": 3, "images_per_strip": 6, "end_lap": 0.6, "side_lap": 0.4, "days": 2}
    block, _ = small_block(8, "bluh:1-12,brown:K1", flight=flight)
    camera = replace(block.cameras[0], brown={"K1": Prior(0.0, 1e-7)})
    block = with_adjustment(replace(block, cameras=(camera,)), parameter_groups="day", parameter_selection="on")
    result = adjust(block)
    p = result.parameters
    gone = {day: set(p.names[(p.status == "removed") & (p.groups == day)]) for day in ("1", "2")}
    assert gone["1"] != gone["2"]
    kept = p.names == "brown.K1"
    assert kept.sum() == 2
    assert set(p.status[kept]) == {"weighted"}


def test_in_a_free_block():
    """The coordinates held stay the same ones while parameters go."""
    result = adjust(selected(datum="inner"))
    left = result.parameters.status != "removed"
    items = tuple(str(n).partition(".")[2] for n in result.parameters.names[left])
    plain = adjust(with_adjustment(result.block, additional_parameters=(("bluh", items),), parameter_selection="off",
                                   parameters_removed=()))  # fmt: skip
    assert result.removals
    np.testing.assert_allclose(result.points.xyz, plain.points.xyz, atol=1e-5)
    np.testing.assert_allclose(result.points.sigma, plain.points.sigma, rtol=1e-5)


def test_free_brown_parameter_removed_counts_as_zero():
    block, _ = small_block(9)
    lens = replace(block.cameras[0], brown={"K1": Prior(1e-7)})
    bare = adjust(block)
    block = with_adjustment(
        replace(block, cameras=(lens,)), additional_parameters=(("brown", ("K1",)),), parameter_selection="on",
        t_limit=1e6,
    )  # fmt: skip
    result = adjust(block)
    assert list(result.parameters.status) == ["removed"]
    assert result.outcome.vtpv == pytest.approx(bare.outcome.vtpv, rel=1e-9)
    assert field_on_grid(result, "ucd").max == 0.0


def test_zero_parameters_go_at_the_expected_rate():
    """Ebner's twelve, nearly orthogonal and all zero in truth: t < 1 at once in 68 % of the cases, and as many go."""
    seeds = range(700, 708)
    at_once = gone = 0
    for seed in seeds:
        block = small_block(seed, "ebner")[0]
        at_once += int((adjust(block).parameters.t < 1.0).sum())
        gone += len(adjust(with_adjustment(block, parameter_selection="on", correlation_limit=1.0)).removals)
    count = 12 * len(seeds)
    low, high = binom.ppf([0.0005, 0.9995], count, ZERO_RATE)
    assert low <= at_once <= high
    assert low <= gone <= high
