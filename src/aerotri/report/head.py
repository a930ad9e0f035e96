"""The rows that pages and documents begin with: project, date of computation, version, coordinate system."""

from __future__ import annotations

from aerotri.coordinates.crs_names import crs_names
from aerotri.report.documents.words import Words
from aerotri.results.head import Head


def head_rows(words: Words, head: Head, block: str = "") -> list[tuple[str, str]]:
    """Words and texts, in the order of the page; the texts are as the user wrote them.

    Parameters
    ----------
    block : its name, where it does not stand in the title.
    """
    project = head.project
    stated = (("client", project.client), ("company", project.company), ("operator", project.operator))
    rows = [(words(f"head.{key}"), text) for key, text in stated if text]
    if project.survey_date:
        rows.append((words("head.survey_date"), words.date(project.survey_date)))
    rows += [(words("head.block"), block)] if block else []
    rows += [(words("head.computed"), computed_text(words, head)), (words("head.version"), f"aerotri {head.version}")]
    rows += crs_rows(words, head.crs)
    lines = project.notes.splitlines()
    return rows + [("" if i else words("head.notes"), line) for i, line in enumerate(lines)]


def computed_text(words: Words, head: Head) -> str:
    """Day and time, as the language writes them."""
    return words.date(head.computed.strftime("%Y-%m-%d")) + head.computed.strftime(" %H:%M UTC")


def crs_rows(words: Words, crs: str) -> list[tuple[str, str]]:
    """Coordinate system by name and code, and the system of the heights."""
    names = crs_names(crs)
    if crs == "local":
        return [(words("head.crs"), words("head.local"))]
    if not names.name:
        return [(words("head.crs"), crs or words("head.not_stated"))]
    return [
        (words("head.crs"), f"{names.name} ({names.code})"),
        (words("head.heights"), names.vertical or words("head.heights_not_named")),
    ]
