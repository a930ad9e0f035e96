"""Command line of everything together."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerotri.cli.app import app
from aerotri.cli.options import (
    CheckPoints,
    ControlPrefix,
    ControlSigma,
    Json,
    MarkedControl,
    PhotographPositions,
    SystemOfPhotographs,
)
from aerotri.tie_points.settings import DEFAULTS


@app.command(epilog="Example: aerotri run photographs --out project --gcp gcp_list.txt --control-sigma-m 0.02")
def run(
    source: Annotated[Path, typer.Argument(help="Folder of photographs, or a block.")],
    out: Annotated[Path, typer.Option(help="Folder to write: block, result, dtm, volume, and one report.")],
    gcp: MarkedControl = "",
    check: CheckPoints = None,
    control_sigma_m: ControlSigma = "",
    control_prefix: ControlPrefix = "",
    positions: PhotographPositions = "",
    camera: Annotated[str, typer.Option(help="Camera: [camera.NAME] tables (.toml), orthority.")] = "",
    focal_length_mm: Annotated[float | None, typer.Option(min=1e-6, help="In place of EXIF.")] = None,
    pixel_um: Annotated[float | None, typer.Option(min=1e-6, help="Size of a pixel, µm, in place of EXIF.")] = None,
    crs: SystemOfPhotographs = "",
    geoid: Annotated[str, typer.Option(help="Geoid grid for its heights.")] = "",
    seed: Annotated[int, typer.Option(help="Seed; the same seed gives the same result.")] = DEFAULTS.seed,
    parameters: Annotated[str, typer.Option(help="Additional parameters of the adjustment.")] = "",
    interval: Annotated[str, typer.Option(help="Interval of the pickets of the DTM, or auto.")] = "",
    boundary: Annotated[str, typer.Option(help="Of a volume: GeoPackage, GeoJSON or WKT; no volume without.")] = "",
    base: Annotated[str, typer.Option(help="Of the volume, as aerotri volume takes it.")] = "",
    plots: Annotated[bool, typer.Option(help="Draw the plots of the adjustment.")] = True,
    go_on: Annotated[bool, typer.Option("--go-on", help="Go on after an adjustment that was rejected.")] = False,
    json_: Json = False,
) -> None:
    """Everything: photographs to tie points, adjustment, terrain and volume, with one report."""
    from aerotri.commands.convert import three_values
    from aerotri.commands.dtm import metres_or_auto
    from aerotri.commands.run import run_all

    settings = {
        "control": gcp, "check": check or (), "control_prefix": control_prefix,
        "control_sigma_m": three_values(control_sigma_m, "--control-sigma-m", may_be_zero=True),
        "positions": positions, "camera": camera, "focal_length_mm": focal_length_mm, "pixel_um": pixel_um, "crs": crs,
        "geoid": geoid, "seed": seed, "parameters": parameters,
        "interval": metres_or_auto(interval) if interval else None,
        "boundary": boundary, "base": base, "plots": plots, "go_on": go_on,
    }  # fmt: skip
    raise typer.Exit(run_all(source, out, settings, json_))
