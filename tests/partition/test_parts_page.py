"""The page of a block in parts against that of the block in one piece."""

import json
import re
from dataclasses import replace
from html import unescape

import numpy as np
import pyarrow.parquet as pq
import pytest

import aerotri
from aerotri.partition import adjusting
from aerotri.report.pages import parts as page
from aerotri.statistics.photograph_residuals import photograph_residuals
from small_blocks import LONG_FLIGHT, small_block, with_adjustment
from statistics_blocks import with_changing_strips

HEADED = re.compile(r"<(?:h3|summary)[^>]*>(.*?)</(?:h3|summary)>(.*?)(?=<h3|<summary|<h2)", re.DOTALL)


@pytest.fixture(scope="module")
def flown():
    """A block with some gross errors, and a lens that errs otherwise in every strip."""
    positions = {"gnss": {"sigma_m": [0.05, 0.05, 0.08]}}
    block, _ = small_block(seed=4, parameters="brown:K1+K2", flight=LONG_FLIGHT, **positions)
    block = with_changing_strips(block, 1, 3.0)
    rays = block.image_points
    xy = rays.xy.copy()
    xy[np.random.default_rng(2).choice(len(xy), 5, replace=False)] += 0.05
    return with_adjustment(replace(block, image_points=replace(rays, xy=xy)), model_part="on")


@pytest.fixture(scope="module")
def both(flown, tmp_path_factory):
    """Folders of the results in one piece and in three parts, and the second result."""
    place = tmp_path_factory.mktemp("both")
    aerotri.adjust(flown, explain=False).save(place / "one")
    aerotri.divide(flown, place / "block", parts=3)
    return place / "one", place / "parts", aerotri.adjust_parts(place / "block", place / "parts")


def tables_of(folder):
    """Rows of the tables of a page by their headings, as sets of texts."""
    text = (folder / "report.html").read_text(encoding="utf-8")
    found = {}
    for heading, below in HEADED.findall(text):
        rows = re.findall(r"<tr>(.*?)</tr>", below, re.DOTALL)
        cells = [
            tuple(unescape(re.sub("<[^>]+>", "", c)).strip() for c in re.findall(r"<t[dh].*?</t[dh]>", r)) for r in rows
        ]
        found[re.sub(r" *<.*", "", heading)] = set(cells)
    return found


def test_tables_are_those_of_one_piece(both):
    one, parts, _ = both
    expected, found = tables_of(one), tables_of(parts)
    same = [
        "Groups of observations", "Precision of the object points", "Positions, adjusted − given",
        "Control points, one by one", "Check points, one by one", "Rays of control and check points, one by one",
        "Photographs with the largest residuals", "Suspected gross errors", "The 30 largest residuals",
        "The 15 weakest points", "The 15 weakest photographs", "Exterior orientation",
    ]  # fmt: skip
    assert set(same) <= set(expected)
    for heading in same:
        assert expected[heading], heading
        assert found[heading] == expected[heading], heading
    assert {path.name for path in (parts / "plots").iterdir()} >= {
        f"{name}.svg"
        for name in (
            "block_plan", "overlap", "trajectory", "error_ellipses", "ground_points", "systematic_errors",
            "averaged_residuals", "residual_histogram", "photograph_residuals", "rays_per_point",
        )
    }  # fmt: skip


def test_total_sigma_is_that_of_one_piece(both):
    one, parts, found = both
    expected, said = (
        json.loads((place / "adjustment.json").read_text(encoding="utf-8"))["model_part"] for place in (one, parts)
    )
    assert [said[key] for key in ("scheme", "clusters")] == [expected[key] for key in ("scheme", "clusters")]
    assert said["method"] == expected["method"] == "field"
    assert [test["scheme"] for test in said["tests"]] == [test["scheme"] for test in expected["tests"]]
    assert said["ratio_height"] == pytest.approx(expected["ratio_height"], rel=1e-4)
    assert said["ratio_height"] > 1.1
    assert "total σ (tX, tY, tZ)" in found.warnings[0]
    assert "σ without the model part" not in (parts / "report.html").read_text(encoding="utf-8")


def test_parts_stand_side_by_side(both, flown):
    _, parts, found = both
    rows = {row[0]: row for row in tables_of(parts)["The parts"] if row and row[0].isdigit()}
    assert set(rows) == set(found.parts)
    assert sum(int(row[4]) for row in rows.values()) == len(flown.points)
    twice = sum(int(row[2]) for row in rows.values()) - len(flown.images)
    assert 0 < twice < sum(int(row[3]) for row in rows.values())
    assert (parts / "work_list.csv").exists()
    beyond = 0
    for part in found.parts:
        table = pq.read_table(parts / "parts" / part / "residuals.parquet", columns=["wx", "wy"])
        w = np.column_stack([table["wx"].to_numpy(), table["wy"].to_numpy()]).astype(float)
        beyond += int((np.nan_to_num(np.abs(w)).max(axis=1) > 3.2905).sum())
    assert beyond == sum(int(row[7]) for row in rows.values()) > 0


def test_nothing_is_drawn_where_that_is_not_wanted(flown, tmp_path):
    aerotri.divide(with_adjustment(flown, model_part="off"), tmp_path / "block", parts=2)
    found = aerotri.adjust_parts(tmp_path / "block", tmp_path / "result", plots=False)
    assert not (tmp_path / "result" / "report.html").exists()
    assert not (tmp_path / "result" / "plots").exists()
    # model_part = "off" asks for none
    assert found.warnings == ()


def test_a_sample_is_drawn_and_what_is_exact_stays(flown, both, tmp_path, monkeypatch):
    monkeypatch.setattr(adjusting, "SAMPLE_RAYS", 600)
    monkeypatch.setattr(page, "MOST_DRAWN", 25)
    aerotri.divide(flown, tmp_path / "block", parts=3)
    found = aerotri.adjust_parts(tmp_path / "block", tmp_path / "result")
    picture = found.record.picture
    assert picture.every == 4
    assert len(picture.sample.block.image_points) < 0.5 * len(flown.image_points)
    text = (tmp_path / "result" / "report.html").read_text(encoding="utf-8")
    assert f"points with {len(page._drawn(found.record)[0].block.image_points)} rays, chosen by their names" in text
    assert "Plans show 21 of 42 photographs" in text
    exact, sampled = tables_of(both[1]), tables_of(tmp_path / "result")
    same = (
        "Groups of observations", "Photographs with the largest residuals", "The 30 largest residuals",
        "The 15 weakest points", "Check points, one by one", "Exterior orientation", "The parts",
    )  # fmt: skip
    for heading in same:
        assert sampled[heading] == exact[heading], heading
    assert sampled["Precision of the object points"] != exact["Precision of the object points"]


def test_sums_of_photographs_are_those_of_all_rays(both, flown):
    _, _, found = both
    whole = photograph_residuals(aerotri.adjust(with_adjustment(flown, model_part="off")).adjusted)
    picture = found.record.picture
    row = {name: k for k, name in enumerate(flown.images.names)}
    rows = [row[name] for name in picture.sample.block.images.names]
    for key in ("rays", "rms_px", "ratio", "limit"):
        np.testing.assert_allclose(getattr(picture.residuals, key), getattr(whole, key)[rows], rtol=1e-5)
