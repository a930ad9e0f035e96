"""How the program ends when it is interrupted, when it errs, and when the machine lacks something."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time

import pytest

import aerotri.cli as cli
from aerotri.cli import interruption

LATE = """
import sys, time
sys.argv = ["aerotri", "parameters"]
import aerotri.cli as cli
import aerotri.commands.parameters as parameters
def slow(*_):
    print("running", flush=True)
    time.sleep(60)
parameters.run_parameters = slow
cli.main()
"""
EARLY = """
import sys, time
sys.argv = ["aerotri", "parameters"]
class Slow:
    def find_spec(self, name, path, target=None):
        if name == "typer":
            print("running", flush=True)
            time.sleep(60)
sys.meta_path.insert(0, Slow())
import aerotri.cli
"""

LISTENING = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
"""What a shell starts in the background ignores SIGINT, and so do the programs that it starts."""


@pytest.mark.skipif(os.name != "posix", reason="signals of a system")
@pytest.mark.parametrize(
    ("program", "number", "code"),
    [(EARLY, signal.SIGINT, 130), (LATE, signal.SIGINT, 130), (LATE, signal.SIGTERM, 143)],
)
def test_an_interruption_is_one_line(program, number, code):
    process = subprocess.Popen(
        [sys.executable, "-c", LISTENING + program], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stdout is not None
    assert process.stdout.readline().strip() == b"running"
    time.sleep(0.05)
    process.send_signal(number)
    _, said = process.communicate()
    assert process.returncode == code
    assert said.decode() == "aerotri: interrupted, nothing was written\n"


def test_what_was_written_is_said(monkeypatch, tmp_path):
    from aerotri.formats.files import work_place

    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    # what stood in a folder that did not become whole is gone with it
    monkeypatch.setattr(work_place, "written", [tmp_path / name for name in ("gone", "a", "b")])
    assert interruption.message() == f"aerotri: interrupted, after {tmp_path / 'a'} was written and 1 more"


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (ZeroDivisionError("x\ny"), 3, "unexpected ZeroDivisionError: x y — please report it"),
        (MemoryError("Unable to allocate 7 GiB"), 2, "not enough memory: Unable to allocate 7 GiB"),
        (OSError(errno.ENOSPC, "No space left on device", "f.tif"), 2, "f.tif: the disk is full; "),
        (FileNotFoundError(errno.ENOENT, "No usable temporary directory found in ['/tmp']"), 2, "TMPDIR"),
        (ImportError("x.so: failed to map segment from shared object"), 2, "not enough memory to load a library: x.so"),
        (ImportError("No module named 'cv2'", name="cv2"), 2, "a library could not be loaded: No module named 'cv2'"),
        (ImportError("cannot import name 'x'", name="aerotri.conventions"), 3, "unexpected ImportError"),
        (KeyboardInterrupt(), 130, "interrupted, nothing was written"),
        (BrokenPipeError(), 0, ""),
    ],
)
def test_exit_codes(error, code, said, monkeypatch, capsys):
    from aerotri.formats.files import work_place

    def failing(**_):
        raise error

    monkeypatch.setattr(work_place, "written", [])
    monkeypatch.setattr(cli, "app", failing)
    monkeypatch.setattr(cli, "_forget_output", lambda: None)
    monkeypatch.delenv("AEROTRI_DEBUG", raising=False)
    assert cli._ended() == code
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == bool(said)
