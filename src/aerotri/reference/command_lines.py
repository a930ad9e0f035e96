"""Commands and their options, read off the functions behind them; which program that is, the caller says."""

from __future__ import annotations

import inspect
import types
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

WORDS = {Path: "path", int: "whole number", float: "number", str: "text"}
"""Kinds of values in the words of a user."""


@dataclass(frozen=True)
class CommandOption:
    """An option or argument of a command.

    Parameters
    ----------
    names : as they are written, such as '--out', or 'BLOCK' of an argument. kind : what is given, '' for a switch.
    default : as it would be written, '' where there is none. required : whether it has to be given.
    repeated : whether it may be given several times. panel : heading it stands under in the help. text : what it does.
    """

    names: tuple[str, ...]
    kind: str
    default: str
    required: bool
    repeated: bool
    panel: str
    text: str


@dataclass(frozen=True)
class CommandLine:
    """A command: its name ('predict volume'), how it is called, what it does, an example, and its options."""

    name: str
    usage: str
    text: str
    example: str
    panel: str
    options: tuple[CommandOption, ...]


def command_lines(program: Any) -> tuple[CommandLine, ...]:
    """All commands of a program, commands of commands included.

    Parameters
    ----------
    program : a `typer.Typer`.
    """
    return tuple(_commands(program, "", ""))


def _commands(program: Any, before: str, panel: str) -> Iterator[CommandLine]:
    """Commands of a group; `panel` is that of the group, for those that state none."""
    for info in program.registered_commands:
        if info.hidden:
            continue
        name = f"{before} {info.name or info.callback.__name__.replace('_', '-')}".strip()
        options = tuple(_options(info.callback))
        yield CommandLine(
            name=name,
            usage=" ".join(["aerotri", name, *filter(None, map(_in_usage, options)), "[OPTIONS]"]),
            text=" ".join((info.help or inspect.getdoc(info.callback) or "").split()),
            example=" ".join((info.epilog or "").split()).removeprefix("Example:").strip(),
            panel=_said(info.rich_help_panel) or panel,
            options=options,
        )
    for group in program.registered_groups:
        yield from _commands(group.typer_instance, f"{before} {group.name}".strip(), _said(group.rich_help_panel))


def _in_usage(option: CommandOption) -> str:
    """How an argument, or an option that has to be given, stands in the line that shows the command."""
    name = option.names[0]
    if name.startswith("-"):
        return f"{name} {option.kind.upper().replace(' ', '_')}" if option.required else ""
    name = f"{name} …" if option.repeated else name
    return name if option.required else f"[{name}]"


def _options(function: Any) -> Iterator[CommandOption]:
    hints = typing.get_type_hints(function, include_extras=True)
    for name, parameter in inspect.signature(function).parameters.items():
        annotation, *beside = typing.get_args(hints[name])
        info = beside[0]
        if info.hidden:
            continue
        is_argument, kind, repeated = type(info).__name__ == "ArgumentInfo", _without_none(annotation), False
        if typing.get_origin(kind) is list:
            kind, repeated = typing.get_args(kind)[0], True
        required = parameter.default is inspect.Parameter.empty
        yield CommandOption(
            names=((info.metavar or name).upper(),) if is_argument else _names(name, _stated(info), kind is bool),
            kind=_kind(kind, info), default="" if required else _default(parameter.default), required=required,
            repeated=repeated, panel=_said(info.rich_help_panel), text=" ".join((info.help or "").split()),
        )  # fmt: skip


def _names(name: str, stated: tuple[str, ...], switch: bool) -> tuple[str, ...]:
    """The names of an option; a switch that names none may be switched off as well."""
    if stated:
        return tuple(part.strip() for one in stated for part in one.split("/") if part.strip().startswith("-"))
    plain = name.strip("_").replace("_", "-")
    return (f"--{plain}", f"--no-{plain}") if switch else (f"--{plain}",)


def _stated(info: Any) -> tuple[str, ...]:
    """Names that the function states; in `Annotated` typer keeps the first of them where a default would stand."""
    first = (info.default,) if isinstance(info.default, str) and info.default.startswith("-") else ()
    return (*first, *(info.param_decls or ()))


def _without_none(annotation: Any) -> Any:
    if typing.get_origin(annotation) in (types.UnionType, typing.Union):
        return next(one for one in typing.get_args(annotation) if one is not type(None))
    return annotation


def _kind(kind: Any, info: Any) -> str:
    """What is given after the name, with its range."""
    if kind is bool:
        return ""
    parts = typing.get_args(kind)
    if typing.get_origin(kind) is typing.Literal:
        return " | ".join(map(str, parts))
    if typing.get_origin(kind) is tuple:
        return " ".join(_kind(one, info) for one in parts)
    word, least, most = WORDS.get(kind, str(kind)), getattr(info, "min", None), getattr(info, "max", None)
    if least is not None and most is not None:
        return f"{word}, {least:g} to {most:g}"
    if least is not None:
        return word + (" > 0" if 0 < least < 1 else f" ≥ {least:g}")
    return word if most is None else f"{word} ≤ {most:g}"


def _default(value: Any) -> str:
    if value is None or value is False or value == "":
        return ""
    if value is True:
        return "on"
    if isinstance(value, tuple | list):
        return " ".join(map(_default, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def _said(panel: Any) -> str:
    """A heading where one is stated; typer has a placeholder where none is."""
    return panel if isinstance(panel, str) else ""
