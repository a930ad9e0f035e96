"""The accuracy of heights as a map over the block."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from scipy.spatial import KDTree

from aerotri.report.plots import plan
from aerotri.report.plots.block import CHECK_SYMBOL, CONTROL_SYMBOLS
from aerotri.report.plots.canvas import WIDTH, axes_at, new_figure, plain, styled
from aerotri.report.quality import two_digits
from aerotri.results.adjusted_block import AdjustedBlock

NEAREST = 9
"""Points whose median a place of the map shows; chosen [C]: the median of nine σ no longer jumps with the number of
rays of single points."""
NODES = 120
"""Places of the map along its longer side; chosen [C]: finer ones are not seen."""
REACH = 3.0
"""Distance from the nearest point, in mean distances of points, up to which the map is drawn [C]."""
CLASSES = 7
"""Classes of the scale, about; chosen [C]: more greys are not told apart in print."""
LIGHTEST, DARKEST = 0.94, 0.25
"""Grey of the first and the last class; chosen [C]: white is for places without points, and symbols show on all."""


@styled
def plot_height_accuracy(adjusted: AdjustedBlock) -> Figure:
    """Median σ of the heights of the object points around every place; the darker the worse.

    Points of many rays and of two lie side by side: the median shows what the block gives there.
    """
    xy, sigma = _heights(adjusted)
    extent = plan.extent_of(xy)
    width, height = plan.plan_size(extent, WIDTH - 2.4, 6.4)
    middle, high = (two_digits(float(np.quantile(sigma, share))) for share in (0.5, 0.95))
    subtitle = (
        f"median of the nearest {min(NEAREST, len(xy))} object points; of all points: median {middle} m, "
        f"95 % below {high} m; white: no points"
    )
    word = "σ" if adjusted.points.model is None else "Total σ"
    figure = new_figure(1.1 + height + 0.75, f"{word} of heights – {plain(adjusted.block.name)}", subtitle)
    axes = plan.plan_axes(figure, (0.95, 1.1, width, height), extent, plan.axis_names(adjusted))
    step = max(extent.width, extent.height) / NODES
    x, y = np.arange(extent.left, extent.right, step), np.arange(extent.bottom, extent.top, step)
    values = median_around(xy, sigma, x, y)
    norm, shades = shade_classes(values)
    axes.pcolormesh(x, y, values, cmap=shades, norm=norm, shading="nearest", zorder=0, rasterized=True)
    scale = axes_at(figure, 0.95 + width + 0.2, 1.1, 0.16, height)
    figure.colorbar(ScalarMappable(norm, shades), cax=scale).set_label("σ of Z [m]")
    _draw_ground_points(axes, figure, adjusted)
    return figure


def heights_with_sigma(adjusted: AdjustedBlock) -> np.ndarray:
    """(N,) bool, the object points whose height has a σ."""
    sigma = adjusted.points.total_sigma[:, 2]
    return np.isfinite(sigma) & np.isfinite(adjusted.points.xyz).all(axis=1) & (sigma > 0.0)


def median_around(xy: np.ndarray, values: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(ny, nx) median of the values (n,) of the nearest points (n, 2) at every node; NaN where none is near."""
    nodes = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    count = min(NEAREST, len(xy))
    found = KDTree(xy).query(nodes, k=max(count, 2))
    distance, index = np.asarray(found[0]), np.asarray(found[1])[:, :count]
    spacing = np.sqrt(max((x[-1] - x[0]) * (y[-1] - y[0]), 1e-12) / len(xy))
    near = distance[:, 0] <= REACH * spacing
    return np.where(near, np.median(values[index], axis=1), np.nan).reshape(len(y), len(x))


def _heights(adjusted: AdjustedBlock) -> tuple[np.ndarray, np.ndarray]:
    there = heights_with_sigma(adjusted)
    return adjusted.points.xyz[there, :2], adjusted.points.total_sigma[there, 2]


def shade_classes(values: np.ndarray) -> tuple[BoundaryNorm, ListedColormap]:
    """Round limits of the classes and their greys; a block that is equally good everywhere has a scale too."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    low, high = (low, high) if high > 1.001 * low else (0.9 * low, 1.1 * high)
    levels = MaxNLocator(CLASSES, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    greys = np.linspace(LIGHTEST, DARKEST, len(levels) - 1)
    return BoundaryNorm(levels, len(greys)), ListedColormap([(grey, grey, grey) for grey in greys.tolist()])


def _draw_ground_points(axes: Axes, figure: Figure, adjusted: AdjustedBlock) -> None:
    """Control and check points on a white ground of their own, and what their symbols mean."""
    kinds, handles = plan.control_kinds(adjusted.control), []
    control_xy = plan.ground_point_xy(adjusted, adjusted.control.point)
    groups = [(f"control{'' if kind == 'full' else f', {kind}'}", control_xy[kinds == kind], symbol)
              for kind, symbol in CONTROL_SYMBOLS.items()]  # fmt: skip
    groups.append(("check", plan.ground_point_xy(adjusted, adjusted.check.point), CHECK_SYMBOL))
    for label, xy, symbol in groups:
        if len(xy):
            look: dict[str, Any] = {"ls": "none", "ms": 7, "mew": 1.0, **symbol}
            axes.plot(*xy.T, ls="none", ms=11, marker=symbol["marker"], mfc="white", mec="white", zorder=4)
            axes.plot(*xy.T, zorder=5, **look)
            handles.append(Line2D([], [], label=f"{label} ({len(xy)})", **look))
    if handles:
        tall = float(figure.get_size_inches()[1])
        figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.85 / WIDTH, 0.5 / tall), ncols=4,
                      borderaxespad=0.0, handletextpad=0.5, columnspacing=1.6)  # fmt: skip
