"""Another set of additional parameters that the choice could not tell from the one it took: what it adds to σ."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.diagnosis.other_set import growth, of_other_set, other_set_in_words
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.pipeline import chain
from aerotri.results.model_part import ModelPart, OtherSet
from aerotri.results.parameter_comparison import Accuracy, AdjustedObject, ParameterComparison, SetOutcome
from aerotri.statistics.joint_covariance import choose_unknowns, joint_cofactors
from aerotri.strategies import parameter_choice
from aerotri.strategies.object_change import movement
from aerotri.strategies.parameter_choice import Chosen, Rival, choose, probability_of_better
from aerotri.terrain.adjustment_part import _by_unknowns as by_unknowns
from small_blocks import small_block

WEIGHT = 0.6
LENS, BLUH = "lens:k1+k2+k3+p1+p2", "bluh:1-12"
ERRORS = {"ucd": {"preset": "ultracam_d", "errors": {"physical": {"rms_um": 4.0, "seed": 2}}}}


def adjusted(monkeypatch, block, taken=LENS, other=BLUH, weight=WEIGHT):
    """By the public way, the choice between two sets made for it."""
    rival = None if other is None else Rival(parse_parameters(other), "", "free", weight)
    chosen = Chosen(taken, parse_parameters(taken), "so", rival=rival)

    def chose(given, geoid=None, progress=None):
        return parameter_choice_of(given, chosen)

    with monkeypatch.context() as patch:
        patch.setattr(chain, "choose_parameters", chose)
        return aerotri.adjust(aerotri.with_settings(block, parameters="auto"), explain=False)


def parameter_choice_of(block, chosen):
    return chain.ParameterChoice(ParameterComparison("b", (), 1, (), (), "off"), chosen, block, None)


@pytest.fixture(scope="module")
def block():
    control = {"distance_bases": 2.5, "sigma_m": [0.03, 0.03, 0.05], "check_points": 8}
    return small_block(21, camera=ERRORS, control=control)[0]


@pytest.fixture(scope="module")
def both(block):
    with pytest.MonkeyPatch.context() as patch:
        return adjusted(patch, block), adjusted(patch, block, other=None)


def test_total_sigma_holds_the_difference_of_the_other_set(block, both):
    """w·s·d·dᵀ beside what stood there before, d as the two sets adjusted by themselves differ."""
    result, alone = both
    other = aerotri.adjust(aerotri.with_settings(block, parameters=BLUH), explain=False)
    told = result.adjusted.model_part.other_set
    assert told.set == BLUH
    assert told.weight == WEIGHT
    assert 0.3 < told.unexplained <= 1.0
    d = other.adjusted.points.xyz - alone.adjusted.points.xyz
    known = np.isfinite(d).all(axis=1)
    assert told.height_m == pytest.approx(np.sqrt(np.mean(d[known, 2] ** 2)), rel=0.02)
    assert told.plan_m == pytest.approx(np.sqrt(np.mean(np.sum(d[known, :2] ** 2, axis=1))), rel=0.02)
    gained = result.adjusted.points.total_covariance - alone.adjusted.points.total_covariance
    expected = told.share * d[:, :, None] * d[:, None, :]
    size = told.share * np.nanmean(np.sum(d**2, axis=1))
    np.testing.assert_allclose(gained[known], expected[known], atol=0.1 * size)
    centres = other.adjusted.images.centre - alone.adjusted.images.centre
    gained = result.adjusted.images.total_covariance - alone.adjusted.images.total_covariance
    np.testing.assert_allclose(
        np.diagonal(gained, axis1=1, axis2=2)[:, :3],
        told.share * centres**2,
        atol=0.1 * told.share * np.max(centres**2),
    )
    # the set that was taken stays, and so does σ of the noise
    np.testing.assert_array_equal(result.adjusted.points.covariance, alone.adjusted.points.covariance)


def test_what_follows_from_the_unknowns_has_its_share(both):
    """Joint covariances of points, and places measured later: intersected with the orientations and parameters."""
    record = both[0].record
    u, difference = record.system.unknowns, record.other
    points = np.flatnonzero(np.diff(u.rays.start) >= 3)[:40]
    names = [str(u.block.points[u.points[k]]) for k in points[:3]]
    factor = record.system.factorise(record.solution.equations)
    chosen = choose_unknowns(u, names)
    root = difference.root
    model = joint_cofactors(record.system, record.solution.state, factor, record.solution.estimator, chosen, root)[1]
    d = difference.points[points[:3]].ravel()
    np.testing.assert_allclose(model, difference.other.share * np.outer(d, d), rtol=1e-4, atol=1e-12)

    from aerotri.deformation.restitution import restitution_of

    restitution = restitution_of(record)
    image = [u.images[u.rays.image[u.rays.start[k] : u.rays.start[k + 1]]] for k in points]
    photographs = np.full((len(points), max(map(len, image))), -1)
    for own, row in zip(image, photographs, strict=True):
        row[: len(own)] = own
    local = record.solution.state.points[points] + u.origin
    j = by_unknowns(record, restitution, np.arange(len(u.block.images)), local, photographs, plan=False)
    count = 6 * len(u.images) + len(u.shared)
    moved = j[:, :, :count] @ np.concatenate([difference.images.ravel(), difference.shared])
    # the image errors that the set taken cannot describe move each place a little in its own way
    d = difference.points[points]
    assert np.sqrt(np.mean(moved**2)) == pytest.approx(np.sqrt(np.mean(d**2)), rel=0.3)
    assert np.corrcoef(moved.ravel(), d.ravel())[0, 1] > 0.8


def test_saved_and_opened(both, tmp_path):
    result = both[0]
    opened = aerotri.open_result(result.save(tmp_path / "out", plots=False))
    for axis in "XYZ":
        np.testing.assert_allclose(opened.points[f"t{axis}"], result.points[f"t{axis}"], rtol=1e-6)
    content = json.loads((tmp_path / "out" / "adjustment.json").read_text(encoding="utf-8"))
    assert content["model_part"]["other_set"]["set"] == BLUH
    assert opened.adjusted.model_part.other_set == result.adjusted.model_part.other_set
    saved = dict(np.load(tmp_path / "out" / "solution.npz"))
    for damaged in ({"other_set": np.array('{"set": "none"}')}, {"other_points": saved["other_points"] * np.nan}):
        np.savez(tmp_path / "out" / "solution.npz", **(saved | damaged))
        with pytest.raises(aerotri.InputError):
            aerotri.open_result(tmp_path / "out")


def test_it_is_told(both):
    part = both[0].adjusted.model_part
    assert growth(part.other_set) > 1.1
    said = other_set_in_words(part)
    assert f"cannot tell the additional parameters from {BLUH}" in said
    assert "better ones: 60 %" in said
    assert any(said == warning for warning in both[0].adjusted.outcome.warnings)
    assert of_other_set(both[0].adjusted)[0].level == "attention"
    little = replace(part, other_set=replace(part.other_set, plan_sigma=0.1, height_sigma=0.1))
    assert not other_set_in_words(little)
    assert of_other_set(replace(both[0].adjusted, model_part=little))[0].level == "good"
    assert not of_other_set(both[1].adjusted)


@pytest.mark.parametrize(
    ("changes", "value", "says"),
    [
        (
            {"height_sigma": 5.0, "plan_sigma": 0.2, "unexplained": 0.0},
            "heights 0.5 m, 5.0 times σ",
            "σ of both explain",
        ),
        (
            {"height_sigma": 0.2, "plan_sigma": 5.0, "unexplained": 0.0},
            "positions 0.3 m, 5.0 times σ",
            "σ of both explain",
        ),
        (
            {"height_sigma": 0.2, "plan_sigma": 1.5, "weight": 0.01},
            "positions 0.3 m, 1.5 times σ",
            "adds little to the total σ",
        ),
        ({"height_sigma": 0.2, "plan_sigma": 0.1}, "heights 0.5 m, 0.2 times σ", "changes little"),
    ],
)
def test_a_difference_that_adds_nothing_is_told_as_it_is(both, changes, value, says):
    other = OtherSet("x", 0.5, plan_m=0.3, height_m=0.5, unexplained=1.0)
    adjusted = replace(both[0].adjusted, model_part=ModelPart(other_set=replace(other, **changes)))
    (found,) = of_other_set(adjusted)
    assert (found.level, found.value) == ("good", value)
    assert says in found.says


def test_no_difference_is_null_in_json():
    assert ModelPart(other_set=OtherSet("none", 0.5)).as_dict()["other_set"]["height_m"] is None


def test_a_change_below_sigma_does_not_count():
    other = OtherSet(BLUH, 0.5, plan_m=0.1, height_m=0.2, plan_sigma=0.8, height_sigma=1.2, unexplained=0.9)
    assert other.share == pytest.approx(0.45)
    assert replace(other, height_sigma=0.9).share == 0.0


def test_the_same_set_changes_nothing(monkeypatch, block, both):
    """A set that differs from the one taken by noise alone counts for nothing."""
    result = adjusted(monkeypatch, block, other="lens:k1+k2+p1+p2+k3")
    told = result.adjusted.model_part.other_set
    assert told.height_sigma < 0.01
    assert told.share == 0.0
    np.testing.assert_allclose(result.points["tZ"], both[1].points["tZ"], rtol=1e-9)


def test_probability_of_better():
    """Between a likelihood ratio that is sure and a difference that only its standard error tells."""
    assert probability_of_better(0.0, 0.0) == probability_of_better(0.0, 30.0) == 0.5
    assert probability_of_better(2.0 * np.log(7.0), 0.0) == pytest.approx(7.0 / 8.0)
    rng = np.random.default_rng(1)
    for value, error in ((5.0, 4.0), (-10.0, 12.0), (30.0, 20.0)):
        drawn = np.mean(1.0 / (1.0 + np.exp(-0.5 * rng.normal(value, error, 20000))))
        assert probability_of_better(value, error) == pytest.approx(drawn, abs=0.03)


def outcome(name, bic, height_m, free=False):
    nowhere, choice = Accuracy.of(np.zeros((0, 3))), parse_parameters(name)
    place = np.random.default_rng(3).uniform(-50.0, 50.0, (30, 3))
    own = AdjustedObject(
        np.arange(30), place + [0.0, 0.0, height_m], np.full(30, 100.0), np.arange(9), np.full((9, 2), bic), free
    )
    count = len(choice)
    return SetOutcome(name, choice, "converged", count, count, 0, 1.0, 1.0, 0.0, bic, nowhere, nowhere, object=own)


def test_the_rival_is_the_set_that_makes_the_object_most_uncertain():
    sets = outcome("none", 0.0, 0.0), outcome("ebner", 1.0, 0.1), outcome(BLUH, 3.0, 0.5), outcome("gruen", 30.0, 9.0)
    chosen = choose(ParameterComparison("b", sets, 10, (), (), "off"))
    assert chosen.name == "none"
    assert chosen.rival is not None
    assert chosen.rival.choice == sets[2].choice
    assert chosen.rival.weight == pytest.approx(1.0 / (1.0 + np.exp(1.5)))
    assert choose(ParameterComparison("b", (sets[0], sets[3]), 10, (), (), "off")).rival is None
    # of a free block a common shift is no difference
    assert movement(sets[0], sets[2]) == pytest.approx(0.5)
    assert movement(outcome("none", 0.0, 0.0, True), outcome("ebner", 0.0, 0.5, True)) < 1e-9
    assert parameter_choice.NEGLIGIBLE == 4.0
