"""What a page says of an orthophoto."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from aerotri.conventions import counted
from aerotri.report.pages.product import (
    PartTable,
    ProductParts,
    check_in_words,
    doubts_of_adjustment,
    fine_of_adjustment,
    metres,
    percent,
    round_length,
    shape_in_words,
    whole,
)
from aerotri.report.quality import many_cells, printable, two_digits

MUCH_UNSEEN = 0.02
"""Share of the surface that no photograph sees above which the page says so first; chosen [C]."""
CAPTIONS = {
    "orthophoto": "The orthophoto with control points (triangles) and check points (circles).",
    "sigma": "σ of X and of Y of what the orthophoto shows, all parts together. Dark is less sure.",
    "seams": "Seams, and the number of the photograph that each part is from; the table below names them.",
    "points": "The ground around the points: the cross stands at their given coordinates, the circle is 2 σ.",
}

WITHOUT_POINTS = {"orthophoto": "The orthophoto. No control or check point lies in it."}


def ortho_parts(c: Mapping[str, Any]) -> ProductParts:
    """The parts of the page; c : content of ortho.json."""
    return ProductParts(
        "Orthophoto", printable(c["block"]), tuple(_doubts(c)), fine_of_adjustment(c), tuple(_cards(c)),
        tuple(_sure(c)), tuple(_numbers(c)), CAPTIONS if c["points"] else CAPTIONS | WITHOUT_POINTS, tuple(_tables(c)),
    )  # fmt: skip


def _doubts(c: Mapping[str, Any]) -> list[str]:
    area = c["area_m2"]
    found = doubts_of_adjustment(c, many_cells("positions", c["sigma_m"]["total"]["median"], c["cell_m"]))
    if area["bridged"] > 0.0:
        found.append(f"{whole(area['bridged'])} m² lie over bridged holes of the surface: σ is not known there.")
    if area["without_photograph"] > MUCH_UNSEEN * area["surface"]:
        found.append(
            f"{percent(area['without_photograph'] / area['surface'])} of the surface is seen by no photograph and "
            "stays empty."
        )
    return found


def _cards(c: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    total, area, left = c["sigma_m"]["total"], c["area_m2"], c["sigma_m"].get("relative")
    return [
        ("σ of X and of Y", metres(total["median"]), "in the coordinate system; median, one standard deviation"),
        *(() if left is None else (("σ of X and of Y, relative", metres(left["median"]), "for lengths and areas"),)),
        ("95 % of the area", metres(total["q95"]), "σ in the coordinate system is at most"),
        ("Area", f"{whole(area['orthophoto'])} m²", f"{percent(_share(area))} of the surface"),
        ("Cell", round_length(c["cell_m"]), f"{whole(c['columns'])} × {whole(c['rows'])} cells"),
    ]


def _share(area: Mapping[str, float]) -> float:
    return area["orthophoto"] / area["surface"] if area["surface"] else 0.0


def _sure(c: Mapping[str, Any]) -> list[str]:
    s, same = c["sigma_m"], c["of_one_adjustment"]
    of_heights = "σ of the heights is not known and not counted" if s["surface"] is None else (
        f"{'matching of the heights' if same else 'heights of the surface'} {metres(s['surface']['median'])}"
    )  # fmt: skip
    from_where = "the surface comes from the same adjustment" if same else "the surface is not from this adjustment"
    text = (
        f"X and Y of what the orthophoto shows have a σ of {metres(s['total']['median'])} each (median of the area; "
        f"95 % of the area: at most {metres(s['total']['q95'])}). Its parts: {of_heights}, adjustment "
        f"{metres(s['orientation']['median'])}, measurement in the photograph {metres(s['image']['median'])}; "
        f"{from_where}."
    )
    left = s.get("relative")
    shape = "" if left is None else (
        f"Relative to the whole orthophoto σ is {metres(left['median'])} (95 % of the area: at most "
        f"{metres(left['q95'])}). {shape_in_words('orthophoto', c)}"
    )  # fmt: skip
    inside = sum(one["role"] == "check" for one in c["points"])
    where = f"{counted(inside, 'check point lies', 'check points lie')} in the orthophoto." if inside else ""
    return [part for part in (text, shape, " ".join(part for part in (check_in_words(c), where) if part)) if part]


def _numbers(c: Mapping[str, Any]) -> list[tuple[str, str]]:
    area, seams, angle, balance = c["area_m2"], c["seams"], c["viewing_angle_deg"], c["balance"]
    used = sum(one["area_m2"] > 0.0 for one in c["photographs"])
    rows = [
        ("Surface", printable(c["surface"])),
        ("Photographs used", f"{used} of {len(c['photographs'])}"),
        ("Size of a pixel on the ground (GSD)", round_length(c["gsd_m"])),
        ("Size of a cell", round_length(c["cell_m"])),
        ("Area of the surface", f"{whole(area['surface'])} m²"),
        ("of it in the orthophoto", f"{whole(area['orthophoto'])} m²"),
        ("seen by no photograph", f"{whole(area['without_photograph'])} m²"),
        ("hidden in the photograph around it, taken from another", f"{whole(area['other_photograph'])} m²"),
        ("over bridged holes of the surface", f"{whole(area['bridged'])} m²"),
        ("Angle of the rays off the vertical, median", _degrees(angle["median"])),
        ("Angle of the rays off the vertical, largest", _degrees(angle["max"])),
        ("Length of the seams", f"{whole(seams['length_m'])} m"),
        ("Colours on both sides of a seam differ by", _of_white(seams["difference"])),
        ("were every cell from its best photograph", _of_white(seams["difference_of_best"])),
        ("Colours of two photographs of the same ground differ by", _of_white(balance["difference_before"])),
        ("after balancing", _of_white(balance["difference_after"])),
    ]
    return rows


def _tables(c: Mapping[str, Any]) -> list[PartTable]:
    points = tuple(
        (printable(p["point"]), p["role"], f"{p['X']:.3f}", f"{p['Y']:.3f}", "" if p["sigma"] is None else
         two_digits(p["sigma"]))
        for p in sorted(c["points"], key=lambda p: (p["role"], str(p["point"])))
    )  # fmt: skip
    whole_area = c["area_m2"]["orthophoto"] or 1.0
    photographs = tuple(
        (printable(p["photograph"]), f"{p['number']}", whole(p["area_m2"]), f"{100.0 * p['area_m2'] / whole_area:.1f}")
        for p in c["photographs"]
    )
    tables = [
        PartTable(
            "Control and check points in the orthophoto",
            (("point", ""), ("role", ""), ("X", "m"), ("Y", "m"), ("σ of X and Y there", "m")), points,
        ),
        PartTable(
            "Photographs", (("photograph", ""), ("number", "–"), ("area", "m²"), ("share of the orthophoto", "%")),
            photographs,
        ),
    ]  # fmt: skip
    return [one for one in tables if one.rows]


def _degrees(value: float | None) -> str:
    return "not known" if value is None else f"{value:.0f}°"


def _of_white(share: float | None) -> str:
    return "not known" if share is None else f"{percent(share)} of white"
