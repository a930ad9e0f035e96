"""A document set by typst: PDF, or pictures of its pages. The only place that knows typst."""

from __future__ import annotations

import json
import tempfile
from datetime import datetime
from importlib.resources import files
from pathlib import Path
from typing import Any

from aerotri.conventions import InputError
from aerotri.report.documents.parts import Document

TEMPLATE = "document.typ"
FIRST_UNCOVERED = "\u2c00"
"""Character from which the letters that typst brings along do not suffice, and those of the machine are looked at."""


def pdf_of(document: Document, made: datetime) -> bytes:
    """The document as PDF; the same document and time give the same bytes.

    Parameters
    ----------
    made : the date that the file carries.

    Raises
    ------
    InputError
        When typst is not installed, or a picture cannot be set.
    """
    found = _compiled(document, made, "pdf")
    return found if isinstance(found, bytes) else found[0]


def pages_of(document: Document, made: datetime, form: str = "svg") -> list[bytes]:
    """The pages as pictures, 'svg' or 'png'; arguments and errors as of `pdf_of`."""
    found = _compiled(document, made, form)
    return [found] if isinstance(found, bytes) else list(found)


def typst_module() -> Any:
    """typst.

    Raises
    ------
    InputError
        When it is not installed.
    """
    try:
        import typst
    except ImportError:
        raise InputError("typst is not installed", "install it: pip install 'aerotri[pdf]'") from None
    return typst


def _compiled(document: Document, made: datetime, form: str) -> Any:
    typst = typst_module()
    moment = [made.year, made.month, made.day, made.hour, made.minute, made.second]
    text = json.dumps(document.content | {"moment": moment}, ensure_ascii=False)
    with tempfile.TemporaryDirectory(prefix="aerotri_pdf") as room:
        place = Path(room)
        template = files("aerotri.report.documents").joinpath(TEMPLATE).read_text(encoding="utf-8")
        (place / TEMPLATE).write_text(template, encoding="utf-8")
        (place / "document.json").write_text(text, encoding="utf-8")
        for name, content in document.files.items():
            (place / name).write_bytes(content)
        try:
            return typst.compile(
                str(place / TEMPLATE), root=room, format=form, ppi=110.0,
                ignore_system_fonts=max(text) < FIRST_UNCOVERED, package_path=room,
            )  # fmt: skip
        except typst.TypstError as error:
            said = str(error).splitlines()
            raise InputError(
                f"the document cannot be set: {said[0] if said else 'typst gives no reason'}",
                "is the logo a picture that other programs open?",
            ) from None
