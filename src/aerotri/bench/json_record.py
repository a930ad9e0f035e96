"""The JSON record of a folder that the bench opens."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from aerotri.conventions import InputError


def read_record(path: Path, what: str, remedy: str) -> dict[str, Any]:
    """The record; InputError where the file cannot be read, or is no record of `what`."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, OSError, RecursionError) as error:
        raise InputError(f"cannot be read: {error}", remedy, path) from None
    if not isinstance(content, dict):
        raise InputError(f"is no record of {what}", remedy, path)
    return content
