"""Reliability as a map: how far an undetected error may move a point in height, how well photographs are controlled."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from aerotri.report.plots import plan
from aerotri.report.plots.canvas import GREY, INK, WIDTH, new_figure, plain, styled
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.outliers import used_rays

CLASSES = 5
"""Classes of equal numbers; chosen [C]: as many shades of grey as are told apart in print."""
SHADES = ("#e3e6e9", "#bcc3ca", "#8b949d", "#565f68", "#111417")
POINT_SIZES = (2.2, 2.9, 3.8, 5.0, 6.6)
"""Diameters, points, each a third larger than the one before, so that size tells what the shade does."""
MOST_POINTS = 20000
"""Points drawn, about; chosen [C]: more cover one another and make the file large."""


@styled
def plot_reliability(adjusted: AdjustedBlock) -> Figure:
    """Points by the largest effect of an undetected error on their height, photographs by their mean redundancy.

    Both in five classes, each a fifth of the points or photographs: darker and larger the worse a point is controlled,
    wider open the less a photograph is.
    """
    effect, redundancy = height_effects(adjusted), mean_redundancy(adjusted)
    xy = adjusted.points.xyz[:, :2]
    extent = plan.extent_of(adjusted.images.centre[:, :2], xy[np.isfinite(effect)])
    width, height = plan.plan_size(extent, WIDTH - 1.2, 6.4)
    settings = adjusted.block.settings.adjustment
    subtitle = (
        f"gross errors found with {100 * settings.power:.0f} % at α = {100 * settings.alpha:g} %: the largest that "
        "stays undetected in a ray moves the\nheight of its point by the value shown"
    )
    figure = new_figure(2.05 + height + 0.85, f"Reliability – {plain(adjusted.block.name)}", subtitle)
    axes = plan.plan_axes(figure, (0.95, 2.05, width, height), extent, plan.axis_names(adjusted))
    limits = _draw_points(axes, xy, effect)
    _draw_photographs(axes, adjusted.images.centre[:, :2], redundancy)
    _legends(figure, limits, _limits(redundancy), int(np.sum(np.isinf(effect))))
    return figure


def height_effects(adjusted: AdjustedBlock) -> np.ndarray:
    """(N,) m, the largest effect of an undetected error in a ray of a point on its height.

    Infinite where a coordinate of a ray is not controlled at all, NaN where the point was not adjusted.
    """
    count, effects = len(adjusted.block.points), adjusted.effects
    out = np.full(count, np.nan)
    if effects is None:
        return out
    used = used_rays(adjusted)
    size = np.where(np.isfinite(effects.height[used]), effects.height[used], np.inf).max(axis=1)
    point = adjusted.block.image_points.point[used]
    largest = np.zeros(count)
    np.maximum.at(largest, point, size)
    out[point] = largest[point]
    return out


def mean_redundancy(adjusted: AdjustedBlock) -> np.ndarray:
    """(n,) mean redundancy number of the image coordinates of every photograph; NaN without rays."""
    used = used_rays(adjusted)
    image, n = adjusted.block.image_points.image[used], len(adjusted.block.images)
    count = np.bincount(image, minlength=n)
    with np.errstate(invalid="ignore"):
        return np.bincount(image, adjusted.rays.r[used].mean(axis=1), n) / np.where(count > 0, count, np.nan)


def _limits(values: np.ndarray) -> np.ndarray:
    """The ends of the classes: quantiles of the finite values, ends that coincide taken once."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return np.zeros(0)
    return np.unique(np.quantile(finite, np.linspace(0.0, 1.0, CLASSES + 1)))


def _classes(values: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Class of every value, −1 where it is not finite; with fewer classes the darkest are used."""
    inside = np.searchsorted(limits[1:-1], values, side="right")
    first = CLASSES - max(len(limits) - 1, 1)
    return np.where(np.isfinite(values), inside + first, -1)


def _draw_points(axes: Axes, xy: np.ndarray, effect: np.ndarray) -> np.ndarray:
    limits = _limits(effect)
    classes = _classes(effect, limits)
    for k in range(CLASSES):
        rows = np.flatnonzero(classes == k)
        # of very many points every so many-th, but of the worst class all
        rows = rows if k == CLASSES - 1 else rows[:: max(1, len(rows) * CLASSES // MOST_POINTS)]
        axes.plot(*xy[rows].T, "o", ms=POINT_SIZES[k], mfc=SHADES[k], mec=GREY, mew=0.25, zorder=2 + 0.1 * k)
    axes.plot(*xy[np.isinf(effect)].T, "x", ms=4.5, mew=1.0, color=INK, zorder=3)
    return limits


def _draw_photographs(axes: Axes, centre: np.ndarray, redundancy: np.ndarray) -> None:
    classes = _classes(redundancy, _limits(redundancy))
    for k in range(CLASSES):
        axes.plot(*centre[classes == k].T, "s", ms=_square(k), mfc="none", mec=INK, mew=0.8, zorder=4)


def _square(k: int) -> float:
    """Size of a photograph's square: the larger the less its rays are controlled."""
    return 8.0 - 1.1 * k


def _legends(figure: Figure, effect: np.ndarray, redundancy: np.ndarray, uncontrolled: int) -> None:
    points, photographs = [], []
    for k, label in _named(effect, ".2g", " m"):
        look: dict[str, Any] = {"marker": "o", "ms": POINT_SIZES[k], "mfc": SHADES[k], "mec": GREY, "mew": 0.25}
        points.append(Line2D([], [], ls="none", label=label, **look))
    if uncontrolled:
        points.append(Line2D([], [], ls="none", marker="x", ms=4.5, color=INK, label=f"of any size ({uncontrolled})"))
    for k, label in _named(redundancy, ".2f", ""):
        look = {"marker": "s", "ms": _square(k), "mfc": "none", "mec": INK, "mew": 0.8}
        photographs.append(Line2D([], [], ls="none", label=label, **look))
    width, height = figure.get_size_inches()
    for handles, title, top in (
        (points, "effect of an undetected error on the height of a point", 1.35),
        (photographs, "mean redundancy number of the rays of a photograph", 0.72),
    ):
        if handles:
            figure.legend(
                handles=handles, title=title, loc="upper left", bbox_to_anchor=(0.85 / width, top / height),
                ncols=3 if len(handles) > CLASSES else CLASSES,
                borderaxespad=0.0, handletextpad=0.3, columnspacing=1.1, alignment="left", title_fontsize=8.5,
            )  # fmt: skip


def _named(limits: np.ndarray, form: str, unit: str) -> list[tuple[int, str]]:
    """(class, its ends in words) of the classes there are; the first and the last are open."""
    if not len(limits):
        return []
    text = [f"{value:{form}}" for value in limits]
    last = max(len(limits) - 2, 0)
    first = CLASSES - 1 - last
    if last == 0:
        return [(first, f"{text[0]}{unit}")]
    named = [(first, f"below {text[1]}{unit}")]
    named += [(first + k, f"{text[k]} to {text[k + 1]}{unit}") for k in range(1, last)]
    return [*named, (first + last, f"above {text[last]}{unit}")]
