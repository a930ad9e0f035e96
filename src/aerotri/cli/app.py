"""The program that command lines are added to."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from aerotri.cli.numbers import CheckedCommand
from aerotri.version import __version__


class Program(typer.Typer):
    """Commands whose numbers are checked."""

    def command(self, *args: Any, **kwargs: Any) -> Any:
        return super().command(*args, **{"cls": CheckedCommand, **kwargs})


app = Program(
    name="aerotri",
    help="Bundle block adjustment with self-calibration for aerial photographs, and how sure it is.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
predict = Program(help="What a flight will give, before it is flown.", no_args_is_help=True, rich_markup_mode=None)
app.add_typer(predict, name="predict")


def invoke(arguments: list[str]) -> int:
    """Exit code of a command line, run in this process.

    Raises
    ------
    InputError
    """
    ended = typer.main.get_command(app).main(arguments, prog_name="aerotri", standalone_mode=False)
    return ended if isinstance(ended, int) else 0


@app.callback(invoke_without_command=True)
def version(show: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if show:
        print(__version__)
        raise typer.Exit
