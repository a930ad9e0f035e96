"""One page about a whole run: its steps, their figures, and every step's own report or plots in it."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from aerotri.report.quality import printable

LARGEST_PLOTS = 12
"""Plots of a step that has no report of its own."""


def run_page(content: dict[str, Any], folder: Path) -> str:
    """The page as text; it loads nothing from elsewhere, and what the steps' pages hold cannot run scripts.

    Parameters
    ----------
    content : source, steps (name, folder, what, status, reason, seconds, arguments), seconds.
    folder : where the steps wrote.
    """
    environment = Environment(
        loader=PackageLoader("aerotri.report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    steps = [_step(step, folder / step["folder"]) for step in content["steps"]]
    template = environment.get_template("run.html.j2")
    return template.render(source=printable(content["source"]), seconds=content["seconds"], steps=steps)


def _step(step: dict[str, Any], folder: Path) -> dict[str, Any]:
    done = step["status"] == "done"
    pages = [place for place in (folder / "report.html", folder / "volume.html") if done and place.is_file()]
    page = pages[0].read_text(encoding="utf-8") if pages else ""
    plots = sorted((folder / "plots").glob("*.png"))[:LARGEST_PLOTS] if done and not page else []
    return {
        **step,
        "reason": printable(step["reason"], 1000),
        "command": printable("aerotri " + " ".join(step["arguments"]), 1000),
        "figures": _figures(folder) if done else [],
        "page": page,
        "plots": [(plot.stem.replace("_", " "), base64.b64encode(plot.read_bytes()).decode("ascii")) for plot in plots],
        "marking": done and (folder / "control_marks" / "marking.html").is_file(),
    }


def _figures(folder: Path) -> list[tuple[str, str]]:
    """Numbers, texts and sentences at the top of the JSON files of a step, in their own words."""
    found = []
    for path in sorted(folder.glob("*.json")):
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            continue
        if isinstance(content, dict):
            found += [(key.replace("_", " "), _text(value)) for key, value in content.items() if _is_plain(value)]
            found += [("", printable(text, 1000)) for text in content.get("messages", []) if isinstance(text, str)]
    return found


def _is_plain(value: Any) -> bool:
    return isinstance(value, int | float | str) and value != ""


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else printable(str(value), 300)
