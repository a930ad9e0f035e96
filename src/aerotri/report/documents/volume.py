"""The certificate of a volume, from volume.json."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from aerotri.formats.results.volume import boundary_in_words, sigma_of_side
from aerotri.report.documents.figures import as_files
from aerotri.report.documents.head import Context, document, signature_fields
from aerotri.report.documents.messages import in_english, message_parts
from aerotri.report.documents.parts import Document, Part, heading, pairs, paragraph, picture, signature, table
from aerotri.report.documents.used import argument_parts
from aerotri.report.documents.words import NO_VALUE, Words, breakable, decimals
from aerotri.report.plots.rendering import RenderedPlot
from aerotri.volume.bases import LEVELS, SPLINES

WIDE = 1.96
"""Standard deviations on either side within which 95 % of normally distributed values lie."""
LEAST = 0.001
"""m³, below which a part of σ is as good as none."""
MOST_BESIDE = 6
"""Piles beside one another in a table; chosen [C]: a page has room for their names."""
PICTURES = ("thickness", "budget")

OWN_BASES = "a base for each of "
"""Beginning of the name of the bases of piles that have one of their own."""
SPLINE = re.compile(r"spline through ([0-9]+) places of the boundary")
"""Name of a base through the outline."""


def volume_certificate(content: Mapping[str, Any], plots: Mapping[str, RenderedPlot], context: Context) -> Document:
    """The certificate of a volume.

    Parameters
    ----------
    content : of volume.json.
    plots : of the result by their names; those that are missing are left out.
    context : language, date of computation, project.
    """
    words = context.words
    parts: list[Part] = [heading(words("volume.result")), pairs(_result(content, words))]
    if content["piles"]:
        parts += [heading(words("volume.piles")), _piles(content, words)]
    parts += [heading(words("volume.measured")), pairs(_measured(content, context))]
    parts += [heading(words("volume.sigma")), *_sigma(content, words)]
    parts += [heading(words("volume.methods")), _methods(content, words), *in_english(words)]
    # what is signed has to include them
    parts += message_parts(content["warnings"], words)
    parts.append(signature(signature_fields(words)))
    files, names = as_files({name: plots[name] for name in PICTURES if name in plots})
    if names:
        parts.append(heading(words("report.pictures")))
        parts += [picture(file, words(f"figure.{name}"), narrow=True) for name, file in names.items()]
    parts += argument_parts(content, words)
    return document(context, words("volume.title"), content["crs"], content["aerotri"], parts, files)


def known_to(words: Words, value: float, sigma: float | None, unit: str) -> str:
    """'8 308 ± 20 m³ (1 σ); ± 39 m³ (95 %)'."""
    if sigma is None:
        return f"{words.with_sigma(value, None)} {unit}; {words('volume.no_sigma')}"
    wide = words.with_sigma(value, sigma * WIDE).partition("± ")[2] or words.number(0.0, 0)
    return f"{words.with_sigma(value, sigma)} {unit} (1 σ); ± {wide} {unit} (95 %)"


def two(words: Words, sigma: float | None) -> str:
    """A σ to two digits; a dash where none is stated."""
    if sigma is None:
        return NO_VALUE
    return f"< {words.plain(LEAST, 1)}" if 0.0 < sigma < LEAST else words.plain(sigma, 2)


def amount(words: Words, value: float | None) -> str:
    """A volume or an area: no decimals from a hundred on."""
    if value is None:
        return NO_VALUE
    return words.whole(value) if abs(value) >= 100.0 else words.number(value, min(2, decimals(value, 4)))


def _total(content: Mapping[str, Any]) -> float | None:
    return None if content["sigma"] is None else content["sigma"]["sigma_m3"]


def _result(c: Mapping[str, Any], words: Words) -> list[tuple[str, str]]:
    rows = [
        (words("volume.net"), known_to(words, c["net_m3"], _total(c), "m³")),
        *((words(f"volume.{of}"),
           words("volume.on", volume=_side(c, of, words), area=amount(words, c[f"{of}_area_m2"])))
          for of in ("cut", "fill")),
        (words("volume.thickness"), f"{words.number(c['mean_thickness_m'], 3)} m"),
    ]  # fmt: skip
    mass = c["mass"]
    if mass is not None:
        density = words.with_sigma(mass["density_t_per_m3"], mass["s_density_t_per_m3"])
        rows += [(words("volume.density"), f"{density} t/m³"),
                 (words("volume.mass"), known_to(words, mass["net_t"], mass["sigma_t"], "t"))]  # fmt: skip
    return rows


def _side(c: Mapping[str, Any], of: str, words: Words) -> str:
    """Cut or fill with its σ where it is known."""
    return _of_pile({**c, f"sigma_{of}_m3": sigma_of_side(c, of)}, of, words)


def _of_pile(pile: Mapping[str, Any], of: str, words: Words) -> str:
    """Cut or fill of a pile, as `_side`."""
    value, sigma = pile[f"{of}_m3"], pile.get(f"sigma_{of}_m3")
    return amount(words, value) if sigma is None else words.with_sigma(value, sigma)


def _piles(c: Mapping[str, Any], words: Words) -> Part:
    whole: dict[str, Any] = {**c, "name": "", "area_m2": c["boundary"]["area_m2"], "sigma_m3": _total(c)}
    whole |= {f"sigma_{of}_m3": sigma_of_side(c, of) for of in ("cut", "fill")}
    with_mass = c["mass"] is not None
    rows: list[tuple[str, ...]] = []
    for one in (*c["piles"], whole):
        sigma, mass = one["sigma_m3"], one["mass"]
        cells = [breakable(one["name"]) if one is not whole else words("volume.together"),
                 amount(words, one["area_m2"]), _of_pile(one, "cut", words), _of_pile(one, "fill", words),
                 words.with_sigma(one["net_m3"], sigma).partition(" ±")[0], two(words, sigma),
                 two(words, None if sigma is None else WIDE * sigma)]  # fmt: skip
        if with_mass:
            cells.append(NO_VALUE if mass is None else words.with_sigma(mass["net_t"], mass["sigma_t"]))
        rows.append(tuple(cells))
    keys = ("pile", "area_m2", "cut_m3", "fill_m3", "net_m3", "sigma_m3", "wide_m3")
    columns = [words(f"volume.{key}") for key in keys] + ([words("volume.mass_t")] if with_mass else [])
    return table(columns, rows, words=1)


def _base_name(c: Mapping[str, Any], words: Words) -> str:
    name = str(c["base"]["name"])
    if name.startswith(OWN_BASES):
        kind = next((key for end, key in ((SPLINES, "splines"), (LEVELS, "levels")) if name.endswith(end)), "bases")
        return words(f"volume.own_{kind}", number=len(c["piles"]))
    spline = SPLINE.fullmatch(name)
    return words("volume.spline", number=spline[1]) if spline else words.term("base", name)


def _measured(c: Mapping[str, Any], context: Context) -> list[tuple[str, str]]:
    words, base, edge, day = context.words, c["base"], c["boundary"], context.project.survey_date
    plane = ""
    if "z0_m" in base and (base["slope_x"] or base["slope_y"]):
        plane = words("volume.plane", z=words.number(base["z0_m"], 3), x=words.number(base["x0_m"], 1),
                      y=words.number(base["y0_m"], 1), slope_x=words.number(100 * base["slope_x"], 2, signed=True),
                      slope_y=words.number(100 * base["slope_y"], 2, signed=True))  # fmt: skip
    elif "z0_m" in base:
        plane = words("volume.level", z=words.number(base["z0_m"], 3))
    rows = [
        (words("volume.surface"), breakable(c["dtm"])),
        (words("volume.epoch"), words.date(day) if day else words("head.not_stated")),
        (words("volume.base"), _base_name(c, words) + plane),
        (
            words("volume.boundary"),
            f"{words.term('given', boundary_in_words(edge))}, {amount(words, edge['area_m2'])} m²",
        ),
        (words("volume.method"), words.term("method", c["method"])),
        (words("volume.no_data"), f"{amount(words, c['no_data_area_m2'])} m²"),
    ]
    s = c["sigma"]
    if s is not None:
        rows.append((words("volume.adjustment"), breakable(s["adjustment"]) or NO_VALUE))
        rows.append((words("volume.heights"), words.whole(s["pickets"])))
    return rows


def _sigma(c: Mapping[str, Any], words: Words) -> list[Part]:
    s = c["sigma"]
    if s is None:
        return [paragraph(words("volume.why_no_sigma"))]
    rows = [(words.term("part", name), two(words, value or None), two(words, WIDE * value or None))
            for name, value in s["parts_m3"].items()]  # fmt: skip
    rows.append((words("part.together"), two(words, s["sigma_m3"]), two(words, WIDE * s["sigma_m3"])))
    parts = [table([words("volume.part"), words("volume.sigma_m3"), words("volume.wide_m3")], rows, words=1)]
    parts += _parts_of_piles(c, words)
    said = [words("volume.about_sigma", mm=two(words, 1e3 * s["sigma_mean_height_m"]))]
    if s["curvature"] is not None:
        said.append(words("volume.curvature", value=words.with_sigma(s["curvature"]["value_m3"],
                                                                     s["curvature"]["sigma_m3"])))  # fmt: skip
    for one in s["systematic"]["variants"]:
        key = "systematic_in" if s["systematic"]["in_the_volume"] else "systematic_out"
        said.append(words(f"volume.{key}", value=words.with_sigma(one["value_m3"], one["sigma_m3"]),
                          variant=words.term("variant", one["variant"])))  # fmt: skip
    return [*parts, *(paragraph(text, small=True) for text in said)]


def _parts_of_piles(c: Mapping[str, Any], words: Words) -> list[Part]:
    """σ of every pile by part."""
    piles = [one for one in c["piles"] if one["parts_m3"] is not None]
    if not piles:
        return []
    names = list(piles[0]["parts_m3"])
    # the names of the parts are long: they are rows as long as the piles fit beside one another
    rows = [(words.term("part", name), *(two(words, one["parts_m3"].get(name) or None) for one in piles))
            for name in names]  # fmt: skip
    rows.append((words("part.together"), *(two(words, one["sigma_m3"]) for one in piles)))
    heads = [words("volume.pile_sigma"), *(breakable(one["name"]) for one in piles)]
    if len(piles) <= MOST_BESIDE:
        return [table(heads, rows, words=1)]
    names_of_parts, *of_piles = zip(*rows, strict=True)
    each = [(head, *values) for head, values in zip(heads[1:], of_piles, strict=True)]
    return [table([heads[0], *names_of_parts], each, words=1, small=True)]


def _methods(c: Mapping[str, Any], words: Words) -> Part:
    rows = [
        (words.term("method", one["method"]), *(_like(c, of, one[f"{of}_m3"], words) for of in ("net", "cut", "fill")))
        for one in c["methods"]
    ]
    keys = ("method", "net_m3", "cut_m3", "fill_m3")
    return table([words(f"volume.{key}") for key in keys], rows, words=1)


def _like(c: Mapping[str, Any], of: str, value: float, words: Words) -> str:
    """A volume of another method to the digits of the one that counts; without σ to six digits, a litre at least."""
    sigma = _total(c) if of == "net" else sigma_of_side(c, of)
    if sigma:
        return words.with_sigma(value, sigma).partition(" ±")[0]
    largest = max(abs(one[f"{of}_m3"]) for one in c["methods"])
    return words.number(value, min(decimals(largest, 6), 3))
