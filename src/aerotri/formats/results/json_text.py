"""JSON as every file and every answer of the program has it: UTF-8, indented, nothing that is not JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

Content = Mapping[str, Any] | Sequence[Any]


def json_text(content: Content, indent: int | None = 2) -> str:
    """The content as JSON.

    Raises
    ------
    ValueError
        For a number that is not finite: what is not known has to be None.
    """
    return json.dumps(content, indent=indent, ensure_ascii=False, allow_nan=False)


def write_json(path: Path, content: Content) -> None:
    """Write the content to a file."""
    path.write_text(json_text(content) + "\n", encoding="utf-8")


def number_or_none(value: float) -> float | None:
    """A number as JSON takes it: None where it is not known."""
    return float(value) if np.isfinite(value) else None
