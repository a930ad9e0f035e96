"""Distances of two clouds: maps of those beyond the level of detection and of σ, and their histogram."""

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
from aerotri.report.plots.change import HATCH, hatch_lost
from aerotri.report.plots.maps import Bounds, extent_of, key_below, scale_beside, single_map
from aerotri.report.plots.volume import COLOURS
from aerotri.report.quality import two_digits
from aerotri.volume.change.clouds import CloudDistances

QUIET, BINS = "#d8d8d8", 60
SHARE = 0.5
"""Of the places of a square, those lost at least where it is hatched; chosen [C]."""
GAINED, LOST, SAME = "gained", "lost", "within the level of detection"


@styled
def plot_distances(found: CloudDistances, content: Mapping[str, Any]) -> Figure:
    """Map of the distances beyond the level of detection, a mark a core point."""
    known = np.isfinite(found.distance)
    beyond = np.abs(found.distance) > found.level(content["registration_m"])
    subtitle = (
        f"{plain(content['second'], 40)} less {plain(content['first'], 40)}, along the normals of the first\n"
        f"grey: within the level of detection (95 %); {content['beyond_level_percent']:.1f} % of the places are "
        "beyond it"
    )
    bounds = _bounds(found)
    figure, axes = single_map("Distances of two point clouds", subtitle, bounds, not content["crs"], key=True)
    size = _size_of_marks(figure, axes, len(found.core))
    largest = max(float(np.percentile(np.abs(found.distance[beyond if beyond.any() else known]), 99.0)), 1e-6)
    axes.scatter(*found.core[known & ~beyond, :2].T, s=size, c=QUIET, marker="s", lw=0)
    image = axes.scatter(
        *found.core[beyond, :2].T, s=size, c=found.distance[beyond], marker="s", lw=0, cmap=COLOURS,
        norm=TwoSlopeNorm(0.0, -largest, largest),
    )  # fmt: skip
    _hatch_lost(axes, found, beyond, extent_of(bounds), content["spacing_m"])
    scale_beside(figure, axes, image, "distance [m]")
    handles = [
        Patch(facecolor=COLOURS(0.85), label=GAINED),
        Patch(facecolor=COLOURS(0.15), edgecolor="white", hatch=HATCH, lw=0.0, label=LOST),
        Patch(facecolor=QUIET, label=SAME),
    ]
    key_below(figure, handles)
    return figure


@styled
def plot_distances_sigma(found: CloudDistances, content: Mapping[str, Any]) -> Figure:
    """Map of the σ of the distances."""
    known = np.isfinite(found.distance)
    most = max(float(np.percentile(found.sigma[known], 99.0)), 1e-9)
    subtitle = f"median {two_digits(content['sigma_m'])} m"
    figure, axes = single_map("σ of the distances", subtitle, _bounds(found), not content["crs"])
    size = _size_of_marks(figure, axes, len(found.core))
    image = axes.scatter(
        *found.core[known, :2].T, s=size, c=found.sigma[known], marker="s", lw=0, cmap="Greys", vmin=0.0,
        vmax=1.2 * most,
    )  # fmt: skip
    scale_beside(figure, axes, image, "σ [m]")
    return figure


def _bounds(found: CloudDistances) -> Bounds:
    """Around all places; not narrower than a fifth of their length: a wall is a line on a map."""
    low, high = found.core[:, :2].min(axis=0), found.core[:, :2].max(axis=0)
    longest = max(float((high - low).max()), 1e-6)
    middle, half = 0.5 * (low + high), np.maximum(0.5 * (high - low) + 0.02 * longest, 0.1 * longest)
    (left, bottom), (right, top) = middle - half, middle + half
    return float(left), float(bottom), float(right), float(top)


def _size_of_marks(figure: Figure, axes: Axes, count: int) -> float:
    """Points², so that marks spread evenly over the map nearly cover it."""
    box, inches = axes.get_position(), figure.get_size_inches()
    return max(72.0**2 * box.width * box.height * float(inches.prod()) / max(count, 1) * 1.3, 0.5)


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
