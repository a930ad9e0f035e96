"""What a page says of a dense surface or an orthophoto: the same parts on its own page and on that of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerotri.conventions import counted
from aerotri.report.pages.adjustment import data_address
from aerotri.report.pages.head import page_environment, page_head, settings_rows
from aerotri.report.plots.canvas import length_text
from aerotri.report.plots.rendering import RenderedPlot
from aerotri.report.quality import printable, two_digits
from aerotri.results.head import Head

FileText = tuple[str, str]
"""Name of a file, and what it is for."""


@dataclass(frozen=True)
class PartTable:
    """A table: its heading, its columns with their units (a dash for numbers without one, '' for words), its rows."""

    heading: str
    columns: tuple[tuple[str, str], ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class ProductParts:
    """The parts of a page.

    Parameters
    ----------
    kind : of product, as the page names it. name : of the block.
    doubts : what is to be known before anything else, in sentences; none where nothing is doubtful.
    fine : what is said where there is none. cards : heading, number and small print.
    sure : paragraphs on how sure it is. numbers : names and values. captions : of the plots by their names, in order.
    """

    kind: str
    name: str
    doubts: tuple[str, ...]
    fine: str
    cards: tuple[tuple[str, str, str], ...]
    sure: tuple[str, ...]
    numbers: tuple[tuple[str, str], ...]
    captions: Mapping[str, str]
    tables: tuple[PartTable, ...] = ()


def product_html(
    parts: ProductParts, content: Mapping[str, Any], plots: Mapping[str, RenderedPlot], files: Sequence[FileText],
    head: Head,
) -> str:  # fmt: skip
    """The page as text.

    Parameters
    ----------
    content : of the JSON file. plots : by the names of the captions. files : what was written, each with its purpose.
    """
    pictures = [(caption, data_address(plots[name]), name) for name, caption in parts.captions.items() if name in plots]
    return page_environment().get_template("product.html.j2").render(
        parts=parts, pictures=pictures, files=files, head=page_head(head),
        settings=settings_rows(content),
    )  # fmt: skip


def write_product_page(
    parts: ProductParts, content: Mapping[str, Any], plots: Mapping[str, RenderedPlot], files: Sequence[FileText],
    path: Path, head: Head,
) -> None:  # fmt: skip
    """Write the page; arguments as of `product_html`."""
    path.write_text(product_html(parts, content, plots, files, head), encoding="utf-8")


def verdict_in_words(content: Mapping[str, Any]) -> list[str]:
    """What is wrong with the adjustment as a whole, nothing where it was accepted; content : as below."""
    a = content.get("adjusted") or {}
    reason = f": {printable(a['reason'], 1000)}" if a.get("reason") else ""
    if a.get("verdict") == "rejected":
        return [f"The adjustment was rejected{reason}. Use this to find the error, not as a result."]
    return [f"The adjustment is doubtful{reason}."] if a.get("verdict") == "doubtful" else []


def only_shape(content: Mapping[str, Any]) -> str:
    """What the adjustment is good for where that is less than positions, '' else."""
    a = content.get("adjusted") or {}
    return printable(a["purpose"], 1000) if a.get("good_for") in ("relative", "neither") else ""


def shape_in_words(what: str, content: Mapping[str, Any]) -> str:
    """What a relative σ is good for; what : has it."""
    scale = (content.get("adjusted") or {}).get("scale")
    text = (
        f"The relative σ is that of the shape: it holds after a shift, rotation and scale of the whole {what}. It is "
        "for lengths and differences within it; the other is for places in the coordinate system."
    )
    return text if scale is None else f"{text} The scale is known to ± {two_digits(100.0 * scale)} %."


def doubts_of_adjustment(content: Mapping[str, Any], large: Sequence[str] = ()) -> list[str]:
    """What the adjustment and its points leave open; then the notes on the input.

    Parameters
    ----------
    content : of dsm.json or ortho.json. large : what is said of a large σ; a note that says the same is left out.
    """
    a, shape = content.get("adjusted") or {}, only_shape(content)
    found = [*verdict_in_words(content), *((shape,) if shape else ()), *map(sentence, large)]
    if a and not a["control_points"]:
        found.append("There are no control points: σ says how well position and height are known without them.")
    if a and not a["check_points"]:
        found.append("There are no check points: σ is not tested by points that were not used.")
    return list(dict.fromkeys([*found, *map(sentence, content.get("notes") or [])]))


def fine_of_adjustment(content: Mapping[str, Any]) -> str:
    """What stands where nothing is doubtful."""
    a = content.get("adjusted") or {}
    held = counted(a.get("control_points", 0), "control point")
    tested = counted(a.get("check_points", 0), "check point")
    return f"The adjustment is accepted; it has {held} and {tested}. No photograph of the block is missing."


def sentence(text: object) -> str:
    """A note as a sentence that begins and ends as one."""
    words = printable(text, 1000)
    return f"{words[:1].upper()}{words[1:]}{'' if words.endswith(('.', '!', '?')) else '.'}"


def check_in_words(content: Mapping[str, Any]) -> str:
    """Differences at the check points, '' without them."""
    a = content.get("adjusted") or {}
    rms = [f"{axis} {metres(value)}" for axis, value in (a.get("rms_check_m") or {}).items() if value is not None]
    if not rms:
        return ""
    few = counted(a["check_points"], "check point")
    return f"{few} of the adjustment, not used in it: differences (RMS) {', '.join(rms)}."


def metres(value: float | None) -> str:
    """Two digits of a length, below a millimetre in mm; 'not known' of None."""
    if value is None:
        return "not known"
    return f"{two_digits(value)} m" if abs(value) >= 1e-3 or value == 0.0 else f"{two_digits(1e3 * value)} mm"


def round_length(value: float) -> str:
    """A length to three digits in the unit that suits it: '11.8 cm'."""
    return length_text(float(f"{value:.3g}"))


def whole(value: float) -> str:
    """A number without decimals, thousands apart."""
    return f"{value:,.0f}".replace(",", "\u2009")


def percent(share: float) -> str:
    """'97.3 %'."""
    return f"{100.0 * share:.1f} %"
