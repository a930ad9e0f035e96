"""What a page says of a dense surface."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from aerotri.report.pages.product import (
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
from aerotri.report.quality import many_cells, printable

FEW, MUCH_BRIDGED, LARGE_PX = 0.9, 0.1, 0.5
"""Share of the ground that has heights below which, share of it that is bridged and y-parallax (median of the pairs)
above which the page says so first; chosen [C]."""
CAPTIONS = {
    "surface": "The surface, lit from the north-west, with contours. White: not measured.",
    "colours": "The measured cells in the colours of the photographs.",
    "sigma": "σ of the heights: matching and adjustment together. Dark is less sure.",
    "photographs": "Number of photographs that measured a cell (rays). Dark: few, errors are found less easily.",
}


def dense_parts(c: Mapping[str, Any]) -> ProductParts:
    """The parts of the page; c : content of dsm.json."""
    return ProductParts(
        "Dense surface", printable(c["block"]), tuple(_doubts(c)), fine_of_adjustment(c), tuple(_cards(c)),
        tuple(_sure(c)), tuple(_numbers(c)), CAPTIONS,
    )  # fmt: skip


def _doubts(c: Mapping[str, Any]) -> list[str]:
    found = doubts_of_adjustment(c, many_cells("heights", c["sigma_Z_m"]["median"], c["cell_m"]))
    if c["coverage"] < FEW:
        found.append(
            f"{percent(1.0 - c['coverage'])} of the ground that pairs of photographs show has no height. Water, "
            "leaves that move and ground without detail cannot be matched. Holes are white in the pictures and empty "
            "in the files."
        )
    if c["y_parallax_px"]["median"] > LARGE_PX:
        found.append(
            f"The photographs of a pair are off by {c['y_parallax_px']['median']:.1f} pixels across their base "
            "(median of the pairs): the orientation or the model of the camera is not good enough."
        )
    ground = c["ground"]
    if ground is not None and ground["bridged"] > MUCH_BRIDGED * (ground["measured"] + ground["bridged"]):
        share = ground["bridged"] / (ground["measured"] + ground["bridged"])
        found.append(
            f"{percent(share)} of the ground in dtm.tif is interpolated below objects; ground.tif shows where."
        )
    return found


def _cards(c: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    s = c["sigma_Z_m"]
    return [
        ("σ of a height", metres(s["median"]), "above the datum; median of the cells, one standard deviation"),
        *(
            ()
            if s.get("relative") is None
            else (
                ("σ of a height, relative", metres(s["relative"]), "of the shape: for volumes and height differences"),
            )
        ),
        ("of matching alone", metres(s["matching"]), "median; the rest comes from the adjustment"),
        ("Measured", percent(c["coverage"]), "of the ground that pairs of photographs show"),
        (
            "Cells with a height",
            whole(c["cells"]["measured"]),
            f"of {round_length(c['cell_m'])}, {whole(c['area_m2'])} m²",
        ),
    ]


def _sure(c: Mapping[str, Any]) -> list[str]:
    s, lasting = c["sigma_Z_m"], c["matching_shared"]
    text = (
        f"Half of the heights are known to {metres(s['median'])} or better (1 σ). Errors of matching, "
        f"{metres(s['matching'])}, differ from place to place. Errors of the adjustment, "
        f"{metres(s['adjustment'])}, are shared by the cells around: they lift, tilt or bend the surface, and "
        "largely cancel in differences of heights that lie near one another."
    )
    if c["noise_length_m"] is not None:
        text += (
            f" Cells within about {metres(c['noise_length_m'])} share the noise of matching (noise length); the "
            "mean of a larger area is more certain than one cell."
        )
    text += (
        f" {metres(lasting['sigma_Z_m'])} of the errors of matching hold over {metres(lasting['length_m'])} "
        "and do not average out. aerotri volume and change count all these parts."
    )
    shape = "" if s.get("relative") is None else (
        f"Relative to the whole surface half of the heights are known to {metres(s['relative'])} or better, "
        f"{metres(s['adjustment_relative'])} of it from the adjustment. {shape_in_words('surface', c)}"
    )  # fmt: skip
    return [part for part in (text, shape, check_in_words(c)) if part]


def _numbers(c: Mapping[str, Any]) -> list[tuple[str, str]]:
    s, y, noise = c["sigma_Z_m"], c["y_parallax_px"], c["noise_length_m"]
    rows = [
        ("Photographs", f"{c['photographs']}"),
        ("Pairs of photographs", f"{c['pairs']}"),
        ("Size of a pixel on the ground (GSD)", round_length(c["gsd_m"])),
        ("Size of a cell", round_length(c["cell_m"])),
        ("Cells with a height", whole(c["cells"]["measured"])),
        ("Their area", f"{whole(c['area_m2'])} m²"),
        ("Ground that pairs of photographs show", f"{whole(c['shown_area_m2'])} m²"),
        ("of this ground, with heights", percent(c["coverage"])),
        ("Photographs that measured a cell, mean", f"{c['photographs_mean']:.1f}"),
        ("σ of heights, median", metres(s["median"])),
        ("by matching alone, median", metres(s["matching"])),
        ("by the adjustment, which cells share, median", metres(s["adjustment"])),
        *(
            ()
            if s.get("relative") is None
            else (
                ("σ of heights relative to the whole surface, median", metres(s["relative"])),
                ("by the adjustment, median", metres(s["adjustment_relative"])),
            )
        ),
        ("Noise length: cells within it share the noise of matching", metres(noise)),
        ("Errors of matching that do not average out", metres(c["matching_shared"]["sigma_Z_m"])),
        ("Length over which their correlation falls to 1/e", metres(c["matching_shared"]["length_m"])),
        ("y-parallax of the pairs, median", f"{y['median']:.2f} px"),
        ("y-parallax of the pairs, largest", f"{y['largest']:.2f} px"),
    ]
    return rows + _of_ground(c["ground"])


def _of_ground(g: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    if g is None:
        return []
    bridge = g["bridge"]
    return [
        ("Cells of the ground (dtm.tif), measured", whole(g["measured"])),
        ("interpolated below objects", whole(g["bridged"])),
        ("Widest object that was taken off", f"{g['widest_object_m']:g} m"),
        (
            "σ of an interpolated height",
            f"{metres(bridge['sigma_at_1_m'])} at 1 m from the ground, with distance to the power "
            f"{bridge['power']:.1f}",
        ),
    ]
