"""`aerotri run`: what the command prints of every step, and its exit codes."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from test_cli import run

from aerotri.cli.app import invoke
from aerotri.commands.run import run_all
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block
from aerotri.formats.block.writer import write_block
from chain_of_fakes import Fakes, ends_of
from small_blocks import small_block


@pytest.fixture(scope="module")
def block_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "in"
    write_block(small_block()[0], folder)
    return folder


def test_block_is_adjusted_and_terrain_named(block_folder, tmp_path):
    """The real adjustment of a small block; its page stands in the one report, unable to run anything."""
    out = tmp_path / "out"
    done = run("run", block_folder, "--out", out, "--parameters", "none", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["report"] == str(out / "report.html")
    assert ends_of(out)["adjust"] == ("done", "")
    assert ends_of(out)["dtm"] == ("left out", "it needs photographs, and a block was given")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("<iframe sandbox srcdoc=") == 2
    assert "&lt;h2" in page
    assert page.index("<b>Accepted</b>") < page.index("<h2>Steps</h2>")
    assert "<script" not in page


def test_control_points_made_check_points(block_folder, tmp_path):
    """By adjust and by run alike; a name that is none is refused."""
    names = read_block(block_folder).points[read_block(block_folder).control.point].tolist()
    given = ["--check", names[0], "--check", names[2], "--parameters", "none", "--no-plots"]
    assert invoke(["adjust", str(block_folder), "--out", str(tmp_path / "result"), *given]) == 0
    assert invoke(["run", str(block_folder), "--out", str(tmp_path / "out"), *given]) == 0
    for result in (tmp_path / "result", tmp_path / "out" / "result"):
        checks = [line.split(",")[0] for line in (result / "check.csv").read_text().splitlines()[1:]]
        assert {names[0], names[2]} <= set(checks)
        assert names[1] not in checks
    with pytest.raises(InputError, match="--check nobody: there is no such control point"):
        invoke(["adjust", str(block_folder), "--check", "nobody"])


def test_every_step_is_told(block_folder, tmp_path, capsys):
    """The command line of the step, what its command prints, and a line a step at the end."""
    assert run_all(block_folder, tmp_path / "out", {"parameters": "none", "plots": False}, False) == 0
    told = capsys.readouterr().out.splitlines()
    result = tmp_path / "out" / "result"
    assert told[0] == f"── Adjustment: aerotri adjust {block_folder} --out {result} --parameters none --no-plots"
    assert told[1] == "verdict: accepted"
    assert f"Written to {result}" in told
    assert told[-8] == "──"
    assert any(line.startswith("Accuracy done") for line in told[-7:])
    assert "Terrain left out: it needs photographs, and a block was given" in told
    assert told[-1] == f"Report: {tmp_path / 'out' / 'report.html'}"


def test_a_block_that_cannot_be_adjusted_is_told(block_folder, tmp_path, capsys):
    """Why there is no result, and exit code 1; the report names the step."""
    block = small_block()[0]
    alone = replace(block, control=replace(block.control, is_check=np.ones(len(block.control), bool)))
    write_block(alone, tmp_path / "free")
    assert run_all(tmp_path / "free", tmp_path / "out", {}, False) == 1
    told = capsys.readouterr()
    assert "the datum is free" in told.err
    assert "Adjustment failed: aerotri adjust ended with 1" in told.out
    assert ends_of(tmp_path / "out")["adjust"] == ("failed", "aerotri adjust ended with 1")


def test_bad_input_ends_the_run(tmp_path, monkeypatch):
    """Of the first step it is bad input of the run: exit code 2, and no record of a run."""
    (tmp_path / "photographs").mkdir()
    Fakes(monkeypatch).ends["tie_points"] = InputError("2 photographs", "give more")
    with pytest.raises(InputError, match="2 photographs"):
        run_all(tmp_path / "photographs", tmp_path / "out", {}, True)
    done = run("run", tmp_path / "photographs", "--out", tmp_path / "out", "--focal-length-mm", "x")
    assert done.returncode == 2
    assert "--focal-length-mm" in done.stderr
    assert not (tmp_path / "out" / "run.json").exists()
