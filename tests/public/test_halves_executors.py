"""Halves adjusted in this process, in other processes and by Dask: the same files, also where a worker is killed."""

from __future__ import annotations

import killed_halves
import pytest
from typer.testing import CliRunner

import aerotri
from aerotri.cli import app, main
from aerotri.execution.work import TasksFailedError
from aerotri.pipeline import halves as stages


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("halves") / "result"
    block = aerotri.simulate(aerotri.example_flight(), seed=1).block
    aerotri.adjust(block, parameters="brown:K1").save(folder, plots=False)
    return folder


@pytest.fixture
def made(result, tmp_path):
    def of(executor, name):
        shares = []
        found = aerotri.halves(result, executor=executor, progress=lambda stage, share: shares.append((stage, share)))
        if executor != "threads":
            assert [share for stage, share in shares if stage == "adjusting halves"][-1] == 1.0
        out = tmp_path / name
        found.save(out)
        return {path.name: path.read_bytes() for path in out.iterdir() if path.is_file()}

    return of


def test_halves_are_the_same_wherever_they_are_adjusted(made):
    pytest.importorskip("distributed")
    by_threads = made("threads", "threads")
    assert b'"strips"' in by_threads["halves.json"]
    assert made("processes:2", "processes") == by_threads
    assert made("dask:local:2", "dask") == by_threads


@pytest.mark.parametrize("executor", ["processes:2", "dask:local:2"])
def test_a_worker_killed_in_mid_run_changes_nothing(executor, made, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    expected = made("threads", "threads")
    monkeypatch.setenv("AEROTRI_TEST_KILLED", str(tmp_path / "killed"))
    monkeypatch.setattr(stages, "compare_division", killed_halves.killed_once)
    assert made(executor, "again") == expected
    assert (tmp_path / "killed").exists()


def test_a_division_that_always_fails_is_named(made, monkeypatch):
    monkeypatch.setattr(stages, "compare_division", killed_halves.never)
    message = r"1 of \d comparisons could not be computed: halves by .*strips.* \(RuntimeError: no luck\) — run"
    with pytest.raises(TasksFailedError, match=message):
        made("processes:2", "failing")


def test_the_command(result, made, tmp_path, monkeypatch, capsys):
    """The files of the Python package; nothing is left beside them; 1 where a division has no result."""
    expected = made("threads", "threads")
    words = ["halves", str(result), "--executor", "processes:2", "--out", str(tmp_path / "here" / "out")]
    done = CliRunner().invoke(app, words, catch_exceptions=False)
    assert done.exit_code == 0
    assert {p.name: p.read_bytes() for p in (tmp_path / "here" / "out").iterdir() if p.is_file()} == expected
    assert [path.name for path in (tmp_path / "here").iterdir()] == ["out"]
    monkeypatch.setattr(stages, "compare_division", killed_halves.never)
    monkeypatch.setattr("sys.argv", ["aerotri", *words[:-1], str(tmp_path / "failed")])
    monkeypatch.setattr("aerotri.cli._leave", lambda code: (_ for _ in ()).throw(SystemExit(code)))
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    assert "halves by" in capsys.readouterr().err
    assert not (tmp_path / "failed").exists()
    words[3] = "cloud"
    assert CliRunner().invoke(app, words).exit_code != 0
