"""Accuracy by check points: numbers of the standard, every requirement kept and missed, layouts, sentences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.diagnosis.accuracy import (
    assessed,
    coordinate_errors,
    layout_of,
    skewness,
    smallest_rectangle,
    suspect_errors,
)
from aerotri.diagnosis.accuracy_inspire import inspire_accuracy
from aerotri.diagnosis.accuracy_rules import class_text, points_for_area, reached
from aerotri.results.accuracy import AccuracyRecord, Asked, CheckedPoints

SIDE = 1000.0
GROUND = np.array([[0.0, 0.0], [SIDE, 0.0], [SIDE, SIDE], [0.0, SIDE]])
KEPT = {"control": 0.004, "survey": 0.004}
"""m, survey errors that a class of 5 cm allows."""


def grid(n: int) -> np.ndarray:
    """(n, 2) places, spread over the square."""
    k = int(np.ceil(np.sqrt(n)))
    centres = (np.arange(k) + 0.5) / k * SIDE
    return np.stack(np.meshgrid(centres, centres), axis=-1).reshape(-1, 2)[:n]


def points(difference: np.ndarray, survey: float = 0.02, vegetated: int = 0) -> CheckedPoints:
    """Check points with given differences; the last ones stand in vegetation."""
    n = len(difference)
    names = np.array([f"K{k:02d}" for k in range(n)])
    return CheckedPoints(names, grid(n), difference, np.full((n, 3), survey), np.arange(n) >= n - vegetated)


def noise(n: int, sigma: float = 0.01) -> np.ndarray:
    """(n, 3) m, symmetric about zero: nothing is skewed, shifted or stands out."""
    half = np.random.default_rng(3).uniform(0.2, 1.5, (n // 2, 3)) * sigma
    return np.vstack([half, -half, *([np.zeros((1, 3))] * (n % 2))])


def record(p: CheckedPoints, control: float = KEPT["control"], verdict: str = "accepted", **asked) -> AccuracyRecord:
    """What is said of check points over a square kilometre."""
    empty = AccuracyRecord("block", "local", verdict, p, Asked(**asked), (), np.full((6, 3), control), None)
    return assessed(empty, GROUND)


def outcome(r: AccuracyRecord) -> dict[str, str]:
    return {one.name: one.met for one in r.requirements}


@pytest.mark.parametrize(("fit", "with_survey"), [(1.00, 2.24), (5.00, 5.39), (10.00, 10.20)])
def test_survey_error_is_included(fit, with_survey):
    """Table 7.4 of the standard: the fit with a survey of 2.0 cm, cm to the last digit printed."""
    signs = np.where(np.arange(30) % 2, 1.0, -1.0)
    r = record(points(np.column_stack([signs, signs, signs]) * fit / 100.0, survey=0.02))
    for one in r.errors[:3]:
        assert 100.0 * one.fit == pytest.approx(fit)
        assert round(100.0 * one.rmse, 2) == with_survey
    assert round(100.0 * r.nva, 2) == with_survey
    assert r.rmse_h == pytest.approx(np.hypot(r.errors[0].rmse, r.errors[1].rmse))
    assert r.rmse_3d**2 == pytest.approx(r.rmse_h**2 + r.nva**2)


def test_measures_of_inspire_and_the_data_they_are_recommended_for():
    """Table 11 of D2.8.II.1: heights a third, plan a sixth of the spacing; a sixth of the interval; E/10 000."""
    signs = np.where(np.arange(30) % 2, 1.0, -1.0)
    sizes = np.array([0.03, 0.04, 0.12])
    found = inspire_accuracy(record(points(signs[:, None] * sizes, survey=0.0)))
    assert (found.rmse_x, found.rmse_y, found.rmse_z) == pytest.approx(tuple(sizes))
    assert found.rmse_p == pytest.approx(0.05)
    assert (found.spacing, found.interval, found.scale) == pytest.approx((0.36, 0.72, 500.0))
    flat = inspire_accuracy(record(points(signs[:, None] * [0.03, 0.04, 0.01], survey=0.0)))
    assert flat.spacing == pytest.approx(0.30)
    without = inspire_accuracy(record(points(np.zeros((0, 3)))))
    assert np.isnan([without.rmse_p, without.spacing, without.interval, without.scale]).all()


@pytest.mark.parametrize(
    ("area", "count"),
    [(0.01, 30), (500, 30), (500.4, 30), (501, 35), (750, 35), (751, 40), (2500, 70), (5000, 120), (90000, 120)],
)
def test_number_by_area(area, count):
    """Rows of table C.1, in whole km², and the largest number."""
    assert points_for_area(area) == count


def test_everything_kept():
    """Thirty-six good points in a grid: every requirement that a class allows is met, and the sentence says tested."""
    r = record(points(noise(36), KEPT["survey"]), horizontal=0.05, vertical=0.05)
    assert {one.name for one in r.requirements if one.met != "met"} == set()
    assert r.met == "met"
    plan, height = r.statements
    assert "was tested to meet" in plan
    assert "for a 5(cm) RMSE_H Horizontal Positional Accuracy Class" in plan
    assert f"RMSE_H = {100 * r.rmse_h:.2f}(cm)" in plan
    assert f"(NVA) was found to be RMSE_V = {100 * r.nva:.2f}(cm)" in height
    assert not r.warnings


def test_class_that_is_not_reached_is_not_claimed():
    """The class reached, rounded up to a millimetre, stands in the sentence."""
    r = record(points(noise(36, 0.05), KEPT["survey"]), horizontal=0.02, vertical=0.02)
    assert outcome(r)["Horizontal accuracy class"] == outcome(r)["Vertical accuracy class (NVA)"] == "not met"
    for text, rmse in zip(r.statements, (r.rmse_h, r.nva), strict=True):
        assert f"for a {class_text(reached(rmse))}(cm)" in text
        assert rmse <= reached(rmse) <= rmse + 1e-3
    assert r.met == "not met"


@pytest.mark.parametrize("what", ["check points", "control points"])
def test_weak_survey_limits_the_class(what):
    """Points surveyed to more than half the class: the requirement fails, and the sentence claims twice their error."""
    weak = {"check points": {"survey": 0.022, "control": 0.004}, "control points": {"survey": 0.004, "control": 0.04}}
    values = weak[what]
    r = record(points(noise(36, 0.001), values["survey"]), values["control"], horizontal=0.06, vertical=0.043)
    found = outcome(r)
    assert found[f"Survey of the {what} in plan"] == found[f"Survey of the {what} in height"] == "not met"
    sigma = values["survey" if what == "check points" else "control"]
    assert f"for a {class_text(reached(2.0 * np.sqrt(2.0) * sigma))}(cm) RMSE_H" in r.statements[0]
    assert f"for a {class_text(reached(2.0 * sigma))}(cm) RMSE_V" in r.statements[1]


def test_half_the_class_is_enough():
    r = record(points(noise(36, 0.001), 0.025), 0.025, vertical=0.05)
    found = outcome(r)
    assert found["Survey of the check points in height"] == found["Survey of the control points in height"] == "met"


def test_fewer_than_thirty_are_said():
    r = record(points(noise(12), KEPT["survey"]), horizontal=0.05, vertical=0.05)
    assert outcome(r)["Check points in plan"] == "not met"
    assert r.met == "not met"
    for text in r.statements:
        assert "call for a minimum of thirty (30) checkpoints" in text
        assert "performed using ONLY 12 checkpoints" in text
        assert "tested to meet" not in text
        assert "produced to meet a 5(cm)" in text


@pytest.mark.parametrize("asked", [{}, {"horizontal": 0.001, "vertical": 0.001}], ids=["nothing", "more than found"])
def test_nothing_was_produced_to_meet_a_class_that_nobody_asked_for(asked):
    """Of few check points: what was found stands there, and no class that the program chose."""
    r = record(points(noise(12), KEPT["survey"]), **asked)
    assert len(r.statements) == 2
    for text, rmse in zip(r.statements, (r.rmse_h, r.nva), strict=True):
        assert "produced to meet" not in text
        assert f"= {100 * rmse:.2f}(cm) using the reduced number of checkpoints." in text


def test_without_check_points():
    """Nothing is tested: said plainly with a remedy; a class asked for may only be called produced to meet."""
    none = points(np.zeros((0, 3)))
    r = record(none, horizontal=0.05, vertical=0.1)
    assert r.met == "not met"
    assert np.isnan([r.rmse_h, r.nva, r.vva, r.rmse_3d]).all()
    assert "There are no check points" in r.warnings[0]
    assert "--check NAME" in r.warnings[0]
    assert all("was produced to meet" in text for text in r.statements)
    assert ["5(cm)" in r.statements[0], "10(cm)" in r.statements[1]] == [True, True]
    assert record(none).statements == ()
    # control surveyed to more than half the class does not even allow the intention
    assert record(none, 0.03, horizontal=0.05, vertical=0.05).statements == ()


def test_vegetation():
    """VVA is of the points in vegetation alone, reported without a limit; they do not count for NVA."""
    d = noise(72)
    d[36:, 2] = 0.3
    r = record(points(d, KEPT["survey"], vegetated=36), horizontal=0.05, vertical=0.05)
    assert (r.errors[2].count, r.errors[3].count) == (36, 36)
    assert r.vva == pytest.approx(np.hypot(0.3, KEPT["survey"]))
    assert r.nva < 0.02
    assert r.met == "met"
    assert "Vegetated Vertical Accuracy (VVA) was found to be RMSE_V = 30.00(cm)" in r.statements[2]
    assert not [one for one in r.suspects if one.axis == "Z"]


def test_mean_error():
    """A quarter of the target is the limit; the horizontal target is shared by X and Y."""
    limit = 0.25 * 0.05 / np.sqrt(2.0)
    for shift, expected in ((0.99 * limit, "met"), (1.01 * limit, "not met")):
        r = record(points(noise(36) + [shift, 0.0, 0.0], KEPT["survey"]), horizontal=0.05)
        assert outcome(r)["Mean error"] == expected


def test_blunders_and_outliers_are_named():
    """Three times the target is a blunder; without a target, what stands out from the others."""
    d = noise(36)
    d[7, 2] = -0.151
    p = points(d, KEPT["survey"])
    (blunder,) = suspect_errors(p, Asked(vertical=0.05))
    assert (blunder.point, blunder.axis, blunder.value) == ("K07", "Z", -0.151)
    assert "blunder" in blunder.reason
    (outlier,) = suspect_errors(p, Asked())
    assert "stands out" in outlier.reason
    r = record(p, vertical=0.05)
    assert outcome(r)["No blunder among the check points"] == "not met"
    assert any("K07" in text for text in r.warnings)
    assert not suspect_errors(points(noise(36)), Asked())


def test_skewness():
    """Known values: 0 for a symmetric sample, and the usual estimator for a small one."""
    assert skewness(noise(36)[:, 0])[0] == pytest.approx(0.0, abs=1e-12)
    values = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 30.0])
    n, m = len(values), values.mean()
    expected = n / ((n - 1) * (n - 2)) * np.sum(((values - m) / values.std(ddof=1)) ** 3)
    assert skewness(values)[0] == pytest.approx(expected)
    draws = np.random.default_rng(5).standard_normal((2000, 30))
    found = np.array([skewness(row)[0] for row in draws])
    assert found.std() == pytest.approx(skewness(draws[0])[1], rel=0.1)
    d = noise(36)
    d[:, 2] = np.exp(np.linspace(-2.5, 2.5, 36)) / 100.0
    assert outcome(record(points(d)))["Errors distributed normally"] == "not met"


def test_layout():
    """Quarters of a turned rectangle, the smallest distance, points too near one another."""
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    box = np.array([[0.0, 0.0], [4000.0, 0.0], [4000.0, 1000.0], [0.0, 1000.0]])
    inside = np.array([[500.0, 100.0], [520.0, 100.0], [3000.0, 200.0], [3500.0, 800.0], [700.0, 900.0]])
    p = replace(points(noise(5)), place=inside @ turn.T)
    layout = layout_of(p, np.vstack([box, [[2000.0, 500.0]]]) @ turn.T)
    assert layout is not None
    assert layout.area == pytest.approx(4e6)
    assert layout.diagonal == pytest.approx(np.hypot(4000.0, 1000.0))
    assert sorted(layout.quadrants) == [1, 1, 1, 2]
    assert layout.spacing == pytest.approx(20.0)
    assert layout.crowded == ("K00", "K01")
    # each quarter is counted where its corner is
    for k, corner in enumerate(layout.corners):
        alone = replace(points(noise(1)), place=0.9 * corner[None] + 0.1 * layout.corners.mean(axis=0))
        found = layout_of(alone, box @ turn.T)
        assert found is not None
        assert found.quadrants.tolist() == np.eye(4, dtype=int)[k].tolist()


def test_no_area():
    """Ground points on a line, or none: nothing is said of number and places."""
    line = np.column_stack([np.arange(5.0), np.arange(5.0)])
    for ground in (line, np.zeros((0, 2))):
        assert layout_of(points(noise(6)), ground) is None
    empty = AccuracyRecord("b", "local", "accepted", points(noise(36)), Asked(), (), np.zeros((0, 3)), None)
    r = assessed(empty, line)
    assert outcome(r)["Check points for the project area"] == "cannot be said"
    stated = assessed(replace(empty, asked=Asked(project_area=1e9)), line)
    assert next(one for one in stated.requirements if "project area" in one.name).asked == "40 for 1e+03 km²"


def test_smallest_rectangle_of_a_triangle():
    """It has twice the area of the triangle, whichever side it stands on."""
    corners = smallest_rectangle(np.array([[0.0, 0.0], [6.0, 0.0], [2.0, 3.0]]))
    sides = np.hypot(*(np.roll(corners, -1, axis=0) - corners).T)
    assert sides[0] * sides[1] == pytest.approx(18.0)


def test_survey_error_that_is_not_stated():
    """The RMSE are too small then: said, and no sentence is made of them."""
    r = record(points(noise(36), survey=0.0), horizontal=0.05, vertical=0.05)
    assert outcome(r)["Survey of the check points in plan"] == "cannot be said"
    assert "36 check points have no survey error" in r.warnings[0]
    assert r.statements == ()


def test_coordinates_that_are_missing():
    """Height points count in height alone, plan points in plan alone."""
    d = noise(36)
    d[:4, :2], d[4:10, 2] = np.nan, np.nan
    counts = [one.count for one in coordinate_errors(points(d))]
    assert counts == [32, 32, 30, 0]


@pytest.mark.parametrize(("verdict", "met"), [("doubtful", "cannot be said"), ("rejected", "not met")])
def test_verdict_of_the_adjustment(verdict, met):
    r = record(points(noise(36), KEPT["survey"]), verdict=verdict, horizontal=0.05, vertical=0.05)
    assert r.met == met
    assert any(verdict in text for text in r.warnings)
    assert (r.statements == ()) == (verdict == "rejected")


def test_nothing_asked():
    """Numbers and the class reached, but no outcome of a class."""
    r = record(points(noise(36), KEPT["survey"]))
    assert outcome(r)["Horizontal accuracy class"] == "cannot be said"
    assert r.met == "cannot be said"
    assert f"for a {class_text(reached(r.rmse_h))}(cm)" in r.statements[0]
