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
        Where the folder holds neither a result, nor a block, nor a plan, the port is taken, or a package is missing.
    """
    for name in ("starlette", "uvicorn"):
        optional_module(name, EXTRA)
    from aerotri.bench.flight_bench import is_plan
    from aerotri.bench.places import photographs_beside, places_of
    from aerotri.bench.serve import serve
    from aerotri.bench.server import make_application
    from aerotri.bench.session import Bench

    console = Console()
    if is_plan(path):
        _serve_plan(path, port, browser, console)
        return
    bench = Bench(places_of(path), photographs or photographs_beside(path), below)

    def tell(address: str) -> None:
        shown = "the block alone" if bench.shown.result is None else str(bench.shown.result)
        console.lines([f"Bench of {shown}: {address}", "Ctrl-C ends it; everything is saved at once."])

    try:
        serve(lambda token: make_application(bench, token), port, browser, tell)
    finally:
        bench.stop()


def _serve_plan(path: Path, port: int, browser: bool, console: Console) -> None:
    """The bench of a planned flight."""
    from aerotri.bench.flight_bench import FlightBench
    from aerotri.bench.flight_pages import make_flight_application
    from aerotri.bench.serve import serve

    bench = FlightBench(path)

    def tell(address: str) -> None:
        console.lines([f"Bench of the plan {bench.given}: {address}", "Ctrl-C ends it; every plan is kept."])

    try:
        serve(lambda token: make_flight_application(bench, token), port, browser, tell)
    finally:
        bench.stop()
