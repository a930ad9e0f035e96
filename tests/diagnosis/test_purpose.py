"""What a result is good for: positions and shape, the shape alone, or neither; with the numbers."""

import json
from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.diagnosis.purpose import plus_minus, purpose
from aerotri.report.pages.adjustment import report_html
from dense_algebra import TINY
from small_blocks import small_block, with_adjustment

NO_CONTROL = {"positions": [], "check_points": 0}


def block_with(gnss_m=None, settings=None, **changes):
    positions = {} if gnss_m is None else {"gnss": {"sigma_m": [gnss_m, gnss_m, 2.0 * gnss_m]}, "control": NO_CONTROL}
    return with_adjustment(small_block(3, **TINY, **positions, **changes)[0], **(settings or {}))


def adjusted(*arguments, **changes):
    return aerotri.adjust(block_with(*arguments, **changes), explain=False)


@pytest.fixture(scope="module")
def of_metres():
    return adjusted(5.0)


def test_control_makes_positions_good():
    result = adjusted()
    assert (result.verdict, result.good_for) == ("accepted", "absolute")
    heights = result.precision["points"]["absolute_m"]["Z"]
    assert f"heights {plus_minus(heights)}" in result.purpose
    assert heights == pytest.approx(np.nanmedian(result.points["sZ"]))


def test_positions_of_metres_make_the_shape_good_alone(of_metres, tmp_path):
    """Both numbers are said, the scale with what it does to a volume; a saved result says the same when opened."""
    p = of_metres.precision
    assert (of_metres.verdict, of_metres.good_for) == ("accepted", "relative")
    for number in (p["points"]["absolute_m"]["Z"], p["points"]["relative_m"]["Z"]):
        assert plus_minus(number) in of_metres.purpose
    assert f"a volume to {plus_minus(300.0 * p['scale'], ' %')}" in of_metres.purpose
    folder = of_metres.save(tmp_path / "r", plots=False)
    again = aerotri.open_result(folder)
    assert (again.good_for, again.purpose) == (of_metres.good_for, of_metres.purpose)
    content = json.loads((folder / "adjustment.json").read_text(encoding="utf-8"))
    assert (content["good_for"], content["purpose"]) == (of_metres.good_for, of_metres.purpose)
    assert of_metres.summary().splitlines()[:2] == ["verdict: accepted", f"  {of_metres.purpose}"]


def test_the_report_says_it_beside_the_verdict(of_metres):
    page = report_html(of_metres.adjusted, {}).replace("\u00a0", " ")
    assert "<b>Accepted, for its shape only.</b>" in page
    assert of_metres.purpose in page
    assert "Good for use" not in page


def test_nothing_is_known_of_the_place_of_a_free_block():
    result = adjusted(settings={"datum": "inner"}, control={"distance_bases": 3.0, "check_points": 0})
    assert result.good_for == "relative"
    assert "Nothing says where the block lies" in result.purpose
    assert result.precision["points"]["absolute_m"] == dict.fromkeys("XYZ")


def test_large_errors_of_image_points_leave_no_shape():
    """A stated σ far beyond a pixel: what is left of the heights is more than ten pixels."""
    coarse = TINY["tie_points"] | {"sigma_um": 200.0}
    block = small_block(3, flight=TINY["flight"], tie_points=coarse, control=NO_CONTROL,
                        gnss={"sigma_m": [5.0, 5.0, 9.0]})[0]  # fmt: skip
    result = aerotri.adjust(block, explain=False)
    assert result.good_for == "neither"
    assert "pixels on the ground" in result.purpose or result.verdict == "rejected"


def test_lengths_in_the_unit_that_suits_them():
    assert [plus_minus(v) for v in (9.22, 0.0312, 0.00042, 121.0)] == ["± 9.2 m", "± 3.1 cm", "± 0.42 mm", "± 120 m"]


def test_a_doubtful_result_is_good_for_something_if_its_sigma_hold(of_metres):
    doubtful = replace(of_metres.record.local, outcome=replace(of_metres.record.local.outcome, verdict="doubtful"))
    found = purpose(doubtful)
    assert found.good_for == "relative"
    assert found.says == f"By its σ, which are in doubt: g{of_metres.purpose[1:]}"
    rejected = replace(doubtful, outcome=replace(doubtful.outcome, verdict="rejected"))
    assert purpose(rejected).good_for == "neither"
