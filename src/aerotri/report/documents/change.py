"""The certificate of a change between two surfaces, from change.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from aerotri.formats.results.change import at_most
from aerotri.report.documents.figures import as_files
from aerotri.report.documents.head import Context, document, signature_fields
from aerotri.report.documents.messages import in_english, message_parts
from aerotri.report.documents.parts import Document, Part, heading, pairs, paragraph, picture, signature, table
from aerotri.report.documents.used import argument_parts
from aerotri.report.documents.volume import WIDE, amount, known_to, two
from aerotri.report.documents.words import NO_VALUE, Words, breakable
from aerotri.report.plots.rendering import RenderedPlot

UNITS = {"dZ": (1e3, "mm"), "dX": (1e3, "mm"), "dY": (1e3, "mm"), "tilt_X": (1e6, "mm/km"), "tilt_Y": (1e6, "mm/km")}
KINDS = ("gained", "lost", "net")


def change_certificate(content: Mapping[str, Any], plots: Mapping[str, RenderedPlot], context: Context) -> Document:
    """The certificate of a change.

    Parameters
    ----------
    content : of change.json of two surfaces.
    plots : of the result by their names; those that are missing are left out.
    context : language, date of computation, project.
    """
    words, whole = context.words, content["volumes"][-1]
    result = [(words(f"change.{of}"), _known(words, whole, of)) for of in KINDS]
    parts: list[Part] = [heading(words("change.result")), pairs(result), paragraph(words("change.about"), small=True)]
    parts += [heading(words("change.areas")), _areas(content, words)]
    parts += [heading(words("change.measured")), pairs(_measured(content, words))]
    parts += [heading(words("volume.sigma")), _parts(content, words)]
    parts += [heading(words("change.alignment")), *_alignment(content, words)]
    # what is signed has to include them
    parts += [*in_english(words), *message_parts(content["warnings"], words)]
    parts.append(signature(signature_fields(words)))
    files, names = as_files(plots)
    if names:
        parts.append(heading(words("report.pictures")))
        parts += [picture(file, words(f"figure.{name}")) for name, file in names.items()]
    parts += argument_parts(content, words)
    return document(context, words("change.title"), content["crs"], content["aerotri"], parts, files)


def _known(words: Words, volume: Mapping[str, Any], of: str) -> str:
    """A volume and how sure it is; what is nothing beside σ of net as that."""
    least = at_most(volume, of)
    if least is None:
        return known_to(words, volume[f"{of}_m3"], volume[f"sigma_{of}_m3"], "m³")
    return f"< {words.plain(least, 1)} m³"


def _areas(c: Mapping[str, Any], words: Words) -> Part:
    rows: list[tuple[str, ...]] = []
    for one in c["volumes"]:
        for of in KINDS:
            value, sigma = one[f"{of}_m3"], one[f"sigma_{of}_m3"]
            area = one["area_m2"] if of == "net" else one[f"{of}_area_m2"]
            rows.append((words.term("given", one["name"]), words(f"change.{of}"), amount(words, area),
                         words.with_sigma(value, sigma).partition(" ±")[0], two(words, sigma),
                         two(words, WIDE * sigma)))  # fmt: skip
    keys = ("area", "kind", "area_m2", "volume_m3", "sigma_m3", "wide_m3")
    return table([words(f"change.{key}") for key in keys], rows, words=2)


def _measured(c: Mapping[str, Any], words: Words) -> list[tuple[str, str]]:
    def metres(value: float | None) -> str:
        return NO_VALUE if value is None else f"{words.plain(value, 2)} m"

    return [
        (words("change.first"), breakable(c["first"])), (words("change.second"), breakable(c["second"])),
        (words("change.cells"),
         words("change.of_cells", count=words.whole(c["cells"]), cell=words.plain(c["cell_m"], 3))),
        (words("change.no_data"), f"{amount(words, c['volumes'][-1]['no_data_area_m2'])} m²"),
        (words("change.sigma"), metres(c["sigma_m"])), (words("change.level"), metres(c["level_of_detection_m"])),
        (words("change.beyond"), f"{words.number(c['beyond_level_percent'], 1)} %"),
        (words("change.noise"), metres(c["noise_length_m"])),
    ]  # fmt: skip


def _parts(c: Mapping[str, Any], words: Words) -> Part:
    """σ of what was gained, lost and of the net volume, by part; of all areas together."""
    whole = c["volumes"][-1]
    names = [name for name, value in whole["parts_net_m3"].items()
             if any(whole[f"parts_{of}_m3"].get(name, value) for of in KINDS)]  # fmt: skip
    rows = [(words.term("part", name), *(two(words, whole[f"parts_{of}_m3"].get(name)) for of in KINDS))
            for name in names]  # fmt: skip
    rows.append((words("part.together"), *(two(words, whole[f"sigma_{of}_m3"]) for of in KINDS)))
    rows.append((words("part.wide"), *(two(words, WIDE * whole[f"sigma_{of}_m3"]) for of in KINDS)))
    return table([words("change.part_m3"), *(words(f"change.{of}") for of in KINDS)], rows, words=1)


def _alignment(c: Mapping[str, Any], words: Words) -> list[Part]:
    a = c["alignment"]
    if a is None:
        return [paragraph(words("change.not_aligned"))]
    said = words("change.aligned", used=words.whole(a["cells_used"]), cells=words.whole(a["cells"]),
                 stable=words.term("given", a["stable"]))  # fmt: skip
    factor = a["noise_factor"]
    noise = (
        words("change.not_stated") if factor is None else words("change.noise_there", factor=words.number(factor, 2))
    )
    said = f"{said} {noise}"
    rows: list[tuple[str, str]] = []
    for one in a["unknowns"]:
        factor, unit = UNITS[one["name"]]
        rows.append((words.term("unknown", one["name"]),
                     f"{words.with_sigma(factor * one['value'], factor * one['sigma'])} {unit}"))  # fmt: skip
    return [paragraph(said), *([pairs(rows)] if rows else [])]
