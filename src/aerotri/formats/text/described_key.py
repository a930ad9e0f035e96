"""Keys of a settings file that say what they mean."""

from __future__ import annotations

from typing import Any

from pydantic import Field


def key(default: Any, text: str, unit: str = "") -> Any:
    """A key: its default, what it means in plain words, its unit; without a default give `...`."""
    return Field(default, description=text, json_schema_extra={"unit": unit})
