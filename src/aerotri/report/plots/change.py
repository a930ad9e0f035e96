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
from matplotlib.ticker import FuncFormatter, MaxNLocator

from aerotri.report.plots.canvas import INK, WIDTH, axes_at, coordinate_text, new_figure, plain, styled
from aerotri.report.plots.volume import COLOURS
from aerotri.volume.boundary import Boundary
from aerotri.volume.change.compute import LEVEL, Change

HIGHEST, MOST_CELLS = 4.6, 1200
QUIET = (0.90, 0.90, 0.90, 1.0)


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
    figure = new_figure(height + 1.75, "Change", subtitle)
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
        axes = axes_at(figure, x0, 0.75, width, height)
        if k == 0:
            quiet = np.where(np.isfinite(d)[..., None], np.array(QUIET), 0.0)
            axes.imshow(quiet, extent=extent, interpolation="nearest", aspect="auto")
        image = axes.imshow(values, extent=extent, interpolation="nearest", aspect="auto", **style)
        for one in areas:
            axes.add_collection(LineCollection(one.rings, colors=INK, linewidths=0.9))
        finish_map(figure, axes, image, label, (left, bottom, right, top), k == 0)
    return figure


def finish_map(
    figure: Figure,
    axes: Axes,
    image: ScalarMappable,
    label: str,
    bounds: tuple[float, float, float, float],
    first: bool,
) -> None:
    """Limits, coordinates and the scale of colours of one of two maps side by side.

    Parameters
    ----------
    bounds : left, bottom, right, top, m. first : whether it is the left one, which has the coordinates of both.
    """
    left, bottom, right, top = bounds
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.xaxis.set_major_locator(MaxNLocator(3))
    axes.yaxis.set_major_locator(MaxNLocator(5))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(coordinate_text))
    axes.set_xlabel("X [m]")
    if first:
        axes.set_ylabel("Y [m]")
    else:
        axes.set_yticklabels([])
    across, up = figure.get_size_inches()
    place = axes.get_position()
    x0, y0, height = place.x1 * across, place.y0 * up, place.height * up
    figure.colorbar(image, cax=axes_at(figure, x0 + 0.1, y0, 0.14, height)).set_label(label)
