"""Command line: a flight planned over an area."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerotri.cli.app import app
from aerotri.cli.options import ARGUMENTS, CAMERA, CONTROL, METHOD, OUTPUT, PLACE, PLANNING, SIGMAS, Json, ProjectOf
from aerotri.conventions import InputError

FLIGHT, GROUND = "Flight", "Ground"


@app.command(
    rich_help_panel=PLANNING,
    epilog="Example: aerotri plan 'POLYGON ((0 0, 400 0, 400 250, 0 250, 0 0))' --camera p1 --gsd 0.02 --ground 100 "
    "--target 'sigma-z 0.03' --out plan",
)
def plan(
    area: Annotated[
        str,
        typer.Argument(
            help="Polygon to be flown: file (GeoPackage, GeoJSON, Shapefile, FlatGeobuf, KML, DXF, WKT) or WKT text.",
            rich_help_panel=ARGUMENTS,
        ),
    ],
    camera: Annotated[
        str,
        typer.Option(
            help="Camera: ultracam_d, dmc, rmk_top_15, p1, or a TOML file with a table [camera.NAME] as block.toml.",
            rich_help_panel=CAMERA,
        ),
    ],
    gsd: Annotated[float, typer.Option(help="Size of a pixel on the mean ground, m.", rich_help_panel=FLIGHT)],
    dem: Annotated[Path | None, typer.Option(help="Heights of the ground (GeoTIFF).", rich_help_panel=GROUND)] = None,
    ground: Annotated[
        float | None, typer.Option(help="Height of level ground, m, instead of a DEM.", rich_help_panel=GROUND)
    ] = None,
    crs: Annotated[
        str | None,
        typer.Option(
            help="EPSG:n of the plan. Default: that of the DEM, else of the area; its UTM zone for degrees.",
            rich_help_panel=PLACE,
        ),
    ] = None,
    forward_overlap: Annotated[
        float, typer.Option(help="Overlap in a strip at least, a share of 0 to 0.95.", rich_help_panel=FLIGHT)
    ] = 0.8,
    side_overlap: Annotated[
        float, typer.Option(help="Overlap of strips at least, a share of 0 to 0.95.", rich_help_panel=FLIGHT)
    ] = 0.6,
    direction: Annotated[
        float | None,
        typer.Option(
            help="Direction of the strips, degrees clockwise from grid north. Default: along the longest side.",
            rich_help_panel=FLIGHT,
        ),
    ] = None,
    cross_strips: Annotated[int, typer.Option(min=0, help="Number of strips across.", rich_help_panel=FLIGHT)] = 0,
    height_mode: Annotated[
        str,
        typer.Option(
            help="constant: one altitude; follow: every strip over its own mean ground.", rich_help_panel=FLIGHT
        ),
    ] = "constant",
    rays: Annotated[
        int,
        typer.Option(min=2, help="Number of photographs of every place of the area, at least.", rich_help_panel=FLIGHT),
    ] = 3,
    speed: Annotated[float, typer.Option(help="Speed, m/s.", rich_help_panel=FLIGHT)] = 10.0,
    turn: Annotated[
        float, typer.Option(min=0.0, help="Time from a strip to the next, a number of seconds.", rich_help_panel=FLIGHT)
    ] = 15.0,
    exposure_interval: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Time the camera needs between exposures, a number of seconds; 0: not checked.",
            rich_help_panel=FLIGHT,
        ),
    ] = 0.0,
    positions_sigma: Annotated[
        str,
        typer.Option(
            help="σ of camera positions by GNSS: of X and Y, and of Z, m, as 0.02,0.03; none without.",
            rich_help_panel=SIGMAS,
        ),
    ] = "none",
    control: Annotated[
        str,
        typer.Option(
            help="Control points to add: a number, or auto for as many as the target needs; or a table as control.csv "
            "of those that are there.",
            rich_help_panel=CONTROL,
        ),
    ] = "auto",
    control_sigma: Annotated[
        str, typer.Option(help="σ of control: of X and Y, and of Z, m.", rich_help_panel=SIGMAS)
    ] = "0.02,0.03",
    most_control: Annotated[
        int, typer.Option(min=0, help="Largest number of control points added.", rich_help_panel=CONTROL)
    ] = 30,
    target: Annotated[
        str | None,
        typer.Option(
            help="What must be reached: 'asprs 5cm' (RMSE_H and RMSE_V), 'sigma-z 0.03' (m, on 95 % of the area) or "
            "'sigma-volume 20' (m³).",
            rich_help_panel=METHOD,
        ),
    ] = None,
    self_calibration: Annotated[
        str,
        typer.Option(
            help="Additional parameters to be estimated, as --parameters of adjust. A named camera's interior "
            "orientation is then estimated too.",
            rich_help_panel=CAMERA,
        ),
    ] = "none",
    tie_points: Annotated[
        int, typer.Option(min=20, help="Number of image points expected in a photograph.", rich_help_panel=METHOD)
    ] = 200,
    tie_probability: Annotated[
        float,
        typer.Option(
            help="Probability that a photograph that sees a tie point measures it, 0 to 1.", rich_help_panel=METHOD
        ),
    ] = 0.6,
    image_sigma: Annotated[float, typer.Option(help="σ of an image coordinate, pixels.", rich_help_panel=SIGMAS)] = 0.5,
    most_photographs: Annotated[
        int,
        typer.Option(min=1, help="Largest number of photographs; a plan of more is refused.", rich_help_panel=METHOD),
    ] = 1500,
    piles: Annotated[
        str | None,
        typer.Option(
            help="Polygons of piles, as AREA: σ of the volume of each. Default: those of AREA where it has several.",
            rich_help_panel=PLACE,
        ),
    ] = None,
    project: ProjectOf = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default NAME_plan here.", rich_help_panel=OUTPUT)
    ] = None,
    json_: Json = False,
) -> None:
    """Plan a flight over an area: strips, accuracy to be expected, and control added where it helps most."""
    from aerotri.commands.plan import run_plan

    asked = {
        "camera": camera, "gsd": gsd, "dem": dem, "ground": ground, "crs": crs, "forward_overlap": forward_overlap,
        "side_overlap": side_overlap, "direction": direction, "cross_strips": cross_strips, "height_mode": height_mode,
        "rays": rays, "speed": speed, "turn": turn, "interval": exposure_interval,
        "positions_sigma": None if positions_sigma == "none" else _pair(positions_sigma, "--positions-sigma"),
        "control": int(control) if control.isascii() and control.isdigit() and len(control) < 9 else control,
        "control_sigma": _pair(control_sigma, "--control-sigma"), "most_control": most_control, "target": target,
        "self_calibration": self_calibration, "tie_points": tie_points, "tie_probability": tie_probability,
        "image_sigma": image_sigma, "most_photographs": most_photographs, "project": project,
        "piles": piles,
    }  # fmt: skip
    run_plan(area, out, asked, json_)


def _pair(text: str, option: str) -> tuple[float, float]:
    """Two numbers, or one for both."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 2):
        raise InputError(f"{option} '{text}' is not possible", "give one number or two, as 0.02,0.03")
    return numbers[0], numbers[-1]
