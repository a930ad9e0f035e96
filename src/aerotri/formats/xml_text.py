"""XML read without following anything it refers to, and the texts of its elements."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

from aerotri.conventions import InputError
from aerotri.formats.csv_text import read_bytes


def read_xml(path: Path) -> ElementTree.Element:
    """The root element of an XML file.

    Raises
    ------
    InputError
        When the file cannot be read, is not XML, or declares a document type: these can define entities that grow
        without bound or refer to other files, and no format read here has one.
    """
    raw = read_bytes(path)
    if b"<!DOCTYPE" in raw or b"<!ENTITY" in raw:
        raise InputError("declares a document type or entities", "remove the declaration", path)
    try:
        return ElementTree.fromstring(raw)
    except ElementTree.ParseError as error:
        line = error.position[0] if error.position else None
        raise InputError(f"is not XML: {str(error).split(':')[0]}", "repair the file", path, line) from error
    except (ValueError, LookupError) as error:
        raise InputError(f"is not XML: {error}", "save the file as UTF-8", path) from error


def text_of(element: ElementTree.Element | None) -> str:
    """The text of an element without blanks around it; '' where there is none."""
    return "" if element is None else (element.text or "").strip()


def child_text(element: ElementTree.Element, tag: str, path: Path, default: str | None = None) -> str:
    """The text of a child.

    Raises
    ------
    InputError
        When it is missing and there is no default.
    """
    text = text_of(element.find(tag))
    if text:
        return text
    if default is None:
        raise InputError(f"<{element.tag}> has no <{tag}>", f"add <{tag}>…</{tag}>", path)
    return default


def numbers(text: str, count: int | None, name: str, path: Path) -> list[float]:
    """Finite numbers separated by commas; `count` of them, or any number where that is None.

    Raises
    ------
    InputError
    """
    try:
        values = [float(part) for part in text.split(",") if part.strip()]
    except ValueError:
        values = [math.nan]
    if not all(math.isfinite(value) for value in values) or count not in (None, len(values)):
        wanted = "numbers" if count is None else f"{count} number{'s' if count != 1 else ''}"
        raise InputError(f"{name} = '{text}' is not {wanted}", "write numbers separated by commas", path)
    return values
