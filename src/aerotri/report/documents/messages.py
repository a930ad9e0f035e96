"""What the program said, in the document as it was said."""

from __future__ import annotations

from collections.abc import Sequence

from aerotri.report.documents.parts import Part, entries, heading, paragraph
from aerotri.report.documents.words import Words, breakable


def in_english(words: Words) -> list[Part]:
    """That messages and pictures are in English, for readers of another language."""
    return [] if words.language == "en" else [paragraph(words("head.language_of_program"), small=True)]


def message_parts(warnings: Sequence[str], words: Words, notes: Sequence[str] = ()) -> list[Part]:
    """Warnings, or that there are none, and notes where there are any."""
    parts: list[Part] = [heading(words("report.warnings"))]
    parts.append(entries(breakable(text) for text in warnings) if warnings else paragraph(words("report.no_warnings")))
    if notes:
        parts += [heading(words("report.notes")), entries(breakable(text) for text in notes)]
    return parts
