"""Variance components: recovery of simulated σ, the sums behind them, what is held, and the saved result."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from aerotri.coordinates import local_frame
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.results.adjustment import write_result
from aerotri.formats.results.json_text import json_text
from aerotri.formats.results.solution import read_solution, write_solution
from aerotri.pipeline import adjust, adjust_keeping_system, reopen
from aerotri.results.variance_components import VarianceComponents
from aerotri.statistics.observation_groups import group_fits, with_scaled_sigmas
from aerotri.strategies.residual_response import ResidualResponse, cross_redundancy
from aerotri.strategies.variance_components import chi_square_tests
from coordinates.test_coordinates import SAARBRUECKEN, UTM32, moved_into
from small_blocks import small_block, with_adjustment

FLIGHT = {
    "gsd_m": 0.1,
    "strips": 2,
    "images_per_strip": 5,
    "end_lap": 0.6,
    "side_lap": 0.5,
    "attitude_sigma_deg": [1.0, 1.0, 2.0],
    "position_sigma_m": [5.0, 5.0, 3.0],
    "days": 2,
}
TIES = {"per_image": 25, "probability": 0.9, "sigma_um": 3.0}
CONTROL = {"distance_bases": 1.3, "sigma_m": [0.15, 0.15, 0.25]}
GNSS = {"sigma_m": [0.25, 0.25, 0.25]}
CASES: dict[str, tuple[dict[str, Any], dict[str, float]]] = {
    "photographs of two days, control, GNSS": (
        {"control": CONTROL, "gnss": GNSS},
        {
            "image points 1": 1.5, "image points 2": 0.6, "control plan": 1.7, "control height": 0.7,
            "GNSS plan": 0.6, "GNSS height": 1.6,
        },
    ),
    "INS, towers": (
        {
            "ins": {"sigma_deg": [0.012, 0.012, 0.012]},
            "towers": {"height_m": 25.0, "sigma_m": 0.1},
            "control": CONTROL | {"sigma_m": [0.2, 0.2, 0.2]},
        },
        {"image points": 0.7, "INS omega phi": 1.6, "INS kappa": 0.6, "constraints": 1.7},
    ),
}  # fmt: skip
SEEDS = range(300, 316)


def wrongly_stated(case: str, seed: int):
    """A block whose groups state their σ too large or too small by the factors of the case."""
    changes, wrong = CASES[case]
    block, _ = small_block(seed, flight=FLIGHT, tie_points=TIES, **changes)
    groups = "day" if "image points 1" in wrong else "camera"
    return with_scaled_sigmas(with_adjustment(block, parameter_groups=groups, variance_components="on"), wrong), wrong


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_components_recover_the_simulated_sigma_within_their_own(case):
    """ln(σ̂/σ) in units of its σ, component by component: |mean| < 3.3/√n, variance in the 99.9 % χ² band."""
    z: dict[str, list[float]] = {}
    for seed in SEEDS:
        block, wrong = wrongly_stated(case, seed)
        result = adjust(block)
        assert result.components is not None
        assert result.components.settled
        assert result.outcome.sigma0 == pytest.approx(1.0, abs=0.01)
        for c in result.components.components:
            if c.group in wrong:
                assert not c.held, f"{seed}: {c.group} {c.held}"
                z.setdefault(c.group, []).append(np.log(c.factor * wrong[c.group]) / (c.factor_sigma / c.factor))
    assert set(z) == set(CASES[case][1])
    n = len(SEEDS)
    low, high = chi2.ppf([0.0005, 0.9995], n) / n
    for name, values in z.items():
        assert abs(np.mean(values)) < 3.3 / np.sqrt(n), f"{name} is biased, mean z {np.mean(values):.2f}"
        assert low < np.mean(np.square(values)) < high, (
            f"σ of {name} is wrong, mean z² {np.mean(np.square(values)):.2f}"
        )


@pytest.fixture(scope="module")
def estimated():
    """A block with wrongly stated σ, and its adjustment with components."""
    block, _ = wrongly_stated("photographs of two days, control, GNSS", 299)
    return block, adjust_keeping_system(block)


def test_the_projector_behind_the_factors(estimated):
    """R·R·z = R·z, Σ_h S_gh = r_g, and products with unit vectors give the redundancy numbers one by one."""
    _, adjustment = estimated
    response = ResidualResponse(adjustment.system, adjustment.solution)
    fits = group_fits(adjustment.local)
    names = tuple(fit.name for fit in fits)
    z = np.where(response.groups != "", np.random.default_rng(3).normal(size=len(response.groups)), 0.0)
    once = response(z)
    np.testing.assert_allclose(response(once), once, atol=1e-5)
    small = names[2:]
    s = cross_redundancy(response, names, probes=40)
    assert [f.count for f in fits if f.name in small] == [40, 20, 20, 10]
    redundancy = np.array([fit.redundancy for fit in fits])
    np.testing.assert_allclose(s.sum(axis=1)[2:], redundancy[2:], rtol=0.01)
    np.testing.assert_allclose(s.sum(axis=1)[:2], redundancy[:2], rtol=0.05)
    u, rays = adjustment.system.unknowns, adjustment.local.rays
    for row in (0, 57, 200):
        unit = np.zeros(len(z))
        unit[2 * row + 1] = 1.0
        assert response(unit)[2 * row + 1] == pytest.approx(rays.r[u.rays.source[row], 1], abs=1e-5)


def test_where_they_stand_still_every_group_fits_its_sigma(estimated):
    block, adjustment = estimated
    result = adjustment.result
    assert result.components.settled
    for fit in group_fits(adjustment.local):
        assert fit.omega / fit.redundancy == pytest.approx(1.0, abs=0.02), fit.name
    total = sum(group.redundancy for group in result.groups)
    assert total == pytest.approx(result.outcome.redundancy, rel=1e-6)
    given = {fit.name: fit.sigma for fit in group_fits(adjust(with_adjustment(block, variance_components="off")))}
    for group, component in zip(result.groups, result.components.components, strict=True):
        assert group.name == component.group
        assert group.sigma_apriori == pytest.approx(given[group.name], rel=1e-12)
        assert group.sigma_aposteriori == pytest.approx(component.sigma, rel=0.01)
        assert f"the σ of {group.name} was changed" in " ".join(result.outcome.warnings)


def test_components_stay_components_when_adjusted_again(estimated):
    """The block of the result has the σ found: adjusted without estimating anything it gives the same."""
    _, adjustment = estimated
    again = adjust(with_adjustment(adjustment.result.block, variance_components="off"))
    np.testing.assert_allclose(again.points.xyz, adjustment.result.points.xyz, atol=1e-5)
    np.testing.assert_allclose(again.images.sigma, adjustment.result.images.sigma, rtol=1e-4)
    assert {test.verdict for test in chi_square_tests(again)} == {"agrees"}


def test_reopened_result_is_the_same(estimated, tmp_path):
    _, adjustment = estimated
    write_block(adjustment.result.block, tmp_path / "block")
    write_solution(tmp_path / "solution.npz", adjustment.system, adjustment.solution, adjustment.local)
    again = reopen(read_block(tmp_path / "block"), read_solution(tmp_path / "solution.npz")).result
    kept = adjustment.result
    assert again.components == kept.components
    assert again.outcome.warnings == kept.outcome.warnings
    assert [g.name for g in again.groups] == [g.name for g in kept.groups]
    for a, b in zip(again.groups, kept.groups, strict=True):
        assert a.sigma_apriori == pytest.approx(b.sigma_apriori, rel=1e-12)
        assert a.sigma_aposteriori == pytest.approx(b.sigma_aposteriori, rel=1e-8)
    np.testing.assert_allclose(again.points.covariance, kept.points.covariance, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(again.points.xyz, kept.points.xyz)


def test_components_through_json_keep_what_is_not_known():
    block, _ = small_block(5, flight=FLIGHT, tie_points=TIES, control={"positions": [[0, 0], [1, 0], [0.5, 1]]})
    components = adjust(with_adjustment(block, variance_components="on")).components
    assert components is not None
    content = components.as_dict()
    text = json_text(content)
    again = VarianceComponents.from_dict(json.loads(text))
    assert again.as_dict() == content
    assert json.loads(text)["components"][1]["factor_sigma"] is None


def test_components_are_written_beside_the_result(estimated, tmp_path):
    _, adjustment = estimated
    write_result(adjustment.result, tmp_path)
    text = (tmp_path / "variance_components.json").read_text(encoding="utf-8")
    assert VarianceComponents.from_dict(json.loads(text)) == adjustment.result.components
    groups = json.loads((tmp_path / "adjustment.json").read_text(encoding="utf-8"))["groups"]
    assert [group["name"] for group in groups] == [c["group"] for c in json.loads(text)["components"]]


def test_a_group_without_redundancy_keeps_its_sigma():
    """Three control points fix seven freedoms: two redundant coordinates say nothing of two σ."""
    block, _ = small_block(5, flight=FLIGHT, tie_points=TIES, control={"positions": [[0, 0], [1, 0], [0.5, 1]]})
    result = adjust(with_adjustment(block, variance_components="on"))
    assert result.components is not None
    by_name = {c.group: c for c in result.components.components}
    for name in ("control plan", "control height"):
        assert by_name[name].factor == 1.0
        assert "too little" in by_name[name].held
        assert any(f"the σ of {name} is held as given" in w for w in result.outcome.warnings)
    assert not by_name["image points"].held
    np.testing.assert_array_equal(result.block.control.sigma, block.control.sigma)


def test_a_sigma_that_is_not_there_goes_to_zero_and_is_held():
    """Towers that stand exactly upright: their condition has no scatter to estimate a σ from."""
    changes: dict[str, Any] = CASES["INS, towers"][0] | {"towers": {"height_m": 25.0, "sigma_m": 1e-6}}
    block, _ = small_block(300, flight=FLIGHT, tie_points=TIES, **changes)
    stated = with_scaled_sigmas(block, {"constraints": 1e4})
    result = adjust(with_adjustment(stated, variance_components="on"))
    assert result.components is not None
    component = next(c for c in result.components.components if c.group == "constraints")
    assert component.held
    assert component.factor == 1.0


@pytest.mark.parametrize(
    ("factor", "verdict"), [(1.0, "agrees"), (0.3, "σ given too small"), (4.0, "σ given too large")]
)
def test_chi_square_tests_without_components(factor, verdict):
    block, _ = small_block(7, control={"distance_bases": 2.0, "sigma_m": [0.05, 0.05, 0.08]})
    result = adjust(with_scaled_sigmas(block, {"image points": factor}))
    assert result.components is None
    test = chi_square_tests(result)[0]
    assert test.group == "image points"
    assert test.verdict == verdict
    assert test.low < test.freedom < test.high
    assert test.statistic == pytest.approx(test.freedom * test.ratio**2)


def test_false_alarms_of_the_tests():
    """At α = 5 % over 30 blocks with right σ: no group is rejected significantly more often than that."""
    rejected, tested = {}, 0
    for seed in range(400, 430):
        changes, _ = CASES["photographs of two days, control, GNSS"]
        block, _ = small_block(seed, flight=FLIGHT, tie_points=TIES, **changes)
        tested += 1
        for test in chi_square_tests(adjust(with_adjustment(block, alpha=0.05))):
            rejected[test.group] = rejected.get(test.group, 0) + (test.verdict != "agrees")
    assert tested == 30
    # binomial, 99.9 %
    assert max(rejected.values()) <= 6, rejected


def test_robust_components_are_blind_to_gross_errors():
    block, _ = small_block(11, flight=FLIGHT, gross_errors={"fraction": 0.02})
    stated = with_scaled_sigmas(block, {"image points": 3.0})
    plain, robust = (
        adjust(with_adjustment(stated, robust=how, variance_components="on")).components for how in ("off", "huber")
    )
    assert robust is not None
    assert plain is not None
    assert robust.settled
    assert robust.components[0].factor == pytest.approx(1.0 / 3.0, rel=0.1)
    assert plain.components[0].factor > 1.0


def test_a_block_in_a_crs_gets_the_factors_of_the_local_one():
    frame = local_frame(UTM32, np.array([SAARBRUECKEN]))
    block, _ = wrongly_stated("photographs of two days, control, GNSS", 301)
    local, moved = adjust(block), adjust_keeping_system(moved_into(frame, block)).result
    assert moved.components is not None
    assert local.components is not None
    for ours, theirs in zip(moved.components.components, local.components.components, strict=True):
        assert ours.factor == pytest.approx(theirs.factor, rel=0.01), ours.group
    given = moved_into(frame, block).control.sigma
    factor = moved.components.factors
    np.testing.assert_allclose(moved.block.control.sigma[:, 0] / given[:, 0], factor["control plan"])
    np.testing.assert_allclose(moved.block.control.sigma[:, 2] / given[:, 2], factor["control height"])


def test_check_points_keep_their_sigma_and_the_common_sigma_follows():
    block, _ = small_block(3)
    assert block.control.is_check.any()
    scaled = with_scaled_sigmas(block, {"image points": 1.7, "control plan": 2.0})
    check = block.control.is_check
    np.testing.assert_array_equal(scaled.control.sigma[check], block.control.sigma[check])
    np.testing.assert_array_equal(scaled.control.sigma[~check, :2], 2.0 * block.control.sigma[~check, :2])
    np.testing.assert_array_equal(scaled.control.sigma[~check, 2], block.control.sigma[~check, 2])
    assert (scaled.image_points.sigma == scaled.settings.image_sigma_um * 1e-3).all()
    assert scaled.settings.image_sigma_um == pytest.approx(1.7 * block.settings.image_sigma_um)
    one_ray = replace(
        block.image_points,
        sigma=block.image_points.sigma * np.where(np.arange(len(block.image_points)) == 5, 2, 1)[:, None],
    )
    scaled = with_scaled_sigmas(replace(block, image_points=one_ray), {"image points": 1.7})
    np.testing.assert_allclose(scaled.image_points.sigma, 1.7 * one_ray.sigma, rtol=1e-14)
