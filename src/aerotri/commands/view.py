"""`aerotri view`: the bench, a result looked at and mended in the browser."""

from __future__ import annotations

from pathlib import Path

from aerotri.commands.console import Console
from aerotri.public.optional import optional_module

EXTRA = "pip install 'aerotri[view]' installs all that the bench needs"


def run_view(path: Path, photographs: Path | None, below: tuple[Path, ...], port: int, browser: bool) -> None:
    """Serve the bench until it is interrupted; arguments as on the command line.

    Raises
    ------
    InputError
        Where the folder holds neither a result nor a block, the port is taken, or a package is missing.
    """
    for name in ("starlette", "uvicorn"):
        optional_module(name, EXTRA)
    from aerotri.bench.places import photographs_beside, places_of
    from aerotri.bench.serve import serve
    from aerotri.bench.session import Bench

    console = Console()
    bench = Bench(places_of(path), photographs or photographs_beside(path), below)

    def tell(address: str) -> None:
        shown = "the block alone" if bench.result is None else str(bench.result)
        console.lines([f"Bench of {shown}: {address}", "Ctrl-C ends it; everything is saved at once."])

    try:
        serve(bench, port, browser, tell)
    finally:
        bench.stop()
