"""TOML beside what tomllib does: which line a key stands on, and writing."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.text.csv_text import read_bytes

_KEY_PART = re.compile(r'"((?:[^"\\]|\\.)*)"|\'([^\']*)\'|([A-Za-z0-9_-]+)')
_HEADER = re.compile(r"\s*\[([^\[\]]+)\]\s*(#.*)?$")
_KEY = re.compile(r"\s*([^=#]+?)\s*=")
DOTTED = re.compile(r"[\w-]+(?:[ \t]*\.[ \t]*[\w-]+)*")
DEEPEST = 100
"""Parts of a key a.b.c: tomllib takes a time that grows with the square of their number."""
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def read_toml(
    path: Path, remedy: str = "write key = value under [table], names and texts in quotes"
) -> tuple[dict[str, Any], str]:
    """Content and text of a TOML file.

    Raises
    ------
    InputError
        When it cannot be read or is not TOML, with the line.
    """
    raw = read_bytes(path)
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise InputError("is not UTF-8", "save the file as UTF-8", path, line) from error
    deep = next((found for found in DOTTED.finditer(text) if found.group().count(".") > DEEPEST), None)
    if deep is not None:
        line = text.count("\n", 0, deep.start()) + 1
        raise InputError("is not TOML: nested too deeply", remedy, path, line)
    try:
        return tomllib.loads(text), text
    except (ValueError, RecursionError) as error:
        found = re.search(r"at line (\d+), column (\d+)", str(error))
        line = int(found[1]) if found else text.count("\n") + 1
        reason = re.sub(r"\s*\(at .*\)$", "", str(error)) or "nested too deeply"
        raise InputError(f"is not TOML: {reason}", remedy, path, line) from error


def line_of_key(text: str, path: Sequence[str | int]) -> int | None:
    """Line (from 1) of a key, or of the table nearest above it; None when nothing of it is in the text."""
    found, depth, table = None, 0, ()
    for number, line in enumerate(text.splitlines(), 1):
        header = _HEADER.match(line)
        key = None if header else _KEY.match(line)
        if header:
            candidate = table = _split(header[1])
        elif key:
            candidate = table + _split(key[1])
        else:
            continue
        if len(candidate) > depth and candidate == tuple(path[: len(candidate)]):
            found, depth = number, len(candidate)
    return found


def _split(key: str) -> tuple[str, ...]:
    return tuple("".join(part) for part in _KEY_PART.findall(key))


def toml_of(content: Mapping[str, Any]) -> str:
    """TOML text of nested tables, strings, numbers, booleans and lists of these.

    A table of the type `Inline` stands on one line, every other gets a header.

    Raises
    ------
    InputError
        For a number that is not finite.
    """
    lines: list[str] = []
    _emit(content, (), lines)
    return "\n".join(lines).strip() + "\n"


def _emit(table: Mapping[str, Any], path: tuple[str, ...], lines: list[str]) -> None:
    plain = {key: value for key, value in table.items() if not _is_section(value)}
    sections = {key: value for key, value in table.items() if _is_section(value)}
    if path and (plain or not sections):
        lines += ["", f"[{'.'.join(_key(part) for part in path)}]"]
    lines += [f"{_key(key)} = {_value(value)}" for key, value in plain.items()]
    for key, value in sections.items():
        _emit(value, (*path, key), lines)


def _is_section(value: Any) -> bool:
    """Whether a value gets a header of its own."""
    return isinstance(value, Mapping) and not isinstance(value, Inline)


class Inline(dict[str, Any]):
    """A table written on one line: ``{ value = 1.0, sigma = 0.1 }``."""


def _key(part: str) -> str:
    return part if _BARE.fullmatch(part) else _string(part)


def value_text(value: Any) -> str:
    """A value as TOML has it.

    Raises
    ------
    InputError
        For a number that is not finite.
    """
    return _value(value)


def key_text(name: str) -> str:
    """A key as TOML has it, in quotes where it needs them."""
    return _key(name)


def _value(value: Any) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(key)} = {_value(entry)}" for key, entry in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_value(entry) for entry in value)}]"
    if isinstance(value, (int, np.integer)):
        return repr(int(value))
    if not math.isfinite(value):
        raise InputError(f"a setting is {value}, no finite number", "give a finite number")
    return repr(float(value))


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
