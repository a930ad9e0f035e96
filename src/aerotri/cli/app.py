"""The program that command lines are added to."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from aerotri.cli.numbers import CheckedCommand
from aerotri.cli.options import COMMAND_PANELS, PLANNING
from aerotri.version import __version__

MARKUP = "markdown"
"""How help texts are read: panels, and nothing in square brackets is lost."""


class ByPanel(TyperGroup):
    """Commands in the order of their panels, whatever module they stand in."""

    def list_commands(self, ctx: Any) -> list[str]:
        def place(name: str) -> int:
            panel = getattr(self.commands[name], "rich_help_panel", "")
            return COMMAND_PANELS.index(panel) if panel in COMMAND_PANELS else len(COMMAND_PANELS)

        return sorted(super().list_commands(ctx), key=place)


class Program(typer.Typer):
    """Commands whose numbers are checked."""

    def command(self, *args: Any, **kwargs: Any) -> Any:
        return super().command(*args, **{"cls": CheckedCommand, **kwargs})


app = Program(
    name="aerotri",
    cls=ByPanel,
    help="Bundle block adjustment with self-calibration for aerial photographs, and how sure it is.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=MARKUP,
)
predict = Program(help="What a flight will give, before it is flown.", no_args_is_help=True, rich_markup_mode=MARKUP)
app.add_typer(predict, name="predict", rich_help_panel=PLANNING)


def invoke(arguments: list[str]) -> int:
    """Exit code of a command line, run in this process.

    Raises
    ------
    InputError
    """
    ended = typer.main.get_command(app).main(arguments, prog_name="aerotri", standalone_mode=False)
    return ended if isinstance(ended, int) else 0


@app.callback(invoke_without_command=True)
def version(
    show: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if show:
        print(__version__)
        raise typer.Exit
