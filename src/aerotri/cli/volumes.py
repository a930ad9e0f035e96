"""Command lines: volumes and what a flight will give."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from aerotri.cli.app import app, predict
from aerotri.cli.options import (
    ARGUMENTS,
    METHOD,
    OUTPUT,
    SIGMAS,
    SURFACE,
    TERRAIN,
    BoundaryOrigin,
    BoundarySigma,
    DensityOf,
    DensitySigma,
    Json,
    ProjectOf,
    Seed,
    SurfaceLayer,
)
from aerotri.volume.settings import BASE, LAYER, SECTIONS, SIGMA, SectionPlan, SigmaOptions
from aerotri.volume.settings import METHOD as VOLUME_METHOD

FLIGHT, SITE = "Flight", "Site"


@app.command(
    rich_help_panel=TERRAIN,
    epilog="Example: aerotri volume drone_project/dtm --boundary blocks/drone_site/pile.geojson "
    "--adjustment drone_project/result --out pile_volume",
)
def volume(
    surface: Annotated[
        Path,
        typer.Argument(
            help="Surface: GeoTIFF, or the folder that dtm or dsm wrote, whose points or cells are then used for σ.",
            rich_help_panel=ARGUMENTS,
        ),
    ],
    layer: SurfaceLayer = LAYER,
    base: Annotated[
        str,
        typer.Option(
            help="level:HEIGHT (m), plane:X,Y,Z;X,Y,Z;X,Y,Z, plane (fitted to the boundary), boundary (spline through "
            "it), lowest (level of its lowest point), or another surface.",
            rich_help_panel=SURFACE,
        ),
    ] = BASE,
    boundary: Annotated[
        str | None,
        typer.Option(
            help="File of polygons (GeoPackage, GeoJSON, Shapefile, FlatGeobuf, KML, DXF, WKT) or WKT text; several "
            "polygons, and the parts of one feature, are piles, each with its own base and volume. Default: the whole "
            "surface.",
            rich_help_panel=SURFACE,
        ),
    ] = None,
    method: Annotated[
        str,
        typer.Option(
            help="The one that counts: prisms, grid, trapezoidal, simpson, simpson38.", rich_help_panel=METHOD
        ),
    ] = VOLUME_METHOD,
    section_spacing: Annotated[
        float | None, typer.Option(min=1e-6, help="Distance of the sections, m.", rich_help_panel=METHOD)
    ] = None,
    azimuth: Annotated[
        float,
        typer.Option(
            help="Direction in which sections follow one another, degrees from north.", rich_help_panel=METHOD
        ),
    ] = SECTIONS.azimuth,
    adjustment: Annotated[
        Path | None,
        typer.Option(
            help="Result folder the surface was measured with; gives the volume its σ.", rich_help_panel=SIGMAS
        ),
    ] = None,
    pickets: Annotated[
        Path | None,
        typer.Option(
            help="pickets.parquet of `aerotri dtm`. Default: that of a folder; else every cell counts as measured.",
            rich_help_panel=SIGMAS,
        ),
    ] = None,
    base_adjustment: Annotated[
        Path | None,
        typer.Option(help="Result folder of a base that is a surface.", rich_help_panel=SIGMAS),
    ] = None,
    base_pickets: Annotated[
        Path | None, typer.Option(help="pickets.parquet of a base that is a surface.", rich_help_panel=SIGMAS)
    ] = None,
    matching_sigma_um: Annotated[
        float | None,
        typer.Option(
            min=1e-6,
            help="σ of an image coordinate in matching, µm. Default: that of the block.",
            rich_help_panel=SIGMAS,
        ),
    ] = None,
    matching_window: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="Side of the matching window on the ground, m; its cells share noise. Default: what dsm wrote into "
            "the surface.",
            rich_help_panel=SIGMAS,
        ),
    ] = SIGMA.matching_window_m,
    base_sigma: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="σ of the base's height, m, common to all of it; for a spline through the boundary in place of what "
            "the ground around tells.",
            rich_help_panel=SIGMAS,
        ),
    ] = SIGMA.base_sigma,
    boundary_sigma: BoundarySigma = SIGMA.boundary_sigma,
    boundary_from: BoundaryOrigin = SIGMA.boundary_from,
    uncorrected: Annotated[
        bool,
        typer.Option(
            "--uncorrected",
            help="The photographs were measured with their image errors in them.",
            rich_help_panel=SIGMAS,
        ),
    ] = False,
    density: DensityOf = None,
    density_sigma: DensitySigma = 0.0,
    project: ProjectOf = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default NAME_volume here.", rich_help_panel=OUTPUT)
    ] = None,
    plots: Annotated[bool, typer.Option(help="Draw the plots and the page.", rich_help_panel=OUTPUT)] = True,
    json_: Json = False,
) -> None:
    """A volume, cut and fill, and how sure it is: σ with every part named."""
    from aerotri.commands.volume import VolumeInput, run_volume

    given = VolumeInput(
        surface, base, boundary, cast(Any, method), adjustment, pickets, base_adjustment, base_pickets,
        cast(Any, layer), density, density_sigma, project, cast(Any, boundary_from),
    )  # fmt: skip
    options = SigmaOptions(
        matching_sigma_um, matching_window, base_sigma=base_sigma, boundary_sigma=boundary_sigma,
        corrected=not uncorrected, boundary_from=cast(Any, boundary_from),
    )  # fmt: skip
    raise typer.Exit(run_volume(given, SectionPlan(section_spacing, azimuth), options, out, plots, json_))


@predict.command(
    "volume", epilog="Example: aerotri predict volume --height 1500 --length 9000 --width 3600 --bridging 3600"
)
def predict_volume(
    height: Annotated[float, typer.Option(help="Flying height over the ground, m.", rich_help_panel=FLIGHT)],
    length: Annotated[float, typer.Option(help="Length of the area, along the strips, m.", rich_help_panel=SITE)],
    width: Annotated[float, typer.Option(help="Width of the area, across the strips, m.", rich_help_panel=SITE)],
    bridging: Annotated[
        float, typer.Option(help="Distance between control points along the strips, m.", rich_help_panel=SITE)
    ],
    sigma0_share: Annotated[
        float,
        typer.Option(help="σ of a height from one model, as a share of the flying height.", rich_help_panel=FLIGHT),
    ] = 2e-4,
    simulate: Annotated[
        bool,
        typer.Option("--simulate", help="Adjust a simulated flight of this design too.", rich_help_panel=METHOD),
    ] = False,
    seed: Seed = 1,
    json_: Json = False,
) -> None:
    """The accuracy of a volume: Kubik's theory, repaired, and the adjustment of a simulated flight."""
    from aerotri.commands.predict import run_predict_volume
    from aerotri.simulation.designs import VolumeDesign

    run_predict_volume(VolumeDesign(height, length, width, bridging, sigma0_share), simulate, seed, json_)


@predict.command("attitude", epilog="Example: aerotri predict attitude --tolerance 1 --thickness 5")
def predict_attitude(
    tolerance: Annotated[
        float, typer.Option(min=1e-9, help="Tolerance of the volume, per cent, 1 σ.", rich_help_panel=SITE)
    ],
    thickness: Annotated[float, typer.Option(help="Mean thickness of the volume, m.", rich_help_panel=SITE)],
    height: Annotated[float, typer.Option(help="Flying height over the ground, m.", rich_help_panel=FLIGHT)] = 1500.0,
    base: Annotated[float, typer.Option(help="Distance between the photographs, m.", rich_help_panel=FLIGHT)] = 900.0,
    focal_length: Annotated[float, typer.Option(help="Focal length, mm.", rich_help_panel=FLIGHT)] = 153.0,
    site: Annotated[
        tuple[float, float],
        typer.Option(metavar="ALONG ACROSS", help="Size along and across the base, m.", rich_help_panel=SITE),
    ] = (400.0, 400.0),
    offset: Annotated[
        tuple[float, float],
        typer.Option(
            metavar="ALONG ACROSS",
            help="Place of the site from the middle of the base, along and across it, m.",
            rich_help_panel=SITE,
        ),
    ] = (0.0, 0.0),
    json_: Json = False,
) -> None:
    """Which σ of ω, φ, κ the tolerance of a volume allows."""
    from aerotri.commands.predict import AttitudeDesign, run_predict_attitude

    design = AttitudeDesign(height, base, focal_length, site, offset, thickness, tolerance)
    run_predict_attitude(design, json_)
