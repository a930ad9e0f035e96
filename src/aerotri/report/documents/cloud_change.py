"""The certificate of a change between two point clouds, from cloud_change.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from aerotri.report.documents.figures import as_files
from aerotri.report.documents.head import Context, document, signature_fields
from aerotri.report.documents.messages import in_english, message_parts
from aerotri.report.documents.parts import Document, Part, heading, pairs, paragraph, picture, signature
from aerotri.report.documents.used import argument_parts
from aerotri.report.documents.volume import two
from aerotri.report.documents.words import Words, breakable
from aerotri.report.plots.rendering import RenderedPlot

PICTURES = ("distances", "distances_sigma", "histogram")


def cloud_change_certificate(
    content: Mapping[str, Any], plots: Mapping[str, RenderedPlot], context: Context
) -> Document:
    """The certificate of distances of two point clouds.

    Parameters
    ----------
    content : of cloud_change.json.
    plots : of the result by their names; those that are missing are left out.
    context : language, date of computation, project.
    """
    words = context.words
    parts: list[Part] = [heading(words("cloud.result")), pairs(_result(content, words))]
    parts.append(paragraph(words("cloud.about"), small=True))
    parts += [heading(words("change.measured")), pairs(_measured(content, words))]
    parts += [heading(words("cloud.precision")), pairs(_precision(content, words))]
    parts += [heading(words("cloud.position")), paragraph(_position(content, words))]
    # what is signed has to include them
    parts += [*in_english(words), *message_parts(content["warnings"], words)]
    parts.append(signature(signature_fields(words)))
    files, names = as_files({name: plots[name] for name in PICTURES if name in plots})
    if names:
        parts.append(heading(words("report.pictures")))
        parts += [picture(file, words(f"figure.{name}")) for name, file in names.items()]
    parts += argument_parts(content, words)
    return document(context, words("change.title"), content["crs"], content["aerotri"], parts, files)


def _result(c: Mapping[str, Any], words: Words) -> list[tuple[str, str]]:
    """Shares of the places with a distance."""
    shares = {"gained": c["gained_percent"], "lost": c["lost_percent"], "same": 100.0 - c["beyond_level_percent"]}
    known = words.whole(c["with_distance"])
    return [
        (words(f"cloud.{name}"), words("cloud.share", percent=words.number(share, 1), count=known))
        for name, share in shares.items()
    ]


def _measured(c: Mapping[str, Any], words: Words) -> list[tuple[str, str]]:
    d = c["distance_m"]
    clouds = [
        (words(f"cloud.{one}"),
         words("cloud.points", name=breakable(c[one]), count=words.whole(c[f"points_{one}"])))
        for one in ("first", "second")
    ]  # fmt: skip
    places = words("cloud.of_places", known=words.whole(c["with_distance"]), count=words.whole(c["core_points"]),
                   spacing=words.plain(c["spacing_m"], 3))  # fmt: skip
    sizes = [(words(f"cloud.{one}"), f"{words.plain(c[f'{one}_m'], 3)} m") for one in ("cylinder", "normal", "reach")]
    smallest, largest = (f"{words.number(d[one], 3, signed=True)} m" for one in ("smallest", "largest"))
    return [
        *clouds, (words("cloud.places"), places), *sizes,
        (words("cloud.distance"), f"{words.number(d['median'], 3, signed=True)} m"),
        (words("cloud.range"), f"{smallest} … {largest}"),
    ]  # fmt: skip


def _precision(c: Mapping[str, Any], words: Words) -> list[tuple[str, str]]:
    values = {
        "sigma": c["sigma_m"], "adjustments": c["adjustments_m"], "registration": c["registration_m"],
        "level": c["level_of_detection_m"],
    }  # fmt: skip
    rows = [
        (words(f"cloud.{name}"), f"{two(words, 1e3 * value)} mm") for name, value in values.items() if value is not None
    ]
    return [*rows, (words("cloud.source"), words(f"source.{c['sigma_from']}"))]


def _position(c: Mapping[str, Any], words: Words) -> str:
    s = c["stable"]
    if s is None:
        return words("cloud.not_aligned")
    mean = words.number(s["mean_m"], 3, signed=True)
    return words("cloud.stable", count=words.whole(s["core_points"]), mean=mean)
