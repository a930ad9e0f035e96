"""Plots over the image format: systematic image errors and averaged residuals as vectors."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch
from matplotlib.quiver import Quiver
from matplotlib.ticker import FixedLocator, MaxNLocator

from aerotri.functional_model.additional_parameters import ultracam_d
from aerotri.image_errors import AveragedResiduals, ErrorField
from aerotri.observations import Camera
from aerotri.report.plots.canvas import (
    GREY,
    INK,
    WIDTH,
    axes_at,
    length_text,
    new_figure,
    per_inch_for,
    plain,
    scale_vector,
    styled,
    vectors,
)

FLIGHT = {"+x": (1, 0), "-x": (-1, 0), "+y": (0, 1), "-y": (0, -1)}
"""Direction of the flight in the image frame, by the axis that points along it."""
FAINT = "#a3abb3"
LONGEST_IN_CELLS, LONGEST_INCH = 1.9, 0.5
"""Longest arrow in cells of its grid, and in inches; chosen [C]: longer ones cross too many others, shorter ones do not
show their direction."""
AROUND_FORMAT = 0.38
"""Inches between the format and the edge of the axes, for arrows that leave the format."""


@styled
def plot_systematic_errors(field: ErrorField, block_name: str) -> Figure:
    """Systematic image errors measured − ideal over the format; what is significant at 95 % is darker."""
    camera = field.camera
    subtitle = (
        f"{_owner(field.group, camera)}: measured − ideal;  largest {micron(field.max, camera)},  "
        f"RMS {micron(field.rms, camera)}{_left_out(field)}"
    )
    axes, figure, cell = _format_figure(
        f"Systematic image errors – {plain(block_name)}", subtitle, camera, field.x.shape
    )
    _draw_vectors(axes, field.x, field.y, field.d, field.significant, cell, camera)
    vector_legend(figure, camera, ("significant at 95 %", "not significant"))
    return figure


def _left_out(field: ErrorField) -> str:
    """What a field was freed of, as a line of its own."""
    return "\nwithout shifts, scale, rotation, tilts: orientation takes them" if field.without_orientation else ""


@styled
def plot_averaged_residuals(averaged: AveragedResiduals, block_name: str) -> Figure:
    """Averaged residuals measured − adjusted by cells: what a systematic error not modelled would look like."""
    camera = averaged.camera
    shown = averaged.shown
    subtitle = (
        f"{_owner(averaged.group, camera)}: measured − adjusted;  largest {micron(averaged.max, camera)},  "
        f"RMS {micron(averaged.rms, camera)} where noise alone would leave {1e3 * averaged.rms_of_noise:.2f} µm\n"
        f"cells with at least {averaged.n_min} rays: {shown.sum()} of {shown.size}, "
        f"median {np.median(averaged.count):.0f} rays a cell"
    )
    title = f"Averaged residuals – {plain(block_name)}"
    axes, figure, cell = _format_figure(title, subtitle, camera, averaged.x.shape)
    mean = np.where(shown[..., None], averaged.mean, np.nan)
    _draw_vectors(axes, averaged.x, averaged.y, mean, averaged.significant, cell, camera)
    vector_legend(figure, camera, ("beyond noise at 95 %", "within noise"))
    return figure


def _owner(group: str, camera: Camera) -> str:
    return plain(group) if group == camera.name else f"{plain(group)}, camera {plain(camera.name)}"


def micron(value_mm: float, camera: Camera) -> str:
    """'2.31 µm (0.26 px)'."""
    if not np.isfinite(value_mm):
        return "–"
    return f"{1e3 * value_mm:.2f} µm ({_pixels(value_mm / camera.pixel_mm)} px)"


def _pixels(value: float) -> str:
    """Two decimals, of less than a tenth two digits."""
    return f"{value:.2f}" if value >= 0.1 else f"{value:.2g}"


def _format_figure(title: str, subtitle: str, camera: Camera, shape: tuple[int, ...]) -> tuple[Axes, Figure, float]:
    """Axes that show the format with equal scales; also the size of a cell in inches."""
    half = np.array(camera.half_format_mm)
    mm_per_inch = max(2 * half[0] / (WIDTH - 2.3), 2 * half[1] / 6.4)
    width, height = 2 * half / mm_per_inch + 2 * AROUND_FORMAT
    lines = subtitle.count("\n") + 1
    figure = new_figure(height + 1.45 + 0.17 * lines, title, subtitle)
    axes = axes_at(figure, 0.8, 0.92, width, height)
    limits = np.array([width, height]) * mm_per_inch / 2
    axes.set_xlim(-limits[0], limits[0])
    axes.set_ylim(-limits[1], limits[1])
    axes.set_xlabel("x in the image [mm]")
    axes.set_ylabel("y in the image [mm]")
    axes.spines[["top", "right"]].set_visible(False)
    for axis, side, reach in ((axes.xaxis, "bottom", half[0]), (axes.yaxis, "left", half[1])):
        axes.spines[side].set_bounds(-reach, reach)
        axis.set_major_locator(FixedLocator(MaxNLocator(8, steps=[1, 2, 5, 10]).tick_values(-reach, reach)[1:-1]))
    draw_format(axes, camera)
    flight_arrow(figure, camera, 0.8 + width + 0.3, 0.92 + height / 2)
    return axes, figure, 2 * half[0] / mm_per_inch / shape[1]


def draw_format(axes: Axes, camera: Camera) -> None:
    """The edge of the format, the seams of its parts and its centre."""
    frame = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * np.array(camera.half_format_mm)
    axes.plot(*frame.T, color=GREY, lw=0.8, zorder=1)
    axes.add_collection(LineCollection(seams(camera), colors=GREY, linewidths=0.5, linestyles=(0, (5, 3)), zorder=1))
    axes.plot(0, 0, "+", color=GREY, ms=7, mew=0.7, zorder=1)


def seams(camera: Camera) -> list[np.ndarray]:
    """Where the parts of a composed image meet: lines from edge to edge, (2, 2) mm each; none for one-part cameras."""
    half = np.array(camera.half_format_mm)
    if camera.model == "dmc":
        return [np.array([[-half[0], 0.0], [half[0], 0.0]]), np.array([[0.0, -half[1]], [0.0, half[1]]])]
    if camera.model != "ultracam_d":
        return []
    pixel, turn = ultracam_d.native_pixel_mm(camera), ultracam_d.native_from_image(camera)
    half_native = np.abs(turn @ half)
    columns, rows = np.array(ultracam_d.SENSOR_SIZE_PX) / 2
    across = [[[x, -half_native[1]], [x, half_native[1]]] for x in (ultracam_d.SEAM_COLUMNS - columns) * pixel]
    along = [[[-half_native[0], y], [half_native[0], y]] for y in (rows - ultracam_d.SEAM_ROWS) * pixel]
    return [np.array(line) @ turn for line in across + along]


def _draw_vectors(
    axes: Axes, x: np.ndarray, y: np.ndarray, d: np.ndarray, strong: np.ndarray, cell: float, camera: Camera
) -> None:
    per_inch, size = per_inch_for(np.hypot(d[..., 0], d[..., 1]), min(LONGEST_IN_CELLS * cell, LONGEST_INCH))
    quiver = draw_vectors(axes, x, y, d, strong, per_inch)
    scale_vector(axes, quiver, size, per_inch, size_text(size, camera), 0.85, 0.28)


def draw_vectors(
    axes: Axes, x: np.ndarray, y: np.ndarray, d: np.ndarray, strong: np.ndarray, per_inch: float, **options: Any
) -> Quiver:
    """Vectors d (ny, nx, 2) mm at (ny, nx) mm, `per_inch` mm drawn as one inch; those not strong are fainter."""
    finite = np.isfinite(d).all(axis=-1)
    faint, dark = finite & ~strong, finite & strong
    at = np.stack([x, y], axis=-1)
    vectors(axes, at[faint], d[faint], per_inch, FAINT, zorder=3, **options)
    return vectors(axes, at[dark], d[dark], per_inch, INK, width=0.013, zorder=4, **options)


def size_text(size_mm: float, camera: Camera) -> str:
    """'5 µm (0.56 px)'."""
    return f"{length_text(1e-3 * size_mm)} ({size_mm / camera.pixel_mm:.2g} px)"


def vector_legend(figure: Figure, camera: Camera, labels: tuple[str, str]) -> None:
    """What dark and faint vectors mean, at the lower right."""
    handles = [
        Line2D([], [], color=INK, lw=1.6, label=labels[0]),
        Line2D([], [], color=FAINT, lw=1.3, label=labels[1]),
    ]
    if seams(camera):
        handles.append(Line2D([], [], color=GREY, lw=0.6, ls=(0, (5, 3)), label="seams of the image's parts"))
    width, height = figure.get_size_inches()
    figure.legend(handles=handles, loc="center right", bbox_to_anchor=(1 - 0.2 / width, 0.28 / height), ncols=3,
                  borderaxespad=0.0, handletextpad=0.6, columnspacing=1.6)  # fmt: skip


def flight_arrow(figure: Figure, camera: Camera, x: float, y: float) -> None:
    """The flight direction beside the format, where the camera says it."""
    if camera.flight_axis is None:
        return
    width, height = figure.get_size_inches()
    dx, dy = (0.26 * component for component in FLIGHT[camera.flight_axis])
    arrow = FancyArrowPatch((x - dx, y - dy), (x + dx, y + dy), transform=figure.dpi_scale_trans, arrowstyle="-|>",
                            mutation_scale=11, color=INK, lw=1.3, shrinkA=0, shrinkB=0)  # fmt: skip
    figure.add_artist(arrow)
    figure.text(x / width, (y - 0.4) / height, "flight", ha="center", va="top", fontsize=8.5)
