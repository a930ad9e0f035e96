"""The report of an adjustment as a document."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.ray_status import RayStatus
from aerotri.formats.block.used_settings import used_settings
from aerotri.observations import Block
from aerotri.report.documents import accuracy_tables, camera_tables
from aerotri.report.documents.figures import adjustment_figures
from aerotri.report.documents.head import Context, document
from aerotri.report.documents.messages import in_english, message_parts
from aerotri.report.documents.parts import (
    Document,
    Part,
    heading,
    pairs,
    paragraph,
    picture,
    table,
    verdict,
)
from aerotri.report.documents.words import NO_VALUE, Words, breakable
from aerotri.report.quality import asprs_warning, metre_digits
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.relative import medians

MOST_POINTS = 500
"""Control or check points that are listed; chosen [C]: some ten pages, all are in control.csv and check.csv."""


def adjustment_report(adjusted: AdjustedBlock, context: Context, version: str) -> Document:
    """The report of an adjustment.

    Parameters
    ----------
    adjusted : the result in the coordinates of the block.
    context : language, date of computation, project.
    version : of aerotri that computed the result.
    """
    words, o = context.words, adjusted.outcome
    parts: list[Part] = [verdict(words(f"verdict.{o.verdict or 'none'}"), words(f"verdict.{o.verdict or 'none'}_text"),
                                 [breakable(text) for text in o.reasons])]  # fmt: skip
    parts += _good_for(adjusted, words)
    parts += [heading(words("report.accuracy")), *_accuracy(adjusted, words)]
    parts += [heading(words("report.adjusted")), pairs(_numbers(adjusted, words))]
    parts += [heading(words("report.groups")), accuracy_tables.group_table(adjusted, words)]
    parts += [heading(words("report.cameras")), *_cameras(adjusted, words)]
    parts += [heading(words("report.sigmas")), accuracy_tables.sigma_table(adjusted, words)]
    if adjusted.points.model is not None:
        parts.append(paragraph(words("report.about_total"), small=True))
    for key, points in (("control", adjusted.control), ("check", adjusted.check)):
        if len(points):
            parts.append(heading(words(f"report.{key}", count=words.whole(len(points)))))
            parts.append(_first(accuracy_tables.ground_table(adjusted, points, words)))
            if len(points) > MOST_POINTS:
                said = words("report.first_points", most=MOST_POINTS, count=words.whole(len(points)))
                parts.append(paragraph(said, small=True))
    parts.append(paragraph(words("report.about_points"), small=True))
    parts += _messages(adjusted, words)
    files, pictures = adjustment_figures(adjusted, words.language)
    parts.append(heading(words("report.pictures")))
    parts += [picture(file, words(f"figure.{name}"), narrow=name != "plan") for name, file in pictures]
    parts += [heading(words("report.settings")), *settings_parts(adjusted.block, words)]
    return document(context, words("report.title"), adjusted.block.crs, version, parts, files)


def _good_for(adjusted: AdjustedBlock, words: Words) -> list[Part]:
    """What the result is good for, with σ of positions, of heights and of the shape; nothing where it is not known."""
    o, relative = adjusted.outcome, adjusted.relative
    if not o.good_for or o.verdict == "rejected" or relative is None:
        return []
    held = np.isfinite(relative.position).all()
    place = medians(adjusted.points.total_sigma) if held else np.full(3, np.nan)
    digits, left = metre_digits(relative.points), relative.medians
    sizes = {
        "plan": words.number(float(place[:2].max()), digits), "height": words.number(float(place[2]), digits),
        "shape": words.number(float(left[2]), digits), "shape_plan": words.number(float(left[:2].max()), digits),
    }  # fmt: skip
    return [paragraph(words(f"good_for.{o.good_for}")), paragraph(words("good_for.about", **sizes), small=True)]


def _first(part: Part) -> Part:
    return part | {"rows": part["rows"][:MOST_POINTS]}


def _accuracy(adjusted: AdjustedBlock, words: Words) -> list[Part]:
    if not len(adjusted.check) and not len(adjusted.control):
        return [paragraph(words("accuracy.none"))]
    parts = [accuracy_tables.accuracy_table(adjusted, words)]
    if not len(adjusted.check):
        parts.append(paragraph(words("accuracy.no_check")))
    return [*parts, paragraph(words("accuracy.about"), small=True)]


def _numbers(adjusted: AdjustedBlock, words: Words) -> list[tuple[str, str]]:
    block, o = adjusted.block, adjusted.outcome
    used = int(np.sum(adjusted.rays.status == RayStatus.USED))
    known = int(np.isfinite(adjusted.points.xyz).all(axis=1).sum())
    gnss = 0 if block.gnss_ins is None else len(block.gnss_ins)
    of = [words("numbers_of.of", part=words.whole(part), whole=words.whole(whole))
          for part, whole in ((known, len(block.points)), (used, len(block.image_points)))]  # fmt: skip
    texts = {
        "status": words.term("status", o.status), "iterations": words.whole(o.iterations),
        "sigma0": f"{words.number(o.sigma0, 3)} ({words.number(o.sigma0_um, 2)} µm)",
        "photographs": words.whole(len(block.images)), "points": of[0], "rays": of[1],
        "ground": words("numbers_of.control_check", control=len(adjusted.control), check=len(adjusted.check)),
        "gnss": words.whole(gnss) if gnss else words("numbers_of.none"),
        "observations": words.whole(o.observations), "unknowns": words.whole(o.unknowns),
        "conditions": words.whole(o.conditions), "redundancy": words.whole(o.redundancy),
    }  # fmt: skip
    return [(words(f"numbers_of.{key}"), text) for key, text in texts.items()]


def _cameras(adjusted: AdjustedBlock, words: Words) -> list[Part]:
    parts: list[Part] = []
    for camera in adjusted.block.cameras:
        parts.append(pairs([(words("camera.camera"), breakable(camera.name)),
                            *camera_tables.projection_words(camera, words)]))  # fmt: skip
    parts.append(camera_tables.interior_table(adjusted, adjusted.block.cameras, words))
    rows = camera_tables.parameter_rows(adjusted)
    if len(rows):
        parts.append(heading(words("report.parameters")))
        parts.append(camera_tables.parameter_table(adjusted, rows, words))
        parts.append(paragraph(words("parameters.about"), small=True))
    return parts


def _messages(adjusted: AdjustedBlock, words: Words) -> list[Part]:
    """Warnings and notes of the program, in the language of the program."""
    found = asprs_warning(adjusted)
    warnings = [*adjusted.outcome.warnings, *([found] if found else [])]
    return [*in_english(words), *message_parts(warnings, words, adjusted.outcome.notes)]


def settings_parts(block: Block, words: Words) -> list[Part]:
    """All settings by their keys of block.toml, defaults included."""
    rows = [
        (
            breakable(one.key),
            breakable(f"{one.text} {one.unit}".strip() if one.text else NO_VALUE),
            words(f"settings.{one.origin}"),
        )
        for one in used_settings(block)
    ]  # fmt: skip
    columns = [words(f"settings.{name}") for name in ("key", "value", "origin")]
    return [paragraph(words("report.about_settings"), small=True), table(columns, rows, words=3, small=True)]
