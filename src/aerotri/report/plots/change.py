"""Maps of a change: what is beyond the level of detection in colour, the rest in grey; and σ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy.ndimage import binary_opening

from aerotri.report.plots.canvas import INK, plain, styled, write_name
from aerotri.report.plots.maps import extent_of, key_below, scale_beside, single_map
from aerotri.report.plots.volume import COLOURS
from aerotri.report.quality import two_digits
from aerotri.volume.boundary import Boundary
from aerotri.volume.change.compute import LEVEL, Change

MOST_CELLS = 1200
QUIET, HATCH = (0.90, 0.90, 0.90, 1.0), "////"


@styled
def plot_change(change: Change, content: Mapping[str, Any], areas: Sequence[Boundary]) -> Figure:
    """The difference where it is beyond the level of detection."""
    d, sigma = _drawn(change.difference), _drawn(change.sigma)
    found = np.abs(d) > LEVEL * sigma
    subtitle = (
        f"{plain(content['second'], 40)} less {plain(content['first'], 40)}\n"
        f"grey: within the level of detection (95 %, {LEVEL:.2f} σ); {content['beyond_level_percent']:.1f} % of the "
        "cells are beyond it"
    )
    figure, axes = single_map("Change", subtitle, change.grid.bounds, not content["crs"], key=True)
    extent = extent_of(change.grid.bounds)
    known = d[found] if found.any() else d[np.isfinite(d)]
    size = max(float(np.percentile(np.abs(known), 99.0)) if len(known) else 0.0, 1e-6)
    quiet = np.where(np.isfinite(d)[..., None], np.array(QUIET), np.array((1.0, 1.0, 1.0, 0.0)))
    axes.imshow(quiet, extent=extent, interpolation="nearest", aspect="auto")
    image = axes.imshow(
        np.where(found, d, np.nan), extent=extent, interpolation="nearest", aspect="auto", cmap=COLOURS,
        norm=TwoSlopeNorm(0.0, -size, size),
    )  # fmt: skip
    hatch_lost(axes, found & (d < 0.0), extent)
    _draw_areas(axes, areas)
    scale_beside(figure, axes, image, "difference [m]")
    handles = [
        Patch(facecolor=COLOURS(0.85), label="gained"),
        Patch(facecolor=COLOURS(0.15), edgecolor="white", hatch=HATCH, lw=0.0, label="lost"),
        Patch(facecolor=QUIET, edgecolor=INK, lw=0.4, label="within the level of detection"),
        Line2D([], [], color=INK, lw=0.9, label="areas"),
    ]
    key_below(figure, handles if areas else handles[:-1])
    return figure


@styled
def plot_change_sigma(change: Change, content: Mapping[str, Any], areas: Sequence[Boundary]) -> Figure:
    """σ of the difference."""
    sigma = _drawn(change.sigma)
    spread = sigma[np.isfinite(sigma)]
    most = max(float(np.percentile(spread, 99.0)) if len(spread) else 0.0, 1e-9)
    subtitle = f"median {two_digits(content['sigma_m'])} m"
    figure, axes = single_map("σ of the difference", subtitle, change.grid.bounds, not content["crs"])
    extent = extent_of(change.grid.bounds)
    image = axes.imshow(
        sigma, extent=extent, interpolation="nearest", aspect="auto", cmap="Greys", vmin=0.0, vmax=1.2 * most
    )
    _draw_areas(axes, areas)
    scale_beside(figure, axes, image, "σ [m]")
    return figure


def _drawn(values: np.ndarray) -> np.ndarray:
    step = max(1, max(values.shape) // MOST_CELLS)
    return values[::step, ::step]


def _draw_areas(axes: Axes, areas: Sequence[Boundary]) -> None:
    """The outlines, with their names where there are several."""
    for one in areas:
        axes.add_collection(LineCollection(one.rings, colors=INK, linewidths=0.9))
    for one in areas if len(areas) > 1 else ():
        if not one.piles:
            write_name(axes, (0.5 * (one.polygon.bounds[0] + one.polygon.bounds[2]), one.polygon.bounds[3]), one.name)


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
