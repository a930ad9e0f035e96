"""Map of the distances of two clouds: beyond the level of detection in colour, the rest in grey; beside it σ."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

from aerotri.report.plots.canvas import WIDTH, axes_at, new_figure, plain, styled
from aerotri.report.plots.change import finish_map
from aerotri.report.plots.volume import COLOURS
from aerotri.volume.change.clouds import CloudDistances

HIGHEST, QUIET = 4.6, "#d8d8d8"


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
    figure = new_figure(height + 1.75, "Distances of two point clouds", subtitle)
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
        axes = axes_at(figure, x0, 0.75, width, height)
        if k == 0:
            axes.scatter(*found.core[known & ~beyond, :2].T, s=size, c=QUIET, marker="s", lw=0)
        image = axes.scatter(*found.core[rows, :2].T, s=size, c=values[rows], marker="s", lw=0, **style)
        finish_map(figure, axes, image, label, (left, bottom, right, top), k == 0, content["crs"])
    return figure
