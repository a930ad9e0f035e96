"""Outputs that are closed or cannot say every letter, and signals beside a library with handlers of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec

import pytest

RUN = "import sys; {}; sys.argv = ['aerotri', *sys.argv[1:]]; from aerotri.cli import main; main()"
IN_A_THREAD = """
import signal, threading
signal.signal(signal.SIGTERM, lambda *_: print("ours", flush=True))
def imported():
    import {}
thread = threading.Thread(target=imported)
thread.start()
thread.join()
signal.raise_signal(signal.SIGTERM)
print("goes on")
"""


def ended(*arguments: str, before: str = "pass", **variables: str) -> subprocess.CompletedProcess[str]:
    """The program, run anew."""
    return subprocess.run(
        [sys.executable, "-c", RUN.format(before), *arguments], env={**os.environ, **variables}, capture_output=True,
        encoding="utf-8", errors="replace", timeout=120, check=False,
    )  # fmt: skip


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-8"])
def test_help_can_be_written_in_any_encoding(encoding):
    done = ended("adjust", "--help", PYTHONIOENCODING=encoding)
    assert done.returncode == 0, done.stderr
    assert "--robust" in done.stdout


@pytest.mark.parametrize("closed", ["stdout", "stderr"])
@pytest.mark.parametrize(("argument", "code"), [("--version", 0), ("no-such-command", 2)])
def test_a_closed_output_changes_no_exit_code(closed, argument, code):
    """Python makes None of a stream that was closed when the program began."""
    done = ended(argument, before=f"sys.{closed} = None")
    assert done.returncode == code
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a device that is always full")
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("arguments", [("--version",), ("explain", "sigma0"), ("parameters", "--json")])
def test_what_cannot_be_printed_is_told(arguments, unbuffered):
    """Whether Python notices at once or at the end."""
    with open("/dev/full", "w", encoding="utf-8") as full:
        done = subprocess.run(
            [sys.executable, "-m", "aerotri", *arguments], env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
            stdout=full, stderr=subprocess.PIPE, text=True, timeout=120, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.startswith("aerotri: what is printed cannot be written: No space left on device — ")
    assert done.stderr.count("\n") == 1


@pytest.mark.skipif(os.name != "posix", reason="elsewhere a folder in use stays")
@pytest.mark.parametrize("arguments", [("adjust", "block"), ("compare", "a.tif", "b.tif"), ("simulate", "plan.toml")])
def test_a_current_folder_that_is_gone_is_told(arguments, tmp_path):
    words = [*arguments, "--out", "out"] if arguments[0] == "simulate" else arguments
    (tmp_path / "gone").mkdir()
    go = f"import os; os.chdir({str(tmp_path / 'gone')!r}); os.rmdir({str(tmp_path / 'gone')!r})"
    done = ended(*words, before=go)
    assert done.returncode == 2
    said = "aerotri: the current folder is not there any more — change to another folder: cd FOLDER\n"
    assert (done.stdout, done.stderr) == ("", said)


@pytest.mark.parametrize(
    ("library", "module"), [("pycolmap", "aerotri.colmap_library"), ("pyceres", "aerotri.crosscheck.ceres_solver")]
)
def test_a_signal_stays_ours_beside_a_library(library, module):
    if find_spec(library) is None:
        pytest.skip(f"{library} is not installed")
    done = subprocess.run(
        [sys.executable, "-c", IN_A_THREAD.format(module)], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.stdout.split("\n") == ["ours", "goes on", ""], done.stderr
