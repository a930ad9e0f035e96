"""Reading a spec file; whatever is wrong with it is said in one line that names the key."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from aerotri.conventions import InputError
from aerotri.simulation import spec as spec_module
from aerotri.simulation.spec import SimulationSpec, Table


def read_spec(path: str | os.PathLike) -> SimulationSpec:
    """The spec of a `simulation.toml`.

    Raises
    ------
    InputError
        File missing or no TOML, an unknown key, a wrong value: names file, line and key.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
        data = tomllib.loads(text)
    except FileNotFoundError:
        raise InputError("no such file", "give the path of a simulation.toml", path) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", "", path) from None
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"at line (\d+)", str(error))
        raise InputError(f"is not TOML: {error}", "correct it", path, int(found[1]) if found else None) from None
    return parse_spec(data, path, text)


def parse_spec(data: Mapping[str, Any], file: str | os.PathLike | None = None, text: str = "") -> SimulationSpec:
    """The spec of nested tables, as TOML gives them.

    Parameters
    ----------
    data : the tables.
    file, text : where they came from, to name the place of an error.
    """
    try:
        return SimulationSpec.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
    keys = [str(part) for part in first["loc"] if part != "[key]"]
    name, line = ".".join(keys), _line_of(text, keys)
    if first["type"] == "extra_forbidden" or "[key]" in first["loc"]:
        raise InputError(f"unknown key '{name}'", _suggestion(keys[-1]), file, line)
    if first["type"] == "missing":
        raise InputError(f"'{name}' is missing", "add it", file, line)
    value = first["input"]
    given = "" if isinstance(value, Mapping | Table) else f" (given: {value!r})"
    message = first["msg"].removeprefix("Value error, ").replace("Input should", "should")
    raise InputError(f"'{name or 'spec'}': {message}{given}", "correct it", file, line)


def _suggestion(key: str) -> str:
    tables = [t for t in vars(spec_module).values() if isinstance(t, type) and issubclass(t, Table)]
    known = sorted({name for table in tables for name in table.model_fields} | {"preset"})
    close = get_close_matches(key, known, n=1)
    return f"did you mean '{close[0]}'?" if close else "remove it or correct its name"


def _line_of(text: str, keys: list[str]) -> int | None:
    """The line that sets the last key within the table of the others; of the table when the key is not there."""
    table_line, inside = None, len(keys) == 1
    for number, line in enumerate(text.splitlines(), start=1):
        header = re.fullmatch(r"\s*\[+([^\]]+)\]+\s*(#.*)?", line)
        if header:
            place = [part.strip(" \"'") for part in header[1].split(".")]
            inside = place == [key for key in keys[:-1] if not key.isdigit()]
            if place == keys[: len(place)]:
                table_line = number
        elif keys and inside and re.match(rf"\s*[\"']?{re.escape(keys[-1])}[\"']?\s*=", line):
            return number
        elif table_line is not None and keys and any(re.match(rf"\s*{re.escape(k)}\s*=", line) for k in keys[:-1]):
            table_line = number
    return table_line
