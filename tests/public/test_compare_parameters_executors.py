"""Sets compared in this process, in other processes and by Dask: the same files, also where a worker is killed."""

from __future__ import annotations

import json

import killed_sets
import pytest
from typer.testing import CliRunner

import aerotri
from aerotri.cli import app, main
from aerotri.execution.work import TasksFailedError
from aerotri.formats.block.folder import write_block
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.strategies import compared_sets
from small_blocks import small_block

SETS = ("dmc", "brown:K1", "none", "bluh:1-4", "ebner", "collocation:5x4")
"""The first cannot be adjusted: the block has another camera. The second is where all others begin."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    control = {"distance_bases": 2.5, "sigma_m": [0.03, 0.03, 0.05], "check_points": 8}
    place = tmp_path_factory.mktemp("compared") / "block"
    write_block(small_block(43, "bluh:1-4", control=control)[0], place)
    return place


@pytest.fixture
def made(folder, tmp_path):
    def of(executor, name, sets=SETS):
        shares = []
        found = aerotri.compare_parameters(
            folder, sets, folds=5, executor=executor, progress=lambda stage, share: shares.append(share)
        )
        told = [share for share in shares if share is not None]
        assert told == sorted(told) == [k / len(sets) for k in range(len(sets))]
        out = tmp_path / name
        found.save(out)
        return {path.name: path.read_bytes() for path in out.glob("*.[cj]s*")}

    return of


def test_sets_are_the_same_wherever_they_are_adjusted(made):
    pytest.importorskip("distributed")
    by_threads = made("threads", "threads")
    sets = json.loads(by_threads["compare_parameters.json"])["sets"]
    assert [one["status"] == "converged" for one in sets] == [False, True, True, True, True, True]
    assert made("processes:2", "processes") == by_threads
    assert made("dask:local:2", "dask") == by_threads


def test_sets_do_not_depend_on_their_order(made):
    """But for the first that can be adjusted, where the others begin."""
    one, two = (
        json.loads(made("threads", name, sets)["compare_parameters.json"])["sets"]
        for name, sets in (("forth", SETS[1:]), ("back", (SETS[1], *SETS[:1:-1])))
    )
    assert {s["set"]: s for s in one} == {s["set"]: s for s in two}


@pytest.mark.parametrize("executor", ["processes:2", "dask:local:2"])
def test_a_worker_killed_in_mid_run_changes_nothing(executor, made, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    expected = made("threads", "threads", SETS[1:4])
    monkeypatch.setenv("AEROTRI_TEST_KILLED", str(tmp_path / "killed"))
    monkeypatch.setattr(compared_sets, "adjust_set", killed_sets.killed_once)
    assert made(executor, "again", SETS[1:4]) == expected
    assert (tmp_path / "killed").exists()


def test_a_set_that_always_fails_is_named(made, monkeypatch):
    monkeypatch.setattr(compared_sets, "adjust_set", killed_sets.never)
    message = r"1 of 4 sets of parameters could not be computed: set ebner:1-12 \(RuntimeError: no luck\) — run"
    with pytest.raises(TasksFailedError, match=message):
        made("processes:2", "failing")


def test_the_command(folder, made, tmp_path, monkeypatch, capsys):
    """The files of the Python package; nothing is left beside them; 1 where a set has no result."""
    sets = SETS[1:5]
    expected = made("threads", "threads", sets)
    asked = [word for one in sets for word in ("--set", one)]
    words = ["compare-parameters", str(folder), *asked, "--folds", "5", "--executor", "processes:2", "--out"]
    done = CliRunner().invoke(app, [*words, str(tmp_path / "here" / "out")], catch_exceptions=False)
    assert done.exit_code == 0
    written = tmp_path / "here" / "out"
    assert {name: (written / name).read_bytes() for name in expected} == expected
    assert [path.name for path in (tmp_path / "here").iterdir()] == ["out"]
    monkeypatch.setattr(compared_sets, "adjust_set", killed_sets.never)
    monkeypatch.setattr("sys.argv", ["aerotri", *words, str(tmp_path / "failed")])
    monkeypatch.setattr("aerotri.cli._leave", lambda code: (_ for _ in ()).throw(SystemExit(code)))
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    assert "set ebner:1-12" in capsys.readouterr().err
    assert not (tmp_path / "failed").exists()
    words[-2] = "cloud"
    assert CliRunner().invoke(app, [*words, str(tmp_path / "never")]).exit_code != 0


def test_where_no_set_can_be_adjusted_nothing_is_begun_elsewhere(folder, monkeypatch):
    monkeypatch.setattr(compared_sets, "adjust_set", killed_sets.never)
    found = aerotri.compare_parameters(folder, ["dmc"], executor="processes:1")
    assert found.choice == ""
    assert [one.choice for one in found.record.outcomes] == [parse_parameters("dmc")]
