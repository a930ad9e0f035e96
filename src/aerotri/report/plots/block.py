"""Plots of the block on the ground: its plan, the differences at control and check points, rays per point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from aerotri.conventions import counted
from aerotri.report.plots import plan
from aerotri.report.plots.canvas import (
    ACCENT,
    GREY,
    INK,
    LIGHT,
    WIDTH,
    axes_at,
    length_text,
    new_figure,
    per_inch_for,
    plain,
    scale_vector,
    styled,
    vectors,
)
from aerotri.results.adjusted_block import AdjustedBlock, GroundPointResults

MOST_NAMED_POINTS = 40
"""Control and check points up to which their names are drawn; chosen [C]: with more the names overlap."""
LONGEST_INCH = 0.55
"""Inches of the longest arrow of a difference."""
BETWEEN = 0.45
"""Inches between two panels; a coordinate of seven digits stands at the edge of each."""
CONTROL_SYMBOLS: dict[str, dict[str, Any]] = {
    "full": {"marker": "^", "mfc": INK, "mec": INK},
    "plan only": {"marker": "^", "mfc": "white", "mec": INK},
    "height only": {"marker": "v", "mfc": LIGHT, "mec": INK},
}
CHECK_SYMBOL: dict[str, Any] = {"marker": "o", "mfc": "white", "mec": ACCENT}


@styled
def plot_block_plan(adjusted: AdjustedBlock) -> Figure:
    """Projection centres, strips, footprints on the mean ground height, control and check points; north is up."""
    corners = plan.footprints(adjusted)
    control_xy = plan.ground_point_xy(adjusted, adjusted.control.point)
    check_xy = plan.ground_point_xy(adjusted, adjusted.check.point)
    extent = plan.extent_of(corners, adjusted.images.centre[:, :2], control_xy, check_xy)
    width, height = plan.plan_size(extent, WIDTH - 1.2, 6.8)
    beside = width < WIDTH - 3.7
    block = adjusted.block
    strips = len(np.unique(block.images.strip[block.images.strip != ""]))
    in_strips = f" in {counted(strips, 'strip')}" if strips else ""
    subtitle = (
        f"{len(block.images)} photographs{in_strips}, {len(adjusted.control)} control and {len(adjusted.check)} check "
        "points; outlines on the mean height of the ground"
    )
    below = 0.65 if beside else 1.15
    figure = new_figure(below + height + 0.75, f"Block plan – {plain(block.name)}", subtitle)
    axes = plan.plan_axes(figure, (0.95, below, width, height), extent, plan.axis_names(adjusted))
    plan.draw_footprints(axes, corners)
    plan.draw_centres(axes, adjusted)
    kinds = plan.control_kinds(adjusted.control)
    for kind, symbol in CONTROL_SYMBOLS.items():
        axes.plot(*control_xy[kinds == kind].T, ls="none", ms=6.5, mew=0.9, zorder=5, **symbol)
    axes.plot(*check_xy.T, ls="none", ms=5.5, mew=1.2, zorder=4, **CHECK_SYMBOL)
    points, xy = np.concatenate([adjusted.control.point, adjusted.check.point]), np.concatenate([control_xy, check_xy])
    if len(points) <= MOST_NAMED_POINTS:
        drawable = np.isfinite(xy).all(axis=1)
        plan.draw_names(axes, xy[drawable], block.points[points[drawable]].tolist(), adjusted.images.centre[:0, :2])
    at = (0.95 + width + 0.3, below + height) if beside else (0.85, 0.58)
    _legend(figure, _plan_symbols(kinds, len(check_xy), strips), at, columns=1 if beside else 3)
    return figure


def _plan_symbols(kinds: np.ndarray, n_check: int, strips: int) -> list[Line2D]:
    symbols = [Line2D([], [], color=GREY, lw=0.7, marker="o", ms=2.6, mec="none", mfc=INK,
                      label="projection centres, strips" if strips else "projection centres"),
               Line2D([], [], color=GREY, lw=0.5, marker="s", ms=9, mfc="none", mec=GREY, mew=0.5, ls="none",
                      label="footprints")]  # fmt: skip
    for kind, symbol in CONTROL_SYMBOLS.items():
        count = int(np.sum(kinds == kind))
        if count:
            label = f"control ({count})" if kind == "full" else f"control, {kind} ({count})"
            symbols.append(Line2D([], [], ls="none", ms=6.5, mew=0.9, label=label, **symbol))
    if n_check:
        symbols.append(Line2D([], [], ls="none", ms=5.5, mew=1.2, label=f"check ({n_check})", **CHECK_SYMBOL))
    return symbols


def _legend(figure: Figure, handles: list[Line2D], at: tuple[float, float], columns: int) -> None:
    """A legend outside the axes, its upper left corner at a place in inches."""
    width, height = figure.get_size_inches()
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(at[0] / width, at[1] / height), ncols=columns,
                  borderaxespad=0.0, handletextpad=0.5, columnspacing=1.6)  # fmt: skip


@styled
def plot_ground_points(adjusted: AdjustedBlock) -> Figure:
    """Differences adjusted − given at control and check points: horizontal vectors, and heights as vertical arrows."""
    results = (adjusted.control, adjusted.check)
    xy = [plan.ground_point_xy(adjusted, r.point) for r in results]
    extent = plan.extent_of(adjusted.images.centre[:, :2], *xy)
    extent = extent.widened(0.03 * max(extent.width, extent.height), 0.05 * max(extent.width, extent.height))
    stacked = extent.width > 1.25 * extent.height
    widest, highest = (WIDTH - 1.2, 3.9) if stacked else (3.4, 5.6)
    arrows = [_vectors_of(r, heights) for heights in (False, True) for r in results]
    extent = _around_arrows(extent, xy * 2, arrows, (widest, highest))
    width, height = plan.plan_size(extent, widest, highest)
    width = max(width, 3.0)
    panels_high = 2 * height + 0.85 if stacked else height
    title = f"Control and check points – {plain(adjusted.block.name)}"
    figure = new_figure(panels_high + 1.9, title, "adjusted − given: " + _differences_text(adjusted))
    places = [(0.95, 0.95 + (height + 0.85 if stacked else 0.0)), (0.95 if stacked else 0.95 + width + BETWEEN, 0.95)]
    for heights, (left, bottom) in zip((False, True), places, strict=True):
        axes = plan.plan_axes(figure, (left, bottom, width, height), extent, plan.axis_names(adjusted))
        if heights and not stacked:
            axes.set_ylabel("")
            axes.tick_params(labelleft=False)
        axes.set_title("heights (up: too high)" if heights else "plan", fontsize=9, loc="left", pad=5)
        plan.draw_centres(axes, adjusted, strong=False)
        _difference_vectors(axes, results, xy, heights, scale_at=(left + width, bottom + height + 0.13))
    _legend(figure, _ground_symbols(adjusted), (0.85, 0.3), columns=4)
    return figure


def _around_arrows(
    extent: plan.Extent, xy: Sequence[np.ndarray], arrows: Sequence[np.ndarray], size: tuple[float, float]
) -> plan.Extent:
    """An extent widened until the arrows end inside, drawn as long as `_difference_vectors` draws them.

    Parameters
    ----------
    xy, arrows : (n, 2) m each, of the control and of the check points: in plan, then in height.
    size : widest, highest inches of the axes.
    """
    per_inch = [_per_inch(arrows[:2])[0]] * 2 + [_per_inch(arrows[2:])[0]] * 2
    # a wider extent makes the same inches longer on the ground
    for _ in range(3):
        width, height = plan.plan_size(extent, *size)
        metres_per_inch = max(extent.width / width, extent.height / height)
        ends = [at + metres_per_inch / scale * v for at, v, scale in zip(xy, arrows, per_inch, strict=True)]
        corners = np.array([[extent.left, extent.bottom], [extent.right, extent.top]])
        extent = plan.extent_of(corners, *ends)
    return extent


def _per_inch(arrows: Sequence[np.ndarray]) -> tuple[float, float]:
    """Metres of an inch of arrows, and of the one that stands for the scale."""
    return per_inch_for(np.concatenate([np.hypot(*v.T) for v in arrows]), LONGEST_INCH)


def _difference_vectors(
    axes: Axes,
    results: Sequence[GroundPointResults],
    xy: Sequence[np.ndarray],
    heights: bool,
    scale_at: tuple[float, float],
) -> None:
    vector = [_vectors_of(r, heights) for r in results]
    per_inch, size = _per_inch(vector)
    symbols: tuple[dict[str, Any], ...] = (CONTROL_SYMBOLS["full"] | {"ms": 4}, CHECK_SYMBOL | {"ms": 3.5})
    for symbol, color, at, v in zip(symbols, (INK, ACCENT), xy, vector, strict=True):
        there = np.isfinite(v).all(axis=1) & np.isfinite(at).all(axis=1)
        axes.plot(*at[there].T, ls="none", mew=0.9, zorder=4, **symbol)
        quiver = vectors(axes, at[there], v[there], per_inch, color, width=0.014, zorder=5)
        if symbol["marker"] == "^":
            label = length_text(size)
            scale_vector(
                axes,
                quiver,
                size,
                per_inch,
                label,
                scale_at[0] - size / per_inch - 0.1 - 0.068 * len(label),
                scale_at[1],
            )


def _vectors_of(results: GroundPointResults, heights: bool) -> np.ndarray:
    """(k, 2) vectors to draw, m: (dX, dY), or (0, dZ)."""
    if not heights:
        return results.difference[:, :2]
    return np.column_stack([np.where(np.isfinite(results.difference[:, 2]), 0.0, np.nan), results.difference[:, 2]])


def _differences_text(adjusted: AdjustedBlock) -> str:
    parts = []
    for name, results in (("control", adjusted.control), ("check", adjusted.check)):
        rms = [_rms(results.difference[:, k]) for k in range(3)]
        if len(results):
            parts.append(f"{name} RMS X, Y, Z " + ", ".join(f"{value:.3f}" for value in rms) + " m")
    return "; ".join(parts) or "there are neither control nor check points"


def _rms(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if len(finite) else float("nan")


def _ground_symbols(adjusted: AdjustedBlock) -> list[Line2D]:
    symbols = []
    if len(adjusted.control):
        symbols.append(Line2D([], [], color=INK, marker="^", ms=5, lw=1.2, label="control"))
    if len(adjusted.check):
        symbols.append(Line2D([], [], color=ACCENT, marker="o", mfc="white", ms=5, lw=1.2, label="check"))
    symbols.append(Line2D([], [], color=LIGHT, lw=0.7, marker="o", ms=2.6, mec="none", label="projection centres"))
    return symbols


@styled
def plot_rays_per_point(adjusted: AdjustedBlock) -> Figure:
    """How many photographs every adjusted point was measured in."""
    rays = adjusted.points.rays[adjusted.points.rays > 0]
    counts = np.bincount(rays) if len(rays) else np.zeros(2, np.int64)
    two = counts[2] if len(counts) > 2 else 0
    mean = rays.mean() if len(rays) else 0.0
    subtitle = (
        f"{len(rays)} points, {mean:.1f} rays a point; {two} points ({100 * two / max(len(rays), 1):.1f} %) "
        "have two rays: a gross error along the base stays unseen there"
    )
    figure = new_figure(3.75, f"Rays per point – {plain(adjusted.block.name)}", subtitle)
    axes = axes_at(figure, 0.95, 0.6, WIDTH - 1.25, 2.45)
    number = np.arange(len(counts))
    color = np.where(number <= 2, LIGHT, GREY)
    axes.bar(number, counts, width=0.8, color=color.tolist(), edgecolor=INK, linewidth=0.6)
    axes.set_xlim(0.4, max(len(counts), 4) - 0.4)
    axes.set_ylim(0, 1.08 * max(int(counts.max()), 1))
    axes.xaxis.set_major_locator(MaxNLocator(min(20, len(counts) + 1), integer=True, min_n_ticks=1))
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.set_xlabel("rays of a point [number of photographs]")
    axes.set_ylabel("points [count]")
    axes.spines[["top", "right"]].set_visible(False)
    return figure
