"""Command line: a result for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerotri.cli.app import app
from aerotri.cli.options import ADJUSTMENT, INPUT, OUTPUT, Json, ResultFolder


@app.command(rich_help_panel=ADJUSTMENT, epilog="Example: aerotri export frederiksstad_ultracam_result --to gpkg")
def export(
    result: ResultFolder,
    to: Annotated[
        str,
        typer.Option(
            help="gpkg: layers with styles for QGIS. geoparquet: points and rays. stac: an item of a catalogue.",
            rich_help_panel=OUTPUT,
        ),
    ] = "gpkg",
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default NAME_export here.", rich_help_panel=OUTPUT)
    ] = None,
    scale: Annotated[
        float | None,
        typer.Option(
            min=1e-6,
            help="By how much error ellipses and differences are drawn larger, a number. Default: as suits the block.",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    flown: Annotated[
        str,
        typer.Option(
            help="Date or time (UTC) of the flight for a catalogue, such as 2026-05-17. Default: when the result was "
            "written.",
            rich_help_panel=INPUT,
        ),
    ] = "",
    json_: Json = False,
) -> None:
    """A result for other programs: layers for a GIS, tables with geometries, an item of a catalogue."""
    from aerotri.commands.export import run_export

    run_export(result, to, out, scale, flown, json_)
