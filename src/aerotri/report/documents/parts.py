"""What a document consists of, as plain data: the head, and parts that the template sets one after the other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

Part = dict[str, Any]
MOST_BOUND, MOST_ROWS = 3, 12
"""Parts that are kept on the page of a signature, and rows of one of them, at most [C]: a third of a page."""


@dataclass(frozen=True)
class Document:
    """What the template is given.

    Parameters
    ----------
    content : title, head, parts and the fixed words, as JSON can hold them.
    files : pictures that the content names, by the names of their files.
    """

    content: dict[str, Any]
    files: dict[str, bytes] = field(default_factory=dict)


def heading(text: str, new_page: bool = False) -> Part:
    """Title of a section."""
    return {"kind": "heading", "text": text, "new_page": new_page}


def paragraph(text: str, small: bool = False) -> Part:
    """Running text."""
    return {"kind": "text", "text": text, "small": small}


def verdict(word: str, text: str, reasons: Sequence[str]) -> Part:
    """The framed judgement with its reasons."""
    return {"kind": "verdict", "word": word, "text": text, "reasons": list(reasons)}


def entries(texts: Iterable[str]) -> Part:
    """A list with a dash before each."""
    return {"kind": "list", "items": list(texts)}


def pairs(rows: Iterable[tuple[str, str]]) -> Part:
    """Words with what they say."""
    return {"kind": "pairs", "rows": [list(row) for row in rows]}


def table(columns: Sequence[str], rows: Iterable[Sequence[str]], words: int = 1, small: bool = False) -> Part:
    """A table; its head is repeated on every page.

    Parameters
    ----------
    columns : headings, with units.
    words : so many columns from the left hold words, the others numbers.
    small : whether letters are smaller, for tables of many columns.
    """
    return {"kind": "table", "columns": list(columns), "rows": [list(row) for row in rows], "words": words,
            "small": small}  # fmt: skip


def picture(file: str, caption: str, narrow: bool = False) -> Part:
    """A picture over the width of the page, or narrower, so that two stand on a page."""
    return {"kind": "picture", "file": file, "caption": caption, "narrow": narrow}


def signature(fields: Sequence[str]) -> Part:
    """Lines to sign on; never apart from one another."""
    return {"kind": "signature", "fields": list(fields), "before": []}


def signed_together(parts: Sequence[Part]) -> list[Part]:
    """The parts with what stands before a signature bound to it: nobody signs a page on which there is nothing else."""
    found: list[Part] = []
    for part in parts:
        if part["kind"] == "signature":
            before: list[Part] = []
            while found and len(before) < MOST_BOUND and _is_short(found[-1]):
                before.insert(0, found.pop())
            part = part | {"before": before}
        found.append(part)
    return found


def _is_short(part: Part) -> bool:
    if part["kind"] in ("pairs", "table"):
        return len(part["rows"]) <= MOST_ROWS
    return part["kind"] in ("text", "list") or (part["kind"] == "heading" and not part["new_page"])
