"""Command line: what the reference says."""

from __future__ import annotations

from typing import Annotated

import typer

from aerotri.cli.app import app
from aerotri.cli.options import ARGUMENTS, HELP, Json


# options of other commands are words to explain, not options of this one
@app.command(
    rich_help_panel=HELP, epilog="Example: aerotri explain points.csv sZ",
    context_settings={"ignore_unknown_options": True},
)  # fmt: skip
def explain(
    key: Annotated[
        list[str] | None,
        typer.Argument(
            help="A key of block.toml, a column, a JSON key, a file, an option or a printed word; before it the "
            "file or command it belongs to, where it is to be that one. Without it: what can be asked.",
            rich_help_panel=ARGUMENTS,
        ),
    ] = None,
    json_: Json = False,
) -> None:
    """What a key, a column, a file, an option or a printed word means."""
    from aerotri.commands.explain import run_explain

    run_explain(" ".join(key or ()), app, json_)
