"""JSON files of other programs, read so that nothing in them can surprise: size of numbers, depth, letters."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from aerotri.conventions import InputError, regular_file

ENDLESS = re.compile(r"[0-9]{300}")
"""Digits of a whole number that no float holds, or Python does not read: it becomes one without end, and is refused."""
HIGH, LOW = r"\\u[dD][89abAB][0-9a-fA-F]{2}", r"\\u[dD][c-fC-F][0-9a-fA-F]{2}"
HALF = re.compile(rf"(?<!\\)(?:\\\\)*(?:{HIGH}(?!{LOW})|(?<!\\u[dD][89abAB]..){LOW})")
"""Half of a pair of escapes that make one character together."""


HEAD = 1 << 16
"""Bytes that tell what a file holds [C]."""


def json_head(path: Path, endings: tuple[str, ...] = (".json",)) -> str:
    """The beginning of a file of one of these endings; '' where there is none, or it cannot be read."""
    try:
        if path.suffix.lower() not in endings or not path.is_file():
            return ""
        with path.open("rb") as file:
            return file.read(HEAD).decode("utf-8", errors="replace")
    except OSError:
        return ""


def read_foreign_json(path: Path, remedy: str) -> Any:
    """What a JSON file holds.

    Parameters
    ----------
    remedy : what to do where it is JSON that cannot be read.

    Raises
    ------
    InputError
        With the line where that is known.
    """
    regular_file(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError("is not UTF-8", "save the file as UTF-8", path) from error
    except OSError as error:
        reason = f"cannot be read: {error.strerror or error}"
        raise InputError(reason, "check the file and its permissions", path) from error
    half = HALF.search(text)
    if half is not None:
        line = text.count("\n", 0, half.start()) + 1
        message = f"a text has half a character, {half[0]}"
        raise InputError(message, "was a name cut in the middle of a character? give it another one", path, line)
    try:
        return json.loads(text, parse_int=float if ENDLESS.search(text) else None)
    except json.JSONDecodeError as error:
        raise InputError(f"is not JSON: {error.msg}", "is it cut off?", path, error.lineno) from error
    except (RecursionError, ValueError) as error:
        raise InputError("is not JSON that can be read: it is nested too deeply", remedy, path) from error
