"""Command line: the bench in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerotri.cli.app import app
from aerotri.cli.options import ADJUSTMENT, ARGUMENTS, INPUT, OUTPUT


@app.command(rich_help_panel=ADJUSTMENT, epilog="Example: aerotri view frederiksstad_ultracam_result")
def view(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="source",
            help="Result folder of `aerotri adjust`, a block, or the folder of `aerotri plan`.",
            rich_help_panel=ARGUMENTS,
        ),
    ],
    photos: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the photographs. Those of `aerotri run` are found by themselves. Without any, marks are "
            "shown on an empty format.",
            rich_help_panel=INPUT,
        ),
    ] = None,
    below: Annotated[
        list[Path] | None,
        typer.Option(
            help="Surface or orthophoto to be drawn below the plan, GeoTIFF. May be repeated. Those of `aerotri run` "
            "are found beside its result.",
            rich_help_panel=INPUT,
        ),
    ] = None,
    port: Annotated[
        int,
        typer.Option(
            min=0, max=65535, help="Number of the port on this machine; 0: any that is free.", rich_help_panel=OUTPUT
        ),
    ] = 0,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.", rich_help_panel=OUTPUT)
    ] = True,
) -> None:
    """The bench: plan, photographs and rays of a result in the browser; marks moved, rays switched, adjusted again."""
    from aerotri.commands.view import run_view

    run_view(path, photos, tuple(below or ()), port, browser)
