"""`aerotri compare-parameters` and what adjust writes of groups, fields and the choice of parameters."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import pytest

from aerotri.commands.adjust import run_adjust
from aerotri.commands.compare_parameters import run_compare_parameters
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from small_blocks import small_block, with_adjustment

SETS = ("none", "bluh:1-4", "dmc")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    control = {"distance_bases": 2.5, "sigma_m": [0.03, 0.03, 0.05], "check_points": 8}
    block, _ = small_block(41, "bluh:1-4", control=control)
    place = tmp_path_factory.mktemp("blocks") / "small"
    write_block(block, place)
    return place


def test_table_and_files(folder, tmp_path, capsys):
    out = tmp_path / "compared"
    assert run_compare_parameters(folder, SETS, 5, None, None, out, False) == 0
    said = capsys.readouterr().out
    assert "Sets of additional parameters compared" in said
    assert "additional parameters chosen: " in said
    content = json.loads((out / "compare_parameters.json").read_text(encoding="utf-8"))
    assert [s["set"] for s in content["sets"]] == ["none", "bluh:1-4", "dmc:30-41+74-77+79"]
    assert content["folds"] == 5
    assert content["sets"][2]["sigma0"] is None
    assert "camera model" in content["sets"][2]["status"]
    with open(out / "compare_parameters.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[1]["check_rms_Z"]) == pytest.approx(content["sets"][1]["check"]["rms"]["Z"])
    written = {f"compare_parameters.{kind}" for kind in ("json", "csv", "png", "svg")}
    assert {p.name for p in out.iterdir()} == written | {".aerotri-files"}
    # an older comparison is replaced, other files are not
    assert run_compare_parameters(folder, SETS[:1], 5, None, None, out, True) == 0
    assert json.loads(capsys.readouterr().out)["sets"][0]["set"] == "none"
    with pytest.raises(InputError, match="holds other files"):
        run_compare_parameters(folder, SETS, 5, None, None, folder, False)


def test_what_cannot_be_compared(folder, tmp_path):
    with pytest.raises(InputError, match="'auto' cannot be one of the sets"):
        run_compare_parameters(folder, ("auto",), 5, None, None, tmp_path / "o", False)
    with pytest.raises(InputError, match="unknown parameter family"):
        run_compare_parameters(folder, ("blu",), 5, None, None, tmp_path / "o", False)
    assert run_compare_parameters(folder, ("dmc",), 5, None, None, tmp_path / "o", True) == 1


def test_adjust_writes_changes_fields_and_removals(tmp_path):
    flight = {"gsd_m": 0.1, "strips": 4, "images_per_strip": 6, "end_lap": 0.6, "side_lap": 0.4, "days": 2}
    block = small_block(42, "bluh:1-6,collocation:5x4", flight=flight)[0]
    write_block(with_adjustment(block, parameter_groups="day", parameter_selection="on"), tmp_path / "block")
    out = tmp_path / "out"
    assert run_adjust(tmp_path / "block", out, None, None, None, True, True) == 0
    (entry,) = json.loads((out / "parameter_changes.json").read_text(encoding="utf-8"))
    assert (entry["first"], entry["second"]) == ("1", "2")
    assert not entry["changed"]
    with open(out / "parameter_changes.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 25 * 16
    assert (out / "plots" / "change.png").exists()
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Change of the image errors between groups" in page
    assert "Image error as a random field" in page
    assert "Parameters removed by the selection" in page
    used = read_block(out / "block").settings.collocation
    assert used.sigma_um is not None
    assert used.length_mm is not None


def test_auto(folder, tmp_path, capsys):
    block = read_block(folder)
    write_block(replace(block, name="small"), tmp_path / "small")
    out = tmp_path / "out"
    assert run_adjust(tmp_path / "small", out, "auto", None, None, True, False) == 0
    assert "additional parameters chosen: " in capsys.readouterr().out
    assert (out / "compare_parameters.json").exists()
    assert (out / "plots" / "compare_parameters.svg").exists()
    assert "Sets of additional parameters compared" in (out / "report.html").read_text(encoding="utf-8")
