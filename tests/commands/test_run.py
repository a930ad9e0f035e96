"""`aerotri run`: every step in its turn, what is missing named, one report."""

from __future__ import annotations

import json

import pytest

from aerotri.cli.run import command_names, invoke
from aerotri.commands.run import run_all
from aerotri.conventions import InputError
from aerotri.formats.block.writer import write_block
from small_blocks import small_block

ALL = ("tiepoints", "adjust", "dtm", "volume")


def steps(out):
    return {
        step["name"]: (step["status"], step["reason"]) for step in json.loads((out / "run.json").read_text())["steps"]
    }


def test_block_is_adjusted_and_terrain_named(tmp_path, capsys):
    """The real adjustment of a small block; its page stands in the one report, unable to run anything."""
    write_block(small_block()[0], tmp_path / "in")
    passed_on = {"adjust": ("--parameters", "none")}
    assert run_all(tmp_path / "in", tmp_path / "out", passed_on, invoke, command_names(), True) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["report"] == str(tmp_path / "out" / "report.html")
    assert steps(tmp_path / "out")["adjust"] == ("done", "")
    assert steps(tmp_path / "out")["dtm"] == ("left out", "it needs photographs, and a block was given")
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("<iframe sandbox srcdoc=") == 1
    assert "&lt;h2" in page
    assert "<script" not in page


def test_steps_follow_one_another(tmp_path, capsys):
    """Arguments are those of a command line; a step without its command is left out and named."""
    (tmp_path / "photographs").mkdir()
    called = []

    def invoke(arguments):
        called.append(arguments)
        return 0

    out = tmp_path / "out"
    passed_on = {"tiepoints": ("--seed", "4"), "dtm": ("--interval", "auto")}
    assert run_all(tmp_path / "photographs", out, passed_on, invoke, ALL, False) == 0
    assert called == [
        ["tiepoints", str(tmp_path / "photographs"), "--out", str(out / "block"), "--seed", "4"],
        ["adjust", str(out / "block"), "--out", str(out / "result")],
        ["dtm", str(out / "result"), str(tmp_path / "photographs"), "--out", str(out / "dtm"), "--interval", "auto"],
    ]
    passed_on = {"volume": ("--boundary", "pile.gpkg")}
    assert run_all(tmp_path / "photographs", out, passed_on, invoke, ALL, True) == 0
    dtm, result = str(out / "dtm"), str(out / "result")
    assert called[-1] == [
        "volume", f"{dtm}/dsm.tif", "--adjustment", result, "--pickets", f"{dtm}/pickets.parquet",
        "--out", str(out / "volume"), "--boundary", "pile.gpkg",
    ]  # fmt: skip
    capsys.readouterr()
    assert run_all(tmp_path / "photographs", out, {}, invoke, ("tiepoints", "adjust"), False) == 0
    assert steps(out)["dtm"] == ("left out", "this installation has no command 'dtm'")
    assert "Terrain left out: this installation has no command 'dtm'" in capsys.readouterr().out


def test_a_step_that_fails_ends_the_run(tmp_path, capsys):
    """What was done stays and is told; bad input of the first step is bad input of the run."""
    (tmp_path / "photographs").mkdir()

    def adjust_fails(arguments):
        return 1 if arguments[0] == "adjust" else 0

    out = tmp_path / "out"
    assert run_all(tmp_path / "photographs", out, {}, adjust_fails, ALL, True) == 1
    assert steps(out) == {
        "tiepoints": ("done", ""),
        "adjust": ("failed", "aerotri adjust ended with 1"),
        "dtm": ("left out", "adjust is missing"),
        "volume": ("left out", "no --boundary was given"),
    }

    def refuses(arguments):
        if arguments[0] != "tiepoints":
            raise InputError("too little ground", "give more")
        return 0

    assert run_all(tmp_path / "photographs", out, {}, refuses, ALL, True) == 1
    assert steps(out)["adjust"] == ("failed", "too little ground — give more")
    with pytest.raises(InputError, match="photographs"):
        run_all(tmp_path / "photographs", tmp_path / "o2", {}, lambda arguments: invoke(arguments), ALL, True)
    with pytest.raises(InputError, match="neither"):
        run_all(tmp_path / "nothing", out, {}, refuses, ALL, True)


def test_names_cannot_run_anything(tmp_path):
    folder = tmp_path / "<img src=x onerror=alert(1)>"
    folder.mkdir()

    def invoke(arguments):
        if arguments[0] == "tiepoints":
            (tmp_path / "out" / "block").mkdir(parents=True)
            (tmp_path / "out" / "block" / "tiepoints.json").write_text(
                '{"messages": ["<script>x</script>"], "rays": 12}'
            )
        return 0

    run_all(folder, tmp_path / "out", {}, invoke, ("tiepoints",), True)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "<img src=x" not in page
    assert "<script>x" not in page
    assert "<td>12</td>" in page


def test_nothing_is_built_on_a_rejected_adjustment(tmp_path):
    """What the adjustment wrote is to be looked at; only --go-on builds on it."""
    (tmp_path / "photographs").mkdir()
    out, called = tmp_path / "out", []

    def rejects(arguments):
        called.append(arguments[0])
        if arguments[0] != "adjust":
            return 0
        (out / "result").mkdir(parents=True, exist_ok=True)
        content = {"verdict": "rejected", "reasons": ["σ₀ is 522"], "message": ""}
        (out / "result" / "adjustment.json").write_text(json.dumps(content))
        return 1

    assert run_all(tmp_path / "photographs", out, {}, rejects, ALL, True) == 1
    assert called == ["tiepoints", "adjust"]
    assert steps(out)["adjust"] == ("failed", "rejected: σ₀ is 522")
    assert steps(out)["dtm"] == ("left out", "adjust is rejected; --go-on builds on it all the same")
    assert run_all(tmp_path / "photographs", out, {}, rejects, ALL, True, go_on=True) == 1
    assert called[2:] == ["tiepoints", "adjust", "dtm"]
