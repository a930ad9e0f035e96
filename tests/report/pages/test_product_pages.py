"""Pages of a dense surface and of an orthophoto: doubts first, units, the same parts on the page of a run."""

from __future__ import annotations

import copy
import json
import re

import pytest

from aerotri.report.pages.dense import dense_parts
from aerotri.report.pages.ortho import ortho_parts
from aerotri.report.pages.product import product_html
from aerotri.report.pages.run import run_page
from aerotri.report.plots.rendering import RenderedPlot
from aerotri.results.head import Head

ADJUSTED = {
    "verdict": "accepted", "reason": "", "control_points": 6, "check_points": 3,
    "rms_check_m": {"X": 0.012, "Y": 0.011, "Z": 0.049},
}  # fmt: skip
DSM = {
    "block": "site", "photographs": 12, "gsd_m": 0.05, "cell_m": 0.1, "cells": {"all": 9000, "measured": 8000},
    "area_m2": 80.0, "shown_area_m2": 82.0, "coverage": 80.0 / 82.0, "pairs": 11, "photographs_mean": 3.6,
    "sigma_Z_m": {"median": 0.074, "matching": 0.011, "adjustment": 0.072}, "noise_length_m": 0.33,
    "matching_shared": {"sigma_Z_m": 9.9e-5, "length_m": 2.9, "parallax_px": 5e-4},
    "y_parallax_px": {"median": 0.05, "largest": 0.2}, "ground": None, "notes": [], "photographs_missing": [],
    "adjusted": ADJUSTED, "settings": [],
}  # fmt: skip
QUANTILES = {"median": 0.014, "q90": 0.019, "q95": 0.02, "max": 0.03}
ORTHO = {
    "block": "site", "surface": "dsm.tif", "cell_m": 0.05, "columns": 1224, "rows": 920, "gsd_m": 0.05,
    "of_one_adjustment": True,
    "area_m2": {"surface": 2500.0, "orthophoto": 2498.0, "without_photograph": 2.0, "other_photograph": 1.0,
                "bridged": 0.0},
    "sigma_m": {name: dict(QUANTILES) for name in ("total", "surface", "orientation", "image")},
    "viewing_angle_deg": {"median": 12.0, "q90": 20.0, "q95": 25.0, "max": 30.0},
    "seams": {"length_m": 365.0, "difference": 0.002, "difference_of_best": 0.004, "cell_m": 0.5},
    "balance": {"difference_before": 0.006, "difference_after": 0.005},
    "points": [{"point": "K02", "role": "check", "X": 1.0, "Y": 2.0, "column": 3.0, "row": 4.0, "sigma": 0.015},
               {"point": "C02", "role": "control", "X": 1.1, "Y": 2.1, "column": 3.0, "row": 4.0, "sigma": None}],
    "photographs": [{"number": 0, "photograph": "1.jpg", "area_m2": 2498.0}],
    "notes": [], "adjusted": ADJUSTED, "settings": [],
}  # fmt: skip
LARGE = {"dsm": "sigma_Z_m__median", "ortho": "sigma_m__total__median"}
PARTS = {"dsm": (dense_parts, DSM), "ortho": (ortho_parts, ORTHO)}


def changed(content, **changes):
    """A copy with values at paths such as adjusted__verdict."""
    found = copy.deepcopy(content)
    for path, value in changes.items():
        *above, key = path.split("__")
        place = found
        for name in above:
            place = place[name]
        place[key] = value
    return found


@pytest.mark.parametrize("kind", PARTS)
def test_without_doubts_the_page_says_so_and_why(kind):
    parts_of, content = PARTS[kind]
    parts = parts_of(content)
    assert parts.doubts == ()
    page = product_html(parts, content, {}, [], Head())
    assert "Nothing doubtful was found." in page
    assert "6 control points and 3 check points" in page


@pytest.mark.parametrize("kind", PARTS)
def test_what_is_wrong_with_the_adjustment_is_said_first(kind):
    parts_of, content = PARTS[kind]
    wrong = changed(
        content, adjusted__verdict="doubtful", adjusted__reason="two control points disagree", notes=["1 is missing"],
        adjusted__check_points=0, adjusted__control_points=0,
    )  # fmt: skip
    doubts = parts_of(wrong).doubts
    assert doubts[0] == "The adjustment is doubtful: two control points disagree."
    assert "no control points" in doubts[1]
    assert "no check points" in doubts[2]
    assert doubts[3] == "1 is missing."
    page = product_html(parts_of(wrong), wrong, {}, [], Head())
    assert page.index("To know first:") < page.index(doubts[0]) < page.index("Pictures")
    rejected = parts_of(changed(content, adjusted__verdict="rejected", adjusted__reason="mirrored")).doubts
    assert "rejected: mirrored" in rejected[0]


@pytest.mark.parametrize(
    ("kind", "changes", "said"),
    [
        ("dsm", {"coverage": 0.8}, "20.0 % of the ground that pairs of photographs show has no height"),
        ("dsm", {"y_parallax_px__median": 1.24}, "off by 1.2 pixels across their base"),
        ("dsm", {"ground": {"measured": 60, "bridged": 40, "widest_object_m": 30.0,
                            "bridge": {"sigma_at_1_m": 0.02, "power": 0.5}}}, "40.0 % of the ground in dtm.tif"),
        ("ortho", {"area_m2__bridged": 120.0}, "120 m² lie over bridged holes"),
        ("ortho", {"area_m2__without_photograph": 250.0}, "10.0 % of the surface is seen by no photograph"),
        ("ortho", {"sigma_m__total__median": 0.5}, "Positions have a σ of 0.5 m (median), which is 10 cells"),
        ("dsm", {"sigma_Z_m__median": 16.0}, "Heights have a σ of 16 m (median), which is 160 cells"),
    ],
)  # fmt: skip
def test_doubts_of_the_product_are_told(kind, changes, said):
    parts_of, content = PARTS[kind]
    (doubt,) = parts_of(changed(content, **changes)).doubts
    assert said in doubt


def test_a_large_sigma_is_said_once_and_before_all_but_a_wrong_adjustment():
    said = "Heights have a σ of 16 m (median), which is 160 cells."
    large = changed(DSM, sigma_Z_m__median=16.0, notes=[f"heights{said[7:-1]}", "1 is missing"],
                    adjusted__control_points=0)  # fmt: skip
    assert [text == said for text in dense_parts(large).doubts] == [True, False, False]
    wrong = dense_parts(changed(large, adjusted__verdict="rejected")).doubts
    assert "rejected" in wrong[0]
    assert wrong[1] == said
    assert not dense_parts(changed(DSM, sigma_Z_m__median=0.2)).doubts


def test_numbers_have_their_units():
    numbers = dict(dense_parts(DSM).numbers)
    assert numbers["σ of heights, median"] == "0.074 m"
    assert numbers["Errors of matching that do not average out"] == "0.099 mm"
    assert numbers["Their area"] == "80 m²"
    assert numbers["Size of a cell"] == "10 cm"
    assert dict(dense_parts(changed(DSM, noise_length_m=None)).numbers)[
        "Noise length: cells within it share the noise of matching"
    ] == "not known"  # fmt: skip
    numbers = dict(ortho_parts(ORTHO).numbers)
    assert numbers["Photographs used"] == "1 of 1"
    assert numbers["Length of the seams"] == "365 m"
    none = changed(ORTHO, sigma_m__surface=None, of_one_adjustment=False, seams__difference=None)
    assert "σ of the heights is not known and not counted" in ortho_parts(none).sure[0]
    assert dict(ortho_parts(none).numbers)["Colours on both sides of a seam differ by"] == "not known"


@pytest.mark.parametrize("kind", PARTS)
def test_the_page_loads_nothing_and_escapes_names(kind):
    parts_of, content = PARTS[kind]
    hostile = changed(content, block="<script>alert(1)</script>", notes=["a <b> photograph"])
    if kind == "ortho":
        hostile["points"][0]["point"] = "<img src=x>"
    parts = parts_of(hostile)
    plots = {name: RenderedPlot(b"<svg/>", b"png") for name in parts.captions}
    page = product_html(parts, hostile, plots, [("file.tif", "what it is for")], Head())
    assert "<script" not in page
    assert "<img src=x>" not in page
    assert "a <b>" not in page
    assert page.count("<figure") == len(parts.captions)
    assert all(source.startswith("data:") for source in re.findall(r'src="([^"]*)"', page))
    assert "what it is for" in page


@pytest.mark.parametrize("kind", PARTS)
def test_the_page_of_a_run_says_the_same(tmp_path, kind):
    parts_of, content = PARTS[kind]
    content = changed(content, notes=["1 photograph of the block is missing"])
    folder = tmp_path / kind
    (folder / "plots").mkdir(parents=True)
    (folder / f"{kind}.json").write_text(json.dumps(content), encoding="utf-8")
    parts = parts_of(content)
    for name in parts.captions:
        (folder / "plots" / f"{name}.png").write_bytes(name.encode())
    step = {"name": kind, "folder": kind, "what": "Product", "status": "done", "reason": "", "seconds": 1.0,
            "arguments": [kind]}  # fmt: skip
    files = {kind: [("x.tif", "a file")]}
    page = run_page({"source": "photographs", "steps": [step], "seconds": 1.0}, tmp_path, Head(), files)
    for text in (*parts.doubts, *parts.sure, *(small for *_, small in parts.cards), "a file"):
        assert text in page
    for name, value in parts.numbers:
        assert f"<td>{name}</td><td>{value}</td>" in page
    assert page.count("<figure") == len(parts.captions)


@pytest.mark.parametrize("verdict", ["accepted", "doubtful"])
def test_doubts_of_the_products_stand_at_the_top(tmp_path, verdict):
    """Once each, with the products that have them; an accepted adjustment comes after them, another before."""
    adjusted = {"verdict": verdict, "reason": "two disagree", "control_points": 0, "check_points": 3}
    steps = []
    for name, content in (("dsm", DSM), ("ortho", ORTHO)):
        (tmp_path / name).mkdir()
        large = changed(content, adjusted=adjusted, **{LARGE[name]: 16.0})
        (tmp_path / name / f"{name}.json").write_text(json.dumps(large), encoding="utf-8")
        steps.append({"name": name, "folder": name, "what": name, "status": "done", "reason": "", "seconds": 1.0,
                      "arguments": [name]})  # fmt: skip
    (tmp_path / "result").mkdir()
    content = {"verdict": verdict, "reasons": [] if verdict == "accepted" else ["two disagree"]}
    (tmp_path / "result" / "adjustment.json").write_text(json.dumps(content), encoding="utf-8")
    page = run_page({"source": "photographs", "steps": steps, "seconds": 1.0}, tmp_path, Head())
    top = page[: page.index("<h2>Steps</h2>")]
    texts = ("Dense surface: Heights have a σ of 16 m (median), which is 160 cells.",
             "Orthophoto: Positions have a σ of 16 m (median), which is 320 cells.",
             "Dense surface and orthophoto: There are no control points")  # fmt: skip
    assert [top.count(text) for text in texts] == [1, 1, 1]
    assert sorted(texts, key=top.index) == list(texts)
    assert "The adjustment is doubtful" not in top
    doubts, said = top.index("To know first:"), top.index('class="verdict"')
    assert (doubts < said) == (verdict == "accepted")


def test_nothing_is_said_first_where_nothing_is_doubtful(tmp_path):
    (tmp_path / "dsm").mkdir()
    (tmp_path / "dsm" / "dsm.json").write_text(json.dumps(DSM), encoding="utf-8")
    step = {"name": "dsm", "folder": "dsm", "what": "Surface", "status": "done", "reason": "", "seconds": 1.0,
            "arguments": ["dsm"]}  # fmt: skip
    assert "To know first" not in run_page({"source": "p", "steps": [step], "seconds": 1.0}, tmp_path, Head())


SHAPE = "Good for its shape only. Relative to one another heights have ± 3 cm."
ONLY_SHAPE = {"adjusted__good_for": "relative", "adjusted__purpose": SHAPE, "adjusted__scale": 0.048}


@pytest.mark.parametrize(
    ("kind", "relative"),
    [("dsm", {"sigma_Z_m__relative": 0.012, "sigma_Z_m__adjustment_relative": 0.004}),
     ("ortho", {"sigma_m__relative": QUANTILES | {"median": 0.0019}})],
)  # fmt: skip
def test_both_sigma_with_what_each_is_good_for(kind, relative):
    """A block without control: the sentence comes first, and the σ of the shape stands beside the other."""
    parts_of, content = PARTS[kind]
    parts = parts_of(changed(content, **ONLY_SHAPE, **relative))
    assert parts.doubts[0] == SHAPE
    cards = {heading: number for heading, number, _ in parts.cards}
    assert next(number for heading, number in cards.items() if "relative" in heading) in ("0.012 m", "0.0019 m")
    text = " ".join(parts.sure)
    assert "after a shift, rotation and scale of the whole" in text
    assert "The scale is known to ± 4.8 %." in text


def test_page_of_a_run_has_both_sigma_and_says_once_what_the_block_is_good_for(tmp_path):
    surface = changed(DSM, **ONLY_SHAPE, sigma_Z_m__relative=0.012, sigma_Z_m__adjustment_relative=0.004)
    adjusted = {"verdict": "accepted", "reasons": [], "good_for": "relative", "purpose": SHAPE}
    for folder, name, content in (("dsm", "dsm", surface), ("result", "adjustment", adjusted)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / f"{name}.json").write_text(json.dumps(content), encoding="utf-8")
    steps = [
        {"name": name, "folder": folder, "what": name, "status": "done", "reason": "", "seconds": 1.0, "arguments": []}
        for name, folder in (("adjust", "result"), ("dsm", "dsm"))
    ]
    page = run_page({"source": "photographs", "steps": steps, "seconds": 2.0}, tmp_path, Head()).replace("\u00a0", " ")
    first = page.partition("<h2>Steps</h2>")[0]
    assert "Accepted, for its shape only" in first
    assert first.count(SHAPE) == 1
    assert "relative, for shape and volumes, 0.012 m" in first
