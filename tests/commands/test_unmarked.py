"""Control that is marked in no photograph: the run stops in a terminal, says how to go on, and takes up the marks."""

from __future__ import annotations

import pytest

from aerotri.commands import run as command
from aerotri.conventions import InputError
from aerotri.public.run_steps import BLOCK
from chain_of_fakes import Fakes, Saved, ends_of


@pytest.fixture
def photographs(tmp_path):
    (tmp_path / "my photographs").mkdir()
    return tmp_path / "my photographs"


@pytest.fixture
def fakes(monkeypatch):
    monkeypatch.setattr(Saved, "unmarked", ("GCP1", "<b>GCP 2</b>"), raising=False)
    return Fakes(monkeypatch)


def test_run_stops_and_says_how_to_go_on(photographs, fakes, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(command._Told, "_tiepoints", lambda *given: None)
    out = tmp_path / "out"
    assert command.run_all(photographs, out, {"unmarked": "stop"}, False) == 1
    assert fakes.verbs == ["tie_points"]
    assert ends_of(out)["adjust"] == ("left out", "tiepoints found control points that are marked in no photograph")
    told = capsys.readouterr().out
    assert "marked in no photograph: GCP1, <b>GCP 2</b>." in told
    assert f"aerotri view {out / BLOCK} --photos '{photographs}'" in told
    assert "--unmarked continue" in told


def test_run_continues_without_marks(photographs, fakes, tmp_path, monkeypatch):
    for name in ("_tiepoints", "_adjust", "_dtm", "_dsm", "_ortho"):
        monkeypatch.setattr(command._Told, name, lambda *given: None)
    assert command.run_all(photographs, tmp_path / "out", {"unmarked": "continue"}, False) == 0
    assert fakes.verbs[:2] == ["tie_points", "adjust"]


def test_run_takes_up_a_block_that_was_marked_since(photographs, fakes, tmp_path, monkeypatch):
    for name in ("_tiepoints", "_adjust", "_dtm", "_dsm", "_ortho"):
        monkeypatch.setattr(command._Told, name, lambda *given: None)
    block = tmp_path / "out" / BLOCK
    block.mkdir(parents=True)
    (block / "edits.csv").write_text("time,image,point,action\n")
    assert command.run_all(photographs, tmp_path / "out", {"unmarked": "continue"}, False) == 0
    assert fakes.verbs[0] == "adjust"
    assert fakes.called[0][1][0] == str(block)
    status, reason = ends_of(tmp_path / "out")["tiepoints"]
    assert status == "left out"
    assert "was marked since" in reason


@pytest.mark.parametrize(("stated", "terminal", "expected"), [
    ("", True, "stop"), ("", False, "continue"), ("continue", True, "continue"), ("stop", False, "stop"),
])  # fmt: skip
def test_somebody_before_a_terminal_is_asked(stated, terminal, expected, monkeypatch):
    monkeypatch.setattr(command, "is_terminal", lambda: terminal)
    monkeypatch.setattr("sys.stdin.isatty", lambda: terminal, raising=False)
    assert command.stop_or_continue(stated) == expected


def test_other_words_are_refused():
    with pytest.raises(InputError, match="use stop or continue"):
        command.stop_or_continue("perhaps")
