"""Command line of everything together: each step is a command line of its own."""

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
    focal_length_mm: Annotated[str, typer.Option(help="In place of EXIF.")] = "",
    pixel_um: Annotated[str, typer.Option(help="Size of a pixel, µm, in place of EXIF.")] = "",
    crs: SystemOfPhotographs = "",
    geoid: Annotated[str, typer.Option(help="Geoid grid for its heights.")] = "",
    seed: Annotated[int, typer.Option(help="Seed; the same seed gives the same result.")] = 1,
    parameters: Annotated[str, typer.Option(help="Additional parameters of the adjustment.")] = "",
    interval: Annotated[str, typer.Option(help="Interval of the pickets of the DTM, or auto.")] = "",
    boundary: Annotated[str, typer.Option(help="Of a volume: GeoPackage, GeoJSON or WKT; no volume without.")] = "",
    base: Annotated[str, typer.Option(help="Of the volume, as aerotri volume takes it.")] = "",
    plots: Annotated[bool, typer.Option(help="Draw the plots of the adjustment.")] = True,
    go_on: Annotated[bool, typer.Option("--go-on", help="Go on after an adjustment that was rejected.")] = False,
    json_: Json = False,
) -> None:
    """Everything: photographs to tie points, adjustment, terrain and volume, with one report."""
    from aerotri.commands.run import run_all

    def given(**values: str) -> tuple[str, ...]:
        return tuple(word for name, value in values.items() if value for word in (f"--{name.replace('_', '-')}", value))

    passed_on = {
        "tiepoints": given(
            gcp=gcp, control_sigma_m=control_sigma_m, control_prefix=control_prefix if gcp else "",
            positions=positions, camera=camera,
            focal_length_mm=focal_length_mm, pixel_um=pixel_um, crs=crs, geoid=geoid, seed=str(seed),
        ) + tuple(word for name in check or () for word in ("--check", name)),
        "adjust": given(parameters=parameters, geoid=geoid, control_prefix="" if gcp else control_prefix)
        + (() if plots else ("--no-plots",)),
        "dtm": given(interval=interval),
        "volume": given(boundary=boundary, base=base) if boundary else (),
    }  # fmt: skip
    raise typer.Exit(run_all(source, out, passed_on, invoke, command_names(), json_, go_on))


def command_names() -> set[str]:
    """Names of the commands there are."""
    return {info.name or info.callback.__name__ for info in app.registered_commands if info.callback is not None}


def invoke(arguments: list[str]) -> int:
    """Exit code of a command line of this program.

    Raises
    ------
    InputError
    """
    ended = typer.main.get_command(app).main(arguments, prog_name="aerotri", standalone_mode=False)
    return ended if isinstance(ended, int) else 0
