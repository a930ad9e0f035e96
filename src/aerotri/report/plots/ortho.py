"""Orthophotos as pictures: with their seams and σ, and the ground around control and check points."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from aerotri.formats.results.ortho import MarkedPoint, seam_lines
from aerotri.rasters.mosaics import COLOURS, read_mosaic
from aerotri.report.plots.canvas import (
    ACCENT,
    INK,
    WIDTH,
    axes_at,
    coordinate_axes,
    length_text,
    new_figure,
    plain,
    styled,
)
from aerotri.report.quality import two_digits
from aerotri.terrain.ortho.make import IMAGE, OrthoOutcome

HIGHEST = 6.4
"""Inches that a map is high at most: with its title it fits a printed page."""
MOST_CELLS = 1400
"""Cells drawn along a side, from the overviews; chosen [C]: about the pixels of the picture."""
AROUND = 24
"""Cells drawn around a point to every side [C]."""
MOST_POINTS, IN_A_ROW = 30, 6
"""Points that are drawn, the first of each role, and side by side."""


def _names(outcome: OrthoOutcome) -> tuple[str, str]:
    local = outcome.photographs.places.frame is None
    return ("X (local) [m]", "Y (local) [m]") if local else ("E [m]", "N [m]")


@styled
def plot_orthophoto(outcome: OrthoOutcome, folder: Path, block_name: str, points: Sequence[MarkedPoint] = ()) -> Figure:
    """The orthophoto with its seams, control and check points, and σ of the positions of its coarse cells."""
    o, g = outcome, outcome.grid
    ratio = g.rows / g.columns
    width = min((WIDTH - 3.8) / 2.0, HIGHEST / ratio)
    height = width * ratio
    covered = 100.0 * float(o.cells.sum()) / max(o.heights, 1)
    subtitle = (
        f"{int((o.cells > 0).sum())} of {len(o.cells)} photographs, cells of {length_text(float(f'{g.cell_x:.3g}'))}; "
        f"{covered:.1f} % of the surface is seen; line: seams"
        f"{', triangle: control point, circle: check point' if len(points) else ''}\n"
        f"σ of X and Y (each): median {two_digits(float(np.nanmedian(o.accuracy.total)))} m"
    )
    figure = new_figure(height + 1.75, f"Orthophoto – {plain(block_name)}", subtitle)
    left, bottom, right, top = g.bounds
    axes = axes_at(figure, 0.95, 0.75, width, height)
    extent = (left, right, bottom, top)
    axes.imshow(_shown(read_mosaic(folder / IMAGE, longest=MOST_CELLS)), extent=extent, interpolation="nearest")
    lines = [np.array(part.coords) for line in seam_lines(o)[1] for part in line.geoms]
    axes.add_collection(LineCollection(lines, colors=ACCENT, linewidths=0.6))
    _mark(axes, points)
    coordinate_axes(axes, width, height, _names(o))
    second = axes_at(figure, 0.95 + width + 0.95, 0.75, width, height)
    sigma, coarse = o.accuracy.total, o.candidates.grid.bounds
    low, high = np.nanpercentile(sigma, [1, 99])
    image = second.imshow(
        sigma, cmap="Greys", vmin=low, vmax=max(high, low + 1e-9), extent=(coarse[0], coarse[2], coarse[1], coarse[3]),
        interpolation="nearest",
    )  # fmt: skip
    second.set_xlim(left, right)
    second.set_ylim(bottom, top)
    coordinate_axes(second, width, height, _names(o))
    second.set_ylabel("")
    scale = axes_at(figure, 0.95 + 2.0 * width + 1.1, 0.75, 0.14, height)
    figure.colorbar(image, cax=scale).set_label("σ of X and Y [m]")
    return figure


def _mark(axes: Axes, points: Sequence[MarkedPoint]) -> None:
    """Control and check points where their given coordinates are, dark with a white rim."""
    for role, marker in (("control", "^"), ("check", "o")):
        xy = np.array([p.xy for p in points if p.role == role]).reshape(-1, 2)
        axes.scatter(*xy.T, s=26, marker=marker, c=INK, edgecolors="white", linewidths=0.9, zorder=3)


OPEN, ARM = 2.5, 8.0
"""Cells from the middle of a cross at which its arms begin and end."""


@styled
def plot_points(outcome: OrthoOutcome, folder: Path, points: Sequence[MarkedPoint], block_name: str) -> Figure:
    """The orthophoto around control and check points; the crosses are their coordinates, the circles 2σ."""
    cell = outcome.grid.cell_x
    drawn = sorted(points, key=lambda p: p.role)[:MOST_POINTS]
    rows = -(-len(drawn) // IN_A_ROW)
    subtitle = (
        f"{len(drawn)} of {len(points)} points; middle of the cross: given coordinates, circle: 2σ of the "
        "orthophoto; a side is "
        f"{length_text(float(f'{(2 * AROUND + 1) * cell:.3g}'))}"
    )
    side, across = 1.15, 1.38
    figure = new_figure(0.85 + rows * 1.45, f"Control and check points – {plain(block_name)}", subtitle)
    for k, point in enumerate(drawn):
        place = 0.25 + (k % IN_A_ROW) * across, 0.1 + (rows - 1 - k // IN_A_ROW) * 1.45
        axes = axes_at(figure, *place, side, side)
        first = int(point.row) - AROUND, int(point.column) - AROUND
        part = read_mosaic(folder / IMAGE, (*first, 2 * AROUND + 1, 2 * AROUND + 1))
        axes.imshow(_shown(part), extent=(0.0, part.shape[2], part.shape[1], 0.0), interpolation="nearest")
        x, y = point.column - first[1], point.row - first[0]
        # open in the middle, so that the centre of the target is seen
        for colour, wide in (("white", 2.4), (ACCENT, 1.0)):
            for one in (-1.0, 1.0):
                axes.plot([x + one * OPEN, x + one * ARM], [y, y], color=colour, lw=wide)
                axes.plot([x, x], [y + one * OPEN, y + one * ARM], color=colour, lw=wide)
        if np.isfinite(point.sigma) and 2.0 * point.sigma / cell < AROUND:
            turn = np.linspace(0.0, 2.0 * np.pi, 60)
            reach = 2.0 * point.sigma / cell
            axes.plot(x + reach * np.cos(turn), y + reach * np.sin(turn), color=ACCENT, lw=0.8)
        axes.set_xlim(0, part.shape[2])
        axes.set_ylim(part.shape[1], 0)
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_title(f"{plain(point.name, 12)}, {point.role}", fontsize=7.5, pad=2)
    return figure


def _shown(bands: np.ndarray) -> np.ndarray:
    """(r, c, 4) uint8 of the bands of an orthophoto; what is not covered is transparent, dark and bright stretched."""
    mask = bands[-1] > 0
    colours = bands[:COLOURS] if len(bands) > COLOURS else np.repeat(bands[:1], COLOURS, axis=0)
    known = colours[:, mask]
    low, high = np.percentile(known, [0.5, 99.5]) if known.size else (0.0, 1.0)
    out = np.clip((colours - low) * (255.0 / max(high - low, 1e-9)), 0.0, 255.0)
    return np.moveaxis(np.concatenate([out, np.where(mask, 255.0, 0.0)[None]]), 0, -1).astype(np.uint8)
