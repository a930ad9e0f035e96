"""The arguments that a result was computed with, as its file states them: all of them, the default ones too."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def used_arguments(
    function: Callable[..., Any], given: Mapping[str, Any], units: Mapping[str, str]
) -> list[dict[str, Any]]:
    """A row an argument, as `settings` of adjustment.json has them.

    Parameters
    ----------
    function : whose defaults count. given : values by the names of its arguments, those that are to be stated.
    units : of those that have one.
    """
    defaults = inspect.signature(function).parameters
    return [
        {"key": name, "value": _plain(value), "unit": units.get(name, ""),
         "origin": "default" if _is_same(value, defaults[name].default) else "given"}
        for name, value in given.items()
    ]  # fmt: skip


def used_settings(
    function: Callable[..., Any], settings: DataclassInstance, units: Mapping[str, str]
) -> list[dict[str, Any]]:
    """The same of a record whose fields are arguments of the function."""
    return used_arguments(function, {one.name: getattr(settings, one.name) for one in fields(settings)}, units)


def _plain(value: Any) -> Any:
    """As JSON has it: of files the name alone, of polygons and surfaces what they are."""
    if value is None or isinstance(value, bool | int | float):
        return value
    if isinstance(value, tuple | list):
        return [_plain(one) for one in value]
    if isinstance(value, str | os.PathLike):
        text = os.fspath(value)
        return Path(text).name if isinstance(text, str) and Path(text).is_file() else str(text)
    if isinstance(value, Mapping):
        return ", ".join(map(str, value))
    name = getattr(value, "label", None) or getattr(value, "geom_type", None) or type(value).__name__
    return str(name)


def _is_same(value: Any, default: Any) -> bool:
    """Whether it is the default; polygons and tables are never."""
    if isinstance(value, tuple | list) and isinstance(default, tuple | list):
        return list(value) == list(default)
    return value is default or (isinstance(value, bool | int | float | str) and value == default)
