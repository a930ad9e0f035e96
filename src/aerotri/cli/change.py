"""Command line: change between two surfaces."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from aerotri.cli.app import app
from aerotri.cli.options import ARGUMENTS, METHOD, OUTPUT, SIGMAS, TERRAIN, Json, ProjectOf


@app.command(
    rich_help_panel=TERRAIN,
    epilog="Example: aerotri change drone_dtm drone_dsm --align none --area blocks/drone_site/pile.geojson "
    "--out change",
)
def change(
    first: Annotated[
        Path,
        typer.Argument(
            help="Earlier surface: GeoTIFF (σ, if any, in a second band whose description begins with σ), or folder of "
            "dsm, dtm or run; or a LAS or LAZ cloud.",
            rich_help_panel=ARGUMENTS,
        ),
    ],
    second: Annotated[Path, typer.Argument(help="Later surface, or point cloud.", rich_help_panel=ARGUMENTS)],
    stable: Annotated[
        str | None,
        typer.Option(
            help="Ground that did not change: file of polygons (GeoPackage, GeoJSON, Shapefile, FlatGeobuf, KML, DXF, "
            "WKT) or WKT text. The second surface is aligned on it.",
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
            help="Where volumes are wanted, as --stable; several polygons, and the parts of one, one by one. "
            "Default: all in common.",
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
    cylinder: Annotated[
        float | None,
        typer.Option(
            min=1e-6, help="Of clouds: diameter of the cylinder whose points are averaged, m.", rich_help_panel=METHOD
        ),
    ] = None,
    normal: Annotated[
        float | None,
        typer.Option(min=1e-6, help="Of clouds: diameter of the ball that gives a normal, m.", rich_help_panel=METHOD),
    ] = None,
    reach: Annotated[
        float | None,
        typer.Option(min=1e-6, help="Of clouds: largest distance that is sought, m.", rich_help_panel=METHOD),
    ] = None,
    spacing: Annotated[
        float | None, typer.Option(min=1e-6, help="Of clouds: spacing of the places, m.", rich_help_panel=METHOD)
    ] = None,
    registration: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="Of clouds: error of the position of one to the other, m, 1 σ. Default: from --stable.",
            rich_help_panel=SIGMAS,
        ),
    ] = None,
    first_adjustment: Annotated[
        Path | None,
        typer.Option(
            help="Result of `aerotri adjust` that the first surface or cloud was measured with. With both, "
            "σ takes into account how the errors of each adjustment bend its surface, and errors that both share "
            "(same control points, same camera) cancel.",
            rich_help_panel=SIGMAS,
        ),
    ] = None,
    second_adjustment: Annotated[
        Path | None,
        typer.Option(
            help="The same of the second surface or cloud; the same folder if both come from one adjustment.",
            rich_help_panel=SIGMAS,
        ),
    ] = None,
    project: ProjectOf = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default NAME_change here.", rich_help_panel=OUTPUT)
    ] = None,
    plots: Annotated[bool, typer.Option(help="Draw the map and the page.", rich_help_panel=OUTPUT)] = True,
    json_: Json = False,
) -> None:
    """What changed between two surfaces: every cell against its σ, volumes gained and lost; distances of clouds."""
    from aerotri.commands.change import run_change, run_cloud_change
    from aerotri.conventions import InputError
    from aerotri.public.cloud_epochs import is_cloud

    sizes = {"cylinder": cylinder, "normal": normal, "reach": reach, "spacing": spacing, "registration": registration}
    if is_cloud(first) and is_cloud(second):
        if area is not None or noise_length is not None:
            raise InputError("--area, --noise-length: of surfaces, and clouds were given", "leave them out")
        run_cloud_change(
            first, second, sizes, stable, (first_adjustment, second_adjustment), project, out, plots, json_
        )
        return
    if is_cloud(first) or is_cloud(second):
        surface, cloud = (second, first) if is_cloud(first) else (first, second)
        raise InputError(
            f"{surface} is a surface and {cloud} a point cloud",
            "give two of a kind: both surfaces, or both clouds (dsm writes dsm.tif and dsm.laz)",
        )
    given = [f"--{name}" for name, value in sizes.items() if value is not None]
    if given:
        raise InputError(f"{', '.join(given)}: of point clouds, and surfaces were given", "give two LAS or LAZ files")
    adjustments = (first_adjustment, second_adjustment)
    run_change(first, second, stable, cast(Any, align), area, noise_length, adjustments, project, out, plots, json_)
