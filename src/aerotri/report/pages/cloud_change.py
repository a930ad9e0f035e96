"""One self-contained page about the distances of two point clouds: map, histogram, level of detection, table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aerotri.report.pages.adjustment import data_address
from aerotri.report.pages.head import page_environment, page_head, settings_rows
from aerotri.report.pages.product import sentence
from aerotri.report.plots.rendering import RenderedPlot
from aerotri.report.quality import printable, two_digits
from aerotri.results.head import Head

CAPTIONS = {
    "distances": "Distance of the second cloud from the first, along the normal of the ground, where it is beyond the "
    "level of detection; brown is gained (the second lies above), blue (hatched) is lost, grey cannot be told from "
    "noise.",
    "distances_sigma": "σ of the distance. Dark is less sure.",
    "histogram": "Number of places by their distance. The scale of counts is logarithmic, so that few places are seen "
    "beside many. Each place is held against its own level of detection; the broken lines are the median of all.",
}
SIGMA_FROM = {
    "adjustments": "It has the noise of the points and what the errors of both adjustments leave in a distance; what "
    "both have in common cancels.",
    "points": "It follows from the σ of the points that both clouds state.",
    "scatter": "It follows from the scatter of the points: errors that all points share, such as those of control, are "
    "not in it.",
}  # fmt: skip


def write_cloud_change_page(
    content: Mapping[str, Any], plots: Mapping[str, RenderedPlot], path: Path, head: Head
) -> None:
    """Write the page; content of cloud_change.json, plots by the names of `CAPTIONS`."""
    text = page_environment().get_template("cloud_change.html.j2").render(
        first=printable(content["first"]), second=printable(content["second"]), cards=_cards(content),
        warnings=[sentence(text) for text in content["warnings"]], sure=_sure(content), stable=_stable(content),
        rows=_rows(content), head=page_head(head), settings=settings_rows(content),
        plots=[(CAPTIONS[name], data_address(plot), name) for name, plot in plots.items()],
    )  # fmt: skip
    path.write_text(text, encoding="utf-8")


def _cards(c: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    of = "of the places, beyond the level of detection"
    return [
        ("Gained", f"{c['gained_percent']:.1f} %", of), ("Lost", f"{c['lost_percent']:.1f} %", of),
        ("Level of detection", _millimetres(c["level_of_detection_m"]), "95 %, median of the places"),
    ]  # fmt: skip


def _millimetres(metres: float) -> str:
    return f"{two_digits(1e3 * metres)} mm"


def _metres(value: float) -> str:
    return f"{round(value, 3) + 0.0:+.3f}".replace("-", "−")


def _sure(c: Mapping[str, Any]) -> str:
    parts, level = "", _millimetres(c["level_of_detection_m"])
    if c["adjustments_m"] is not None:
        parts = f" The adjustments bring {_millimetres(c['adjustments_m'])} of it (median)."
    return (
        f"A single place shows a change from {level} on (95 %, median of all places). "
        f"{c['beyond_level_percent']:.1f} % of the places are beyond it, where 5 % would be by chance. σ of a "
        f"distance is {_millimetres(c['sigma_m'])} (median). {SIGMA_FROM[c['sigma_from']]}{parts} Registration "
        f"error (position of one cloud relative to the other): {_millimetres(c['registration_m'])}."
    )


def _stable(c: Mapping[str, Any]) -> str:
    s = c["stable"]
    if s is None:
        return "No stable ground was given: the clouds are compared as they lie."
    return (
        f"{s['core_points']} places with a distance lie on stable ground; their mean distance is "
        f"{_metres(s['mean_m'])} m. The clouds are not moved."
    )


def _rows(c: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    d = c["distance_m"]
    return [
        ("points of the first cloud", str(c["points_first"]), ""),
        ("points of the second cloud", str(c["points_second"]), ""),
        ("places", str(c["core_points"]), ""),
        ("places with a distance", str(c["with_distance"]), ""),
        ("distance between places", f"{c['spacing_m']:.3g}", "m"),
        ("diameter of the cylinder whose points are averaged", f"{c['cylinder_m']:.3g}", "m"),
        ("diameter of the ball that gives a normal", f"{c['normal_m']:.3g}", "m"),
        ("largest distance that was sought", f"{c['reach_m']:.3g}", "m"),
        ("distance, median", _metres(d["median"]), "m"),
        ("distance, smallest", _metres(d["smallest"]), "m"),
        ("distance, largest", _metres(d["largest"]), "m"),
    ]
