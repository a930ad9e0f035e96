"""Work list, control rays, free check and comparison as tables: known cells, limits said, nothing steers a terminal."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from aerotri.diagnosis.free_verdict import in_words
from aerotri.diagnosis.work_list import WorkItem, WorkList
from aerotri.formats.results.free_check import free_check_json
from aerotri.formats.results.run_comparison import comparison_json
from aerotri.report.pages.adjustment import Findings, report_html
from aerotri.report.tables import comparison as comparison_tables
from aerotri.report.tables import work as work_tables
from aerotri.report.tables.adjustment import Column, Table
from aerotri.report.tables.terminal import WIDEST_CELL, table_lines
from aerotri.statistics.comparison import compare
from aerotri.statistics.similarity import Similarity
from aerotri.strategies.free_stages import CONTROL, FREE, POSITIONS, FreeCheck, Stage, Suspect
from synthetic import make_adjusted_block

HOSTILE = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def adjusted():
    return make_adjusted_block(2, 5, 80, n_control=6, n_check=5)


def free_check(name="C05", **changes):
    suspect = Suspect("control", name, "Z", -12.5, 0.734)
    residual = np.array([[0.01, -0.02, 0.03], [np.nan, np.nan, 0.5]])
    found = FreeCheck(
        stages=(
            Stage(FREE, "converged", "", 1.02, 1040.4, 1000),
            Stage(CONTROL, "converged", "", 1.2, 1480.0, 1020, 27, 21.1, 2.3, 12.5, 4.1, (suspect,)),
        ),
        sigma0_full=1.2, spread=1.0, beyond=0, point=np.array([name, "C06"]),
        similarity=Similarity(np.ones(3), np.array([1e-3, 0.0, 0.0]), 1.0 + 4e-5, residual, 3), position_offset=None,
    )  # fmt: skip
    return replace(found, **changes)


def test_work_table():
    items = (
        WorkItem(1, "left out", "01_004", "left out", np.inf, "measure"),
        WorkItem(3, "ray", "12 in 01_001", "wx +4.0", 1.2157, "look"),
    )
    work = WorkList(items, {"ray": 7, "left out": 1})
    table = work_tables.work_table(work)
    assert table.texts[0] == ("1", "wrong", "left out", "01_004", "left out", "–", "measure")
    assert table.texts[1][1:6] == ("doubtful", "ray", "12 in 01_001", "wx +4.0", "1.2")
    assert work_tables.work_counts(work) == "Found: 1 left out, 7 rays; 2 of 8 are listed."
    assert work_tables.work_counts(WorkList((), {})) == ""


def test_control_rays_table(adjusted):
    table = work_tables.control_rays_table(adjusted)
    known = np.concatenate([adjusted.control.point, adjusted.check.point])
    assert len(table) == np.isin(adjusted.block.image_points.point, known).sum()
    w = [max(abs(row[3]), abs(row[4])) for row in table.rows if np.isfinite(row[3])]
    assert w[0] == max(w)
    assert {row[1] for row in table.rows} == {"control", "check"}
    names = [row[0] for row in table.rows]
    assert sum(a != b for a, b in itertools.pairwise(names)) == len(set(names)) - 1, "point by point"


def test_free_check_verdicts():
    assert free_check().verdict == "control"
    assert "Look first at C05: given Z too large by 0.734 m (w 12.5)." in in_words(free_check())
    stages = free_check().stages
    good = replace(stages[1], ratio=1.1, largest_w=2.0, suspects=())
    assert free_check(stages=(stages[0], good)).verdict == "fits"
    # one coordinate that no chance explains decides even where all together pass
    single = replace(stages[1], ratio=1.1)
    assert free_check(stages=(stages[0], single)).verdict == "control"
    poor = replace(stages[0], sigma0=1.3)
    assert free_check(stages=(poor, good)).verdict == "tie points"
    assert free_check(stages=(poor, stages[1])).verdict == "both"
    assert free_check(stages=(replace(stages[0], sigma0=1.9), good), spread=1.85).verdict == "tie points"
    positions = replace(stages[1], name=POSITIONS)
    assert free_check(stages=(stages[0], good, positions)).verdict == "positions"
    together = replace(stages[1], largest_w=3.5)
    sentence = in_words(free_check(stages=(stages[0], together)))
    assert "No single value explains it (the largest: C05: given Z too large" in sentence
    assert "off by 0.010, 0.020, 0.354 m" in sentence
    untested = replace(good, ratio=np.nan)
    assert free_check(stages=(stages[0], untested)).verdict == "not tested"
    no_result = Stage(CONTROL, "rank deficient", "too little control", np.nan, np.nan, 0)
    assert free_check(stages=(stages[0], no_result)).verdict == "control"
    lost = Stage(FREE, "rank deficient", "no ties", np.nan, np.nan, 0)
    assert free_check(stages=(lost,)).verdict == "failed"
    assert "approximately" in in_words(free_check(robust=True))


def test_free_check_tables():
    check = free_check()
    assert work_tables.stages_table(check).texts[1] == (
        CONTROL, "converged", "1.200", "1020", "1480.0", "21.10", "2.30", "12.5", "4.1", "does not fit",
    )  # fmt: skip
    similarity = work_tables.similarity_table(check)
    assert [row[0] for row in similarity.texts] == ["C05", "C06", "RMS"]
    assert similarity.texts[1][1:3] == ("–", "–")
    text = work_tables.similarity_text(check)
    assert "+63.66, +0.00, +0.00 mgon" in text
    assert "+40.0 ppm" in text
    lines = work_tables.free_check_lines(check)
    assert lines[0] == "free adjustment: control"
    assert lines[-1] == "  Look first at C05: given Z too large by 0.734 m (w 12.5)."


def test_free_check_json_is_plain():
    content = json.loads(json.dumps(free_check_json(free_check()), allow_nan=False))
    assert content["verdict"] == "control"
    assert content["stages"][1]["suspects"][0] == {
        "kind": "control", "name": "C05", "component": "Z", "w": -12.5, "error": 0.734, "error_px": None,
    }  # fmt: skip
    assert content["stages"][0]["fits"] is None
    assert content["transformation"]["points"][1] == {"point": "C06", "dX": None, "dY": None, "dZ": 0.5}
    assert content["transformation"]["scale_ppm"] == pytest.approx(40.0)
    assert free_check_json(free_check(similarity=None))["transformation"] is None


def test_page_with_a_free_check(adjusted):
    without = report_html(adjusted, {})
    assert "Free adjustment" not in without
    assert 'id="work"' in without
    page = report_html(adjusted, {}, Findings(free_check=free_check()))
    assert "<h2>Free adjustment</h2>" in page
    assert "given Z too large by 0.734 m" in page
    places = [page.index(text) for text in ('id="ground"', "<h2>Free adjustment</h2>", 'id="camera"', 'id="work"')]
    assert places == sorted(places)


def test_hostile_names_stay_text(adjusted):
    item = WorkItem(1, "ray", HOSTILE, HOSTILE, 2.0, HOSTILE)
    findings = Findings(WorkList((item,), {"ray": 1}), free_check(HOSTILE))
    page = report_html(adjusted, {}, findings)
    assert page.count("<script") == report_html(adjusted, {}).count("<script")
    assert page.count("&lt;script&gt;") >= 6


def test_nothing_to_look_at(adjusted):
    assert "Nothing stands out." in report_html(adjusted, {}, Findings(WorkList((), {})))


def test_table_lines_align():
    table = Table("Title", (Column("name"), Column("value", "m", ".2f")), (("a", 1.0), ("longer", -12.5)))
    assert table_lines(table) == ["Title", "  name    value [m]", "  a            1.00", "  longer     -12.50"]
    wide = Table("T", (Column("name"),), (("x" * 100,),))
    assert len(table_lines(wide)[-1].strip()) == WIDEST_CELL
    assert table_lines(replace(wide, rows=())) == []
    assert all(line.isprintable() for line in table_lines(replace(wide, rows=(("\x1b[2J",),))))


def test_comparison_tables(adjusted):
    centre = adjusted.images.centre.copy()
    centre[3, 1] += 0.12
    settings = adjusted.block.settings
    other = replace(settings, adjustment=replace(settings.adjustment, additional_parameters=(("bluh", ("1", "2")),)))
    second = replace(adjusted, images=replace(adjusted.images, centre=centre),
                     block=replace(adjusted.block, settings=other))  # fmt: skip
    comparison = compare(adjusted, second)
    tables = {table.title: table for table in comparison_tables.comparison_tables(comparison, 3)}
    assert tables["Settings that differ"].texts[0] == (
        "adjustment.additional_parameters", "bluh:1-12,ultracam_d:42-73", "bluh:1-2",
    )  # fmt: skip
    elements = tables["Orientation of the 10 photographs in common"]
    assert elements.texts[1] == ("Y0", "m", "0.0379", "0.1200", "2.00", adjusted.block.images.names[3])
    worst = tables["Photographs that changed most"]
    assert len(worst) == 1
    assert worst.texts[0][:4] == (adjusted.block.images.names[3], "2.00", "0.0000", "+0.1200")
    assert not any(title.startswith("Rays") for title in tables)
    assert "Warnings" not in tables


def test_parameters_of_one_run(adjusted):
    p = adjusted.parameters
    keep = np.arange(len(p)) < 10
    fields = ("names", "groups", "kinds", "marks", "value", "max_correlation", "max_correlation_with",
              "total_correlation", "status", "reason")  # fmt: skip
    fewer = replace(p, **{f: getattr(p, f)[keep] for f in fields}, covariance=p.covariance[np.ix_(keep, keep)])
    tables = comparison_tables.comparison_tables(compare(adjusted, replace(adjusted, parameters=fewer)), 5)
    one = next(table for table in tables if table.title == "Parameters of one run only")
    assert one.rows[0][:3] == ("first", "ucd2", len(p) - 10)


def test_comparison_json_is_plain(adjusted):
    angles = adjusted.images.angles.copy()
    angles[2, 2] += np.radians(0.003)
    comparison = compare(adjusted, replace(adjusted, images=replace(adjusted.images, angles=angles)))
    content = json.loads(json.dumps(comparison_json(comparison, 4), allow_nan=False))
    kappa = content["orientations"]["elements"][5]
    assert (kappa["element"], kappa["unit"], kappa["at"]) == ("kappa", "deg", str(adjusted.block.images.names[2]))
    assert kappa["max"] == pytest.approx(0.003)
    assert kappa["max_ratio"] == pytest.approx(0.003 / 0.0006)
    assert content["orientations"]["worst"][0]["kappa"] == pytest.approx(0.003)
    assert content["check_points"]["common_count"] == 5
    assert content["rays"]["counts"]["switched"] == 0
