"""Figures 16 to 20 of paper 003 in our form: contour lines by parameter set and end lap, image errors beside them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from aerotri import drawing

PANEL, GAP, ABOVE = 4.6, 0.95, 0.62
MOST_LINES = 45


def interval_of(deformation, wanted_cm: float | None) -> float:
    """cm, the paper's interval, a larger one where the lines would run together, ours where it has none."""
    dz = deformation.d[..., 2]
    low, high = float(np.nanmin(dz)), float(np.nanmax(dz))
    if wanted_cm is None:
        return 100.0 * drawing.contour_interval(low, high)
    while 100.0 * (high - low) / wanted_cm > MOST_LINES:
        wanted_cm *= 2.0
    return wanted_cm


@drawing.styled
def deformation_figure(title: str, subtitle: str, rows: Sequence[Sequence[tuple[str, Any, float]]]) -> Figure:
    """Panels of contour lines: rows of (caption, deformation, interval in cm)."""
    sizes = [drawing.panel_size(row[0][1], PANEL, 4.0) for row in rows]
    columns = max(len(row) for row in rows)
    height = sum(size[1] for size in sizes) + len(rows) * (ABOVE + 0.55) + 1.1
    figure = drawing.new_figure(height, title, subtitle, width=columns * (PANEL + GAP) + 0.2)
    top = height - 0.75
    for row, size in zip(rows, sizes, strict=True):
        for column, (caption, deformation, interval) in enumerate(row):
            left = GAP - 0.1 + column * (PANEL + GAP)
            axes = drawing.axes_at(figure, left, top - ABOVE - size[1], *size)
            drawing.draw_contours(axes, deformation, interval)
            _title(axes, caption, f"{_range(deformation)}; contour interval {interval:g} cm")
        top -= size[1] + ABOVE + 0.55
    _legend(figure, any(d.seams for row in rows for _, d, _ in row))
    return figure


@drawing.styled
def errors_and_deformation(title: str, subtitle: str, rows: Sequence[tuple[str, Any, Any, float]]) -> Figure:
    """Image errors on the left, the model deformation on the right: (caption, errors, deformation, interval in cm)."""
    fields = [_field_size(field) for _, field, _, _ in rows]
    models = [drawing.panel_size(d, PANEL, 4.0) for _, _, d, _ in rows]
    heights = [max(a[1], b[1]) for a, b in zip(fields, models, strict=True)]
    height = sum(heights) + len(rows) * (ABOVE + 0.65) + 1.1
    figure = drawing.new_figure(height, title, subtitle, width=2 * (PANEL + GAP) + 0.2)
    top = height - 0.75
    for (caption, field, deformation, interval), left, right, tall in zip(rows, fields, models, heights, strict=True):
        _draw_field(figure, field, GAP - 0.1, top - ABOVE - left[1], left, caption)
        axes = drawing.axes_at(figure, GAP - 0.1 + PANEL + GAP, top - ABOVE - right[1], *right)
        drawing.draw_contours(axes, deformation, interval)
        _title(axes, _range(deformation), f"contour interval {interval:g} cm")
        top -= tall + ABOVE + 0.65
    _legend(figure, any(d.seams for _, _, d, _ in rows))
    return figure


def _field_size(field) -> tuple[float, float]:
    half = np.array(field.camera.half_format_mm)
    per_inch = max(2.3 * half[0] / PANEL, 2.3 * half[1] / 4.0)
    return float(2.3 * half[0] / per_inch), float(2.3 * half[1] / per_inch)


def _draw_field(figure: Figure, field, left: float, bottom: float, size, caption: str) -> None:
    camera = field.camera
    half = np.array(camera.half_format_mm)
    axes = drawing.axes_at(figure, left, bottom, *size)
    axes.set_xlim(-1.15 * half[0], 1.15 * half[0])
    axes.set_ylim(-1.15 * half[1], 1.15 * half[1])
    axes.set_xlabel("x in the image [mm]")
    axes.set_ylabel("y in the image [mm], along the flight" if camera.flight_axis == "+y" else "y in the image [mm]")
    frame = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * half
    axes.plot(*frame.T, color=drawing.GREY, lw=0.8, zorder=1)
    axes.add_collection(
        LineCollection(drawing.seams(camera), colors=drawing.GREY, linewidths=0.9, linestyles=(0, (1, 2)), zorder=1)
    )
    lengths = np.hypot(field.d[..., 0], field.d[..., 1])
    per_inch, round_size = drawing.per_inch_for(lengths, 0.35)
    at = np.stack([field.x, field.y], axis=-1).reshape(-1, 2)
    quiver = drawing.vectors(axes, at, field.d.reshape(-1, 2), per_inch, drawing.INK, zorder=3)
    at_right, above = left + size[0] - 0.9, bottom + size[1] + 0.14
    drawing.scale_vector(axes, quiver, round_size, per_inch, drawing.length_text(1e-3 * round_size), at_right, above)
    _title(axes, caption, f"image errors: RMS {1e3 * field.rms:.1f} µm, largest {1e3 * field.max:.1f} µm")


def _title(axes: Axes, *lines: str) -> None:
    axes.set_title("\n".join(lines), fontsize=8.5, loc="left")


def _range(deformation) -> str:
    dz = 100.0 * deformation.d[..., 2]
    text = f"dZ {np.nanmin(dz):+.0f} … {np.nanmax(dz):+.0f} cm, RMS {np.sqrt(np.nanmean(dz**2)):.1f} cm"
    return text.replace("-", "−")


def _legend(figure: Figure, seams_there: bool) -> None:
    width, height = figure.get_size_inches()
    figure.legend(
        handles=drawing.contour_symbols(seams_there), loc="center left",
        bbox_to_anchor=(0.7 / width, 0.24 / height), ncols=5, borderaxespad=0.0,
    )  # fmt: skip
