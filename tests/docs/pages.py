"""Pages of the documentation taken literally: their files are written, their commands run, in the order of the page."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path

from aerotri.cli.app import invoke

DOCS = Path(__file__).resolve().parents[2] / "docs"
FENCE = re.compile(r"^```(?P<head>[^\n]*)\n(?P<body>.*?)^```$", re.DOTALL | re.MULTILINE)
CAPTION = re.compile(r"\A:caption: (?P<caption>[^\n]*)\n")


def fences(page: Path) -> Iterator[tuple[str, str, str]]:
    """Every fenced block of a page: its language, its caption ('' without one) and its text."""
    for found in FENCE.finditer(page.read_text(encoding="utf-8")):
        language = found["head"].replace("{code-block}", "").strip()
        caption = CAPTION.match(found["body"])
        yield language, caption["caption"] if caption else "", found["body"][caption.end() if caption else 0 :]


def commands(text: str) -> Iterator[list[str]]:
    """The aerotri commands of a block of shell lines, as arguments; a backslash joins lines."""
    for line in text.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words[:1] == ["aerotri"]:
            yield words[1:]


def page_commands(page: Path) -> list[list[str]]:
    """The arguments of all commands of a page that stand in blocks of shell lines (sh)."""
    return [words for language, _, text in fences(page) if language == "sh" for words in commands(text)]


def follow(page: Path, folder: Path, can_run: Callable[[list[str]], bool] | None = None) -> Iterator[list[str]]:
    """Write each file of a page into a folder and run each of its commands there, in the order of the page.

    A block whose caption is a path with a suffix is a file. The current folder has to be `folder`. Commands for which
    `can_run` is false are left out.

    Yields
    ------
    The arguments of each command, after it has ended with exit code 0.
    """
    for language, caption, text in fences(page):
        if Path(caption).suffix and " " not in caption:
            target = folder / caption
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text, encoding="utf-8")
        if language == "sh":
            for arguments in filter(can_run, commands(text)):
                assert invoke(arguments) == 0, f"{page.name}: aerotri {shlex.join(arguments)}"
                yield arguments
