"""The command line answers at once: nothing heavy is imported for its help."""

from __future__ import annotations

import subprocess
import sys

HEAVY = ("numpy", "scipy", "numba", "pyarrow", "matplotlib", "pydantic", "cv2", "rasterio")


def test_the_help_imports_nothing_heavy():
    code = (
        "import sys, contextlib, io; sys.argv = ['aerotri', '--help']; import aerotri.cli as cli\n"
        "with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()): cli.main()\n"
        f"print([name for name in {HEAVY} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
