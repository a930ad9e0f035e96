"""Command line: change between two surfaces."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from aerotri.cli.app import app
from aerotri.cli.options import ARGUMENTS, METHOD, OUTPUT, SIGMAS, TERRAIN, Json


@app.command(
    rich_help_panel=TERRAIN,
    epilog="Example: aerotri change drone_dtm drone_dsm --align none --area blocks/drone_site/pile.geojson "
    "--out change",
)
def change(
    first: Annotated[
        Path,
        typer.Argument(
            help="Earlier surface: GeoTIFF with σ as second band, or folder of dsm or dtm.", rich_help_panel=ARGUMENTS
        ),
    ],
    second: Annotated[Path, typer.Argument(help="Later surface.", rich_help_panel=ARGUMENTS)],
    stable: Annotated[
        str | None,
        typer.Option(
            help="Ground that did not change: GeoPackage, GeoJSON, WKT file or WKT text. The second surface is aligned "
            "on it.",
            rich_help_panel=METHOD,
        ),
    ] = None,
    align: Annotated[
        str,
        typer.Option(
            help="What the second surface is moved by on stable ground: none, height, shift (X, Y, height) or tilt "
            "(shift and two tilts).",
            rich_help_panel=METHOD,
        ),
    ] = "shift",
    area: Annotated[
        str | None,
        typer.Option(
            help="Where volumes are wanted, as --stable; several polygons one by one. Default: all in common.",
            rich_help_panel=METHOD,
        ),
    ] = None,
    noise_length: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="Side of the square whose cells share one noise, m. Default: what dsm wrote, or stable ground shows.",
            rich_help_panel=SIGMAS,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default NAME_change here.", rich_help_panel=OUTPUT)
    ] = None,
    plots: Annotated[bool, typer.Option(help="Draw the map and the page.", rich_help_panel=OUTPUT)] = True,
    json_: Json = False,
) -> None:
    """What changed between two surfaces: every cell against its σ, volumes gained and lost with σ."""
    from aerotri.commands.change import run_change

    run_change(first, second, stable, cast(Any, align), area, noise_length, out, plots, json_)
