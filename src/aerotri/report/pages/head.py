"""What all pages share: their templates, and the head with project, date of computation and coordinate system."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from aerotri.observations.project import Project
from aerotri.report.documents.words import Words
from aerotri.report.head import head_rows
from aerotri.report.quality import printable
from aerotri.results.head import Head


@dataclass(frozen=True)
class PageHead:
    """The head of a page.

    Parameters
    ----------
    title : of the project, '' without one. logo : a data address, '' without one. rows : words and texts.
    version : of aerotri.
    """

    title: str
    logo: str
    rows: tuple[tuple[str, str], ...]
    version: str


def page_head(head: Head, block: str = "") -> PageHead:
    """The head as `head.html.j2` shows it; `block` as of `head_rows`."""
    rows = [(word, printable(text, 4000)) for word, text in head_rows(Words("en"), head, block)]
    return PageHead(printable(head.project.title), logo_address(head.project), tuple(rows), head.version)


def settings_rows(content: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Name, value and origin of all `settings` of volume.json or change.json, as `head.html.j2` shows them."""
    return [
        (printable(one["key"]), _stated(one["value"], one["unit"]), str(one["origin"]))
        for one in content.get("settings") or []
    ]


def _stated(value: Any, unit: str) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    text = f"{value:.9g}" if isinstance(value, int | float) else printable(str(value), 300)
    return f"{text} {unit}".strip()


def page_environment() -> Environment:
    """The templates; every text is escaped, and a name that is missing is an error."""
    return Environment(
        loader=PackageLoader("aerotri.report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip


def logo_address(project: Project) -> str:
    """The logo inside a page, as a data address; '' where there is none."""
    kind = {".png": "png", ".jpg": "jpeg", ".svg": "svg+xml"}.get(project.logo_ending)
    if kind is None or not project.logo_content:
        return ""
    return f"data:image/{kind};base64,{base64.b64encode(project.logo_content).decode('ascii')}"
