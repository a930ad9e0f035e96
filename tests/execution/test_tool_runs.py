"""Runs of a Monte Carlo by `--executor` of the tools: the same numbers, also where a worker is killed."""

from __future__ import annotations

import argparse
import importlib
import sys

import pytest
import toy_tasks

from aerotri.execution.work import TasksFailedError
from places import PROJECT


@pytest.fixture
def tool(monkeypatch):
    monkeypatch.syspath_prepend(str(PROJECT / "tools" / "prove"))
    yield importlib.import_module("runs_elsewhere")
    sys.modules.pop("runs_elsewhere")


@pytest.fixture
def compute(tool, tmp_path):
    def of(words, function, shared, seeds):
        parser = argparse.ArgumentParser()
        tool.add_executor(parser)
        with tool.runs_of(parser.parse_args([*words, "--scratch", str(tmp_path)])) as runs:
            return runs(function, shared, seeds)

    return of


@pytest.mark.parametrize("words", [[], ["--executor", "processes:2"], ["--executor", "dask:local:2"]])
def test_runs_come_in_the_order_of_their_seeds(words, compute, tmp_path):
    pytest.importorskip("distributed")
    assert compute(words, toy_tasks.squared, 10, range(1, 6)) == [11, 14, 19, 26, 35]
    # nothing is left
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("executor", ["processes:2", "dask:local:2"])
def test_a_killed_run_is_computed_again(executor, compute, tmp_path):
    pytest.importorskip("distributed")
    (tmp_path / "own").mkdir()
    found = compute(["--executor", executor], toy_tasks.written, (str(tmp_path / "own"), {2}, 1), range(1, 5))
    assert found == [1, 2, 3, 4]
    assert len(list((tmp_path / "own").glob("begun_2_*"))) == 2


@pytest.mark.parametrize("words", [[], ["--executor", "processes:2"]])
def test_a_run_without_a_result_is_named(words, compute):
    with pytest.raises(TasksFailedError, match=r"1 of 3 runs .*: the run with seed 3 \(ValueError: 3 is odd\)"):
        compute(words, toy_tasks.failing, None, (2, 3, 4))
