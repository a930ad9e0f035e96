"""Distances of two clouds: map of those beyond the level of detection beside σ, and their histogram."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MaxNLocator

from aerotri.report.plots.canvas import INK, WIDTH, axes_at, new_figure, plain, styled, value_text
from aerotri.report.plots.change import finish_map
from aerotri.report.plots.volume import COLOURS
from aerotri.volume.change.clouds import CloudDistances

HIGHEST, QUIET, BINS = 4.6, "#d8d8d8", 60
STRIPE = 0.12
"""Of the side of a mark, the width of the white line across those that were lost: in black and white they are as dark
as what was gained."""
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
    size = max((72.0 * width / np.sqrt(max(len(found.core), 1))) ** 2 * 0.6, 0.5)
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
            lost = beyond & (found.distance < 0.0)
            axes.scatter(*found.core[lost, :2].T, s=size, c="white", marker="_", lw=STRIPE * np.sqrt(size))
        finish_map(figure, axes, image, label, (left, bottom, right, top), k == 0, content["crs"])
    handles = [
        Patch(facecolor=COLOURS(0.85), label=GAINED),
        Patch(facecolor=COLOURS(0.15), edgecolor="white", hatch="---", lw=0.0, label=LOST),
        Patch(facecolor=QUIET, label=SAME),
    ]
    figure.legend(handles=handles, loc="center left", bbox_to_anchor=(0.9 / WIDTH, 0.25 / (height + 2.1)), ncols=3)
    return figure


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
    kinds = ((d < -level, COLOURS(0.15), "---", LOST), (np.abs(d) <= level, QUIET, "", SAME),
             (d > level, COLOURS(0.85), "", GAINED))  # fmt: skip
    axes.hist([shown[own] for own, *_ in kinds], bins=edges.tolist(), stacked=True, color=[kind[1] for kind in kinds])
    for (_, _, hatch, _), bars in zip(kinds, axes.containers, strict=True):
        for bar in bars:
            bar.set(hatch=hatch, edgecolor="white", linewidth=0.2)
    for sign in (-1.0, 1.0):
        axes.axvline(sign * usual, color=INK, lw=0.9, ls=(0, (5, 3)))
    axes.set_xlim(edges[0], edges[-1])
    axes.spines[["top", "right"]].set_visible(False)
    axes.yaxis.set_major_locator(MaxNLocator(4, integer=True))
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
