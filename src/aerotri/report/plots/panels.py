"""Several vector fields over one format side by side, on one scale, so that they can be compared by eye."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from aerotri.image_errors import AveragedResiduals, ErrorField
from aerotri.report.plots.camera import (
    LONGEST_IN_CELLS,
    draw_format,
    draw_vectors,
    flight_arrow,
    size_text,
    vector_legend,
)
from aerotri.report.plots.canvas import WIDTH, axes_at, new_figure, per_inch_for, plain, scale_vector, styled

MARGIN, GAP, AROUND = 0.3, 0.12, 0.14
"""Inches: beside the panels, between them, around a format."""
HEAD, FOOT, CAPTION = 0.55, 0.52, 0.48
"""Inches: above and below all panels, above a panel."""
LARGEST_INCH, WIDEST = 0.42, 4.2
"""Longest arrow, and widest panel, inches; chosen [C]: a single panel would fill the page otherwise, and its arrows
cross."""


@dataclass(frozen=True, eq=False)
class Panel:
    """A field over the image format with its heading; averaged residuals and error fields alike."""

    heading: str
    field: ErrorField | AveragedResiduals

    @property
    def vectors(self) -> np.ndarray:
        """(ny, nx, 2) mm, NaN where nothing is drawn."""
        if isinstance(self.field, ErrorField):
            return self.field.d
        return np.where(self.field.shown[..., None], self.field.mean, np.nan)


@styled
def plot_panels(panels: Sequence[Panel], title: str, subtitle: str = "") -> Figure:
    """Fields of one camera beside each other, their vectors on one scale; largest and RMS under each heading.

    Parameters
    ----------
    panels : one to four, of the same camera.
    """
    camera, number = panels[0].field.camera, len(panels)
    if not 1 <= number <= 4 or any(panel.field.camera.half_format_mm != camera.half_format_mm for panel in panels):
        raise ValueError("one to four panels of one format")
    half = np.array(camera.half_format_mm)
    columns = number if number < 4 else 2
    rows = -(-number // columns)
    room = 0.5 if camera.flight_axis else 0.0
    width = min((WIDTH - 2 * MARGIN - room - (columns - 1) * GAP) / columns, WIDEST)
    mm_per_inch = 2 * half[0] / (width - 2 * AROUND)
    height = 2 * half[1] / mm_per_inch + 2 * AROUND
    cell = 2 * half[0] / mm_per_inch / max(panel.field.x.shape[1] for panel in panels)
    lengths = np.concatenate([np.hypot(*panel.vectors.reshape(-1, 2).T) for panel in panels])
    longest = min(1.4 * LONGEST_IN_CELLS * cell, LARGEST_INCH)
    per_inch, size = per_inch_for(lengths, longest)
    # vectors may reach beyond the format, and not into the text above it
    caption = CAPTION + max(0.0, longest - AROUND)
    total = HEAD + rows * (caption + height) + FOOT + 0.17 * (subtitle.count("\n") + 1)
    figure = new_figure(total, plain(title, 120), subtitle)
    limits = np.array([width, height]) * mm_per_inch / 2
    for k, panel in enumerate(panels):
        row, column = divmod(k, columns)
        left, bottom = MARGIN + column * (width + GAP), FOOT + (rows - 1 - row) * (caption + height)
        axes = axes_at(figure, left, bottom, width, height)
        axes.set_xlim(-limits[0], limits[0])
        axes.set_ylim(-limits[1], limits[1])
        axes.set_axis_off()
        draw_format(axes, camera)
        field = panel.field
        quiver = draw_vectors(axes, field.x, field.y, panel.vectors, field.significant, per_inch, clip_on=False)
        _caption(figure, panel, left + AROUND, bottom + height + caption - CAPTION)
        if k == 0:
            scale_vector(axes, quiver, size, per_inch, size_text(size, camera), MARGIN + AROUND, 0.28)
    flight_arrow(figure, camera, MARGIN + columns * (width + GAP) + 0.2, FOOT + height / 2)
    vector_legend(figure, camera, ("beyond noise at 95 %", "within noise"))
    return figure


def _caption(figure: Figure, panel: Panel, left: float, bottom: float) -> None:
    width, height = figure.get_size_inches()
    field = panel.field
    sizes = np.array([field.max, field.rms])
    microns, pixels = 1e3 * sizes, sizes / field.camera.pixel_mm
    numbers = "largest {:.2f}, RMS {:.2f} µm".format(*microns) + " ({:.2f}, {:.2f} px)".format(*pixels)
    figure.text(left / width, (bottom + 0.2) / height, plain(panel.heading, 60), fontsize=9, weight="bold")
    figure.text(left / width, (bottom + 0.04) / height, numbers, fontsize=7.5)
