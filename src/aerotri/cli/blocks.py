"""Command lines: blocks begun, checked, simulated, and adjusted by other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerotri.cli.app import app
from aerotri.cli.options import (
    ADJUSTMENT,
    ARGUMENTS,
    BLOCKS,
    METHOD,
    OUTPUT,
    BlockFolder,
    CameraName,
    CameraSize,
    ControlPrefix,
    GeoidGrid,
    Json,
    Overwrite,
    Seed,
    StatedFocalLength,
    StatedPixelSize,
)
from aerotri.conventions import InputError

PHOTOGRAPHS = "Photographs"


@app.command(
    rich_help_panel=BLOCKS,
    epilog="Example: aerotri init gravel_pit --camera-size 8192x5460 --pixel-um 4.4 --focal-length-mm 35",
)
def init(
    folder: Annotated[
        Path, typer.Argument(help="Folder of the new block; no file in it is replaced.", rich_help_panel=ARGUMENTS)
    ],
    camera_name: CameraName = "main",
    camera_size: CameraSize = "",
    pixel_um: StatedPixelSize = None,
    focal_length_mm: StatedFocalLength = None,
    json_: Json = False,
) -> None:
    """Begin a block: block.toml with every key explained, and empty tables with their columns."""
    from aerotri.commands.init import run_init

    run_init(folder, camera_name, camera_size, pixel_um, focal_length_mm, json_)


@app.command(rich_help_panel=BLOCKS, epilog="Example: aerotri check blocks/frederiksstad_ultracam")
def check(
    block: BlockFolder,
    control_prefix: ControlPrefix = "",
    geoid: GeoidGrid = None,
    json_: Json = False,
) -> None:
    """Read a block without adjusting it: what it holds, what looks wrong, what an adjustment lacks."""
    from aerotri.commands.check import run_check

    raise typer.Exit(run_check(block, control_prefix, geoid, json_))


@app.command(
    rich_help_panel=BLOCKS,
    epilog="Example: aerotri simulate blocks/drone_site/simulation.toml --out drone_site --render --seed 1",
)
def simulate(
    spec: Annotated[Path, typer.Argument(help="Flight plan (TOML).", rich_help_panel=ARGUMENTS)],
    out: Annotated[Path, typer.Option(help="Block folder to write; its truth/ stands inside.", rich_help_panel=OUTPUT)],
    seed: Seed = 1,
    render: Annotated[
        bool,
        typer.Option(
            "--render",
            help="Photographs too: 16 bit TIFF, or JPEG with EXIF if the plan says so.",
            rich_help_panel=PHOTOGRAPHS,
        ),
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option(help="Photograph to render. May be repeated. Default: all.", rich_help_panel=PHOTOGRAPHS),
    ] = None,
    targets: Annotated[
        bool,
        typer.Option("--targets", help="Render discs at control and check points.", rich_help_panel=PHOTOGRAPHS),
    ] = False,
    blur_px: Annotated[
        float,
        typer.Option(
            min=0.0, max=20.0, help="σ of the blur (point spread) rendered, pixels.", rich_help_panel=PHOTOGRAPHS
        ),
    ] = 0.5,
    noise: Annotated[
        float,
        typer.Option(
            min=0.0, max=20000.0, help="σ of the noise rendered, grey values of 65 535.", rich_help_panel=PHOTOGRAPHS
        ),
    ] = 50.0,
    parts: Annotated[
        int | None,
        typer.Option(
            min=2,
            help="Number of parts in which the block is written, never held whole; adjust computes it part by part.",
            rich_help_panel=METHOD,
        ),
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
) -> None:
    """Make a block with known truth from a flight plan, and photographs of it."""
    from aerotri.commands.simulate import run_simulate, run_simulate_parts

    options = None
    if parts is not None:
        if render or only or targets or overwrite:
            raise InputError("--render, --only, --targets and --overwrite are not for parts", "leave out --parts")
        run_simulate_parts(spec, out, seed, parts, json_)
        return
    if render:
        from aerotri.simulation.rendering import RenderOptions

        options = RenderOptions(blur_px=blur_px, noise=noise, targets=targets)
    elif only or targets:
        raise InputError("--only and --targets are about photographs", "add --render")
    run_simulate(spec, out, seed, json_, options, tuple(only or ()), overwrite)


@app.command(rich_help_panel=ADJUSTMENT, epilog="Example: aerotri crosscheck drone_project/result --out crosscheck")
def crosscheck(
    source: Annotated[
        Path,
        typer.Argument(help="A result folder, a block, or any format that convert reads.", rich_help_panel=ARGUMENTS),
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default NAME_crosscheck here.", rich_help_panel=OUTPUT)
    ] = None,
    json_: Json = False,
) -> None:
    """Adjust the same block by pycolmap and by Ceres with an independent model, and compare against σ."""
    from aerotri.commands.crosscheck import run_crosscheck

    raise typer.Exit(run_crosscheck(source, out, json_))
