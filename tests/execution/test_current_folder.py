"""No process that the program starts runs a file of the current folder, such as one that is called json.py."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from aerotri.execution import first_run

COMPILING = """
import os
from pathlib import Path
from aerotri.execution import first_run
first_run.LISTED = Path(os.environ["LISTED"])
print(first_run.compile_ahead(), [process.wait(120) for process in first_run._held[1:]])
"""
WORKERS = """
from pathlib import Path
import toy_tasks
from aerotri.execution import beginning
from aerotri.execution.opening import opened
from aerotri.execution.work import Work
if __name__ == "__main__":
    beginning.method = lambda: METHOD
    with opened("processes:1") as executor:
        print(executor.run(Work(toy_tasks.squared, 0, [1, 2], ["a", "b"], "tasks", Path("parcels"), 1000)))
"""
BENCH = """
from pathlib import Path
from aerotri.bench.job import Job
job = Job("aerotri.bench.worker", ["nothing"], Path("out"), lambda folder: None)
job.wait()
print(job.state()["error"])
"""
SPAWNED, FORKED = WORKERS.replace("METHOD", "'spawn'"), WORKERS.replace("METHOD", "'forkserver'")
SMALL = "aerotri.adjustment._factor_kernels:extend_add"


@pytest.mark.parametrize(
    ("script", "expected"),
    [
        (COMPILING, "1 [0]"),
        (SPAWNED, "[1, 4]"),
        pytest.param(FORKED, "[1, 4]", marks=pytest.mark.skipif(sys.platform != "linux", reason="as on Linux")),
        (BENCH, ""),
    ],
)
def test_modules_of_the_current_folder_are_not_run(script, expected, tmp_path):
    """The parent is a script of another folder, as the command `aerotri` is."""
    place, folder = tmp_path / "script", tmp_path / "current"
    place.mkdir()
    folder.mkdir()
    for name in ("json", "pickle", "numpy", "socket"):
        (folder / f"{name}.py").write_text("open('RUN', 'w').close()\nraise ImportError('not the real one')\n")
    (place / "script.py").write_text(script)
    shutil.copy(Path(__file__).with_name("toy_tasks.py"), place)
    (tmp_path / "list.json").write_text(first_run.as_listed(_small_list()))
    environment = {**os.environ, "AEROTRI_THREADS": "2", "LISTED": str(tmp_path / "list.json"),
                   "NUMBA_CACHE_DIR": str(tmp_path / "kept")}  # fmt: skip
    line = [sys.executable, str(place / "script.py")]
    done = subprocess.run(line, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(expected)
    assert not (folder / "RUN").exists()


def _small_list():
    return [kernel for kernel in first_run.listed_kernels(first_run.LISTED) if kernel[0] == SMALL]
