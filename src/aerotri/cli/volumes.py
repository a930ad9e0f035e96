"""Command lines: volumes and what a flight will give."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from aerotri.cli.app import app, predict
from aerotri.cli.options import Json
from aerotri.volume.settings import BASE, METHOD, SECTIONS, SIGMA, SectionPlan, SigmaOptions


@app.command(epilog="Example: aerotri volume dtm.tif --boundary pile.gpkg --base boundary --adjustment saar_result")
def volume(
    dtm: Annotated[Path, typer.Argument(help="Surface (GeoTIFF).")],
    base: Annotated[
        str,
        typer.Option(
            help="level:HEIGHT, plane:X,Y,Z;X,Y,Z;X,Y,Z, plane (fitted to the boundary), boundary (spline through it), "
            "lowest (level of its lowest point), or another raster."
        ),
    ] = BASE,
    boundary: Annotated[
        str | None, typer.Option(help="GeoPackage, GeoJSON, WKT file or WKT text; the whole surface without.")
    ] = None,
    method: Annotated[
        str, typer.Option(help="The one that counts: prisms, grid, trapezoidal, simpson, simpson38.")
    ] = METHOD,
    section_spacing: Annotated[float | None, typer.Option(min=1e-6, help="Metres between sections.")] = None,
    azimuth: Annotated[float, typer.Option(help="Degrees from north, in which sections follow one another.")] = (
        SECTIONS.azimuth
    ),
    adjustment: Annotated[
        Path | None, typer.Option(help="Result folder the surface was measured with; gives the volume its σ.")
    ] = None,
    pickets: Annotated[
        Path | None, typer.Option(help="pickets.parquet of `aerotri dtm`; without, every cell is taken for one.")
    ] = None,
    base_adjustment: Annotated[Path | None, typer.Option(help="Result folder of a base that is a surface.")] = None,
    base_pickets: Annotated[Path | None, typer.Option(help="pickets.parquet of a base that is a surface.")] = None,
    matching_sigma_um: Annotated[
        float | None, typer.Option(min=1e-6, help="σ of an image coordinate of a picket; default that of the block.")
    ] = None,
    matching_window: Annotated[
        float, typer.Option(min=0.0, help="Side of the matching window on the ground, m; its cells share noise.")
    ] = SIGMA.matching_window_m,
    base_sigma: Annotated[float, typer.Option(min=0.0, help="σ of the base's height, m, common to all of it.")] = (
        SIGMA.base_sigma
    ),
    boundary_sigma: Annotated[float, typer.Option(min=0.0, help="σ of a corner of the boundary, m.")] = (
        SIGMA.boundary_sigma
    ),
    uncorrected: Annotated[
        bool, typer.Option("--uncorrected", help="The photographs were measured with their image errors in them.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Folder to write; default NAME_volume here.")] = None,
    plots: Annotated[bool, typer.Option(help="Draw the plots and the page.")] = True,
    json_: Json = False,
) -> None:
    """A volume, cut and fill, and how sure it is: σ with every part named."""
    from aerotri.commands.volume import VolumeInput, run_volume

    given = VolumeInput(dtm, base, boundary, cast(Any, method), adjustment, pickets, base_adjustment, base_pickets)
    options = SigmaOptions(
        matching_sigma_um, matching_window, base_sigma=base_sigma, boundary_sigma=boundary_sigma,
        corrected=not uncorrected,
    )  # fmt: skip
    raise typer.Exit(run_volume(given, SectionPlan(section_spacing, azimuth), options, out, plots, json_))


@predict.command(
    "volume", epilog="Example: aerotri predict volume --height 1500 --length 9000 --width 3600 --bridging 3600"
)
def predict_volume(
    height: Annotated[float, typer.Option(help="Flying height over the ground, m.")],
    length: Annotated[float, typer.Option(help="Of the area, along the strips, m.")],
    width: Annotated[float, typer.Option(help="Of the area, across the strips, m.")],
    bridging: Annotated[float, typer.Option(help="Distance between control points along the strips, m.")],
    sigma0_share: Annotated[float, typer.Option(help="σ of a height from one model over the flying height.")] = 2e-4,
    simulate: Annotated[bool, typer.Option("--simulate", help="Adjust a simulated flight of this design too.")] = False,
    seed: Annotated[int, typer.Option(help="Of the simulation.")] = 1,
    json_: Json = False,
) -> None:
    """The accuracy of a volume: Kubik's theory, repaired, and the adjustment of a simulated flight."""
    from aerotri.commands.predict import run_predict_volume
    from aerotri.simulation.designs import VolumeDesign

    run_predict_volume(VolumeDesign(height, length, width, bridging, sigma0_share), simulate, seed, json_)


@predict.command("attitude", epilog="Example: aerotri predict attitude --tolerance 1 --thickness 5")
def predict_attitude(
    tolerance: Annotated[float, typer.Option(min=1e-9, help="Of the volume, per cent, 1 σ.")],
    thickness: Annotated[float, typer.Option(help="Mean thickness of the volume, m.")],
    height: Annotated[float, typer.Option(help="Flying height over the ground, m.")] = 1500.0,
    base: Annotated[float, typer.Option(help="Between the photographs, m.")] = 900.0,
    focal_length: Annotated[float, typer.Option(help="mm.")] = 153.0,
    site: Annotated[tuple[float, float], typer.Option(help="Size along and across the base, m.")] = (400.0, 400.0),
    offset: Annotated[
        tuple[float, float], typer.Option(help="Of the site from the middle of the base, along and across it, m.")
    ] = (0.0, 0.0),
    json_: Json = False,
) -> None:
    """Which σ of ω, φ, κ the tolerance of a volume allows."""
    from aerotri.commands.predict import AttitudeDesign, run_predict_attitude

    design = AttitudeDesign(height, base, focal_length, site, offset, thickness, tolerance)
    run_predict_attitude(design, json_)
