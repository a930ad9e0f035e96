"""Tie points in threads, processes and workers of Dask: the same block, also where a worker is killed."""

from __future__ import annotations

import json
from pathlib import Path

import killed_searches
import pytest
from test_photographs_to_block import files, options

from aerotri.commands.tiepoints import run_tiepoints
from aerotri.conventions import InputError
from aerotri.execution.work import TasksFailedError
from aerotri.tie_points import tasks
from aerotri.tie_points.photographs_to_block import CACHE

__all__ = ["files"]


@pytest.fixture
def made(files, tmp_path):
    """Ties the photographs by an executor; contents of the files of the block, and of the kept ones, by name."""

    def of(executor, name):
        out = tmp_path / name
        run_tiepoints(files[0] / "photographs", out, options(files, executor=executor), True)
        found = {path.relative_to(out): path.read_bytes() for path in out.rglob("*") if path.is_file()}
        # the sums of all files, those with seconds among them
        found.pop(Path(".aerotri-files"))
        for path in list(found):
            if path.name == "tiepoints.json":
                found[path] = json.loads(found[path])
                assert found[path].pop("seconds") > 0.0
                found[path].pop("marking_page", None)
        return found

    return of


def test_blocks_are_the_same_wherever_points_are_found(made):
    pytest.importorskip("distributed")
    by_threads = made("threads", "threads")
    kept = [path for path in by_threads if path.parts[0] == CACHE]
    assert len(kept) > 6
    assert made("processes:2", "processes") == by_threads
    assert made("dask:local:2", "dask") == by_threads


@pytest.mark.parametrize("executor", ["processes:2", "dask:local:2"])
def test_workers_killed_in_mid_run_change_nothing(executor, made, tmp_path, monkeypatch):
    """One at its features, one at its pairs."""
    pytest.importorskip("distributed")
    expected = made("threads", "threads")
    (tmp_path / "killed").mkdir()
    monkeypatch.setenv("AEROTRI_TEST_KILLED", str(tmp_path / "killed"))
    monkeypatch.setattr(tasks, "find_features_of", killed_searches.features_killed_once)
    monkeypatch.setattr(tasks, "match_with_others", killed_searches.matches_killed_once)
    assert made(executor, "again") == expected
    assert {path.name for path in (tmp_path / "killed").iterdir()} == {"features", "matches"}


@pytest.mark.parametrize(("what", "replaced", "message"), [
    ("find_features_of", killed_searches.no_features, r"1 of 6 photographs .*: features of \S+ \(RuntimeError: no"),
    ("match_with_others", killed_searches.no_matches, r"1 of \d photographs .*: pairs of \S+ \(RuntimeError: no"),
])  # fmt: skip
def test_a_photograph_that_always_fails_is_named_and_the_others_are_kept(
    what, replaced, message, made, tmp_path, monkeypatch
):
    with monkeypatch.context() as patched:
        patched.setattr(tasks, what, replaced)
        with pytest.raises(TasksFailedError, match=message):
            made("processes:2", "failing")
    assert not (tmp_path / "failing" / "block.toml").exists()
    assert len(list((tmp_path / "failing" / CACHE).rglob("*.npz"))) >= 5
    assert made("processes:2", "failing") == made("threads", "threads")


def test_a_wrong_executor_is_refused(made):
    with pytest.raises(InputError, match="is not an executor"):
        made("cloud", "none")
