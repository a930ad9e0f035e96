"""Sets of additional parameters side by side: each as `adjust` has it, prediction of control against adjusting anew."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from aerotri.diagnosis.parameter_sets import verdict
from aerotri.formats.results.parameter_sets import comparison_columns, comparison_json
from aerotri.functional_model.additional_parameters import AUTO, parse_parameters
from aerotri.observations import Prior
from aerotri.pipeline import adjust, adjust_keeping_system, chain, compare_parameters
from aerotri.pipeline.choosing import choose_parameters
from aerotri.pipeline.in_frame import adjust_in_frame
from aerotri.pipeline.verdict import with_outcome
from aerotri.report.tables.parameters import comparison_table
from aerotri.report.tables.terminal import table_lines
from aerotri.results.parameter_comparison import Accuracy, Evidence, ParameterComparison, SetOutcome
from aerotri.strategies.control_prediction import folds_of, predict_control
from aerotri.strategies.parameter_choice import Gain, candidate_sets, choose, distances, gain, gains, measure, standings
from aerotri.strategies.parameter_comparison import set_name
from small_blocks import small_block, with_adjustment

ERRORS = {"ucd": {"preset": "ultracam_d", "errors": {"physical": {"rms_um": 4.0, "seed": 2}}}}
SETS = ("none", "bluh:1-12", "ebner", "collocation:5x4")


@pytest.fixture(scope="module")
def block():
    control = {"distance_bases": 2.5, "sigma_m": [0.03, 0.03, 0.05], "check_points": 8}
    return small_block(21, camera=ERRORS, control=control)[0]


@pytest.fixture(scope="module")
def compared(block):
    return compare_parameters(block, [parse_parameters(spec) for spec in SETS])


@pytest.mark.parametrize("folds", [4, 100])
@pytest.mark.parametrize("parameters", ["none", "bluh:1-12"])
def test_prediction_is_an_adjustment_without_the_fold(block, folds, parameters):
    a = adjust_keeping_system(with_adjustment(block, additional_parameters=parse_parameters(parameters)))
    factor = a.system.factorise(a.solution.equations)
    found = predict_control(a.system, a.solution, factor, a.result.outcome.sigma0, folds)
    control = block.control
    for fold in (0, 1):
        out = found.point[found.fold == fold]
        is_check = control.is_check | np.isin(control.point, out)
        again = adjust(replace(a.result.block, control=replace(control, is_check=is_check)))
        row = {int(p): k for k, p in enumerate(again.check.point)}
        at = [row[int(p)] for p in out]
        own = found.fold == fold
        sigma0 = again.outcome.sigma0 / a.result.outcome.sigma0
        np.testing.assert_allclose(found.difference[own], again.check.difference[at], rtol=1e-3, atol=3e-4)
        np.testing.assert_allclose(found.sigma[own] * sigma0, again.check.sigma[at], rtol=1e-3)


def test_prediction_of_what_nothing_else_determines():
    """Two control points of three left out together: the datum is gone, and the prediction with it."""
    block = small_block(22, control={"distance_bases": 3.0, "sigma_m": [0.03, 0.03, 0.05]})[0]
    a = adjust_keeping_system(block)
    count = len(a.result.control)
    factor = a.system.factorise(a.solution.equations)
    found = predict_control(a.system, a.solution, factor, 1.0, 1)
    assert len(found.point) == count
    assert np.isnan(found.difference).all()


def test_folds():
    assert sorted(folds_of(np.arange(7), 100).tolist()) == list(range(7))
    place = np.arange(23)
    assert np.bincount(folds_of(place, 5)).tolist() == [5, 5, 5, 4, 4]
    np.testing.assert_array_equal(folds_of(place, 5), folds_of(place, 5))
    # the same points in other rows
    np.testing.assert_array_equal(folds_of(place[::-1] * 3, 5), folds_of(place, 5)[::-1])


def test_each_set_as_adjust_has_it(block, compared):
    """Whatever was adjusted before: σ0, check points, count."""
    for spec, outcome in zip(SETS, compared.outcomes, strict=True):
        result = adjust(with_adjustment(block, additional_parameters=parse_parameters(spec)))
        assert outcome.converged
        assert outcome.sigma0 == pytest.approx(result.outcome.sigma0, rel=2e-3 if "coll" in spec else 1e-6)
        atol = 3e-3 if "coll" in spec else 1e-5
        np.testing.assert_allclose(outcome.check.difference, result.check.difference, atol=atol)
        assert outcome.count == len(result.parameters)
        if "coll" not in spec:
            assert outcome.significant == (result.parameters.t > 1.96).sum()
            assert outcome.effective == outcome.count
    field = compared.outcomes[-1]
    assert 0.0 < field.effective < field.count
    assert field.length_mm > 0.0


def test_information_criteria(block, compared):
    """Ω and r of the adjustment without parameters, k more of them with a set."""
    plain = adjust(block).outcome
    outcome = compared.outcomes[1]
    own = adjust(with_adjustment(block, additional_parameters=parse_parameters("bluh:1-12"))).outcome
    r = plain.redundancy
    assert compared.outcomes[0].aic == pytest.approx(r * np.log(plain.vtpv / r), rel=1e-6)
    assert outcome.aic == pytest.approx(r * np.log(own.vtpv / r) + 24, rel=1e-6)
    assert outcome.bic == pytest.approx(r * np.log(own.vtpv / r) + 12 * np.log(r), rel=1e-6)


def test_tables(compared):
    table = comparison_table(compared)
    assert [row[0] for row in table.rows] == [o.name for o in compared.outcomes]
    lines = table_lines(table)
    assert len(lines) == 2 + len(SETS)
    content = json.loads(json.dumps(comparison_json(compared), allow_nan=False))
    assert [s["set"] for s in content["sets"]] == [o.name for o in compared.outcomes]
    assert content["sets"][1]["check"]["rms"]["Z"] == pytest.approx(compared.outcomes[1].check.rms[2])
    columns = comparison_columns(compared)
    assert len({len(column) for column in columns.values()}) == 1


def test_confidence_bounds():
    """χ² of 8 differences: 2.18 and 17.53."""
    accuracy = Accuracy.of(np.column_stack([np.ones(8), np.full(8, np.nan), np.arange(8.0)]))
    assert accuracy.count.tolist() == [8, 0, 8]
    assert accuracy.low[0] == pytest.approx(np.sqrt(8 / 17.535), rel=1e-3)
    assert accuracy.high[0] == pytest.approx(np.sqrt(8 / 2.180), rel=1e-3)
    assert np.isnan(accuracy.rms[1])


def made_up(name: str, scale: float, count: int, bic: float, seed: int = 0, points: int = 40) -> SetOutcome:
    """A set with differences of a given size at the control points, those of one seed all alike."""
    d = Accuracy.of(scale * np.random.default_rng(seed).normal(size=(points, 3)))
    choice = parse_parameters(name)
    return SetOutcome(set_name(choice), choice, "converged", count, count, count, 1.0, 2.0, bic, bic, d, d)


def with_evidence(outcome: SetOutcome, mean: float, scatter: float, sigma_height: float = 0.1, seed: int = 3):
    """Eight areas and five control points, −2 ln of the density of each `mean` more than of a set with 0."""
    drawn = np.random.default_rng(seed)
    common = drawn.normal(1000.0, 100.0, 13)
    own = common + mean + scatter * np.random.default_rng(seed + outcome.count).normal(size=13)
    return replace(outcome, evidence=Evidence(own[:8], np.zeros(0), own[8:], sigma_height))


def comparison_of(*outcomes: SetOutcome) -> ParameterComparison:
    names = tuple(str(k) for k in range(40))
    return ParameterComparison("b", outcomes, 10, names, names, "off")


def test_choice_of_the_one_that_predicts_better():
    none = with_evidence(made_up("none", 1.0, 0, 0.0), 30.0, 5.0)
    ebner = with_evidence(made_up("ebner", 3.0, 12, 500.0), 0.0, 5.0)
    chosen = choose(comparison_of(none, ebner))
    assert chosen.name == "ebner:1-12"
    assert "predict the image points of 8 areas of the block and 5 control points best" in chosen.reason
    behind = distances(comparison_of(none, ebner))["none"]
    assert behind.best == "ebner:1-12"
    assert 13 * 20.0 < behind.value < 13 * 40.0
    assert not behind.alike


def test_of_sets_that_cannot_be_told_apart_the_one_with_the_larger_sigma():
    ebner = with_evidence(made_up("ebner", 1.0, 12, 0.0), 0.0, 10.0, sigma_height=0.10)
    gruen = with_evidence(made_up("gruen", 1.0, 44, 0.0), 2.0, 10.0, sigma_height=0.15)
    none = with_evidence(made_up("none", 1.0, 0, 0.0), 90.0, 10.0, sigma_height=0.50)
    chosen = choose(comparison_of(ebner, gruen, none))
    assert chosen.name == "gruen:all"
    assert (
        "as well as ebner:1-12, and their σ are the largest of these. none is the best of the others" in chosen.reason
    )


def test_an_area_that_a_set_cannot_predict_is_left_out_for_both():
    ebner = with_evidence(made_up("ebner", 1.0, 12, 0.0), 0.0, 1.0)
    none = with_evidence(made_up("none", 1.0, 0, 0.0), 20.0, 1.0)
    areas = ebner.evidence.areas.copy()
    areas[0] = np.nan
    gap = replace(ebner, evidence=replace(ebner.evidence, areas=areas))
    value = distances(comparison_of(gap, none))["none"].value
    assert value == pytest.approx(12 * 20.0, abs=20.0)


def test_a_small_block_leaves_it_to_bic():
    chosen = choose(comparison_of(made_up("none", 1.0, 0, 9.0, points=3), made_up("ebner", 1.0, 12, 5.0, points=3)))
    assert chosen.name == "ebner:1-12"
    assert "BIC alone" in chosen.reason


def test_gain_with_its_standard_error():
    one, two = made_up("ebner", 0.8, 12, 0.0, seed=1), made_up("none", 1.0, 0, 0.0, seed=1)
    found = gain(one, two, (one.control.difference, two.control.difference))
    assert found.value == pytest.approx(0.2)
    assert found.error < 1e-12
    independent = made_up("none", 1.0, 0, 0.0, seed=2)
    found = gain(one, independent, (one.control.difference, independent.control.difference))
    assert 0.03 < found.error < 0.2
    assert measure(np.array([[3.0, 1.0, 2.0], [-3.0, -1.0, -2.0]])) == pytest.approx(6.0 ** (1.0 / 3.0))


def test_significant_but_useless_is_said():
    base, useless = made_up("none", 1.0, 0, 5.0, seed=1), made_up("ebner", 1.0, 12, 0.0, seed=1)
    comparison = comparison_of(base, useless, made_up("ebner:1-3", 1.1, 3, 0.0, seed=1), made_up("gruen", 0.5, 44, 0.0))
    found, behind = gains(comparison)["ebner:1-12"], standings(comparison)["ebner:1-12"]
    # nested are none and ebner:1-3, not gruen
    assert found.against == "none"
    assert behind.against == "gruen:all"
    worse = "worse than gruen:all"
    assert verdict(useless, found, behind) == f"significant, but no better than none; {worse}"
    assert verdict(replace(useless, significant=1), found, behind) == f"no better than none; {worse}"
    assert verdict(useless, Gain("none", 0.3, 0.1), Gain("gruen:all", -0.1, 0.1)) == "helps; as good as the best"
    assert verdict(useless, None, Gain("ebner:1-12", 0.0, 0.0)) == "the best"


def test_a_set_that_cannot_be_adjusted_is_named_and_the_others_go_on(block):
    found = compare_parameters(block, [parse_parameters(spec) for spec in ("bluh:1-4", "dmc", "none")])
    assert [o.converged for o in found.outcomes] == [True, False, True]
    assert "camera model" in found.outcomes[1].status
    assert comparison_table(found).rows[1][-1] == found.outcomes[1].status
    json.dumps(comparison_json(found), allow_nan=False)


def test_auto_adjusts_with_what_it_chooses(block):
    found = adjust_keeping_system(with_adjustment(block, additional_parameters=AUTO))
    assert found.compared is not None
    assert len(found.compared.outcomes) == len(candidate_sets(block))
    chosen = choose(found.compared)
    assert set_name(found.result.block.settings.adjustment.additional_parameters) == chosen.name
    assert found.result.outcome.notes[0] == chosen.reason
    plain = adjust(with_adjustment(block, additional_parameters=chosen.choice))
    assert found.result.outcome.sigma0 == pytest.approx(plain.outcome.sigma0, rel=1e-9)
    assert np.sqrt(np.mean(found.result.check.difference[:, 2] ** 2)) < 0.6 * np.sqrt(
        np.mean(adjust(block).check.difference[:, 2] ** 2)
    )


def test_auto_takes_the_next_set_where_the_first_does_not_converge(block, monkeypatch):
    """And the first where none does: what was tried last is no better."""
    tried, failing = [], 1

    def adjusted(own, *rest):
        tried.append(own.settings.adjustment.additional_parameters)
        found = adjust_in_frame(own, *rest)
        status = "not converged" if len(tried) <= failing else found.result.outcome.status
        return with_outcome(found, replace(found.result.outcome, status=status))

    automatic = with_adjustment(block, additional_parameters=AUTO, model_part="off")
    choice = choose_parameters(automatic)
    monkeypatch.setattr(chain, "adjust_in_frame", adjusted)
    monkeypatch.setattr(chain, "choose_parameters", lambda *rest: choice)
    found = adjust_keeping_system(automatic)
    assert len(tried) == 2
    assert tried[0] != tried[1] == found.result.block.settings.adjustment.additional_parameters
    assert found.result.outcome.status == "converged"
    assert "chosen first, did not converge" in found.result.outcome.notes[0]
    first, tried, failing = tried[0], [], 100
    found = adjust_keeping_system(automatic)
    assert len(tried) == chain.MOST_CHOICES
    assert found.result.block.settings.adjustment.additional_parameters == first
    assert found.result.outcome.status == "not converged"


def test_a_lens_with_start_values_is_not_held(block):
    """None is no candidate where the lens was found by a first orientation; one that was calibrated may be held."""
    camera = block.cameras[0]
    for prior, there in ((Prior(), True), (Prior(-0.05), False), (Prior(-0.05, sigma=1e-3), True)):
        for part in ({"lens": {"k1": prior}}, {"brown": {"K1": prior}}):
            own = replace(block, cameras=(replace(camera, **part), *block.cameras[1:]))
            assert (() in candidate_sets(own)) == there


def test_a_field_is_tried_beside_the_lens(block):
    """A field alone holds the lens near zero where the image points hardly determine it, and bends the block."""
    for model in ("frame", "ultracam_d", "dmc"):
        own = replace(block, cameras=tuple(replace(camera, model=model) for camera in block.cameras))
        families = [{family for family, _ in choice} for choice in candidate_sets(own)]
        beside = [one for one in families if "collocation" in one]
        assert beside
        assert all(one & {"lens", "brown", "bluh"} for one in beside)
