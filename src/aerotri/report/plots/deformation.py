"""Model deformation as pictures: contour lines of dZ in the manner of Spreckels et al., profiles, the whole block."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter
from scipy.interpolate import RegularGridInterpolator

from aerotri.deformation.block_models import BlockDeformation, Seam
from aerotri.deformation.model_grid import Deformation
from aerotri.formats.results.deformation import contour_interval, worst_seams
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

MEANING = {"free": "orientation of the self-calibrated block", "absorbed": "orientation adjusted without parameters"}
HIGHEST = 6.6
"""Inches that a map is high at most: with its title it fits a printed page."""
SEAM_STYLE: dict[str, Any] = {"colors": GREY, "linewidths": 0.9, "linestyles": (0, (1, 2))}
"""Grey and dotted: behind the contour lines."""
PROFILE_STYLES: tuple[dict[str, Any], ...] = (
    {"color": GREY, "lw": 1.0, "ls": (0, (1, 1.2))},
    {"color": GREY, "lw": 1.0, "ls": (0, (5, 2))},
    {"color": INK, "lw": 1.6, "ls": "-"},
)
"""Of dX, dY and dZ: the height is what matters, so it is strongest."""
BASE_STYLE: dict[str, Any] = {"marker": "+", "ms": 9, "mew": 1.3, "color": ACCENT}
"""Of the two projection centres."""


@styled
def plot_deformation(deformation: Deformation, block_name: str) -> Figure:
    """Contour lines of dZ over a model: solid above zero, dashed below, zero bold; broken where the tiles meet."""
    d, dz = deformation, 100.0 * deformation.d[..., 2]
    interval = 100.0 * contour_interval(float(np.nanmin(dz)) / 100.0, float(np.nanmax(dz)) / 100.0)
    subtitle = (
        f"{_numbers(d)}\n{_range(dz)}, mean σ {100.0 * np.nanmean(d.sigma[..., 2]):.1f} cm; "
        f"contour interval {interval:g} cm"
    )
    width, height = panel_size(d, WIDTH - 1.4, HIGHEST)
    figure = new_figure(height + 2.05, f"Model deformation – {plain(block_name)}", subtitle)
    draw_contours(axes_at(figure, max(0.95, (WIDTH - width) / 2.0), 0.95, width, height), d, interval)
    _legend(figure, contour_symbols(bool(d.seams)), 4)
    return figure


def panel_size(deformation: Deformation, widest: float, highest: float) -> tuple[float, float]:
    """Width and height of axes that show a model with equal scales, inches."""
    return _View(deformation).size(widest, highest)


def draw_contours(axes: Axes, deformation: Deformation, interval_cm: float) -> None:
    """Contour lines of dZ with seams and projection centres in axes of a `panel_size`."""
    d, view = deformation, _View(deformation)
    view.frame(axes)
    _contours(axes, view, 100.0 * d.d[..., 2], interval_cm)
    axes.add_collection(LineCollection([view.turned(line) for line in d.seams], zorder=1, **SEAM_STYLE))
    axes.plot(*view.turned(d.base).T, ls="none", zorder=5, **BASE_STYLE)


@styled
def plot_deformation_profile(deformation: Deformation, block_name: str) -> Figure:
    """dX, dY, dZ along the base and across it through its middle, dZ with twice its σ."""
    d = deformation
    figure = new_figure(5.6, f"Profiles of the model deformation – {plain(block_name)}", _numbers(d))
    middle, along = d.base.mean(axis=0), d.base[1] - d.base[0]
    along = along / np.linalg.norm(along)
    directions = (("along the base", along), ("across the base", np.array([-along[1], along[0]])))
    for k, (name, direction) in enumerate(directions):
        axes = axes_at(figure, 0.8, 3.2 - 2.35 * k, WIDTH - 1.1, 1.65)
        distance, values, sigma = _profile(d, middle, direction)
        band = 200.0 * sigma[:, 2]
        dz = 100.0 * values[:, 2]
        axes.fill_between(distance, dz - band, dz + band, color=LIGHT, alpha=0.55, lw=0, zorder=1)
        for axis, style in enumerate(PROFILE_STYLES):
            axes.plot(distance, 100.0 * values[:, axis], zorder=2 + axis, **style)
        axes.axhline(0.0, color=GREY, lw=0.6, zorder=1)
        axes.margins(x=0.01)
        axes.set_xlabel(f"{name}, from its middle [m]")
        axes.set_ylabel("[cm]")
        axes.spines[["top", "right"]].set_visible(False)
        _minus(axes)
    handles = [Line2D([], [], label=f"d{name}", **style) for name, style in zip("XYZ", PROFILE_STYLES, strict=True)]
    handles.append(Line2D([], [], color=LIGHT, lw=7, alpha=0.55, label="dZ ± 2σ"))
    _legend(figure, handles, 4)
    return figure


@styled
def plot_block_deformation(deformation: BlockDeformation, block_name: str) -> Figure:
    """dZ of every node in the model nearest to it as grey tones, borders of the models, the worst seams numbered."""
    d = deformation
    dz = 100.0 * d.d[..., 2]
    worst = worst_seams(d)[:5]
    subtitle = (
        f"{d.variant}: {MEANING.get(d.variant, '')}; {len(d.models)} models; {_range(dz)}\n"
        f"steps between neighbouring models: RMS {100.0 * d.step_rms:.1f} cm; numbered: the worst seams"
    )
    extent = (d.x[0], d.x[-1], d.y[-1], d.y[0])
    ratio = (extent[3] - extent[2]) / (extent[1] - extent[0])
    width = min(WIDTH - 2.1, HIGHEST / ratio)
    height = width * ratio
    figure = new_figure(height + 2.05 + 0.16 * len(worst), f"Block deformation – {plain(block_name)}", subtitle)
    bottom = 1.0 + 0.16 * len(worst)
    axes = axes_at(figure, 0.95, bottom, width, height)
    half = d.spacing / 2.0
    image = axes.imshow(
        dz, cmap="Greys_r", interpolation="nearest", aspect="auto", zorder=0, vmin=np.nanpercentile(dz, 1),
        vmax=np.nanpercentile(dz, 99), extent=(extent[0] - half, extent[1] + half, extent[2] - half, extent[3] + half),
    )  # fmt: skip
    axes.add_collection(LineCollection(_borders(d), colors=ACCENT, linewidths=0.7, zorder=2))
    for number, seam in enumerate(worst, start=1):
        _mark_seam(axes, d, seam, number)
    coordinate_axes(axes, width, height, ("X (local) [m]", "Y (local) [m]") if d.crs == "local" else ("E [m]", "N [m]"))
    scale = axes_at(figure, 0.95 + width + 0.15, bottom, 0.16, height)
    bar = figure.colorbar(image, cax=scale)
    bar.set_label("dZ [cm]")
    _minus(scale)
    for number, seam in enumerate(worst, start=1):
        first, second = (d.models[k].name for k in (seam.first, seam.second))
        text = f"{number}  {plain(first, 60)} | {plain(second, 60)}: RMS {100.0 * seam.rms:.1f} cm, {seam.count} nodes"
        at = (0.32 + 0.16 * (len(worst) - number)) / float(figure.get_size_inches()[1])
        figure.text(0.95 / WIDTH, at, text, fontsize=8)
    return figure


class _View:
    """How a model lies on the page: north up, or for the normal case the flight up."""

    def __init__(self, deformation: Deformation):
        self._flight_up = deformation.names is None
        d = deformation
        known = np.isfinite(d.d[..., 2])
        rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
        margin = d.spacing
        low = np.array([d.x[columns[0]], d.y[rows[-1]]]) - margin
        high = np.array([d.x[columns[-1]], d.y[rows[0]]]) + margin
        corners = self.turned(np.array([low, high]))
        self._low, self._high = corners.min(axis=0), corners.max(axis=0)
        grid_x, grid_y = np.meshgrid(d.x, d.y)
        self.at = self.turned(np.column_stack([grid_x.ravel(), grid_y.ravel()])).T.reshape(2, *grid_x.shape)
        self.regions = [d.region == k for k in np.unique(d.region[d.region >= 0])]
        self._labels = ("X (local) [m]", "Y (local) [m]") if d.crs == "local" else ("E [m]", "N [m]")
        if self._flight_up:
            self._labels = ("across the flight [m]", "along the flight [m]")

    def turned(self, xy: np.ndarray) -> np.ndarray:
        """(n, 2) on the page."""
        return np.column_stack([-xy[:, 1], xy[:, 0]]) if self._flight_up else xy

    def size(self, widest: float, highest: float) -> tuple[float, float]:
        """Width and height of axes with equal scales, inches."""
        size = self._high - self._low
        per_inch = max(size[0] / widest, size[1] / highest)
        return float(size[0] / per_inch), float(size[1] / per_inch)

    def frame(self, axes: Axes) -> None:
        axes.set_xlim(self._low[0], self._high[0])
        axes.set_ylim(self._low[1], self._high[1])
        box, dpi = axes.get_window_extent(), axes.figure.dpi
        coordinate_axes(axes, box.width / dpi, box.height / dpi, self._labels)


def _contours(axes: Axes, view: _View, dz: np.ndarray, interval: float) -> None:
    """Lines region by region: what is smooth is drawn smooth, steps stay steps."""
    first, last = np.floor(np.nanmin(dz) / interval), np.ceil(np.nanmax(dz) / interval)
    levels = interval * np.arange(first, last + 1)
    styles = ["--" if level < 0 else "-" for level in levels]
    widths = [1.5 if level == 0 else 0.8 for level in levels]
    for region in view.regions:
        if min(region.any(axis=1).sum(), region.any(axis=0).sum()) < 2:
            continue
        values = np.ma.masked_array(dz, ~region | ~np.isfinite(dz))
        lines = axes.contour(*view.at, values, levels=levels, colors=INK, linestyles=styles, linewidths=widths,
                             zorder=3)  # fmt: skip
        axes.clabel(lines, fmt=value_text, fontsize=7, inline=True, inline_spacing=2)


def contour_symbols(seams: bool) -> list[Line2D]:
    """What the lines of `draw_contours` mean, for a legend."""
    symbols = [
        Line2D([], [], color=INK, lw=0.9, label="dZ above 0 [cm]"),
        Line2D([], [], color=INK, lw=1.5, label="0"),
        Line2D([], [], color=INK, lw=0.9, ls="--", label="below 0"),
        Line2D([], [], ls="none", label="projection centres", **BASE_STYLE),
    ]
    if seams:
        symbols.append(Line2D([], [], color=GREY, lw=0.9, ls=(0, (1, 2)), label="seams of the images' parts"))
    return symbols


def _numbers(d: Deformation) -> str:
    g = d.geometry
    name = "normal case" if d.names is None else plain(d.title, 80)
    return (
        f"{name}; {d.variant}: {MEANING.get(d.variant, '')};  end lap {100.0 * g.end_lap:.1f} %, "
        f"h/b {g.h_over_b:.2f}, GSD {length_text(round(g.gsd_m, 3))}, 1 µm of x-parallax {g.cm_per_um:.1f} cm"
    )


def _range(dz: np.ndarray) -> str:
    low, high = (f"{value:+.1f}".replace("-", "−") for value in (np.nanmin(dz), np.nanmax(dz)))
    return f"dZ {low} … {high} cm, RMS {np.sqrt(np.nanmean(dz**2)):.1f} cm"


def _profile(d: Deformation, middle: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance (n,) m, deformation and σ (n, 3) m along a line, linear between nodes; NaN off the model."""
    reach = float(np.hypot(d.x[-1] - d.x[0], d.y[0] - d.y[-1]))
    distance = np.arange(-reach, reach, d.spacing / 2.0)
    at = middle + distance[:, None] * direction
    nodes = np.concatenate([d.d, d.sigma], axis=2)[::-1]
    between = RegularGridInterpolator((d.y[::-1], d.x), nodes, bounds_error=False, fill_value=np.nan)
    values, sigma = np.split(between(at[:, ::-1]), 2, axis=1)
    known = np.flatnonzero(np.isfinite(values[:, 2]))
    if not len(known):
        return distance, values, sigma
    span = slice(known[0], known[-1] + 1)
    return distance[span], values[span], sigma[span]


def _borders(d: BlockDeformation) -> list[np.ndarray]:
    """Segments between nodes of different models, (2, 2) each."""
    half, n = d.spacing / 2.0, d.number
    row, column = np.nonzero(n[:, 1:] != n[:, :-1])
    x, y = d.x[column] + half, d.y[row]
    upright = np.stack([np.column_stack([x, y - half]), np.column_stack([x, y + half])], axis=1)
    row, column = np.nonzero(n[1:] != n[:-1])
    x, y = d.x[column], d.y[row] - half
    level = np.stack([np.column_stack([x - half, y]), np.column_stack([x + half, y])], axis=1)
    return [*upright, *level]


def _mark_seam(axes: Axes, d: BlockDeformation, seam: Seam, number: int) -> None:
    """A number on the middle of a seam."""
    n = d.number
    both = {seam.first, seam.second}
    found = []
    for dr, dc in ((0, 1), (1, 0)):
        a, b = n[: n.shape[0] - dr, : n.shape[1] - dc], n[dr:, dc:]
        meet = (a != b) & np.isin(a, list(both)) & np.isin(b, list(both))
        row, column = np.nonzero(meet)
        found.append(np.column_stack([d.x[column], d.y[row]]))
    places = np.concatenate(found)
    middle = places[np.argmin(np.linalg.norm(places - np.median(places, axis=0), axis=1))]
    x, y = middle.tolist()
    axes.text(x, y, str(number), fontsize=8, weight="bold", ha="center", va="center", zorder=6,
              bbox={"boxstyle": "circle,pad=0.25", "fc": "white", "ec": INK, "lw": 0.9})  # fmt: skip


def _minus(axes: Axes) -> None:
    axes.yaxis.set_major_formatter(FuncFormatter(value_text))


def _legend(figure: Figure, handles: list[Line2D], columns: int) -> None:
    width, height = figure.get_size_inches()
    figure.legend(handles=handles, loc="center left", bbox_to_anchor=(0.8 / width, 0.26 / height), ncols=max(
        columns, len(handles)), borderaxespad=0.0, handletextpad=0.6, columnspacing=1.5)  # fmt: skip
