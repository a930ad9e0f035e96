"""Command line: true orthophotos."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from aerotri.cli.app import app
from aerotri.cli.options import ARGUMENTS, INPUT, METHOD, OUTPUT, TERRAIN, Json, ResultFolder, SurfaceLayer, Workers
from aerotri.execution.choice import THREADS
from aerotri.terrain.ortho.settings import DEFAULTS, OrthoSettings
from aerotri.terrain.settings import LARGEST_EDGE


@app.command(
    rich_help_panel=TERRAIN,
    epilog="Example: aerotri ortho drone_project/result blocks/drone_site/photographs drone_dtm --out drone_ortho",
)
def ortho(
    result: ResultFolder,
    photographs: Annotated[
        list[Path],
        typer.Argument(help="Folders or files of the photographs, TIFF or JPEG.", rich_help_panel=ARGUMENTS),
    ],
    surface: Annotated[
        Path,
        typer.Argument(
            help="Heights with what stands on the ground: the folder of dsm or dtm, or a GeoTIFF in metres.",
            rich_help_panel=ARGUMENTS,
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default NAME_ortho here.", rich_help_panel=OUTPUT)
    ] = None,
    cell: Annotated[
        float | None,
        typer.Option(
            "--cell", "--resolution",
            min=1e-6, help="Cell, m. Default: the size of a pixel on the ground (GSD).", rich_help_panel=OUTPUT
        ),
    ] = DEFAULTS.cell,
    area: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(
            metavar="X Y X Y", help="X Y of the lower left, X Y of the upper right corner, m.", rich_help_panel=OUTPUT
        ),
    ] = DEFAULTS.area,
    edge: Annotated[
        float,
        typer.Option(
            min=0.0, max=LARGEST_EDGE, help="Share of the photograph at its edge that is not used.",
            rich_help_panel=METHOD,
        ),
    ] = DEFAULTS.edge,
    resampling: Annotated[
        str, typer.Option(help="bicubic, bilinear or nearest.", rich_help_panel=METHOD)
    ] = DEFAULTS.resampling,
    balance: Annotated[
        bool, typer.Option(help="Bring the colours of the photographs to one another.", rich_help_panel=METHOD)
    ] = DEFAULTS.balance,
    seams: Annotated[
        bool,
        typer.Option(
            help="Lay seams where photographs look alike; without, every cell is from its best photograph.",
            rich_help_panel=METHOD,
        ),
    ] = DEFAULTS.seams,
    layer: SurfaceLayer = "dsm",
    ideal: Annotated[
        bool,
        typer.Option(
            "--ideal", help="The photographs are those of imgeo, without image errors.", rich_help_panel=INPUT
        ),
    ] = DEFAULTS.ideal,
    fill: Annotated[
        float,
        typer.Option(
            min=0.0, help="Bridge holes of the surface that are at most so wide, m; for the picture, without σ.",
            rich_help_panel=METHOD,
        ),
    ] = DEFAULTS.fill,
    plots: Annotated[
        bool, typer.Option(
            help="Draw the orthophoto with σ, and the points in it: PNG and SVG in the folder plots; write the page "
            "ortho.html.", rich_help_panel=OUTPUT,
        ),
    ] = True,
    json_: Json = False,
    executor: Workers = THREADS,
) -> None:  # fmt: skip
    """True orthophoto: every cell of the ground from the photograph that sees it best, with σ of positions."""
    from aerotri.commands.ortho import run_ortho

    settings = OrthoSettings(cell, area, edge, cast(Any, resampling), balance, seams, ideal, fill)
    raise typer.Exit(run_ortho(result, photographs, surface, layer, out, settings, plots, json_, executor))
