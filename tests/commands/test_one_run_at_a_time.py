"""Two runs of `dsm` or `ortho` do not write to one place at the same time."""

from __future__ import annotations

import subprocess
import sys

import pytest

import aerotri
from aerotri.commands.dsm import run_dsm
from aerotri.commands.ortho import run_ortho
from aerotri.conventions import InputError
from aerotri.terrain.ortho.settings import OrthoSettings
from aerotri.terrain.settings import DenseSettings

HOLD = """
import sys
from aerotri.formats.files.work_place import held
with held(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def taken(tmp_path):
    """A place that another process writes to."""
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path / "out")], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield tmp_path / "out"
        process.kill()


def test_a_second_dsm_is_refused(taken):
    with pytest.raises(InputError, match="out: another run is writing here — wait until it has ended"):
        run_dsm(taken.parent / "result", [], taken, DenseSettings(), plots=False, as_json=True)


def test_a_second_ortho_is_refused(taken):
    place = taken.parent
    with pytest.raises(InputError, match="out: another run is writing here — wait until it has ended"):
        run_ortho(place / "result", [], place / "dsm", "dsm", taken, OrthoSettings(), plots=False, as_json=True)


def test_tiles_that_another_run_makes_are_refused(taken):
    """In Python too, whatever folder they are in."""
    place = taken.parent
    with pytest.raises(InputError, match="out: another run is writing here — wait until it has ended"):
        aerotri.dense_surface(place / "result", [], tiles=taken)
    with pytest.raises(InputError, match="out: another run is writing here — wait until it has ended"):
        aerotri.orthophoto(place / "result", [], place / "dsm.tif", place / "ortho", tiles=taken)
