"""The page from message to remedy quotes what the program says: every quoted text stands in the source code."""

import ast
import re
from functools import cache

import pages
import pytest

from aerotri.reference.lookup import entries, find
from aerotri.report.tables.adjustment import what_to_do
from aerotri.results.adjusted_block import Outcome

PAGE = pages.DOCS / "understand" / "remedies.md"
SOURCE = pages.DOCS.parent / "src" / "aerotri"
LEAST_SHARE, LEAST_LENGTH = 0.5, 5
"""Share of a quoted text, and letters, that one piece of a message has to cover; the rest is filled in at run time."""


@cache
def pieces() -> set[str]:
    """All texts of the source code that the program could print, taken apart where something is filled in."""
    found = set()
    for path in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.add(" ".join(node.value.split()))
    return {piece for piece in found if len(piece) >= LEAST_LENGTH}


def quoted() -> list[str]:
    """The texts of the first columns between the variable parts."""
    rows = re.findall(r"^\| (`.*?) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    codes = [code for row in rows for code in re.findall(r"`([^`]+)`", row)]
    parts = {part.strip(" .,()") for code in codes for part in code.split("…")}
    return sorted(part for part in parts if len(part) >= LEAST_LENGTH)


def is_said(text: str, there: set[str]) -> bool:
    least = LEAST_SHARE * len(text)
    return any(text in piece or (len(piece) >= least and piece in text) for piece in there)


def test_the_program_says_what_the_page_quotes():
    there, texts = pieces(), quoted()
    assert len(texts) > 60
    assert [text for text in texts if not is_said(text, there)] == []


def test_a_text_that_the_program_does_not_say_is_found():
    assert not is_said("the moon is too close to the block", pieces())


def test_every_link_to_a_place_of_the_page_has_its_place():
    page = PAGE.read_text(encoding="utf-8")
    anchors = set(re.findall(r"^\((message-[a-z0-9-]+)\)=$", page, re.MULTILINE))
    links = set(re.findall(r"\(#(message-[a-z0-9-]+)\)", page))
    assert len(anchors) >= 15
    assert links <= anchors


def outcome(status, verdict):
    return Outcome(status, "", 3, 1.0, 1.0, 1.0, 9, 4, 0, 5, verdict=verdict)


@pytest.mark.parametrize(
    ("status", "verdict"),
    [("rank deficient", ""), ("not converged", ""), ("converged", "doubtful"), ("converged", "rejected")],
)
def test_a_result_that_is_not_accepted_leads_to_the_page(status, verdict):
    (line,) = what_to_do(outcome(status, verdict))
    place = re.search(r"remedies\.md#([a-z0-9-]+)$", line)
    word = re.search(r"`aerotri explain ([a-z ]+)`", line)
    assert place is not None
    assert word is not None
    assert f"({place[1]})=" in PAGE.read_text(encoding="utf-8")
    assert [entry for entry in find(word[1], entries()) if entry.kind == "word of a result"]


def test_an_accepted_result_needs_no_remedy():
    assert what_to_do(outcome("converged", "accepted")) == []
