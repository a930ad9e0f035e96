"""The arguments that a result was computed with, as a table of its document."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from aerotri.report.documents.parts import Part, heading, paragraph, table
from aerotri.report.documents.words import NO_VALUE, Words, breakable


def argument_parts(content: Mapping[str, Any], words: Words) -> list[Part]:
    """All of `settings` in the JSON file of a volume or a change; nothing of a result that does not have them."""
    used = content.get("settings") or []
    if not used:
        return []
    rows = [(breakable(one["key"]), _text(one, words), words(f"settings.{one['origin']}")) for one in used]
    columns = [words(f"settings.{name}") for name in ("key", "value", "origin")]
    return [heading(words("report.settings")), paragraph(words("settings.about_arguments"), small=True),
            table(columns, rows, words=3, small=True)]  # fmt: skip


def _text(one: Mapping[str, Any], words: Words) -> str:
    value = one["value"]
    if value is None:
        return NO_VALUE
    if isinstance(value, bool):
        return words("settings.yes" if value else "settings.no")
    text = words.short(value) if isinstance(value, int | float) else breakable(value)
    return f"{text} {one['unit']}".strip()
