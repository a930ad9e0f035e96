"""Sets of additional parameters side by side, as a picture."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from aerotri.report.plots.canvas import FRAME, GREY, INK, LIGHT, WIDTH, axes_at, new_figure, plain, styled
from aerotri.results.parameter_comparison import ParameterComparison, SetOutcome

ROW, HEAD, FOOT, LABELS, GAP = 0.34, 0.95, 0.95, 2.45, 0.22
"""Inches: a row of the picture, above and below all of them, for the names, between the axes."""


@styled
def plot_comparison(comparison: ParameterComparison) -> Figure:
    """RMS at check points with bounds and at control points predicted without themselves, set by set, X, Y and Z."""
    outcomes = [o for o in comparison.outcomes if o.converged]
    height = HEAD + ROW * max(len(outcomes), 1) + FOOT
    subtitle = (
        f"RMS at {len(comparison.check_points)} check points with 95 % bounds, and at "
        f"{len(comparison.control_points)} control points predicted without themselves"
    )
    figure = new_figure(height, f"Sets of additional parameters – {plain(comparison.block)}", subtitle)
    width = (WIDTH - LABELS - 0.25 - 2 * GAP) / 3.0
    for k, axis in enumerate("XYZ"):
        axes = axes_at(figure, LABELS + k * (width + GAP), FOOT, width, ROW * max(len(outcomes), 1))
        _draw_axis(axes, outcomes, k)
        axes.set_title(axis, fontsize=9, weight="bold", pad=5)
        axes.set_xlabel("RMS [m]")
        axes.set_yticks(range(len(outcomes)), [_label(o) for o in outcomes] if k == 0 else [""] * len(outcomes))
        axes.tick_params(axis="y", length=0)
    _legend(figure, height)
    return figure


def _label(o: SetOutcome) -> str:
    count = f"{o.count}" if abs(o.effective - o.count) < 1e-6 else f"{o.effective:.0f} eff."
    return f"{plain(o.name, 34)}  ({count})"


def _draw_axis(axes: Axes, outcomes: list[SetOutcome], k: int) -> None:
    axes.set_xscale("log")
    axes.set_ylim(max(len(outcomes), 1) - 0.5, -0.5)
    axes.spines[["top", "right", "left"]].set_visible(False)
    for row, o in enumerate(outcomes):
        axes.axhline(row, color=LIGHT, lw=0.4, zorder=0)
        if np.isfinite(o.check.rms[k]):
            axes.plot([o.check.low[k], o.check.high[k]], [row, row], color=INK, lw=2.0, solid_capstyle="butt", zorder=2)
            axes.plot(o.check.rms[k], row, "o", color=INK, ms=5.5, zorder=3)
        if np.isfinite(o.control.rms[k]):
            axes.plot(o.control.rms[k], row, "s", mfc="white", mec=GREY, mew=1.1, ms=5, zorder=4)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=6))
    axes.xaxis.set_major_formatter(FuncFormatter(_tick))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(axis="x", which="minor", length=0)
    axes.grid(axis="x", color=LIGHT, lw=0.4)
    axes.spines["bottom"].set_linewidth(FRAME)


def _legend(figure: Figure, height: float) -> None:
    handles = [
        Line2D([], [], color=INK, marker="o", ms=5.5, lw=2.0, label="check points, 95 % bounds"),
        Line2D([], [], color=GREY, marker="s", mfc="white", ms=5, lw=0, label="control points, predicted"),
    ]
    figure.legend(handles=handles, loc="lower right", bbox_to_anchor=(1 - 0.2 / WIDTH, 0.12 / height), ncols=2)


def _tick(value: float, place: int | None = None) -> str:
    return f"{value:g}"
