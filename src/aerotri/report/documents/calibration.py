"""The calibration certificate of a camera, from an adjustment with self-calibration."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date

import numpy as np

from aerotri.conventions import InputError
from aerotri.image_errors import ImageGroup, image_groups, interior_elements
from aerotri.observations import Camera
from aerotri.observations.block import INTERIOR_ELEMENTS
from aerotri.report.documents import camera_tables
from aerotri.report.documents.figures import as_files, camera_figures
from aerotri.report.documents.head import Context, document, signature_fields
from aerotri.report.documents.parts import (
    Document,
    Part,
    entries,
    heading,
    pairs,
    paragraph,
    picture,
    signature,
    table,
    verdict,
)
from aerotri.report.documents.picture_texts import in_language
from aerotri.report.documents.words import Words, breakable
from aerotri.report.plots.rendering import render_plots
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.covariance import correlations

MONTHS = 24
"""Until the next calibration is recommended. [C]: intervals of one to three years are usual for laboratory
calibrations of survey cameras; in between every flight with check points shows whether the camera has changed."""
COLUMNS = 12
"""Columns of a table of correlations: as many as fit across a page."""
MOST_CORRELATED = 60
"""Parameters whose correlations are all listed [C]; of more, those of at least `NAMED_FROM`."""
NAMED_FROM = 0.7
MOST_GROUPS = 4
"""Groups of photographs of a camera whose image errors are drawn [C]."""


def calibration_certificate(adjusted: AdjustedBlock, context: Context, version: str, camera: str = "") -> Document:
    """The certificate of one camera, or of all, each beginning on a page of its own.

    Parameters
    ----------
    adjusted : the result in the coordinates of the block.
    context : language, date of computation, project. version : of aerotri that computed the result.
    camera : its name; '' for all that took photographs.

    Raises
    ------
    InputError
        When no photograph was taken with a camera of that name.
    """
    block, words = adjusted.block, context.words
    taken = [one for k, one in enumerate(block.cameras) if np.any(block.images.camera == k)]
    chosen = [one for one in taken if camera in ("", one.name)]
    if not chosen:
        known = ", ".join(one.name for one in taken)
        raise InputError(f"no photograph was taken with a camera '{camera}'", f"cameras of the result: {known}")
    parts: list[Part] = []
    files: dict[str, bytes] = {}
    for number, one in enumerate(chosen):
        own, pictures = _of_camera(adjusted, one, context, number)
        parts += own
        files |= pictures
    return document(context, words("calibration.title"), block.crs, version, parts, files)


def _of_camera(
    adjusted: AdjustedBlock, camera: Camera, context: Context, number: int
) -> tuple[list[Part], dict[str, bytes]]:
    words, o = context.words, adjusted.outcome
    groups = [one for one in image_groups(adjusted.block) if one.camera is camera]
    p = adjusted.parameters
    own = np.isin(p.groups, [one.name for one in groups]) & (p.status != "removed")
    rows = camera_tables.parameter_rows(adjusted, own)
    parts = [heading(words("calibration.camera", name=breakable(camera.name)), new_page=number > 0),
             pairs(camera_tables.projection_words(camera, words))]  # fmt: skip
    if o.verdict != "accepted":
        parts.append(verdict(words(f"verdict.{o.verdict or 'none'}"), words("calibration.not_accepted"),
                             [breakable(text) for text in o.reasons]))  # fmt: skip
    parts += [heading(words("calibration.interior")), camera_tables.interior_table(adjusted, [camera], words)]
    parts.append(paragraph(words("calibration.about_interior"), small=True))
    parts += _held(adjusted, camera, bool(np.any(own & (p.kinds != "interior"))), words)
    parts += [heading(words("calibration.validity")), pairs(_validity(adjusted, groups, context))]
    parts += [heading(words("calibration.next")), paragraph(_next(context)),
              entries([words(f"calibration.next_{k}") for k in (1, 2, 3)]),
              paragraph(words("calibration.next_rule", months=MONTHS), small=True),
              signature(signature_fields(words))]  # fmt: skip
    parts.append(heading(words("report.parameters"), new_page=True))
    if len(rows):
        parts += [
            camera_tables.parameter_table(adjusted, rows, words),
            paragraph(words("parameters.about"), small=True),
        ]
    else:
        parts.append(paragraph(words("calibration.no_parameters")))
    pictures, files = _pictures(adjusted, groups, words, number)
    return [*parts, *pictures, *_correlations(adjusted, camera, rows, words)], files


def _held(adjusted: AdjustedBlock, camera: Camera, has_parameters: bool, words: Words) -> list[Part]:
    """What was held beside the elements that the table of the interior orientation calls held.

    Parameters
    ----------
    has_parameters : whether any additional parameter was determined.
    """
    determined = int((interior_elements(adjusted, camera)[1] > 0.0).sum())
    if not determined and not has_parameters:
        return [paragraph(words("calibration.nothing_determined"))]
    held = camera_tables.held_rows(camera, words)
    if held:
        return [heading(words("calibration.held")), pairs(held)]
    return [paragraph(words("calibration.nothing_held"))] if determined == len(INTERIOR_ELEMENTS) else []


def _validity(adjusted: AdjustedBlock, groups: Sequence[ImageGroup], context: Context) -> list[tuple[str, str]]:
    words, block = context.words, adjusted.block
    own = np.any([one.images for one in groups], axis=0)
    heights = adjusted.images.centre[own, 2]
    heights = heights[np.isfinite(heights)]
    ground = adjusted.points.xyz[:, 2]
    ground = ground[np.isfinite(ground)]
    rays = int(adjusted.images.rays[own].sum())
    above = words.number(float(np.median(heights) - np.median(ground)), 0) if len(heights) and len(ground) else ""
    project = context.project
    rows = [
        (words("calibration.from_block"), breakable(block.name)),
        (words("calibration.photographs"), words.whole(int(own.sum()))),
        (words("calibration.rays"), words.whole(rays)),
        (words("calibration.height"), words("calibration.above_ground", height=above) if above else "–"),
        (words("calibration.flown"),
         words.date(project.survey_date) if project.survey_date else words("head.not_stated")),
        (words("numbers_of.sigma0"), f"{words.number(adjusted.outcome.sigma0_um, 2)} µm"),
        (words("calibration.verdict"), words(f"verdict.{adjusted.outcome.verdict or 'none'}")),
    ]  # fmt: skip
    return rows


def _next(context: Context) -> str:
    words, day = context.words, context.project.survey_date
    if not day:
        return words("calibration.next_undated", months=MONTHS)
    return words("calibration.next_dated", date=words.date(months_later(day, MONTHS)), months=MONTHS)


def months_later(day: str, months: int) -> str:
    """The same day so many months later, the last of the month where there is none; YYYY-MM-DD."""
    start = date.fromisoformat(day)
    year, month = divmod(start.year * 12 + start.month - 1 + months, 12)
    for of_month in range(start.day, 27, -1):
        try:
            return date(year, month + 1, of_month).isoformat()
        except ValueError:
            continue
    return date(year, month + 1, min(start.day, 28)).isoformat()


def _pictures(
    adjusted: AdjustedBlock, groups: Sequence[ImageGroup], words: Words, number: int
) -> tuple[list[Part], dict[str, bytes]]:
    figures = {
        f"camera{number}_{k}_{name}": (name, figure)
        for k, group in enumerate(groups[:MOST_GROUPS])
        for name, figure in camera_figures(adjusted, group).items()
    }
    drawn = in_language({name: figure for name, (_, figure) in figures.items()}, words.language)
    files, names = as_files(render_plots(drawn))
    parts = [picture(names[name], words(f"figure.{caption}"), narrow=True) for name, (caption, _) in figures.items()]
    return [heading(words("calibration.field")), *parts] if parts else [], files


def _correlations(adjusted: AdjustedBlock, camera: Camera, rows: np.ndarray, words: Words) -> list[Part]:
    """Interior elements and parameters of the camera against one another; percent."""
    p = adjusted.parameters
    interior = np.flatnonzero((p.kinds == "interior") & (p.groups == camera.name) & (p.status != "removed"))
    chosen = np.array([k for k in (*interior, *rows) if p.covariance[k, k] > 0.0], dtype=int)
    if len(chosen) < 2:
        return []
    r = np.nan_to_num(correlations(p.covariance[np.ix_(chosen, chosen)]), posinf=0.0, neginf=0.0)
    several = len(set(p.groups[rows].tolist())) > 1
    names = [camera_tables.SYMBOLS.get(str(p.names[k])) or
             breakable(f"{p.names[k]} ({p.groups[k]})" if several else p.names[k]) for k in chosen]  # fmt: skip
    title = heading(words("calibration.correlations"))
    if len(chosen) > MOST_CORRELATED:
        return [title, paragraph(words("calibration.pairs", least=words.number(NAMED_FROM, 1)), small=True),
                _pairs(names, r, words)]  # fmt: skip
    parts = [title, paragraph(words("calibration.percent"), small=True)]
    labels = [f"{k}  {name}" for k, name in enumerate(names, start=1)]
    for start in range(0, len(chosen), COLUMNS):
        columns = range(start, min(start + COLUMNS, len(chosen)))
        below = [(labels[i], *(_percent(r[i, j], words) if j <= i else "" for j in columns))
                 for i in range(start, len(chosen))]  # fmt: skip
        parts.append(table([words("parameters.name"), *(str(j + 1) for j in columns)], below, words=1, small=True))
    return parts


def _pairs(names: Sequence[str], r: np.ndarray, words: Words) -> Part:
    found = [(float(r[i, k]), i, k) for i in range(len(names)) for k in range(i + 1, len(names))]
    high = sorted((one for one in found if abs(one[0]) >= NAMED_FROM), key=lambda one: -abs(one[0]))
    rows = [(names[i], names[k], _percent(value, words)) for value, i, k in high]
    return table([words("parameters.name"), words("parameters.name"), "r [%]"], rows, words=2)


def _percent(r: float, words: Words) -> str:
    return words.number(100.0 * float(r), 0)
