"""Adjusted against given positions of the photographs, over time."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from aerotri.report.plots.canvas import GREY, INK, LIGHT, WIDTH, axes_at, new_figure, plain, styled
from aerotri.statistics.position_differences import PositionDifferences

PANEL = 1.25
"""Inches a panel is high."""
MOST_DOTS = 3000
"""Photographs drawn; chosen [C]: of more, evenly spaced ones and the largest differences."""
LONG_GAP = 5.0
"""Median steps of time between photographs from which on the line is broken [C]: the turn to the next strip."""
MOST_STRIPS = 12
"""Strips up to which their names stand; chosen [C]: more overlap."""


@styled
def plot_trajectory(found: PositionDifferences, name: str) -> Figure:
    """Differences in X, Y, Z over time with the given σ; over the number of the photograph where there are no times."""
    shown = _thinned(found)
    thin = f"; {len(shown)} of {len(found.image)} photographs drawn" if len(shown) < len(found.image) else ""
    order = "strip by strip" if len(np.unique(found.strip)) > 1 else "in the order of the block"
    how = "over time" if found.time is not None else f"{order}: not all photographs have a time"
    figure = new_figure(
        3 * PANEL + 1.7, f"Positions, adjusted − given – {plain(name)}",
        f"grey: ± the given σ about zero; {how}{thin}\n{trajectory_text(found)}",
    )  # fmt: skip
    over = np.arange(1.0, len(found.image) + 1) if found.time is None else (found.time - found.time[0]) / 60.0
    for k, axis in enumerate("XYZ"):
        axes = axes_at(figure, 0.95, 0.55 + (2 - k) * (PANEL + 0.05), WIDTH - 1.25, PANEL - 0.05)
        _draw(axes, found, shown, over, k)
        axes.set_ylabel(f"{axis} [m]")
        if k < 2:
            axes.tick_params(labelbottom=False)
        else:
            axes.set_xlabel("time since the first photograph [min]" if found.time is not None else "photograph")
        _separate_strips(axes, found, named=k == 0)
    return figure


def trajectory_text(found: PositionDifferences) -> str:
    """Offset and drift in words."""
    mean, drift = found.offset, found.drift
    parts = [f"{axis} {_signed(mean[0, k], 3)}" for k, axis in enumerate("XYZ") if np.isfinite(mean[0, k])]
    text = f"offset (mean) {', '.join(parts)} m"
    slopes = [f"{axis} {_signed(1e3 * drift[0, k], 1)}" for k, axis in enumerate("XYZ") if np.isfinite(drift[0, k])]
    return f"{text}; drift {', '.join(slopes)} mm/min" if slopes else text


def _signed(value: float, digits: int) -> str:
    """With its sign, and no sign of a zero."""
    text = f"{value:+.{digits}f}"
    return (text.lstrip("+-") if float(text) == 0.0 else text).replace("-", "−")


def _thinned(found: PositionDifferences) -> np.ndarray:
    """Rows to draw, in order."""
    count = len(found.image)
    if count <= MOST_DOTS:
        return np.arange(count)
    even = np.linspace(0, count - 1, MOST_DOTS - 300).astype(np.int64)
    largest = np.argsort(-np.nan_to_num(np.abs(found.difference)), axis=0)[:100].ravel()
    return np.unique(np.concatenate([even, largest]))


def _draw(axes: Axes, found: PositionDifferences, shown: np.ndarray, over: np.ndarray, k: int) -> None:
    x, d, sigma = over[shown], found.difference[shown, k], found.sigma[shown, k]
    breaks = _breaks(found, shown, over)
    axes.axhline(0.0, color=GREY, lw=0.8)
    for part in np.split(np.arange(len(shown)), breaks):
        axes.fill_between(x[part], -sigma[part], sigma[part], color=LIGHT, alpha=0.45, lw=0.0, zorder=0)
        axes.plot(x[part], d[part], color=INK, lw=0.7, marker="o", ms=1.8 if len(shown) < 1000 else 1.0, zorder=2)
    known = np.abs(d[np.isfinite(d)])
    reach = max(float(known.max(initial=0.0)), 1e-4)
    axes.set_ylim(-1.15 * reach, 1.15 * reach)
    margin = 0.01 * max(float(over[-1] - over[0]), 1e-9)
    axes.set_xlim(over[0] - margin, over[-1] + margin)
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.spines[["top", "right"]].set_visible(False)


def _breaks(found: PositionDifferences, shown: np.ndarray, over: np.ndarray) -> np.ndarray:
    """Places among the rows shown where a new line begins: another strip, or a long time without photographs."""
    other = found.strip[shown][1:] != found.strip[shown][:-1]
    if found.time is not None:
        step = np.diff(over[shown])
        other |= step > LONG_GAP * max(float(np.median(step)), 1e-9)
    return np.flatnonzero(other) + 1


def _separate_strips(axes: Axes, found: PositionDifferences, named: bool) -> None:
    """Where the photographs stand strip by strip: lines between them, and their names."""
    starts = np.flatnonzero(found.strip[1:] != found.strip[:-1]) + 1
    if found.time is not None or not 0 < len(starts) < 200:
        return
    for start in starts.tolist():
        axes.axvline(start + 0.5, color=LIGHT, lw=0.7, zorder=0)
    if named and len(starts) < MOST_STRIPS:
        for first, last in zip([0, *starts.tolist()], [*starts.tolist(), len(found.strip)], strict=True):
            axes.text(0.5 * (first + last) + 0.5, 1.0, plain(found.strip[first], 10), fontsize=7, ha="center",
                      va="bottom", transform=axes.get_xaxis_transform())  # fmt: skip
