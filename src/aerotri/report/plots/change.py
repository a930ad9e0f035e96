"""Map of a change: what is beyond the level of detection in colour, the rest in grey; beside it σ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MaxNLocator
from scipy.ndimage import binary_opening

from aerotri.report.plots.canvas import INK, WIDTH, axes_at, coordinate_text, new_figure, plain, styled, write_name
from aerotri.report.plots.volume import COLOURS
from aerotri.volume.boundary import Boundary
from aerotri.volume.change.compute import LEVEL, Change

HIGHEST, MOST_CELLS = 4.6, 1200
QUIET, HATCH = (0.90, 0.90, 0.90, 1.0), "////"


@styled
def plot_change(change: Change, content: Mapping[str, Any], areas: Sequence[Boundary]) -> Figure:
    """Two maps side by side on one scale of coordinates."""
    left, bottom, right, top = change.grid.bounds
    width = min((WIDTH - 3.6) / 2.0, HIGHEST * (right - left) / (top - bottom))
    height = width * (top - bottom) / (right - left)
    step = max(1, max(change.difference.shape) // MOST_CELLS)
    d, sigma = change.difference[::step, ::step], change.sigma[::step, ::step]
    found = np.abs(d) > LEVEL * sigma
    subtitle = (
        f"{plain(content['second'], 40)} less {plain(content['first'], 40)}\n"
        f"grey: within the level of detection (95 %, {LEVEL:.2f} σ); {content['beyond_level_percent']:.1f} % of the "
        "cells are beyond it"
    )
    figure = new_figure(height + 2.1, "Change", subtitle)
    extent = (left, right, bottom, top)
    known = d[found] if found.any() else d[np.isfinite(d)]
    size = max(float(np.percentile(np.abs(known), 99.0)) if len(known) else 0.0, 1e-6)
    spread = sigma[np.isfinite(sigma)]
    most = max(float(np.percentile(spread, 99.0)) if len(spread) else 0.0, 1e-9)
    maps: tuple[tuple[np.ndarray, dict[str, Any], str], ...] = (
        (np.where(found, d, np.nan), {"cmap": COLOURS, "norm": TwoSlopeNorm(0.0, -size, size)}, "difference [m]"),
        (sigma, {"cmap": "Greys", "vmin": 0.0, "vmax": 1.6 * most}, "σ [m]"),
    )
    for k, (values, style, label) in enumerate(maps):
        x0 = 0.95 + k * (width + 1.6)
        axes = axes_at(figure, x0, 1.1, width, height)
        if k == 0:
            quiet = np.where(np.isfinite(d)[..., None], np.array(QUIET), np.array((1.0, 1.0, 1.0, 0.0)))
            axes.imshow(quiet, extent=extent, interpolation="nearest", aspect="auto")
        image = axes.imshow(values, extent=extent, interpolation="nearest", aspect="auto", **style)
        if k == 0:
            hatch_lost(axes, found & (d < 0.0), extent)
        for one in areas:
            axes.add_collection(LineCollection(one.rings, colors=INK, linewidths=0.9))
        for one in areas if k == 0 and len(areas) > 1 else ():
            if not one.piles:
                write_name(
                    axes, (0.5 * (one.polygon.bounds[0] + one.polygon.bounds[2]), one.polygon.bounds[3]), one.name
                )
        finish_map(figure, axes, image, label, (left, bottom, right, top), k == 0, content["crs"])
    handles = [
        Patch(facecolor=COLOURS(0.85), label="gained"),
        Patch(facecolor=COLOURS(0.15), edgecolor="white", hatch=HATCH, lw=0.0, label="lost"),
        Patch(facecolor=QUIET, edgecolor=INK, lw=0.4, label="within the level of detection"),
        Line2D([], [], color=INK, lw=0.9, label="areas"),
    ]
    shown = handles if areas else handles[:-1]
    figure.legend(handles=shown, loc="center left", bbox_to_anchor=(0.9 / WIDTH, 0.25 / (height + 2.1)), ncols=4)
    return figure


def hatch_lost(axes: Axes, lost: np.ndarray, extent: tuple[float, float, float, float]) -> None:
    """Hatch what was lost: in black and white it is as dark as what was gained. Single cells are left out."""
    whole = binary_opening(lost, np.ones((3, 3), bool))
    if not whole.any() or whole.all():
        return
    left, right, bottom, top = extent
    rows, columns = lost.shape
    x = left + (np.arange(columns) + 0.5) * (right - left) / columns
    y = top - (np.arange(rows) + 0.5) * (top - bottom) / rows
    drawn = axes.contourf(x, y, whole.astype(float), levels=[0.5, 1.5], colors="none", hatches=[HATCH])
    drawn.set(edgecolor="white", linewidth=0.0)


def finish_map(
    figure: Figure,
    axes: Axes,
    image: ScalarMappable,
    label: str,
    bounds: tuple[float, float, float, float],
    first: bool,
    crs: str,
) -> None:
    """Limits, coordinates and the scale of colours of one of two maps side by side.

    Parameters
    ----------
    bounds : left, bottom, right, top, m. first : whether it is the left one, which has the coordinates of both.
    crs : coordinate system, '' where none is stated.
    """
    left, bottom, right, top = bounds
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.xaxis.set_major_locator(MaxNLocator(3))
    axes.yaxis.set_major_locator(MaxNLocator(5))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(coordinate_text))
    axes.set_xlabel("E [m]" if crs else "X [m]")
    if first:
        axes.set_ylabel("N [m]" if crs else "Y [m]")
    else:
        axes.set_yticklabels([])
    across, up = figure.get_size_inches()
    place = axes.get_position()
    x0, y0, height = place.x1 * across, place.y0 * up, place.height * up
    figure.colorbar(image, cax=axes_at(figure, x0 + 0.1, y0, 0.14, height)).set_label(label)
