"""The cause of a wrong block is found and said, and nothing is said where there is none of the usual ones."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from aerotri.commands.adjust import run_adjust
from aerotri.diagnosis import diagnose
from aerotri.diagnosis.evidence import fit, gather
from aerotri.diagnosis.free_model import connected_parts, free_model, sub_block
from aerotri.diagnosis.placement import lay_on
from aerotri.diagnosis.sampling import ENOUGH_CONTROL, MOST_PHOTOGRAPHS, MOST_RAYS, sampled
from aerotri.diagnosis.trials import FAILED, Trial, explains
from aerotri.formats.block.folder import write_block
from aerotri.functional_model.rotation import exponential
from aerotri.pipeline import adjust
from small_blocks import small_block
from ten_photographs import ten_photographs, without_start_values
from wrong_blocks import answer_of, clean, focal_length, image_points, kinds, misses, negated

FEW = (
    ("navigation", "x of one photograph negated"),
    ("track", "x of one photograph negated"),
    ("control", "names of one photograph's points moved by one"),
    ("control", "one control point 2 m off in X"),
    ("control", "x of one strip negated"),
    ("navigation", "INS: kappa of four photographs + 180°"),
    ("navigation", "INS: phi of one photograph + 120°"),
    ("navigation", "GNSS 10 m too high"),
    ("navigation", "focal length a tenth"),
    ("control", "strips without a common point"),
    ("track", "X and Y of GNSS exchanged"),
    ("navigation", "rolling shutter of 0.3 m"),
)
"""Kinds that run in the tests; tools/prove/wrong_blocks.py runs all of them."""


@pytest.mark.parametrize(("geometry", "name"), FEW)
def test_wrong_blocks_are_not_accepted_and_the_cause_is_said(geometry, name, tmp_path):
    kind = next(kind for kind in kinds() if (kind.geometry, kind.name) == (geometry, name))
    answer = answer_of(kind.spoil(clean(geometry)), tmp_path)
    assert misses(kind, answer) == [], answer


def test_there_are_sixty_kinds_each_named_once():
    names = [(kind.geometry, kind.name) for kind in kinds()]
    assert len(names) >= 60
    assert len(set(names)) == len(names)


def test_nothing_is_said_of_a_block_that_is_only_noisy():
    block = clean("navigation")
    noise = np.random.default_rng(5).normal(0.0, 0.02, block.image_points.xy.shape)
    noisy = replace(block, image_points=replace(block.image_points, xy=block.image_points.xy + noise))
    result = adjust(noisy)
    assert result.outcome.verdict != "accepted"
    assert diagnose(noisy, adjust, result) == ()


def test_no_unit_is_said_where_nothing_tells_it():
    """Control of decimetres stated as centimetres, no other positions: in any smaller unit it would count for less."""
    block = without_start_values(ten_photographs(1, navigated=False))
    noise = np.random.default_rng(3).normal(0.0, 0.25, block.control.xyz.shape)
    noisy = replace(block, control=replace(block.control, xyz=block.control.xyz + noise))
    result = adjust(noisy)
    assert result.outcome.verdict != "accepted"
    assert not [cause for cause in diagnose(noisy, adjust, result) if "taken for what they are" in cause]


def three_photographs(seed):
    """Three photographs, the neighbours with seven points in common: too few for a pair to be oriented by itself."""
    flight = {"gsd_m": 0.1, "strips": 1, "images_per_strip": 3, "end_lap": 0.6, "side_lap": 0.4,
              "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0]}  # fmt: skip
    ties = {"per_image": 3, "probability": 1.0, "sigma_um": 2.0}
    control = {"distance_bases": 1.0, "sigma_m": [0.03, 0.03, 0.05], "check_points": 0}
    block, _ = small_block(seed, flight=flight, tie_points=ties, control=control)
    most_rays = np.argsort(-np.bincount(block.image_points.point, minlength=len(block.points)), kind="stable")
    return sub_block(block, np.arange(3), ~np.isin(np.arange(len(block.points)), most_rays[1:5]))[0]


@pytest.mark.parametrize("seed", [1, 3])
def test_three_photographs_begin_with_their_start_values(seed):
    """X and Y of control exchanged are said; without start values there is no model of so few points."""
    block = three_photographs(seed)
    wrong = replace(block, control=replace(block.control, xyz=block.control.xyz[:, [1, 0, 2]]))
    causes = diagnose(wrong, adjust, adjust(wrong))
    assert [cause for cause in causes if cause.startswith("coordinates of control points fit")]
    assert "X and Y exchanged" in causes[0]
    assert free_model(without_start_values(block)) is None


def test_the_model_of_the_image_points_leaves_a_mirrored_photograph_out():
    model = free_model(image_points(negated(0), 4)(clean("control")))
    assert np.flatnonzero(~model.joined).tolist() == [4]


def test_the_model_of_the_image_points_is_the_block():
    """Laid on the control it puts the projection centres where they are, to some decimetres at 750 m."""
    block, truth = small_block()
    model = free_model(block)
    placed = fit(gather(block, model), ("control",)).placed
    assert np.abs(placed(model.centre) - truth.centre).max() < 1.0


def test_placing_is_not_spoilt_by_wrong_positions():
    rng = np.random.default_rng(2)
    source = rng.normal(size=(12, 3))
    turn, shift = exponential(np.array([0.3, -1.0, 2.0])), np.array([500.0, -20.0, 7.0])
    target = 40.0 * source @ turn.T + shift
    spoilt = target.copy()
    spoilt[[1, 7, 8]] += rng.normal(0.0, 100.0, (3, 3))
    placed = lay_on(source, spoilt, np.array([0.0, 0.0, -1.0]))
    np.testing.assert_allclose(placed(source), target, atol=0.01)


def test_a_strip_is_placed_with_its_direction_of_view_down():
    line = np.outer(np.arange(6.0), [1.0, 0.0, 0.0])
    placed = lay_on(line, 100.0 * line[:, [1, 0, 2]] + [0.0, 0.0, 900.0], np.array([0.0, 1.0, 0.0]))
    down = placed(np.array([[0.0, 1.0, 0.0]])) - placed(np.zeros((1, 3)))
    np.testing.assert_allclose(down[0], [0.0, 0.0, -100.0], atol=1e-6)


def test_parts_of_a_block():
    block = clean("control")
    assert [len(part) for part in connected_parts(block)] == [10]
    kind = next(kind for kind in kinds() if kind.name.startswith("strips without"))
    assert [len(part) for part in connected_parts(kind.spoil(block))] == [5, 5]


def test_of_a_large_block_the_part_around_the_worst_photograph_is_searched():
    block, _ = small_block(flight={"gsd_m": 0.1, "strips": 6, "images_per_strip": 15, "end_lap": 0.6, "side_lap": 0.3})
    worst = 40
    w = np.ones_like(block.image_points.xy)
    w[block.image_points.image == worst] = 90.0
    part, is_part = sampled(block, SimpleNamespace(rays=SimpleNamespace(w=w)))
    assert is_part
    assert len(part.images) == MOST_PHOTOGRAPHS
    assert len(part.image_points) <= MOST_RAYS
    assert block.images.names[worst] in part.images.names
    assert len(connected_parts(part)) == 1


def test_the_cause_of_a_failure_is_printed(tmp_path, capsys):
    """Strips without a common point have no result with control in one of them only."""
    kind = next(kind for kind in kinds() if (kind.geometry, kind.name[:14]) == ("control", "strips without"))
    write_block(kind.spoil(clean("control")), tmp_path / "block")
    assert run_adjust(tmp_path / "block", tmp_path / "result", None, None, None, False, False) == 1
    said = capsys.readouterr().err
    assert "rank deficient" in said
    assert "because the photographs fall into 2 parts without a common point" in said


@pytest.fixture(scope="module")
def sparse_control():
    """More photographs than the search works with, and one control point for every fifteen of them."""
    block, _ = small_block(
        flight={"gsd_m": 0.1, "strips": 6, "images_per_strip": 15, "end_lap": 0.7, "side_lap": 0.4},
        tie_points={"per_image": 25, "sigma_um": 2.0},
        control={"positions": [[x, y] for x in (0.0, 0.5, 1.0) for y in (0.0, 1.0)], "sigma_m": [0.03, 0.03, 0.05]},
    )
    return block


def test_a_part_of_a_large_block_has_the_control_that_holds_it(sparse_control):
    part, is_part = sampled(sparse_control, None)
    assert is_part
    assert MOST_PHOTOGRAPHS <= len(part.images) <= len(sparse_control.images)
    own = part.control.point[~part.control.is_check]
    rays = np.bincount(part.image_points.point, minlength=len(part.points))[own]
    assert (rays >= 2).sum() >= ENOUGH_CONTROL
    assert adjust(part).outcome.status == "converged"


def test_a_change_is_proven_by_an_adjustment_of_a_large_block_too(sparse_control):
    block = focal_length(0.9)(sparse_control)
    said = " ".join(diagnose(block, adjust, adjust(block)))
    assert "1.11" in said, said
    assert "principal distance" in said
    assert "no result" not in said


def test_what_has_no_result_explains_nothing():
    assert not explains(FAILED, FAILED)
    assert not explains(Trial("rejected", 9.0, 9.0, 1.0), FAILED)
    assert explains(FAILED, Trial("accepted", 1.0, 1.0, 1.0))
