"""A block whose control points do not fit the photographs: the run stops, says why, and goes on only where asked."""

from __future__ import annotations

import pytest

from aerotri.commands import run as command
from chain_of_fakes import Fakes, Saved, ends_of

PROBLEM = "the control points do not fit the photographs: only 3 of 7 agree with one another"


@pytest.fixture
def photographs(tmp_path, monkeypatch):
    for name in ("_tiepoints", "_adjust", "_dtm", "_dsm", "_ortho"):
        monkeypatch.setattr(command._Told, name, lambda *given: None)
    monkeypatch.setattr(Saved, "misplaced", PROBLEM)
    (tmp_path / "photographs").mkdir()
    return tmp_path / "photographs"


def test_run_stops(photographs, monkeypatch, tmp_path, capsys):
    fakes = Fakes(monkeypatch)
    assert command.run_all(photographs, tmp_path / "out", {"unmarked": "continue"}, False) == 1
    assert fakes.verbs == ["tie_points"]
    assert ends_of(tmp_path / "out")["tiepoints"] == ("failed", PROBLEM)
    status, reason = ends_of(tmp_path / "out")["adjust"]
    assert status == "left out"
    assert "--go-on" in reason
    assert PROBLEM in capsys.readouterr().out


def test_run_goes_on_where_asked(photographs, monkeypatch, tmp_path):
    fakes = Fakes(monkeypatch)
    assert command.run_all(photographs, tmp_path / "out", {"go_on": True}, False) == 1
    assert fakes.verbs[:2] == ["tie_points", "adjust"]
