"""XML read without following anything it refers to, and the texts of its elements."""

from __future__ import annotations

import math
import re
from pathlib import Path
from xml.etree import ElementTree

from aerotri.conventions import InputError
from aerotri.formats.text.csv_text import read_bytes
from aerotri.formats.text.tables import LARGEST_NUMBER

DECLARATION = re.compile(r"<\?xml\s[^>]*\?>")
ENCODING = re.compile(r"""encoding\s*=\s*["']([^"']*)["']""")
ENCODINGS = ("utf-8", "utf8", "us-ascii", "ascii", "iso-8859-1", "latin-1", "iso-8859-15", "windows-1252", "cp1252")
REMEDY = "save the file as UTF-8, and declare that or nothing"


def read_xml(path: Path) -> ElementTree.Element:
    """The root element of an XML file.

    Raises
    ------
    InputError
        When the file cannot be read, is not XML, or declares a document type: these can define entities that grow
        without bound or refer to other files, and no format read here has one.
    """
    return xml_of(read_bytes(path), path)


def xml_of(raw: bytes, path: Path) -> ElementTree.Element:
    """The root element of what an XML file, or a file in an archive, holds; see `read_xml`.

    Raises
    ------
    InputError
    """
    text = _decoded(raw, path)
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError("declares a document type or entities", "remove the declaration", path)
    try:
        return ElementTree.fromstring(DECLARATION.sub("", text, count=1))
    except ElementTree.ParseError as error:
        line = error.position[0] if error.position else None
        raise InputError(
            f"is not XML: {str(error).split(':')[0]}", "export the file again; is it cut off?", path, line
        ) from error
    except (ValueError, LookupError, RecursionError) as error:
        raise InputError(f"is not XML: {error}", "save the file as UTF-8", path) from error


def _decoded(raw: bytes, path: Path) -> str:
    """The text in the encoding that its first line declares.

    Only encodings that write ASCII as ASCII: in UTF-16 or UTF-7 a document type would pass unseen.
    """
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" in raw:
        raise InputError("is not UTF-8", REMEDY, path, 1)
    declared = DECLARATION.match(raw[:1000].decode("latin-1"))
    name = ENCODING.search(declared.group()) if declared else None
    encoding = name[1].lower() if name else "utf-8"
    if encoding not in ENCODINGS:
        raise InputError(f"is written in '{encoding[:40]}'", REMEDY, path, 1)
    try:
        return raw.decode(encoding)
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise InputError(f"is not {encoding.upper()}", REMEDY, path, line) from error


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
    if not all(abs(value) <= LARGEST_NUMBER for value in values) or count not in (None, len(values)):
        wanted = "numbers" if count is None else f"{count} number{'s' if count != 1 else ''}"
        raise InputError(f"{name} = '{text[:60]}' is not {wanted}", "write numbers separated by commas", path)
    return values
