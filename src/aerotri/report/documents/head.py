"""The head that all documents have: project, date of computation, version, coordinate system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from aerotri.observations.project import Project
from aerotri.report.documents.parts import Document, Part, signed_together
from aerotri.report.documents.words import Words, breakable
from aerotri.report.head import computed_text, head_rows
from aerotri.results.head import Head
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
    head = Head(project, crs, context.made, version)
    rows = head_rows(words, head, context.name if project.title and context.of_block else "")
    files = dict(files)
    logo = ""
    if project.logo_content:
        logo = "logo" + project.logo_ending
        files[logo] = project.logo_content
    content: dict[str, Any] = {
        "language": words.language, "title": title, "subtitle": subtitle,
        "number": computed_text(words, head),
        "author": breakable(project.company or project.operator), "logo": logo,
        "made": words("head.made", version=__version__), "page": words("head.page", page="{page}", pages="{pages}"),
        "head": [[word, breakable(text, 4000)] for word, text in rows], "parts": signed_together(parts),
    }  # fmt: skip
    return Document(content, files)


def signature_fields(words: Words) -> list[str]:
    """What is signed: place and date, name, signature, stamp."""
    return [words(f"signature.{key}") for key in ("place", "name", "signature", "stamp")]
