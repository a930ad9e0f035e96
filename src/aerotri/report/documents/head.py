"""The head that all documents have: project, date of computation, version, coordinate system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from aerotri.coordinates.crs_names import crs_names
from aerotri.observations.project import Project
from aerotri.report.documents.parts import Document, Part
from aerotri.report.documents.words import Words, breakable
from aerotri.version import __version__


@dataclass(frozen=True)
class Context:
    """What every document is told beside its result.

    Parameters
    ----------
    words : the language. made : when the result was computed. project : whom it belongs to.
    name : of the block or of the surface. of_block : whether it is that of a block.
    """

    words: Words
    made: datetime
    project: Project
    name: str
    of_block: bool = True


def crs_rows(words: Words, crs: str) -> list[tuple[str, str]]:
    """Coordinate system and system of the heights."""
    names = crs_names(crs)
    if crs == "local":
        return [(words("head.crs"), words("head.local"))]
    if not names.name:
        return [(words("head.crs"), breakable(crs) or words("head.not_stated"))]
    return [
        (words("head.crs"), f"{names.name} ({names.code})"),
        (words("head.heights"), names.vertical or words("head.no_heights")),
    ]


def document(
    context: Context, subtitle: str, crs: str, version: str, parts: Sequence[Part], files: dict[str, bytes]
) -> Document:
    """A document with its head.

    Parameters
    ----------
    subtitle : what kind of document it is. crs : as the result names it. version : of aerotri that computed.
    parts : what follows the head. files : pictures by the names of their files.
    """
    words, project = context.words, context.project
    title = breakable(project.title or context.name)
    computed = words.date(context.made.strftime("%Y-%m-%d")) + context.made.strftime(" %H:%M UTC")
    rows = [(words(f"head.{key}"), breakable(text)) for key, text in _stated(project) if text]
    if project.survey_date:
        rows.append((words("head.survey_date"), words.date(project.survey_date)))
    rows += [(words("head.block"), breakable(context.name))] if project.title and context.of_block else []
    rows += [(words("head.computed"), computed), (words("head.version"), f"aerotri {version}")]
    rows += crs_rows(words, crs)
    rows += _notes(words, project)
    files = dict(files)
    logo = ""
    if project.logo_content:
        logo = "logo" + project.logo_ending
        files[logo] = project.logo_content
    content: dict[str, Any] = {
        "language": words.language, "title": title, "subtitle": subtitle, "number": computed,
        "author": breakable(project.company or project.operator), "logo": logo,
        "made": words("head.made", version=__version__), "page": words("head.page", page="{page}", pages="{pages}"),
        "head": [list(row) for row in rows], "parts": list(parts),
    }  # fmt: skip
    return Document(content, files)


def _stated(project: Project) -> list[tuple[str, str]]:
    return [("client", project.client), ("company", project.company), ("operator", project.operator)]


def _notes(words: Words, project: Project) -> list[tuple[str, str]]:
    lines = project.notes.splitlines()
    return [("" if i else words("head.notes"), breakable(line, 4000)) for i, line in enumerate(lines)]


def signature_fields(words: Words) -> list[str]:
    """What is signed: place and date, name, signature, stamp."""
    return [words(f"signature.{key}") for key in ("place", "name", "signature", "stamp")]
