"""`aerotri adjust --executor`: what is said of folders that are no block in parts, and of executors that are none."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    ("folder", "executor", "text"),
    [
        ("block", "processes:2", "--executor processes:2 for a block in one piece — divide it first"),
        ("block", "processes", "is not a number of processes"),
        ("nothing", "processes:x", "is not a number of processes"),
        ("nothing", "processes:2", "there is no such file or folder"),
    ],
)
def test_what_is_wrong_is_said(folder, executor, text, tmp_path):
    (tmp_path / "block").mkdir()
    line = [sys.executable, "-m", "aerotri", "adjust", tmp_path / folder, "--executor", executor]
    done = subprocess.run(line, capture_output=True, text=True)
    assert done.returncode == 2
    assert text in done.stderr
