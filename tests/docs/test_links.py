"""Every link of the documentation, and of the files beside it, leads somewhere; nothing is fetched."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

from places import PROJECT

DOCS = PROJECT / "docs"
GENERATED = DOCS / "reference" / "generated"
"""Pages made when the documentation is built: `sphinx-build -W` checks the links to them."""
BESIDE = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")
PAGES = sorted(
    path for path in (*DOCS.rglob("*.md"), *(PROJECT / name for name in BESIDE))
    if path.exists() and not {"_build", "generated"} & set(path.relative_to(PROJECT).parts)
)  # fmt: skip

FENCE = re.compile(r"^(\s*)(```+|~~~+|:::+)")
LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(<?([^)>\s]+)>?(?:\s+\"[^\"]*\")?\)")
OWN_LINE = re.compile(r"^```\{(?:include|figure|image|literalinclude)\}\s+(\S+)", re.MULTILINE)
HEADING = re.compile(r"^(#{1,6})\s+(.+?)\s*#*\s*$")
LABEL = re.compile(r"^\(([^)\s]+)\)=\s*$")
FORMULA = re.compile(r"\$\$.*?\$\$|\$[^$\n]+\$|`[^`\n]*`", re.DOTALL)
DEEPEST_ANCHOR = 4
"""Headings that get an anchor: `myst_heading_anchors` of docs/conf.py."""


def lines_of_text(text: str) -> list[str]:
    """Lines outside fenced code."""
    found, fence = [], ""
    for line in text.splitlines():
        mark = FENCE.match(line)
        if mark and mark[2][0] != ":" and not fence:
            fence = mark[2]
        elif fence and line.strip().startswith(fence) and not line.strip().strip(fence[0]):
            fence = ""
        elif not fence:
            found.append(line)
    return found


def links_of(text: str) -> list[str]:
    """Targets of links and pictures, formulas and inline code left out."""
    plain = FORMULA.sub("", "\n".join(lines_of_text(text)))
    return [*LINK.findall(plain), *OWN_LINE.findall(text)]


def slug(heading: str) -> str:
    """The anchor of a heading as GitHub and MyST make it."""
    words = re.sub(r"`([^`]*)`", r"\1", heading)
    words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", words).replace("*", "")
    kept = "".join(c for c in words.lower() if c.isalnum() or c in " -_")
    return kept.strip().replace(" ", "-")


@cache
def anchors_of(path: Path) -> frozenset[str]:
    """Anchors of a page: labels, and headings, numbered where they repeat."""
    found: list[str] = []
    for line in lines_of_text(path.read_text(encoding="utf-8")):
        if label := LABEL.match(line):
            found.append(label[1])
        if (heading := HEADING.match(line)) and len(heading[1]) <= DEEPEST_ANCHOR:
            name, again = slug(heading[2]), 0
            while (name if not again else f"{name}-{again}") in found:
                again += 1
            found.append(name if not again else f"{name}-{again}")
    return frozenset(found)


def broken(link: str, page: Path) -> str:
    """Why a link leads nowhere; '' where it does lead somewhere."""
    if re.match(r"[a-z][a-z0-9+.-]*:", link):
        scheme = link.partition(":")[0]
        return "" if scheme in ("https", "mailto") else f"the scheme {scheme} is not https"
    target, _, anchor = link.partition("#")
    path = (page.parent / target).resolve() if target else page
    if path.is_relative_to(GENERATED):
        return ""
    if not path.is_relative_to(PROJECT):
        return "leaves the repository"
    if not path.exists():
        return "is not there"
    if anchor and path.suffix == ".md" and anchor not in anchors_of(path):
        return f"has no heading or label '{anchor}'"
    return ""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(PROJECT)))
def test_links(page):
    text = page.read_text(encoding="utf-8")
    wrong = {link: why for link in links_of(text) if (why := broken(link, page))}
    assert not wrong


def test_all_pages_are_looked_at():
    assert PROJECT / "README.md" in PAGES
    assert DOCS / "theory" / "index.md" in PAGES


@pytest.mark.parametrize(
    ("link", "why"),
    [
        ("least_squares.md", ""),
        ("least_squares.md#datum", ""),
        ("choice.md#choosing-a-set", ""),
        ("../validation/damaged.md#rank-defects", ""),
        ("../../tools/results/paper_003.md", ""),
        ("https://example.org/page", ""),
        ("http://example.org/page", "the scheme http is not https"),
        ("least_sqares.md", "is not there"),
        ("least_squares.md#no-such-heading", "has no heading or label 'no-such-heading'"),
        ("#no-such-heading", "has no heading or label 'no-such-heading'"),
        ("../../../elsewhere.md", "leaves the repository"),
    ],
)
def test_broken_links_are_found(link, why):
    assert broken(link, DOCS / "theory" / "index.md") == why


def test_code_and_formulas_are_no_links():
    text = "[a](one.md) `[b](two.md)` $f[x](y)$\n\n```python\nd[0](three.md)\n```\n\n![c](four.png)\n"
    assert links_of(text) == ["one.md", "four.png"]
    assert links_of("```{include} five.md\n```\n") == ["five.md"]


def test_headings_become_anchors():
    assert slug("`datum` and *defects*: σ of 3 × 3") == "datum-and-defects-σ-of-3--3"
