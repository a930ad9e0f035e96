"""Command lines: adjustment, sets of additional parameters, two runs compared."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerotri.cli.app import app
from aerotri.cli.options import (
    ADJUSTMENT,
    ARGUMENTS,
    INPUT,
    METHOD,
    OUTPUT,
    BlockFolder,
    CheckPoints,
    ControlPrefix,
    GeoidGrid,
    Json,
    ResultFolder,
    Robust,
    Workers,
)
from aerotri.conventions import InputError
from aerotri.execution.choice import THREADS, chosen


@app.command(
    rich_help_panel=ADJUSTMENT,
    epilog="Example: aerotri adjust blocks/frederiksstad_ultracam --parameters bluh:1-12,ultracam_d:42-73",
)
def adjust(
    block: BlockFolder,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default NAME_result here.", rich_help_panel=OUTPUT)
    ] = None,
    parameters: Annotated[
        str | None,
        typer.Option(
            help="Additional parameters (self-calibration): bluh:1-8+12,ultracam_d:42-73, brown:K1+K2, auto, none. "
            "Default: as block.toml says.",
            rich_help_panel=METHOD,
        ),
    ] = None,
    robust: Robust = None,
    model_part: Annotated[
        str | None,
        typer.Option(
            help="off: σ of the noise alone. on: strips or other groups of photographs that share errors are found, "
            "and σ gets a model part. Default: as block.toml says.",
            rich_help_panel=METHOD,
        ),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            help="Start values of photographs without orientation: strips (control, and strips along the track), "
            "points (tie points alone, whatever the geometry) or auto. Default: as block.toml says.",
            rich_help_panel=METHOD,
        ),
    ] = None,
    check: CheckPoints = None,
    control_prefix: ControlPrefix = "",
    geoid: GeoidGrid = None,
    check_free: Annotated[
        bool,
        typer.Option(
            "--check-free",
            help="Adjust without the control as well: is an error in the tie points or in the control?",
            rich_help_panel=METHOD,
        ),
    ] = False,
    executor: Workers = THREADS,
    photos: Annotated[
        list[Path] | None,
        typer.Option(
            help="Photographs or their folder: the report shows every mark of a control or check point. May be "
            "repeated.",
            rich_help_panel=INPUT,
        ),
    ] = None,
    plots: Annotated[bool, typer.Option(help="Draw the plots and the report.", rich_help_panel=OUTPUT)] = True,
    json_: Json = False,
) -> None:
    """Adjust a block: orientation, points, self-calibration, and σ of everything.

    The folder of divide is adjusted part by part, with --executor on many machines.
    """
    from aerotri.commands.adjust import run_adjust

    names = tuple(check or ())
    if (block / "parts").is_dir() and not (block / "block.toml").exists():
        from aerotri.commands.adjust_parts import run_adjust_parts

        others = {
            "parameters": parameters, "check_free": check_free, "control_prefix": control_prefix,
            "check": names, "model_part": model_part, "start": start, "photos": photos,
        }  # fmt: skip
        raise typer.Exit(run_adjust_parts(block, out, robust, geoid, executor, json_, plots, **others))
    if executor != THREADS:
        chosen(executor)
        # a folder that is not there is told below
        if block.exists():
            raise InputError(f"--executor {executor} for a block in one piece", "divide it first: aerotri divide")
    raise typer.Exit(
        run_adjust(
            block,
            out,
            parameters,
            robust,
            geoid,
            plots,
            json_,
            check_free,
            control_prefix,
            names,
            model_part,
            start,
            tuple(photos or ()),
        )
    )


@app.command(rich_help_panel=ADJUSTMENT, epilog="Example: aerotri divide blocks/frederiksstad_ultracam --parts 4")
def divide(
    block: BlockFolder,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default NAME_parts here.", rich_help_panel=OUTPUT)
    ] = None,
    parts: Annotated[
        int | None,
        typer.Option(min=2, help="Number of parts. Default: parts of 2000 photographs.", rich_help_panel=METHOD),
    ] = None,
    json_: Json = False,
) -> None:
    """Cut a large block into parts; adjust then computes it part by part, with the same numbers."""
    from aerotri.commands.divide import run_divide

    run_divide(block, out, parts, json_)


@app.command(rich_help_panel=ADJUSTMENT, epilog="Example: aerotri parameters --family dmc --out patterns")
def parameters(
    family: Annotated[
        str | None, typer.Option(help="One family in full, such as bluh or dmc.", rich_help_panel=INPUT)
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder to write a picture of every pattern to.", rich_help_panel=OUTPUT),
    ] = None,
    draw: Annotated[Path | None, typer.Option(hidden=True, help="The old form of --out.")] = None,
    json_: Json = False,
) -> None:
    """The sets of additional parameters: names, mark, source, pattern."""
    from aerotri.commands.console import OldForm
    from aerotri.commands.parameters import run_parameters

    form = OldForm(out, draw, "--draw DIR", "--out DIR")
    run_parameters(form.target, family, json_)
    form.tell()


@app.command(
    rich_help_panel=ADJUSTMENT, epilog="Example: aerotri diff plain_result frederiksstad_ultracam_result --top 10"
)
def diff(
    first: Annotated[Path, typer.Argument(help="Result folder of the first run.", rich_help_panel=ARGUMENTS)],
    second: Annotated[
        Path,
        typer.Argument(help="Result folder of the second run; its σ measure the changes.", rich_help_panel=ARGUMENTS),
    ],
    top: Annotated[
        int, typer.Option(help="Number of photographs, points and image points to name.", rich_help_panel=OUTPUT)
    ] = 5,
    json_: Json = False,
) -> None:
    """What changed between two runs, against σ."""
    from aerotri.commands.diff import run_diff

    raise typer.Exit(run_diff(first, second, top, json_))


@app.command(rich_help_panel=ADJUSTMENT, epilog="Example: aerotri halves frederiksstad_ultracam_result")
def halves(
    result: ResultFolder,
    divisions: Annotated[
        list[str] | None,
        typer.Option(
            "--division",
            help="photographs, strips, directions or time: how the photographs are divided. May be repeated. Default: "
            "all.",
            rich_help_panel=METHOD,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default NAME_halves here.", rich_help_panel=OUTPUT)
    ] = None,
    json_: Json = False,
    executor: Workers = THREADS,
) -> None:
    """Adjust two halves of the photographs apart and compare them: model errors, found without control."""
    from aerotri.commands.halves import run_halves

    raise typer.Exit(run_halves(result, divisions or (), out, json_, executor))


@app.command(
    rich_help_panel=ADJUSTMENT,
    epilog="Example: aerotri accuracy frederiksstad_ultracam_result --class-horizontal 7.5 --class-vertical 12",
)
def accuracy(
    result: ResultFolder,
    class_horizontal: Annotated[
        float | None,
        typer.Option(min=1e-6, help="Largest RMSE_H that is allowed, cm: the class asked for.", rich_help_panel=INPUT),
    ] = None,
    class_vertical: Annotated[
        float | None,
        typer.Option(min=1e-6, help="Largest RMSE_V that is allowed, cm: the class asked for.", rich_help_panel=INPUT),
    ] = None,
    vegetated: Annotated[
        Path | None,
        typer.Option(help="Text file with the check points in vegetation, one name a line.", rich_help_panel=INPUT),
    ] = None,
    project_area: Annotated[
        float | None,
        typer.Option(
            min=1e-9,
            help="Project area, km², for the number of check points. Default: within the outermost ground points.",
            rich_help_panel=INPUT,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default NAME_accuracy here.", rich_help_panel=OUTPUT)
    ] = None,
    json_: Json = False,
) -> None:
    """Accuracy by check points, as the ASPRS standard asks for it: a page for the client."""
    from aerotri.commands.accuracy import run_accuracy

    raise typer.Exit(run_accuracy(result, class_horizontal, class_vertical, vegetated, project_area, out, json_))


@app.command(
    "compare-parameters",
    rich_help_panel=ADJUSTMENT,
    epilog="Example: aerotri compare-parameters blocks/frederiksstad_ultracam --set none --set bluh:1-12 --folds 3",
)
def compare_parameters(
    block: BlockFolder,
    sets: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="A set, as adjust --parameters takes it. May be repeated. Default: one of each family.",
            rich_help_panel=METHOD,
        ),
    ] = None,
    folds: Annotated[
        int,
        typer.Option(
            min=2,
            max=1000,
            help="Number of parts in which control points are left out and predicted.",
            rich_help_panel=METHOD,
        ),
    ] = 10,
    robust: Robust = None,
    geoid: GeoidGrid = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default NAME_compare here.", rich_help_panel=OUTPUT)
    ] = None,
    executor: Workers = THREADS,
    json_: Json = False,
) -> None:
    """Sets of additional parameters side by side: fit, check points, cross-validation over control points."""
    from aerotri.commands.compare_parameters import run_compare_parameters

    raise typer.Exit(run_compare_parameters(block, sets or (), folds, robust, geoid, out, json_, executor))
