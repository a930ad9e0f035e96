"""Orthophotos as pictures: the image, its σ, its seams, and the ground around control and check points."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from scipy.ndimage import distance_transform_edt, find_objects

from aerotri.formats.results.ortho import MarkedPoint, seam_lines
from aerotri.rasters.grids import Grid
from aerotri.rasters.mosaics import COLOURS, read_mosaic
from aerotri.report.plots.canvas import ACCENT, INK, axes_at, length_text, new_figure, plain, styled
from aerotri.report.plots.maps import Bounds, extent_of, scale_beside, single_map, write_names
from aerotri.report.quality import two_digits
from aerotri.terrain.ortho.make import IMAGE, OrthoOutcome

MOST_CELLS = 1400
"""Cells drawn along a side, from the overviews; chosen [C]: about the pixels of the picture."""
AROUND = 24
"""Cells drawn around a point to every side [C]."""
MOST_POINTS, IN_A_ROW = 30, 6
"""Points that are drawn, the first of each role, and side by side."""
MOST_NAMED = 60
"""Points that have their names in the orthophoto [C]: more would hide it."""
PALE = 0.6
"""Share of white below seams."""


@styled
def plot_orthophoto(outcome: OrthoOutcome, folder: Path, block_name: str, points: Sequence[MarkedPoint] = ()) -> Figure:
    """The orthophoto with control and check points."""
    o, g = outcome, outcome.grid
    covered = 100.0 * float(o.cells.sum()) / max(o.heights, 1)
    subtitle = (
        f"{int((o.cells > 0).sum())} of {len(o.cells)} photographs, cells of {length_text(float(f'{g.cell_x:.3g}'))}; "
        f"{covered:.1f} % of the surface is seen"
        f"{'; triangle: control point, circle: check point' if len(points) else ''}"
    )
    figure, axes = single_map(f"Orthophoto – {plain(block_name)}", subtitle, g.bounds, _is_local(o))
    shown = _shown(read_mosaic(folder / IMAGE, longest=MOST_CELLS))
    axes.imshow(shown, extent=extent_of(g.bounds), interpolation="nearest")
    _mark(axes, points)
    return figure


@styled
def plot_ortho_sigma(outcome: OrthoOutcome, block_name: str) -> Figure:
    """σ of the positions, on the coarse cells on which seams are laid."""
    o, sigma = outcome, outcome.accuracy.total
    median = two_digits(float(np.nanmedian(sigma)))
    title, subtitle = f"σ of positions – {plain(block_name)}", f"of X and Y, each: median {median} m"
    figure, axes = single_map(title, subtitle, o.grid.bounds, _is_local(o))
    low, high = np.nanpercentile(sigma, [1, 99])
    image = axes.imshow(
        sigma, cmap="Greys", vmin=low, vmax=max(high, low + 1e-9), extent=extent_of(o.candidates.grid.bounds),
        interpolation="nearest",
    )  # fmt: skip
    _within(axes, o.grid.bounds)
    scale_beside(figure, axes, image, "σ of X and Y [m]")
    return figure


@styled
def plot_seams(outcome: OrthoOutcome, folder: Path, block_name: str) -> Figure:
    """The seams over the pale orthophoto, and the number of the photograph that each part is from."""
    o = outcome
    subtitle = "line: seams; numbers: photographs, as in photographs.tif and seams.gpkg"
    figure, axes = single_map(f"Seams – {plain(block_name)}", subtitle, o.grid.bounds, _is_local(o))
    shown = _shown(read_mosaic(folder / IMAGE, longest=MOST_CELLS))
    shown[..., :COLOURS] = PALE * 255.0 + (1.0 - PALE) * shown[..., :COLOURS]
    axes.imshow(shown, extent=extent_of(o.grid.bounds), interpolation="nearest")
    lines = [np.array(part.coords) for line in seam_lines(o)[1] for part in line.geoms]
    axes.add_collection(LineCollection(lines, colors=ACCENT, linewidths=0.9))
    _within(axes, o.grid.bounds)
    numbers, places = middles_of(o.choice.number, o.candidates.grid)
    write_names(axes, places, numbers, marked=False)
    return figure


def middles_of(number: np.ndarray, grid: Grid) -> tuple[list[int], np.ndarray]:
    """Photographs that are used, the one with most cells first, and for each the place (n, 2) m deepest within them.

    Parameters
    ----------
    number : (rows, columns) photograph of every cell, −1 none.
    """
    found = []
    for k, window in enumerate(find_objects(number + 1)):
        if window is None:
            continue
        own = number[window] == k
        deep = np.asarray(distance_transform_edt(np.pad(own, 1)))[1:-1, 1:-1]
        i, j = np.unravel_index(int(np.argmax(deep)), deep.shape)
        place = grid.x(float(window[1].start + j)), grid.y(float(window[0].start + i))
        found.append((-int(own.sum()), k, place))
    found.sort()
    return [k for _, k, _ in found], np.array([place for *_, place in found]).reshape(-1, 2)


def _is_local(outcome: OrthoOutcome) -> bool:
    return outcome.photographs.places.frame is None


def _within(axes: Axes, bounds: Bounds) -> None:
    """The limits of the orthophoto: coarse cells reach beyond it."""
    axes.set_xlim(bounds[0], bounds[2])
    axes.set_ylim(bounds[1], bounds[3])


def _mark(axes: Axes, points: Sequence[MarkedPoint]) -> None:
    """Control and check points where their given coordinates are, dark with a white rim, and their names."""
    # rings, so that a control point beside a check point is seen through them
    for role, marker, size, inside in (("control", "^", 26, INK), ("check", "o", 48, "none")):
        xy = np.array([p.xy for p in points if p.role == role]).reshape(-1, 2)
        marks = axes.scatter(*xy.T, s=size, marker=marker, c=inside, edgecolors=INK, linewidths=1.1, zorder=3)
        marks.set_path_effects([withStroke(linewidth=2.8, foreground="white")])
    if len(points) <= MOST_NAMED:
        # check points first: where there is little room theirs are the names to be read
        ordered = sorted(points, key=lambda p: p.role)
        write_names(axes, np.array([p.xy for p in ordered]).reshape(-1, 2), [p.name for p in ordered])


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
