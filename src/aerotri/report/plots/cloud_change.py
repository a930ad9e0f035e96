"""Distances of two clouds: map of those beyond the level of detection beside σ, and their histogram."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, StrMethodFormatter

from aerotri.report.plots.canvas import INK, WIDTH, axes_at, new_figure, plain, styled, value_text
from aerotri.report.plots.change import HATCH, finish_map, hatch_lost
from aerotri.report.plots.volume import COLOURS
from aerotri.volume.change.clouds import CloudDistances

HIGHEST, QUIET, BINS = 4.6, "#d8d8d8", 60
SHARE = 0.5
"""Of the places of a square, those lost at least where it is hatched; chosen [C]."""
GAINED, LOST, SAME = "gained", "lost", "within the level of detection"


@styled
def plot_distances(found: CloudDistances, content: Mapping[str, Any]) -> Figure:
    """Two maps side by side on one scale of coordinates, a mark a core point."""
    low, high = found.core[:, :2].min(axis=0), found.core[:, :2].max(axis=0)
    margin = 0.02 * max(float((high - low).max()), 1e-6)
    (left, bottom), (right, top) = low - margin, high + margin
    ratio = float(np.clip((right - left) / (top - bottom), 0.2, 5.0))
    width = min((WIDTH - 3.6) / 2.0, HIGHEST * ratio)
    height = width / ratio
    known = np.isfinite(found.distance)
    beyond = np.abs(found.distance) > found.level(content["registration_m"])
    subtitle = (
        f"{plain(content['second'], 40)} less {plain(content['first'], 40)}, along the normals of the first\n"
        f"grey: within the level of detection (95 %); {content['beyond_level_percent']:.1f} % of the places are "
        "beyond it"
    )
    figure = new_figure(height + 2.1, "Distances of two point clouds", subtitle)
    size = max((72.0**2 * width * height / max(len(found.core), 1)) * 1.3, 0.5)
    largest = float(np.percentile(np.abs(found.distance[beyond if beyond.any() else known]), 99.0))
    most = float(np.percentile(found.sigma[known], 99.0))
    maps: tuple[tuple[np.ndarray, np.ndarray, dict[str, Any], str], ...] = (
        (beyond, found.distance, {"cmap": COLOURS, "norm": TwoSlopeNorm(0.0, -max(largest, 1e-6), max(largest, 1e-6))},
         "distance [m]"),
        (known, found.sigma, {"cmap": "Greys", "vmin": 0.0, "vmax": max(1.6 * most, 1e-9)}, "σ [m]"),
    )  # fmt: skip
    for k, (rows, values, style, label) in enumerate(maps):
        x0 = 0.95 + k * (width + 1.6)
        axes = axes_at(figure, x0, 1.1, width, height)
        if k == 0:
            axes.scatter(*found.core[known & ~beyond, :2].T, s=size, c=QUIET, marker="s", lw=0)
        image = axes.scatter(*found.core[rows, :2].T, s=size, c=values[rows], marker="s", lw=0, **style)
        if k == 0:
            _hatch_lost(axes, found, beyond, (left, right, bottom, top), content["spacing_m"])
        finish_map(figure, axes, image, label, (left, bottom, right, top), k == 0, content["crs"])
    handles = [
        Patch(facecolor=COLOURS(0.85), label=GAINED),
        Patch(facecolor=COLOURS(0.15), edgecolor="white", hatch=HATCH, lw=0.0, label=LOST),
        Patch(facecolor=QUIET, label=SAME),
    ]
    figure.legend(handles=handles, loc="center left", bbox_to_anchor=(0.9 / WIDTH, 0.25 / (height + 2.1)), ncols=3)
    return figure


def _hatch_lost(
    axes: Axes, found: CloudDistances, beyond: np.ndarray, extent: tuple[float, float, float, float], spacing: float
) -> None:
    """Hatch squares most of whose places were lost: in black and white they are as dark as what was gained."""
    left, right, bottom, top = extent
    known = np.isfinite(found.distance)
    edges = [np.linspace(low, high, max(2, int(np.clip((high - low) / (1.5 * spacing), 6, 300))))
             for low, high in ((bottom, top), (left, right))]  # fmt: skip
    of = [np.histogram2d(found.core[rows, 1], found.core[rows, 0], edges)[0]
          for rows in (known & beyond & (found.distance < 0.0), known)]  # fmt: skip
    hatch_lost(axes, (of[0] > SHARE * of[1])[::-1], extent)


@styled
def plot_histogram(found: CloudDistances, content: Mapping[str, Any]) -> Figure:
    """How many places have which distance, by what the level of detection says of each."""
    known = np.isfinite(found.distance)
    d, level = found.distance[known], found.level(content["registration_m"])[known]
    usual = content["level_of_detection_m"]
    subtitle = (
        f"{len(d)} places; level of detection (95 %) {usual:.3f} m in the median (broken lines)\n"
        f"{content['gained_percent']:.1f} % gained, {content['lost_percent']:.1f} % lost, the rest cannot be told from "
        "noise; the outermost bars hold all that lies beyond them"
    )
    figure = new_figure(3.6, "Histogram of the distances", subtitle)
    axes = axes_at(figure, 0.95, 1.05, WIDTH - 1.25, 1.65)
    low, high = (float(v) for v in np.percentile(d, [0.5, 99.5]))
    edges = np.linspace(min(low, -1.5 * usual), max(high, 1.5 * usual), BINS + 1)
    shown = np.clip(d, edges[0], edges[-1])
    kinds = ((np.abs(d) <= level, QUIET, "", SAME), (d < -level, COLOURS(0.15), HATCH, LOST),
             (d > level, COLOURS(0.85), "", GAINED))  # fmt: skip
    for own, colour, hatch, _ in kinds:
        counts = np.histogram(shown[own], edges)[0]
        axes.stairs(counts, edges, fill=True, facecolor=colour, hatch=hatch, edgecolor="white", lw=0.3)
    axes.set_yscale("log")
    for sign in (-1.0, 1.0):
        axes.axvline(sign * usual, color=INK, lw=0.9, ls=(0, (5, 3)))
    axes.set_xlim(edges[0], edges[-1])
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_ylim(0.7, None)
    axes.yaxis.set_major_locator(LogLocator())
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:.0f}"))
    axes.xaxis.set_major_formatter(FuncFormatter(value_text))
    axes.set_xlabel("distance [m]")
    axes.set_ylabel("places [count]")
    handles: list[Patch | Line2D] = [
        Patch(facecolor=colour, edgecolor="white", hatch=hatch, lw=0.0, label=label)
        for _, colour, hatch, label in reversed(kinds)
    ]
    handles.append(Line2D([], [], color=INK, lw=0.9, ls=(0, (5, 3)), label="level of detection, median"))
    figure.legend(handles=handles, loc="center left", bbox_to_anchor=(0.9 / WIDTH, 0.25 / 3.6), ncols=4)
    return figure
