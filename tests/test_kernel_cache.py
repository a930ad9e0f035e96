"""Kernels are compiled once by several processes, and a process that is gone stops nobody."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from aerotri import kernel_cache

KERNELS = """
from aerotri.compiled import kernel

@kernel
def twice(x):
    return 2.0 * x
"""
CALL = "import here; print('begins', flush=True); print(here.twice(4.0), sum(here.twice.stats.cache_misses.values()))"
HOLD = "import sys, time; from pathlib import Path; from aerotri.kernel_cache import _locked; " \
       "print(_locked(Path(sys.argv[1])) is not None, flush=True); time.sleep(600)"  # fmt: skip


@pytest.fixture
def environment(tmp_path, monkeypatch):
    """A module with a kernel, and an empty folder for what is compiled."""
    (tmp_path / "here.py").write_text(KERNELS)
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    # Python tells sources by whole seconds and their size: one that is changed at once would be read as it was
    python = {"PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
    return {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept"), **python}


def begun(environment, *line) -> subprocess.Popen:
    """A process of Python that has printed its first line."""
    process = subprocess.Popen([sys.executable, "-c", *line], env=environment, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline().strip() in ("begins", "True")
    return process


def lock_of(environment, tmp_path):
    """The lock of the kernel, after a first call; what that call compiled is taken away again."""
    assert begun(environment, CALL).communicate(timeout=120)[0].split() == ["8.0", "1"]
    (lock,) = (tmp_path / "kept").rglob("*.lock")
    for file in lock.parent.glob("here.twice*.nb*"):
        file.unlink()
    return lock


def test_the_second_process_waits_and_reads(environment, tmp_path):
    """It neither compiles beside the first one nor goes on before it."""
    holder = begun(environment, HOLD, str(lock_of(environment, tmp_path)))
    both = [begun(environment, CALL) for _ in range(2)]
    time.sleep(1.0)
    assert [one.poll() for one in both] == [None, None]
    holder.kill()
    holder.wait()
    said = sorted(one.communicate(timeout=120)[0].split() for one in both)
    assert said == [["8.0", "0"], ["8.0", "1"]]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signal")
def test_the_lock_of_a_killed_process_is_free(environment, tmp_path):
    lock = lock_of(environment, tmp_path)
    holder = begun(environment, HOLD, str(lock))
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    started = time.monotonic()
    assert begun(environment, CALL).communicate(timeout=120)[0].split() == ["8.0", "1"]
    assert time.monotonic() - started < kernel_cache.PATIENCE_S


def test_patience_ends(tmp_path, monkeypatch):
    """A process that holds the lock and does nothing does not stop others for good."""
    monkeypatch.setattr(kernel_cache, "PATIENCE_S", 0.2)
    held = kernel_cache._locked(tmp_path / "a.lock")
    assert held is not None
    assert kernel_cache._locked(tmp_path / "a.lock") is None
    os.close(held)
    again = kernel_cache._locked(tmp_path / "a.lock")
    assert again is not None
    os.close(again)


def test_a_folder_that_cannot_be_written_stops_nothing(tmp_path):
    (tmp_path / "file").touch()
    assert kernel_cache._locked(tmp_path / "file" / "a.lock") is None


def test_what_was_kept_of_other_kernels_is_not_taken(environment):
    """The code of a kernel holds that of kernels in other files: when these change, it is compiled again."""
    changed = f"from aerotri import kernel_cache; kernel_cache.digest_of_sources = lambda _: 'changed'; {CALL}"
    said = [begun(environment, line).communicate(timeout=120)[0].split() for line in (CALL, CALL, changed)]
    assert said == [["8.0", "1"], ["8.0", "0"], ["8.0", "1"]]


TAKES_A_RECORD = """
from aerotri.compiled import kernel

@kernel
def twice(x):
    return 2.0 * x[0]
"""
RECORD = "from typing import NamedTuple\nclass One(NamedTuple):\n    x: float\n"
WITH_RECORD = "import here; from {0} import One; print('begins', flush=True); " \
              "print(here.twice(One(4.0)), sum(here.twice.stats.cache_misses.values()))"  # fmt: skip


def test_an_index_of_types_that_are_gone_is_written_anew(environment, tmp_path):
    """After an upgrade in which a record moved to another module."""
    (tmp_path / "here.py").write_text(TAKES_A_RECORD)
    (tmp_path / "before.py").write_text(RECORD)
    assert begun(environment, WITH_RECORD.format("before")).communicate(timeout=120)[0].split() == ["8.0", "1"]
    (tmp_path / "before.py").rename(tmp_path / "after.py")
    for misses in ("1", "0"):
        assert begun(environment, WITH_RECORD.format("after")).communicate(timeout=120)[0].split() == ["8.0", misses]


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_damaged_file_is_written_anew(environment, tmp_path, ending, share):
    """A disk was full, a copy was cut off."""
    assert begun(environment, CALL).communicate(timeout=120)[0].split() == ["8.0", "1"]
    (file,) = (tmp_path / "kept").rglob(f"here.twice*.{ending}")
    file.write_bytes(file.read_bytes()[: int(share * file.stat().st_size)])
    for misses in ("1", "0"):
        assert begun(environment, CALL).communicate(timeout=120)[0].split() == ["8.0", misses]


FILL = """
import errno
from aerotri import kernel_cache
whole = kernel_cache.KeptFiles._save_data
def full(self, name, data):
    raise OSError(errno.ENOSPC, "No space left on device")
kernel_cache.KeptFiles._save_data = full
"""


def test_a_full_disk_keeps_nothing_and_stops_nobody(environment, tmp_path):
    """After it the index points to a file that is not there, or to that of an older kernel."""
    assert begun(environment, CALL).communicate(timeout=120)[0].split() == ["8.0", "1"]
    (tmp_path / "here.py").write_text(KERNELS.replace("2.0 * x", "3.0 * x"))
    process = subprocess.Popen(
        [sys.executable, "-c", FILL + CALL], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    said, warned = process.communicate(timeout=120)
    assert said.split() == ["begins", "12.0", "1"]
    assert str(tmp_path / "kept") in warned
    assert "No space left" in warned
    for misses in ("1", "0"):
        assert begun(environment, CALL).communicate(timeout=120)[0].split() == ["12.0", misses]


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_a_file_that_cannot_be_read_or_replaced_stops_nobody(environment, tmp_path, ending):
    """A folder stands in its place: a file that may not be read would be one that root may read."""
    assert begun(environment, CALL).communicate(timeout=120)[0].split() == ["8.0", "1"]
    (file,) = (tmp_path / "kept").rglob(f"here.twice*.{ending}")
    file.unlink()
    file.mkdir()
    process = subprocess.Popen(
        [sys.executable, "-c", CALL], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    said, warned = process.communicate(timeout=120)
    assert said.split() == ["begins", "8.0", "1"]
    # it cannot be replaced either
    assert "cannot be stored" in warned
    assert os.name == "nt" or str(file) in warned


@pytest.mark.skipif(os.name != "posix", reason="links of a system")
@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_a_link_to_what_is_not_there_is_replaced(environment, tmp_path, ending):
    assert begun(environment, CALL).communicate(timeout=120)[0].split() == ["8.0", "1"]
    (file,) = (tmp_path / "kept").rglob(f"here.twice*.{ending}")
    file.unlink()
    file.symlink_to(tmp_path / "nowhere")
    for misses in ("1", "0"):
        assert begun(environment, CALL).communicate(timeout=120)[0].split() == ["8.0", misses]


def test_the_digest_reads_every_module_that_kernels_import():
    """Constants and the order of fields are compiled in: a change of them is another kernel."""
    package = Path(kernel_cache.__file__).parent
    read = {path for pattern in kernel_cache.KERNEL_FILES for path in package.rglob(pattern)}
    imported = set()
    for path in package.rglob("_*kernels.py"):
        for name in re.findall(r"^(?:from|import) (aerotri[\w.]*)", path.read_text(encoding="utf-8"), re.M):
            imported.add(package.parent / f"{name.replace('.', '/')}.py")
    assert len(imported) > 10
    assert imported <= read
