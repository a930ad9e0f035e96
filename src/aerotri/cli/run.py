"""Command line of everything together."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerotri.cli.app import app
from aerotri.cli.options import (
    ARGUMENTS,
    CONTROL,
    FIRST,
    METHOD,
    OUTPUT,
    SURFACE,
    AxesOfLists,
    BoundaryOrigin,
    BoundarySigma,
    CameraFile,
    CheckPoints,
    ColumnsOfList,
    ControlPrefix,
    ControlSigma,
    DensityOf,
    DensitySigma,
    FocalLength,
    GeoidGrid,
    Json,
    MarkedControl,
    PhotographPositions,
    PixelSize,
    ProjectOf,
    Seed,
    SurfaceLayer,
    SystemOfPhotographs,
    TimeStampsOfFlight,
    Workers,
    cell_of_surface,
)
from aerotri.execution.choice import THREADS
from aerotri.tie_points.settings import DEFAULTS
from aerotri.volume.settings import RUN_LAYER, SIGMA


@app.command(
    rich_help_panel=FIRST,
    epilog="Example: aerotri run blocks/drone_site/photographs --out drone_project "
    "--gcp blocks/drone_site/gcp_list.txt --control-sigma-m 0.01,0.01,0.02 --check K01 --check K02 --check K03 "
    "--boundary blocks/drone_site/pile.geojson",
)
def run(
    source: Annotated[Path, typer.Argument(help="Folder of photographs, or a block.", rich_help_panel=ARGUMENTS)],
    out: Annotated[
        Path,
        typer.Option(
            help="Folder to write: block, result, dtm, volume, dsm, ortho, dsm_volume, and one report.",
            rich_help_panel=OUTPUT,
        ),
    ],
    gcp: MarkedControl = "",
    check: CheckPoints = None,
    control_sigma_m: ControlSigma = "",
    control_prefix: ControlPrefix = "",
    axes: AxesOfLists = None,
    columns: ColumnsOfList = "",
    positions: PhotographPositions = "",
    time_stamps: TimeStampsOfFlight = "",
    camera: CameraFile = None,
    focal_length_mm: FocalLength = None,
    pixel_um: PixelSize = None,
    crs: SystemOfPhotographs = "",
    geoid: GeoidGrid = None,
    seed: Seed = DEFAULTS.seed,
    parameters: Annotated[
        str,
        typer.Option(help="Additional parameters of the adjustment, as adjust takes them.", rich_help_panel=METHOD),
    ] = "",
    interval: Annotated[
        str,
        typer.Option(help="Distance of the points (pickets) of the terrain, m, or auto.", rich_help_panel=SURFACE),
    ] = "",
    boundary: Annotated[
        str,
        typer.Option(
            help="Boundary of a volume: GeoPackage, GeoJSON, Shapefile, FlatGeobuf, KML, DXF or WKT. Without it there "
            "is no volume. It is measured on the terrain (OUT/dtm, of which --layer chooses the surface), and on the "
            "dense surface (OUT/dsm), whatever --layer says.",
            rich_help_panel=SURFACE,
        ),
    ] = "",
    base: Annotated[
        str, typer.Option(help="Base of the volume, as aerotri volume takes it.", rich_help_panel=SURFACE)
    ] = "",
    layer: SurfaceLayer = RUN_LAYER,
    boundary_from: BoundaryOrigin = SIGMA.boundary_from,
    boundary_sigma: BoundarySigma = SIGMA.boundary_sigma,
    density: DensityOf = None,
    density_sigma: DensitySigma = 0.0,
    dense: Annotated[
        bool, typer.Option(help="The dense surface and the orthophoto as well.", rich_help_panel=SURFACE)
    ] = True,
    resolution: Annotated[
        float | None, cell_of_surface("Cell of the dense surface, m. Default: two pixels on the ground.", SURFACE)
    ] = None,
    executor: Workers = THREADS,
    plots: Annotated[bool, typer.Option(help="Draw the plots of the adjustment.", rich_help_panel=OUTPUT)] = True,
    go_on: Annotated[
        bool,
        typer.Option(
            "--go-on",
            help="Go on after a rejected adjustment, or if the place of the block cannot be trusted.",
            rich_help_panel=METHOD,
        ),
    ] = False,
    unmarked: Annotated[
        str,
        typer.Option(
            help="Where control points are marked in no photograph: stop after the tie points, or continue. Default: "
            "stop in a terminal, continue elsewhere.",
            rich_help_panel=CONTROL,
        ),
    ] = "",
    project: ProjectOf = None,
    json_: Json = False,
) -> None:
    """Everything: photographs to tie points, adjustment, terrain, volume and orthophoto, with one report."""
    from aerotri.commands.convert import three_values
    from aerotri.commands.dtm import metres_or_auto
    from aerotri.commands.run import run_all, stop_or_continue

    settings = {
        "control": gcp, "check": check or (), "control_prefix": control_prefix,
        "axes": axes, "columns": columns,
        "control_sigma_m": three_values(control_sigma_m, "--control-sigma-m", may_be_zero=True),
        "positions": positions, "time_stamps": time_stamps, "camera": camera,
        "focal_length_mm": focal_length_mm, "pixel_um": pixel_um, "crs": crs,
        "geoid": geoid, "seed": seed, "parameters": parameters,
        "interval": metres_or_auto(interval) if interval else None,
        "boundary": boundary, "base": base, "layer": layer, "boundary_from": boundary_from,
        "boundary_sigma": boundary_sigma, "density": density, "density_sigma": density_sigma,
        "dense": dense, "resolution": resolution, "plots": plots, "go_on": go_on,
        "unmarked": stop_or_continue(unmarked),
        "executor": executor, "project": project,
    }  # fmt: skip
    raise typer.Exit(run_all(source, out, settings, json_))
