"""Cameras and their parameters as tables of a document."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerotri.image_errors import interior_elements, interior_model_sigmas, largest_effects
from aerotri.observations import Camera
from aerotri.observations.block import INTERIOR_ELEMENTS
from aerotri.report.documents.parts import Part, table
from aerotri.report.documents.words import NO_VALUE, Words, breakable
from aerotri.report.tables.adjustment import unit_of
from aerotri.results.adjusted_block import AdjustedBlock

SYMBOLS = {"focal_length_mm": "c", "x0_mm": "x0", "y0_mm": "y0"}


def interior_table(adjusted: AdjustedBlock, cameras: Sequence[Camera], words: Words) -> Part:
    """Principal distance and principal point with σ and total σ, and what was given."""
    rows: list[tuple[str, ...]] = []
    with_model = adjusted.parameters.model_sigma is not None
    for camera in cameras:
        values, sigmas = interior_elements(adjusted, camera)
        model = interior_model_sigmas(adjusted, camera)
        total = sigmas if model is None else np.hypot(sigmas, model)
        for k, key in enumerate(INTERIOR_ELEMENTS):
            held = sigmas[k] <= 0.0
            sigma = [words("camera.held") if held else words.number(sigmas[k], 4)]
            sigma += [NO_VALUE if held else words.number(total[k], 4)] if with_model else []
            given = camera.interior[key].value
            rows.append((breakable(camera.name), SYMBOLS[key], words.number(values[k], 4), *sigma,
                         words.number(given, 4), words.number(values[k] - given, 4, signed=True)))  # fmt: skip
    columns = [words("camera.camera"), words("camera.element"), words("camera.value_mm"), "σ [mm]"]
    columns += [words("camera.total_mm")] if with_model else []
    return table([*columns, words("camera.given_mm"), words("camera.change_mm")], rows, words=2)


def parameter_rows(adjusted: AdjustedBlock, chosen: np.ndarray | None = None) -> np.ndarray:
    """(k,) rows of shared parameters other than interior elements and the nodes of random fields.

    Parameters
    ----------
    chosen : (s,) bool, those to take; all where None.
    """
    p = adjusted.parameters
    kept = (p.kinds != "interior") & ~p.is_node
    return np.flatnonzero(kept if chosen is None else kept & chosen)


def parameter_table(adjusted: AdjustedBlock, rows: np.ndarray, words: Words) -> Part:
    """Additional parameters with σ, test, effect and the largest correlation."""
    p = adjusted.parameters
    numbers = (p.value, p.sigma, p.total_sigma, p.t, 1e3 * largest_effects(adjusted), p.max_correlation)
    with_model = p.model_sigma is not None
    cells: list[tuple[str, ...]] = []
    for k in rows.tolist():
        value, sigma, total, t, effect, largest = (float(one[k]) for one in numbers)
        partner = words.number(largest, 2, signed=True)
        partner += f" ({breakable(p.max_correlation_with[k])})" if p.max_correlation_with[k] else ""
        cells.append((breakable(p.names[k]), breakable(p.groups[k]), words.term("status", str(p.status[k])),
                      unit_of(str(p.names[k])), words.scientific(value, 4), words.scientific(sigma, 1),
                      *([words.scientific(total, 1)] if with_model else []), words.number(t, 1),
                      words.number(effect, 2), partner))  # fmt: skip
    columns = [words(f"parameters.{key}") for key in ("name", "group", "status", "unit", "value")] + ["σ"]
    columns += [words("parameters.total")] if with_model else []
    columns += ["t", words("parameters.effect"), words("parameters.largest_r")]
    return table(columns, cells, words=4, small=True)


def held_rows(camera: Camera, words: Words) -> list[tuple[str, str]]:
    """Parameters beside the interior orientation that were stated and held, with their values."""
    rows: list[tuple[str, str]] = []
    for family, held in (("brown", camera.brown), ("lens", camera.lens), ("", camera.parameters)):
        for name, one in held.items():
            if one.fixed and one.value != 0.0:
                full = f"{family}.{name}" if family else name
                rows.append((breakable(full), words.scientific(one.value, 5)))
    return rows


def projection_words(camera: Camera, words: Words) -> list[tuple[str, str]]:
    """Format, pixel, kind of camera."""
    columns, lines = camera.size_px
    pixel = camera.pixel_um
    size = f"{words.number(columns * pixel * 1e-3, 3)} mm × {words.number(lines * pixel * 1e-3, 3)} mm"
    rows = [
        (words("camera.format"), f"{columns} × {lines} px, {size}"),
        (words("camera.pixel"), f"{words.short(pixel)} µm"),
        (words("camera.model"), f"{camera.model}, {words.term('projection', camera.projection)}"),
    ]
    if camera.flight_axis is not None:
        rows.append((words("camera.flight_axis"), camera.flight_axis.replace("-", "−")))
    return rows
