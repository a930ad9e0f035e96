"""The command line answers at once: nothing heavy is imported for its help."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec

import pytest

import aerotri
from aerotri.cli import interruption

HEAVY = ("numpy", "scipy", "numba", "pyarrow", "matplotlib", "pydantic", "cv2", "rasterio")


def test_the_help_imports_nothing_heavy():
    code = (
        "import sys, contextlib, io; sys.argv = ['aerotri', '--help']; import aerotri.cli as cli\n"
        "with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()): cli.main()\n"
        f"print([name for name in {HEAVY} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("module", ["aerotri", "aerotri.cli"])
def test_the_package_runs_as_a_module(module, monkeypatch):
    done = subprocess.run([sys.executable, "-m", module, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == aerotri.__version__
    # what Python calls the program then, whose signals are taken from the first import on
    spec = find_spec(f"{module}.__main__")
    assert spec is not None
    monkeypatch.setattr(sys, "argv", [spec.origin])
    assert interruption.is_program()
    monkeypatch.setattr(sys, "argv", ["/elsewhere/__main__.py"])
    assert not interruption.is_program()
