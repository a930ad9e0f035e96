"""The letters of a text file: UTF-8, UTF-16, or the code page of Windows."""

from __future__ import annotations

import codecs
from dataclasses import dataclass
from pathlib import Path

from aerotri.conventions import InputError

UTF8_REMEDY = "save the file as UTF-8"
CODE_PAGE = "cp1252"
"""What programs under Windows write in western languages without asking; UTF-8 is never taken for it."""
SHOWN = 40
"""Characters of a line that are shown at most."""


@dataclass(frozen=True)
class Decoded:
    """A text, and what to say of how it was read; '' where it is UTF-8."""

    text: str
    note: str = ""


def decoded(raw: bytes, path: Path, first_line: int = 1, any_letters: bool = False) -> Decoded:
    """The text of bytes, a line's end as \\n.

    Parameters
    ----------
    path : for the messages. first_line : number of the first line among those of the file.
    any_letters : whether UTF-16 and the code page are read too, not UTF-8 alone.

    Raises
    ------
    InputError
        With the line, where the bytes are no text in any of these.
    """
    if any_letters and raw[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return Decoded(_plain_ends(_utf16(raw, path)))
    try:
        return Decoded(_plain_ends(raw.removeprefix(codecs.BOM_UTF8).decode("utf-8")))
    except UnicodeDecodeError as error:
        place = error.start
    line = raw.count(b"\n", 0, place) + first_line
    try:
        text = raw.decode(CODE_PAGE) if any_letters else ""
    except UnicodeDecodeError:
        text = ""
    if not text or "\0" in text:
        raise InputError("is not UTF-8", UTF8_REMEDY, path, line)
    shown = _plain_ends(text).split("\n")[line - first_line].strip()[:SHOWN]
    return Decoded(_plain_ends(text), f"{path.name}:{line}: not UTF-8, read as Windows-1252: {shown!r}")


def head_decoded(raw: bytes) -> str:
    """The text of the first bytes of a file, whatever they are; '' where they are no text."""
    if raw[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return raw.decode("utf-16", "ignore")
    if b"\0" in raw:
        return ""
    text = raw.removeprefix(codecs.BOM_UTF8)
    try:
        # a letter may be cut in two at the end
        return codecs.getincrementaldecoder("utf-8")().decode(text)
    except UnicodeDecodeError:
        return text.decode(CODE_PAGE, "replace")


def _utf16(raw: bytes, path: Path) -> str:
    try:
        return raw.decode("utf-16")
    except UnicodeDecodeError as error:
        raise InputError("is not a whole UTF-16 text", UTF8_REMEDY, path) from error


def _plain_ends(text: str) -> str:
    return text.replace("\r\n", "\n").replace("\r", "\n")
