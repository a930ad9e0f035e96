"""JSON files of other programs, read so that nothing in them can surprise: size of numbers, depth, letters."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from aerotri.conventions import InputError, regular_file

ENDLESS = re.compile(r"[0-9]{300}")
"""Digits of a whole number that no float holds, or Python does not read: it becomes one without end, and is refused."""
HALF = re.compile(r"\\u[dD][89a-fA-F]")
"""The beginning of an escape that may be half of a pair which makes one character."""
TEXT = re.compile(r'"(?:[^"\\]|\\.)*"', re.DOTALL)
"""A text of JSON, as it is written."""

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
    _refuse_half_characters(text, path)
    try:
        return json.loads(text, parse_int=float if ENDLESS.search(text) else None)
    except json.JSONDecodeError as error:
        raise InputError(f"is not JSON: {error.msg}", "is it cut off?", path, error.lineno) from error
    except (RecursionError, ValueError) as error:
        raise InputError("is not JSON that can be read: it is nested too deeply", remedy, path) from error


def _refuse_half_characters(text: str, path: Path) -> None:
    """Refuse texts of a JSON file that cannot be written again: half of a pair of escapes stands alone."""
    for found in TEXT.finditer(text) if HALF.search(text) else ():
        if HALF.search(found[0]) is None:
            continue
        try:
            json.loads(found[0], strict=False).encode("utf-8")
        except UnicodeEncodeError as error:
            line = text.count("\n", 0, found.start()) + 1
            message = f"a text has half a character, \\u{ord(error.object[error.start]):04x}"
            remedy = "was a name cut in the middle of a character? give it another one"
            raise InputError(message, remedy, path, line) from error
        except json.JSONDecodeError:
            # said with its place where the whole is read
            return
