"""Reading a spec file; whatever is wrong with it is said in one line that names the key."""

from __future__ import annotations

import re
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from aerotri.conventions import FilePath, InputError
from aerotri.formats.text.toml_text import read_toml
from aerotri.simulation import spec as spec_module
from aerotri.simulation.spec import SimulationSpec
from aerotri.simulation.spec_table import Table


def read_spec(path: FilePath) -> SimulationSpec:
    """The spec of a `simulation.toml`.

    Raises
    ------
    InputError
        File missing or no TOML, an unknown key, a wrong value: names file, line and key.
    """
    path = Path(path)
    if not path.exists():
        raise InputError("no such file", "give the path of a simulation.toml", path)
    data, text = read_toml(path, "see blocks/frederiksstad_ultracam/simulation.toml")
    return parse_spec(data, path, text)


def parse_spec(data: Mapping[str, Any], file: FilePath | None = None, text: str = "") -> SimulationSpec:
    """The spec of nested tables, as TOML gives them.

    Parameters
    ----------
    data : the tables.
    file, text : where they came from, to name the place of an error.
    """
    try:
        return SimulationSpec.model_validate(data)
    except OverflowError:
        raise InputError("holds a number too large to be read", "give a smaller number", file) from None
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
    keys = [str(part) for part in first["loc"] if part != "[key]"]
    name, line = ".".join(keys), _line_of(text, keys)
    if first["type"] == "extra_forbidden" or "[key]" in first["loc"]:
        raise InputError(f"unknown key '{name}'", _suggestion(keys[-1]), file, line)
    if first["type"] == "missing":
        raise InputError(f"'{name}' is missing", "add it", file, line)
    value = first["input"]
    given = "" if isinstance(value, Mapping | Table) else f" (given: {_shown(value)})"
    message = first["msg"].removeprefix("Value error, ").replace("Input should", "should")
    raise InputError(f"'{name or 'spec'}': {message}{given}", _look_up(keys), file, line)


def _look_up(keys: list[str]) -> str:
    """Where the values stand that a key may have."""
    named = ".".join(key for key in keys if not key.isdigit())
    return f"what it may be: aerotri explain {named}" if named else "write key = value under [table]"


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


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
