"""Kernels compiled ahead: the list is what the command calls, and the processes compile it and end."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aerotri.cli import app
from aerotri.conventions import InputError
from aerotri.execution import first_run

BLOCK = Path(__file__).parents[2] / "blocks" / "frederiksstad_ultracam"
ADJUST = """
import json, sys
from pathlib import Path
from numba.core.dispatcher import Dispatcher
import aerotri
aerotri.adjust(aerotri.read_block(sys.argv[1]))
found = {}
for module in list(sys.modules.values()):
    if getattr(module, "__name__", "").startswith("aerotri."):
        for one in vars(module).values():
            if isinstance(one, Dispatcher) and one.overloads:
                name = f"{one.py_func.__module__}:{one.py_func.__name__}"
                found[name] = sorted(str(key) for key in one.overloads)
print(json.dumps(found))
"""
SMALL = ["aerotri.adjustment._intersection_kernels:median", "aerotri.adjustment._factor_kernels:extend_add"]
START = """
import sys
from pathlib import Path
from aerotri.execution import first_run
first_run.LISTED = Path(sys.argv[1])
count = first_run.compile_ahead()
codes = [one.wait(120) for one in first_run._held[1:]]
print(count, codes, first_run._is_first_run())
"""


def test_the_list_is_what_an_adjustment_calls():
    """Signatures that have changed: tools/benchmark/benchmark_first_run.py --record writes the list anew."""
    done = subprocess.run([sys.executable, "-c", ADJUST, str(BLOCK)], capture_output=True, text=True, check=True)
    called = json.loads(done.stdout)
    listed: dict[str, set[str]] = {}
    for name, types in first_run.listed_kernels(first_run.LISTED):
        listed.setdefault(name, set()).add(str(types))
    assert "aerotri.adjustment._kernels:assemble" in called
    for name, types in called.items():
        assert set(types) <= listed.get(name, set()), name
    kernels = {name: first_run._found(name) for name in listed}
    inner = {a for a in kernels for b in kernels if first_run._calls(kernels[b], kernels[a])}
    assert set(listed) - inner <= set(called)


def test_a_list_is_written_as_it_was_read(tmp_path):
    kernels = first_run.listed_kernels(first_run.LISTED)
    (tmp_path / "list.json").write_text(first_run.as_listed(kernels))
    assert first_run.listed_kernels(tmp_path / "list.json") == kernels


def small_list(path: Path) -> Path:
    kernels = [one for one in first_run.listed_kernels(first_run.LISTED) if one[0] in SMALL]
    assert len(kernels) == 2
    path.write_text(first_run.as_listed(kernels))
    return path


def test_processes_compile_the_list_once_and_end(tmp_path):
    """Two processes, each kernel compiled by one of them; there is nothing left to compile for the next command."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept"), "AEROTRI_THREADS": "3"}
    line = [sys.executable, "-c", START, str(small_list(tmp_path / "list.json"))]
    done = subprocess.run(line, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[0] == "2 [0, 0] False"
    kept = [file.name for file in (tmp_path / "kept").rglob("*.nbc")]
    assert len(kept) == 2
    assert all(any(name.partition(":")[2] in file for file in kept) for name in SMALL)
    again = subprocess.run(line, env=environment, capture_output=True, text=True, check=True)
    assert again.stdout.split("\n")[0] == "0 [] False"


def test_a_single_thread_starts_none(monkeypatch):
    monkeypatch.setenv("AEROTRI_THREADS", "1")
    assert first_run.compile_ahead() == 0


def test_functions_that_are_not_compiled_start_none(monkeypatch):
    """NUMBA_DISABLE_JIT, as for a debugger."""
    monkeypatch.setenv("AEROTRI_THREADS", "3")
    monkeypatch.setattr(first_run, "_found", lambda name: len)
    assert first_run.compile_ahead() == 0


def test_they_end_with_the_command(tmp_path):
    """A command that has ended, however, leaves nobody behind that compiles."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept")}
    line = [sys.executable, "-m", "aerotri.execution.first_run", str(tmp_path), str(first_run.LISTED)]
    process = subprocess.Popen(line, stdin=subprocess.PIPE, env=environment)
    process.stdin.close()
    assert process.wait(30) == 0
    assert len(list((tmp_path / "kept").rglob("*.nbc"))) < len(first_run.listed_kernels(first_run.LISTED))


@pytest.mark.parametrize("command", ["adjust", "run"])
def test_commands_that_adjust_start_them_first(command, monkeypatch, tmp_path):
    """Before anything is read."""
    begun = []
    monkeypatch.setattr(first_run, "compile_ahead", lambda: begun.append(command))
    words = [command, str(tmp_path / "nothing"), "--out", str(tmp_path / "out")]
    with pytest.raises(InputError):
        CliRunner().invoke(app, words, catch_exceptions=False)
    assert begun == [command]
