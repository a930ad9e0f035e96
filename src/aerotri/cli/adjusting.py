"""Command lines: adjustment, sets of additional parameters, two runs compared."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerotri.cli.app import app
from aerotri.cli.options import BlockFolder, ControlPrefix, GeoidGrid, Json


@app.command(epilog="Example: aerotri adjust blocks/frederiksstad_ultracam --parameters bluh:1-12,ultracam_d:42-73")
def adjust(
    block: BlockFolder,
    out: Annotated[Path | None, typer.Option(help="Result folder; default NAME_result in the current folder.")] = None,
    parameters: Annotated[
        str | None, typer.Option(help="Additional parameters: bluh:1-8+12,ultracam_d:42-73, brown:K1+K2, none, auto.")
    ] = None,
    robust: Annotated[str | None, typer.Option(help="off, huber, danish, cauchy, adaptive or data-snooping.")] = None,
    geoid: GeoidGrid = None,
    check_free: Annotated[
        bool, typer.Option("--check-free", help="Adjust free as well: is an error in the tie points or in the control?")
    ] = False,
    control_prefix: ControlPrefix = "",
    plots: Annotated[bool, typer.Option(help="Draw the plots and the report.")] = True,
    json_: Json = False,
) -> None:
    """Adjust a block: orientation, points, self-calibration, and σ of everything."""
    from aerotri.commands.adjust import run_adjust

    raise typer.Exit(run_adjust(block, out, parameters, robust, geoid, plots, json_, check_free, control_prefix))


@app.command(epilog="Example: aerotri parameters --family dmc --draw patterns")
def parameters(
    family: Annotated[str | None, typer.Option(help="One family in full, such as bluh or dmc.")] = None,
    draw: Annotated[Path | None, typer.Option(help="Folder to picture every pattern in.")] = None,
    json_: Json = False,
) -> None:
    """The sets of additional parameters: names, mark, source, pattern."""
    from aerotri.commands.parameters import run_parameters

    run_parameters(draw, family, json_)


@app.command(epilog="Example: aerotri diff before_result after_result --top 10")
def diff(
    first: Annotated[Path, typer.Argument(help="Result folder of the first run.")],
    second: Annotated[Path, typer.Argument(help="Result folder of the second run; its σ measure the changes.")],
    top: Annotated[int, typer.Option(help="How many photographs, points, rays to name.")] = 5,
    json_: Json = False,
) -> None:
    """What changed between two runs, against σ."""
    from aerotri.commands.diff import run_diff

    raise typer.Exit(run_diff(first, second, top, json_))


@app.command("compare-parameters", epilog="Example: aerotri compare-parameters saar --set none --set bluh:1-12")
def compare_parameters(
    block: BlockFolder,
    sets: Annotated[
        list[str] | None,
        typer.Option("--set", help="A set, as adjust --parameters takes it; may repeat. Default: one of each family."),
    ] = None,
    folds: Annotated[
        int, typer.Option(min=2, max=1000, help="Parts in which control points are left out and predicted.")
    ] = 10,
    robust: Annotated[str | None, typer.Option(help="off, huber, danish, cauchy or adaptive.")] = None,
    geoid: GeoidGrid = None,
    out: Annotated[Path | None, typer.Option(help="Folder to write; default NAME_compare here.")] = None,
    json_: Json = False,
) -> None:
    """Sets of additional parameters side by side: fit, check points, cross-validation over control points."""
    from aerotri.commands.compare_parameters import run_compare_parameters

    raise typer.Exit(run_compare_parameters(block, sets or (), folds, robust, geoid, out, json_))
