"""Functions of a script and of modules beside it, on workers that were started apart."""

import os
import subprocess
import sys
import time

import pytest

from aerotri.conventions import InputError
from aerotri.execution.scripts import Script, script_of, unpickled

BESIDE = """
from dataclasses import dataclass

@dataclass(frozen=True)
class Size:
    value: int

def doubled(shared, task):
    return Size(2 * task.value)
"""
SCRIPT = """
from __future__ import annotations
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from aerotri.execution.opening import opened
from aerotri.execution.work import Work
import beside_it

@dataclass(frozen=True)
class Case:
    word: str

@dataclass(frozen=True)
class Found:
    text: str

def one(shared: Case, task: int) -> Found:
    return Found(f"{shared.word} {task}")

def computed(executor, function, shared, tasks):
    return executor.run(Work(function, shared, tasks, list(map(str, tasks)), "runs", Path(sys.argv[2]), 1000))

if __name__ == "__main__":
    with opened(sys.argv[1]) as executor:
        found = computed(executor, one, Case("run"), range(3))
        assert all(isinstance(each, Found) for each in found)
        print(*(each.text for each in found), sep=", ")
        sizes = computed(executor, beside_it.doubled, None, [beside_it.Size(k) for k in range(3)])
        assert all(isinstance(each, beside_it.Size) for each in sizes)
        print(*(each.value for each in sizes), sep=", ")
"""


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    """Address of a scheduler with a worker, both programs of their own in another folder."""
    pytest.importorskip("distributed")
    place = tmp_path_factory.mktemp("apart")
    file = place / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    quiet = {"cwd": place, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    lines = (
        [*dask, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)],
        [*dask, "worker", "--scheduler-file", str(file), "--nthreads", "1", "--no-dashboard", "--no-nanny"],
    )
    programs = [subprocess.Popen(line, **quiet, env={**os.environ, "AEROTRI_THREADS": "1"}) for line in lines]
    until = time.monotonic() + 60.0
    while not file.is_file() and time.monotonic() < until:
        time.sleep(0.2)
    yield f"dask:{file}"
    for program in programs:
        program.terminate()
        program.wait()


def run(folder, executor):
    (folder / "beside_it.py").write_text(BESIDE, encoding="utf-8")
    (folder / "script.py").write_text(SCRIPT, encoding="utf-8")
    line = [sys.executable, folder / "script.py", executor, folder / "shared"]
    return subprocess.run(line, cwd="/", capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize("executor", ["threads", "processes:2"])
def test_started_by_the_script(executor, tmp_path):
    done = run(tmp_path, executor)
    assert done.stdout == "run 0, run 1, run 2\n0, 2, 4\n", done.stderr


def test_on_a_worker_that_was_started_apart(scheduler, tmp_path):
    done = run(tmp_path, scheduler)
    assert done.stdout == "run 0, run 1, run 2\n0, 2, 4\n", done.stderr
    # a script that was changed is read anew
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.replace('f"{shared.word} {task}"', 'f"{shared.word} no {task}"'), encoding="utf-8")
    line = [sys.executable, script, scheduler, tmp_path / "shared"]
    done = subprocess.run(line, cwd="/", capture_output=True, text=True, timeout=120)
    assert done.stdout.startswith("run no 0, run no 1"), done.stderr


def test_a_script_that_is_not_seen_or_another_one_is_told(tmp_path):
    content = b"c__main__\none\n."
    with pytest.raises(InputError, match=r"the worker on .* does not see the script .*gone\.py"):
        unpickled(content, Script(tmp_path / "gone.py", "0" * 16))
    (tmp_path / "other.py").write_text("one = 1\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"has another script in the place of .*other\.py"):
        unpickled(content, Script(tmp_path / "other.py", "0" * 16))


def test_the_commands_of_the_program_need_no_script():
    assert script_of([b"nothing"], unpickled) is None
