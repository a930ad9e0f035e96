"""Surfaces, pickets and differences as pictures: grey tones and shapes, readable without colour."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LightSource
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
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
from aerotri.report.plots.maps import HIGHEST, coordinate_names, extent_of, scale_beside, single_map
from aerotri.report.quality import two_digits
from aerotri.terrain.compare import Comparison
from aerotri.terrain.dtm import TerrainOutcome
from aerotri.terrain.picket_status import PicketStatus

HOLE = "#cfe0f2"
MOST_CELLS = 1200
"""Cells drawn along a side, the others skipped; chosen [C]: about the pixels of the picture."""
SHADE_CELLS = 1.0
"""σ of the smoothing of a surface before it is lit, cells; chosen [C]: noise of single cells would hide the shapes."""
CONTOUR_CELLS, CONTOUR_SMOOTHED = 300, 4.0
"""Cells along a side from which on contours are drawn through some of them, smoothed, and σ of that, in cells that are
drawn; chosen [C]: on level ground a contour through noise is a cloud of dots."""
ERROR_MARKS = {
    PicketStatus.BACKWARD: ("x", "backward"), PicketStatus.AMBIGUOUS: ("+", "ambiguous"),
    PicketStatus.NEIGHBOURS: ("s", "off its neighbours"), PicketStatus.PEAK: ("^", "peak or pit"),
}  # fmt: skip


def plot_surface(outcome: TerrainOutcome, block_name: str) -> Figure:
    """The surface with objects, lit from the north-west."""
    o = outcome
    subtitle = (
        f"{len(o.pickets.names)} photographs, pickets every {length_text(float(f'{o.interval:.3g}'))}, cells of "
        f"{length_text(float(f'{o.cell:.3g}'))}; {_heights_in_words(o.dsm.z)}; white: no pickets"
    )
    return plot_shape(o.dsm.grid, o.dsm.z, f"Surface – {plain(block_name)}", subtitle, _is_local(o))


def plot_surface_sigma(outcome: TerrainOutcome, block_name: str) -> Figure:
    """The σ of the cells of the surface."""
    o = outcome
    subtitle = f"median {two_digits(float(np.nanmedian(o.dsm.sigma)))} m; white: no pickets"
    return plot_grey(
        o.dsm.grid, o.dsm.sigma, (f"σ of the heights – {plain(block_name)}", subtitle, "σ of Z [m]"), _is_local(o)
    )


def _is_local(outcome: TerrainOutcome) -> bool:
    return outcome.photographs.places.frame is None


def _heights_in_words(z: np.ndarray) -> str:
    return f"heights {np.nanmin(z):.1f} … {np.nanmax(z):.1f} m".replace("-", "−")


@styled
def plot_shape(grid: Grid, z: np.ndarray, title: str, subtitle: str, is_local: bool) -> Figure:
    """Heights (rows, columns) m, lit from the north-west, as a map of a column's width."""
    figure, axes = single_map(title, subtitle, grid.bounds, is_local)
    _draw_shape(axes, grid, z)
    return figure


@styled
def plot_grey(grid: Grid, values: np.ndarray, texts: tuple[str, str, str], is_local: bool) -> Figure:
    """Values (rows, columns) as grey tones, as a map of a column's width.

    Parameters
    ----------
    texts : title, what stands below it, and label of the scale.
    """
    figure, axes = single_map(texts[0], texts[1], grid.bounds, is_local)
    scale_beside(figure, axes, _draw_grey(axes, grid, values), texts[2])
    return figure


@styled
def plot_heights(grid: Grid, z: np.ndarray, sigma: np.ndarray | None, name: str, is_local: bool) -> Figure:
    """A surface lit from the north-west, and beside it the σ of its cells where it is known.

    Parameters
    ----------
    z, sigma : (rows, columns) m, NaN where not known.
    """
    known = f"; σ: median {two_digits(float(np.nanmedian(sigma)))} m" if sigma is not None else ""
    subtitle = (
        f"{grid.rows} × {grid.columns} cells of {length_text(float(f'{grid.cell_x:.3g}'))}; {_heights_in_words(z)}"
        f"{known}; white: not known"
    )
    width, height = _size(grid, WIDTH - 1.6 if sigma is None else (WIDTH - 3.8) / 2.0)
    figure = new_figure(height + 1.75, f"Surface – {plain(name)}", subtitle)
    left = axes_at(figure, 0.95, 0.75, width, height)
    _draw_shape(left, grid, z)
    _coordinates(left, width, height, local=is_local)
    if sigma is not None:
        right = axes_at(figure, 0.95 + width + 0.95, 0.75, width, height)
        image = _draw_grey(right, grid, sigma)
        _coordinates(right, width, height, local=is_local)
        right.set_ylabel("")
        scale_beside(figure, right, image, "σ of Z [m]")
    return figure


def _draw_shape(axes: Axes, grid: Grid, z: np.ndarray) -> None:
    """Heights lit from the north-west, with contours."""
    every = _every(z)
    shown = z[::every, ::every]
    light = LightSource(315, 45)
    filled = _smoothed(np.where(np.isfinite(shown), shown, np.nan))
    step = grid.cell_x * every
    shade = light.hillshade(filled, vert_exag=_exaggeration(filled), dx=step, dy=step)
    shade = np.where(np.isfinite(shown), shade, 1.0)
    axes.imshow(shade, cmap="gray", vmin=0.0, vmax=1.0, extent=extent_of(grid.bounds), interpolation="nearest")
    _contours(axes, grid, z)


def _draw_grey(axes: Axes, grid: Grid, values: np.ndarray) -> AxesImage:
    """Values as grey tones, the hundredth part at either end as its bound."""
    every = _every(values)
    low, high = np.nanpercentile(values, [1, 99])
    return axes.imshow(
        values[::every, ::every], cmap="Greys", vmin=low, vmax=max(high, low + 1e-9), extent=extent_of(grid.bounds),
        interpolation="nearest",
    )  # fmt: skip


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
    left, bottom, right, top = grid.bounds
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
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
    image = axes.imshow(d[::every, ::every], cmap="Greys_r", vmin=-limit, vmax=limit, extent=extent_of(c.grid.bounds),
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
    coordinate_axes(axes, width, height, labels or coordinate_names(local))


def _signed(axes: Axes) -> None:
    axes.yaxis.set_major_formatter(FuncFormatter(value_text))
