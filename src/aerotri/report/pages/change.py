"""One self-contained page about a change: volumes with σ, the map, the alignment."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aerotri.formats.results.change import at_most
from aerotri.report.pages.adjustment import data_address
from aerotri.report.pages.head import page_environment, page_head, settings_rows
from aerotri.report.pages.product import sentence
from aerotri.report.plots.rendering import RenderedPlot
from aerotri.report.quality import printable, two_digits, with_sigma
from aerotri.results.head import Head

CAPTIONS = {
    "difference": "Difference of the surfaces where it is beyond the level of detection; brown is gained, blue "
    "(hatched) is lost, grey cannot be told from noise.",
    "difference_sigma": "σ of the difference. Dark is less sure.",
}
NOTHING = "no cell is beyond the level of detection"
PARTS = {
    "adjustment": "adjustments", "model": "image errors that photographs share",
    "matching_shared": "matching errors that neighbouring cells share",
    "bridged": "ground that is bridged below objects",
}  # fmt: skip
UNKNOWNS = {
    "dZ": ("height", 1e3, "mm"), "dX": ("X", 1e3, "mm"), "dY": ("Y", 1e3, "mm"),
    "tilt_X": ("tilt along X", 1e6, "mm/km"), "tilt_Y": ("tilt along Y", 1e6, "mm/km"),
}  # fmt: skip


def write_change_page(content: Mapping[str, Any], plots: Mapping[str, RenderedPlot], path: Path, head: Head) -> None:
    """Write the page; content of change.json."""
    environment = page_environment()
    text = environment.get_template("change.html.j2").render(
        first=printable(content["first"]), second=printable(content["second"]),
        cards=_cards(content["volumes"][-1]), warnings=[sentence(text) for text in content["warnings"]],
        sure=_sure(content), rows=[_row(one) for one in content["volumes"]], unknowns=_unknowns(content),
        alignment=_alignment(content),
        plots=[(CAPTIONS[name], data_address(plot), name) for name, plot in plots.items()],
        head=page_head(head), settings=settings_rows(content),
    )  # fmt: skip
    path.write_text(text, encoding="utf-8")


def _cards(v: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    said = {"gained": "of cells beyond the level of detection", "lost": "of cells beyond the level of detection",
            "net": "of all cells"}  # fmt: skip
    return [
        (of.capitalize(), f"{_amount(v, of)} m³", f"{text}, one standard deviation" if v[f"sigma_{of}_m3"] else NOTHING)
        for of, text in said.items()
    ]


def _amount(v: Mapping[str, Any], of: str) -> str:
    """m³; without σ where no cell is beyond the level of detection: of nothing there is none."""
    value, sigma, least = v[f"{of}_m3"], v[f"sigma_{of}_m3"], at_most(v, of)
    if least is not None:
        return f"less than {least:g}"
    return "0" if value == 0.0 and sigma == 0.0 else with_sigma(value, sigma)


def _row(v: Mapping[str, Any]) -> tuple[str, ...]:
    numbers = (_amount(v, of) for of in ("gained", "lost", "net"))
    return printable(v["name"]), f"{v['area_m2']:.0f}", *numbers, f"{v['no_data_area_m2']:.0f}"


def _sure(c: Mapping[str, Any]) -> str:
    parts = c["volumes"][-1]["parts_net_m3"]
    words = ", ".join(f"{PARTS.get(name, name)} {two_digits(value)} m³" for name, value in parts.items() if value > 0.0)
    return (
        f"A single cell shows a change from {two_digits(1e3 * c['level_of_detection_m'])} mm on (95 %, median of all "
        f"cells). {c['beyond_level_percent']:.1f} % of the cells are beyond it, where 5 % would be by chance. "
        f"Neighbouring cells of the difference share their noise over {two_digits(c['noise_length_m'])} m: "
        f"{_whose_noise(c)}. σ of the net volume by part: {words}."
    )


def _whose_noise(c: Mapping[str, Any]) -> str:
    """Where the noise length is from: that of a difference is no noise length of one surface."""
    if any(one["key"] == "noise_length" and one["value"] is not None for one in c.get("settings", ())):
        return "as stated"
    if c["alignment"] is None:
        return "that of the matching, as the surfaces state it"
    return (
        "what the differences on stable ground show, with all errors that neighbours share, where it is longer than "
        "the noise length of the surfaces, which is that of their matching alone"
    )


def _unknowns(c: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    if c["alignment"] is None:
        return []
    found = []
    for one in c["alignment"]["unknowns"]:
        name, factor, unit = UNKNOWNS[one["name"]]
        found.append((name, with_sigma(factor * one["value"], factor * one["sigma"]), unit))
    return found


def _alignment(c: Mapping[str, Any]) -> str:
    a = c["alignment"]
    if a is None:
        return "No stable ground was given: the surfaces are compared as they lie."
    factor = a["noise_factor"]
    noise = (
        "No σ was stated; it is from the scatter there"
        if factor is None
        else f"The noise there is {factor:.2f} times the stated one"
    )
    return f"{a['cells_used']} of {a['cells']} cells on stable ground ({printable(a['stable'])}) took part. {noise}."
