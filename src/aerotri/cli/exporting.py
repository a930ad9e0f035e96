"""Command line: a result for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerotri.cli.app import app
from aerotri.cli.options import ADJUSTMENT, ARGUMENTS, DOCUMENTS, INPUT, OUTPUT, Json


@app.command(rich_help_panel=ADJUSTMENT, epilog="Example: aerotri export frederiksstad_ultracam_result --to gpkg")
def export(
    result: Annotated[
        Path,
        typer.Argument(
            help="Result folder of `aerotri adjust`; as PDF also of `aerotri volume` or `aerotri change`.",
            rich_help_panel=ARGUMENTS,
        ),
    ],
    to: Annotated[
        str,
        typer.Option(
            help="gpkg: layers with styles for QGIS. geoparquet: points and rays. stac: an item of a catalogue. "
            "pdf: a document.",
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
    document: Annotated[
        str,
        typer.Option(
            help="Of an adjustment as PDF: report, or calibration, the certificate of its cameras.",
            rich_help_panel=DOCUMENTS,
        ),
    ] = "report",
    camera: Annotated[
        str, typer.Option(help="Camera of a calibration certificate. Default: all.", rich_help_panel=DOCUMENTS)
    ] = "",
    language: Annotated[str, typer.Option(help="Language of a PDF: en or de.", rich_help_panel=DOCUMENTS)] = "en",
    project: Annotated[
        Path | None,
        typer.Option(
            help="Block or result whose [project] stands at the head of the PDF of a volume or a change. Default: "
            "looked for beside it.",
            rich_help_panel=DOCUMENTS,
        ),
    ] = None,
    json_: Json = False,
) -> None:
    """A result for other programs and people: layers for a GIS, tables with geometries, an item of a catalogue, PDF."""
    from aerotri.commands.export import run_export

    of_document = {"document": document, "camera": camera, "language": language, "project": project}
    run_export(result, to, out, scale, flown, of_document, json_)
