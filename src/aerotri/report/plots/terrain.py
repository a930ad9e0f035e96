"""Surfaces, pickets and differences as pictures: grey tones and shapes, readable without colour."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LightSource
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator
from scipy.ndimage import gaussian_filter

from aerotri.rasters.grids import Grid
from aerotri.report.plots.canvas import (
    ACCENT,
    GREY,
    INK,
    LIGHT,
    WIDTH,
    axes_at,
    coordinate_axes,
    length_text,
    new_figure,
    plain,
    styled,
    value_text,
)
from aerotri.report.quality import two_digits
from aerotri.terrain.compare import Comparison
from aerotri.terrain.dtm import TerrainOutcome
from aerotri.terrain.picket_status import PicketStatus

HIGHEST = 6.4
"""Inches that a map is high at most: with its title it fits a printed page."""
HOLE = "#cfe0f2"
MOST_CELLS = 1200
"""Cells drawn along a side, the others skipped; chosen [C]: about the pixels of the picture."""
SHADE_CELLS = 1.0
"""σ of the smoothing of a surface before it is lit, cells; chosen [C]: noise of single cells would hide the shapes."""
CONTOUR_CELLS, CONTOUR_SMOOTHED = 300, 4.0
"""Cells along a side from which on contours are drawn through some of them, smoothed, and σ of that, in cells that are
drawn; chosen [C]: on level ground a contour through noise is a cloud of dots."""
OUTLYING = 0.002
"""Share of the measured cells at each side of a picture that may lie beyond it [C]: a few far cells would shrink it."""
ERROR_MARKS = {
    PicketStatus.BACKWARD: ("x", "backward"), PicketStatus.AMBIGUOUS: ("+", "ambiguous"),
    PicketStatus.NEIGHBOURS: ("s", "off its neighbours"), PicketStatus.PEAK: ("^", "peak or pit"),
}  # fmt: skip


def plot_surface(outcome: TerrainOutcome, block_name: str) -> Figure:
    """The surface with objects, lit from the north-west, and the σ of its cells."""
    o = outcome
    z = o.dsm.z
    subtitle = (
        f"{len(o.pickets.names)} photographs, pickets every {length_text(float(f'{o.interval:.3g}'))}, cells of "
        f"{length_text(float(f'{o.cell:.3g}'))}; heights {np.nanmin(z):.1f} … {np.nanmax(z):.1f} m\n"
        f"σ of the heights: median {two_digits(float(np.nanmedian(o.dsm.sigma)))} m; white: no pickets"
    )
    return _plot_heights(o.dsm.grid, z, o.dsm.sigma, block_name, subtitle, o.photographs.places.frame is None)


def plot_heights(grid: Grid, z: np.ndarray, sigma: np.ndarray | None, name: str, is_local: bool) -> Figure:
    """A surface lit from the north-west, and the σ of its cells where it is known.

    Parameters
    ----------
    z, sigma : (rows, columns) m, NaN where not known.
    """
    known = f"; σ: median {two_digits(float(np.nanmedian(sigma)))} m" if sigma is not None else ""
    subtitle = (
        f"{grid.rows} × {grid.columns} cells of {length_text(float(f'{grid.cell_x:.3g}'))}; heights "
        f"{np.nanmin(z):.1f} … {np.nanmax(z):.1f} m{known}; white: not known"
    )
    return _plot_heights(grid, z, sigma, name, subtitle, is_local)


def plot_dense(grid: Grid, z: np.ndarray, sigma: np.ndarray, matching: float, name: str, is_local: bool) -> Figure:
    """A dense surface as far as it was measured, and the σ of its heights.

    Parameters
    ----------
    z, sigma : (rows, columns) m, NaN where not measured; σ of matching and adjustment together.
    matching : m, median σ of matching alone.
    """
    known = np.isfinite(z)
    rows, columns = (between(known.sum(axis=axis)) for axis in (1, 0))
    part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    z, sigma = z[part], sigma[part]
    subtitle = (
        f"cells of {length_text(float(f'{grid.cell_x:.3g}'))}; heights {np.nanmin(z):.1f} … {np.nanmax(z):.1f} m; "
        f"white: not measured\nσ of heights, drawn: median {two_digits(float(np.nanmedian(sigma)))} m; of matching "
        f"alone {two_digits(matching)} m"
    )
    shown = grid.window(int(rows[0]), int(columns[0]), *z.shape)
    return _plot_heights(shown, z, sigma, name, subtitle, is_local)


def between(counts: np.ndarray) -> tuple[int, int]:
    """First and last row, or column, between which nearly all measured cells lie."""
    share = np.cumsum(counts) / max(int(counts.sum()), 1)
    first, last = np.searchsorted(share, [OUTLYING, 1.0 - OUTLYING])
    return int(first), int(min(last, len(counts) - 1))


@styled
def _plot_heights(
    grid: Grid, z: np.ndarray, sigma: np.ndarray | None, name: str, subtitle: str, is_local: bool,
    label: str = "σ of Z [m]",
) -> Figure:  # fmt: skip
    width, height = _size(grid, WIDTH - 1.6 if sigma is None else (WIDTH - 3.8) / 2.0)
    figure = new_figure(height + 1.75, f"Surface – {plain(name)}", subtitle)
    left = axes_at(figure, 0.95, 0.75, width, height)
    every = _every(z)
    shown = z[::every, ::every]
    light = LightSource(315, 45)
    filled = _smoothed(np.where(np.isfinite(shown), shown, np.nan))
    step = grid.cell_x * every
    shade = light.hillshade(filled, vert_exag=_exaggeration(filled), dx=step, dy=step)
    shade = np.where(np.isfinite(shown), shade, 1.0)
    left.imshow(shade, cmap="gray", vmin=0.0, vmax=1.0, extent=_extent(grid), interpolation="nearest")
    _contours(left, grid, z)
    _coordinates(left, width, height, local=is_local)
    if sigma is not None:
        _plot_sigma(figure, 0.95 + width + 0.95, (width, height), grid, sigma[::every, ::every], is_local, label)
    return figure


def _plot_sigma(
    figure: Figure, place: float, size: tuple[float, float], grid: Grid, sigma: np.ndarray, is_local: bool,
    label: str,
) -> None:  # fmt: skip
    """σ of the heights as grey tones, from `place` on; inches."""
    right = axes_at(figure, place, 0.75, *size)
    low, high = np.nanpercentile(sigma, [1, 99])
    image = right.imshow(sigma, cmap="Greys", vmin=low, vmax=high, extent=_extent(grid), interpolation="nearest")
    _coordinates(right, *size, local=is_local)
    right.set_ylabel("")
    scale = axes_at(figure, place + size[0] + 0.15, 0.75, 0.14, size[1])
    figure.colorbar(image, cax=scale).set_label(label)


@styled
def plot_pickets(outcome: TerrainOutcome, block_name: str) -> Figure:
    """Where pickets are: accepted, moved nearby, in error by what shows it, and the nodes that stayed holes."""
    p = outcome.pickets
    seen = p.status != PicketStatus.NOT_SEEN
    holes = seen & (p.status >= PicketStatus.LOW_CORRELATION) & (p.status < PicketStatus.BACKWARD)
    subtitle = (
        f"{int(p.accepted.sum())} of {int(seen.sum())} nodes accepted, {int((p.accepted & (p.tries > 0)).sum())} of "
        f"them moved to a place nearby; {int(p.errors.sum())} error pickets, {int(holes.sum())} holes"
    )
    grid = outcome.dsm.grid
    width, height = _size(grid, WIDTH - 1.4)
    figure = new_figure(height + 1.95, f"Pickets – {plain(block_name)}", subtitle)
    axes = axes_at(figure, 0.9, 0.95, width, height)
    size = float(np.clip(60.0 * width / np.sqrt(max(int(seen.sum()), 1)), 0.6, 12.0))
    own, aside = p.accepted & (p.tries == 0), p.accepted & (p.tries > 0)
    axes.scatter(*p.xyz[own, :2].T, s=size, c=LIGHT, lw=0, label="accepted")
    axes.scatter(*p.xyz[aside, :2].T, s=size * 1.5, c=GREY, lw=0, label="moved nearby")
    axes.scatter(*p.node[holes].T, s=size * 2, facecolors="none", edgecolors=ACCENT, lw=0.6, label="hole")
    for status, (mark, name) in ERROR_MARKS.items():
        wrong = p.status == status
        if wrong.any():
            style: dict[str, Any] = {"c": INK} if mark in "x+" else {"facecolors": "none", "edgecolors": INK}
            axes.scatter(*p.xyz[wrong, :2].T, s=22, marker=mark, lw=0.8, label=name, **style)
    axes.set_xlim(_extent(grid)[:2])
    axes.set_ylim(_extent(grid)[2:])
    _coordinates(axes, width, height, local=outcome.photographs.places.frame is None)
    tall = float(figure.get_size_inches()[1])
    figure.legend(loc="center left", bbox_to_anchor=(0.7 / WIDTH, 0.25 / tall), ncols=7, borderaxespad=0.0,
                  handletextpad=0.3, columnspacing=1.2, markerscale=1.0)  # fmt: skip
    return figure


@styled
def plot_comparison(comparison: Comparison, title: str) -> Figure:
    """Differences as a map and as a histogram with the normal curve of the same NMAD."""
    c = comparison
    d = c.difference
    s = c.statistics
    subtitle = (
        f"{s.count} cells: bias {s.bias:+.3f} m, median {s.median:+.3f}, RMSE {s.rmse:.3f}, σ {s.std:.3f}, NMAD "
        f"{s.nmad:.3f}, LE90 {s.le90:.3f} m; covered {100 * c.coverage:.0f} %, blue: not covered"
        + (f"\n{c.alignment_text}" if c.alignment_text else "")
    ).replace("-", "−")
    width, height = _size(c.grid, WIDTH - 4.6)
    height_all = max(height, 2.4)
    figure = new_figure(height_all + 1.75, f"Differences – {plain(title, 90)}", subtitle)
    axes = axes_at(figure, 0.95, 0.75, width, height)
    limit = float(np.nanpercentile(np.abs(d), 98)) or 1e-3
    axes.set_facecolor(HOLE)
    every = _every(d)
    image = axes.imshow(d[::every, ::every], cmap="Greys_r", vmin=-limit, vmax=limit, extent=_extent(c.grid),
                        interpolation="nearest")  # fmt: skip
    _coordinates(axes, width, height, local=False, labels=("X [m]", "Y [m]"))
    scale = axes_at(figure, 0.95 + width + 0.12, 0.75, 0.14, height)
    figure.colorbar(image, cax=scale).set_label("difference [m]")
    _signed(scale)
    place = 0.95 + width + 1.35
    histogram = axes_at(figure, place, 0.75, WIDTH - place - 0.25, height_all)
    known = d[np.isfinite(d)]
    reach = 4.0 * max(s.nmad, 0.01 * limit)
    bins = np.linspace(s.median - reach, s.median + reach, 61)
    histogram.hist(np.clip(known, bins[0], bins[-1]), bins=bins.tolist(), color=LIGHT, edgecolor="white", lw=0.3)
    curve = len(known) * (bins[1] - bins[0]) / (s.nmad * np.sqrt(2 * np.pi)) if s.nmad > 0 else 0.0
    histogram.plot(bins, curve * np.exp(-0.5 * ((bins - s.median) / max(s.nmad, 1e-9)) ** 2), color=INK, lw=1.0)
    histogram.axvline(0.0, color=GREY, lw=0.8, ls=(0, (4, 2)))
    histogram.set_xlabel("difference [m], line: normal, σ = NMAD;\nall beyond stand at the ends")
    histogram.set_yticks([])
    histogram.spines[["top", "right", "left"]].set_visible(False)
    histogram.xaxis.set_major_formatter(FuncFormatter(value_text))
    return figure


def _size(grid: Grid, widest: float) -> tuple[float, float]:
    ratio = grid.rows * grid.cell_y / (grid.columns * grid.cell_x)
    width = min(widest, HIGHEST / ratio)
    return width, width * ratio


def _extent(grid: Grid) -> tuple[float, float, float, float]:
    right, low = grid.left + grid.columns * grid.cell_x, grid.top - grid.rows * grid.cell_y
    return grid.left, right, low, grid.top


def _every(values: np.ndarray) -> int:
    return max(1, -(-max(values.shape) // MOST_CELLS))


def _smoothed(z: np.ndarray, cells: float = SHADE_CELLS) -> np.ndarray:
    """Heights without the noise of single cells, for drawing alone; holes filled by what is around them."""
    known = np.isfinite(z)
    weight = gaussian_filter(known.astype(float), cells)
    middle = float(np.nanmedian(z))
    mean = gaussian_filter(np.where(known, z - middle, 0.0), cells) / np.maximum(weight, 1e-9)
    return np.where(weight > 1e-6, mean, 0.0) + middle


def _exaggeration(z: np.ndarray) -> float:
    """So that the steepest tenth of the slopes looks steep, whatever the relief."""
    spread = np.ptp(np.percentile(z, [2, 98]))
    return float(np.clip(0.15 * max(z.shape) / max(spread, 1e-6), 0.5, 20.0))


def _contours(axes: Axes, grid: Grid, z: np.ndarray) -> None:
    every = max(1, max(z.shape) // CONTOUR_CELLS)
    heights = z[::every, ::every]
    if max(z.shape) > CONTOUR_CELLS and np.isfinite(heights).any():
        heights = np.where(np.isfinite(heights), _smoothed(heights, CONTOUR_SMOOTHED), np.nan)
    shown = np.ma.masked_invalid(heights)
    if min(shown.shape) < 2 or shown.count() < 4 or float(np.ptp(shown.compressed())) < 1e-6:
        return
    x, y = grid.x(np.arange(0, grid.columns, every)), grid.y(np.arange(0, grid.rows, every))
    levels = MaxNLocator(8, steps=[1, 2, 5, 10]).tick_values(float(shown.min()), float(shown.max()))
    lines = axes.contour(x, y, shown, levels=levels, colors=INK, linewidths=0.6)
    axes.clabel(lines, fmt=value_text, fontsize=7, inline_spacing=2)


def _coordinates(axes: Axes, width: float, height: float, local: bool, labels: tuple[str, str] | None = None) -> None:
    names = labels or (("X (local) [m]", "Y (local) [m]") if local else ("E [m]", "N [m]"))
    coordinate_axes(axes, width, height, names)


def _signed(axes: Axes) -> None:
    axes.yaxis.set_major_formatter(FuncFormatter(value_text))
