"""The commands: thin, each a few lines around the package; heavy imports only where they are used."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerotri import __version__
from aerotri.conventions import InputError

if TYPE_CHECKING:
    pass

app = typer.Typer(
    name="aerotri",
    help="Bundle block adjustment with self-calibration for aerial photographs, and how sure it is.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Json = Annotated[bool, typer.Option("--json", help="Print the outcome as JSON instead of text.")]


def main() -> None:
    """Entry point: bad input is one line and exit 2, a failed adjustment its status and exit 1."""
    try:
        app()
    except InputError as error:
        print(f"aerotri: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print("aerotri: interrupted, nothing was written", file=sys.stderr)
        raise SystemExit(130) from None


@app.callback(invoke_without_command=True)
def version(show: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if show:
        print(__version__)
        raise typer.Exit


@app.command(epilog="Example: aerotri adjust blocks/frederiksstad_ultracam --parameters bluh:1-12,ultracam_d:42-73")
def adjust(
    block: Annotated[Path, typer.Argument(help="Block folder, or its block.toml.")],
    out: Annotated[Path | None, typer.Option(help="Result folder; default NAME_result in the current folder.")] = None,
    parameters: Annotated[
        str | None, typer.Option(help="Additional parameters, such as bluh:1-8+12,ultracam_d:42-73, brown:K1+K2, none.")
    ] = None,
    robust: Annotated[str | None, typer.Option(help="off or huber.")] = None,
    geoid: Annotated[
        Path | None, typer.Option(help="Geoid grid (PROJ GeoTIFF) for heights that the CRS does not bring along.")
    ] = None,
    check_free: Annotated[
        bool, typer.Option("--check-free", help="Adjust free as well: is an error in the tie points or in the control?")
    ] = False,
    plots: Annotated[bool, typer.Option(help="Draw the plots and the report.")] = True,
    json_: Json = False,
) -> None:
    """Adjust a block: orientation, points, self-calibration, and σ of everything."""
    from aerotri.commands.adjust import run_adjust

    raise typer.Exit(run_adjust(block, out, parameters, robust, geoid, plots, json_, check_free))


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


@app.command(epilog="Example: aerotri simulate blocks/frederiksstad_ultracam/simulation.toml --out demo --seed 1")
def simulate(
    spec: Annotated[Path, typer.Argument(help="Flight plan (TOML).")],
    out: Annotated[Path, typer.Option(help="Block folder to write; its truth/ stands inside.")],
    seed: Annotated[int, typer.Option(help="Seed; the same seed gives the same block.")] = 1,
    json_: Json = False,
) -> None:
    """Make a block with known truth from a flight plan."""
    from aerotri.commands.simulate import run_simulate

    run_simulate(spec, out, seed, json_)


@app.command(epilog="Example: aerotri convert ../shared/data/dbat_sxb sxb")
def convert(
    source: Annotated[Path, typer.Argument(help="A DBAT script or its folder, a BAL file, a COLMAP model, a block.")],
    target: Annotated[Path, typer.Argument(help="Block folder, BAL file (.txt) or COLMAP folder to write.")],
    to: Annotated[str, typer.Option(help="block, bal, colmap (binary) or colmap-text.")] = "block",
    positions: Annotated[
        Path | None, typer.Option(help="Observed projection centres to add (DBAT: label, X, Y, Z, σ).")
    ] = None,
    json_: Json = False,
) -> None:
    """Convert between formats; a block without orientation is adjusted first where the target needs one."""
    from aerotri.commands.convert import run_convert

    run_convert(source, target, to, positions, json_)


@app.command(epilog="Example: aerotri crosscheck blocks/frederiksstad_ultracam --out check")
def crosscheck(
    source: Annotated[Path, typer.Argument(help="A result folder, a block, or any format that convert reads.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write; default NAME_crosscheck here.")] = None,
    json_: Json = False,
) -> None:
    """Adjust the same block by pycolmap and by Ceres with an independent model, and compare against σ."""
    from aerotri.commands.crosscheck import run_crosscheck

    raise typer.Exit(run_crosscheck(source, out, json_))


if __name__ == "__main__":
    main()
