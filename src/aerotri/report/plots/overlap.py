"""In how many photographs every place of the ground is seen, as a map."""

from __future__ import annotations

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from aerotri.deformation.overlap import ENOUGH, Overlap, overlap_of
from aerotri.report.plots import plan
from aerotri.report.plots.canvas import GREY, INK, WIDTH, length_text, new_figure, nice_number, plain, styled
from aerotri.results.adjusted_block import AdjustedBlock

MOST = 9
"""The last class holds all that is seen so often or more; chosen [C]: more classes are not told apart."""
DARKEST, LIGHTEST = 0.35, 0.97
"""Grey of one photograph and of `MOST`; chosen [C]: dark is where too few see the ground."""
HATCHES = {1: "xxxx", 2: "////"}
"""Of the classes with too few photographs, so that print in black and white shows them."""


@styled
def plot_overlap(adjusted: AdjustedBlock, polygons: np.ndarray | None = None) -> Figure | None:
    """Photographs per ground cell; the darker the fewer, and hatched below three.

    Parameters
    ----------
    polygons : (n,) footprints over the relief (`deformation.footprints`); where None, those on the mean height of the
        ground.

    Returns
    -------
    None where no photograph sees the ground.
    """
    exact = polygons is not None
    prints = polygons if polygons is not None else _flat(adjusted)
    found = overlap_of(prints, adjusted.images.centre[:, :2])
    if found is None or not found.count.any():
        return None
    rows, columns = found.count.shape
    right, top = found.corner + found.cell * np.array([columns, rows])
    extent = plan.Extent(float(found.corner[0]), float(right), float(found.corner[1]), float(top))
    width, height = plan.plan_size(extent, WIDTH - 2.75, 6.2)
    ground = "the ground of the object points" if exact else "the mean height of the ground"
    figure = new_figure(
        0.95 + height + 0.95, f"Overlap – {plain(adjusted.block.name)}",
        f"{overlap_text(found)}\nfootprints on {ground}; cells of {length_text(found.cell)}",
    )  # fmt: skip
    axes = plan.plan_axes(figure, (0.95, 0.95, width, height), extent, plan.axis_names(adjusted))
    _draw_classes(axes, found)
    axes.plot(*adjusted.images.centre[:, :2].T, ".", ms=2.0 if len(adjusted.block.images) < 500 else 0.8, color=INK)
    _legend(figure, found, (0.95 + width + 0.25, 0.95 + height))
    _scale_bar(figure, axes, width)
    return figure


def overlap_text(found: Overlap) -> str:
    """Areas seen, and seen too rarely, in words."""
    seen, few = found.area(1), found.area(1, ENOUGH - 1)
    text = f"seen: {area_text(seen)}, by fewer than {ENOUGH} photographs: {area_text(few)} ({100 * few / seen:.0f} %)"
    hull = float(found.inside.sum()) * found.cell**2
    if hull <= 0.0:
        return text
    inside = found.area(0, ENOUGH - 1, inside=True)
    return f"{text}; within the outermost projection centres {100 * inside / hull:.1f} %"


def area_text(square_metres: float) -> str:
    """An area in the unit that suits it."""
    for unit, size in (("km²", 1e6), ("ha", 1e4)):
        if square_metres >= size:
            return (
                f"{square_metres / size:.3g} {unit}"
                if square_metres < 1e3 * size
                else f"{square_metres / size:.0f} {unit}"
            )
    return f"{square_metres:.0f} m²" if square_metres >= 100.0 else f"{square_metres:.3g} m²"


def _flat(adjusted: AdjustedBlock) -> np.ndarray:
    """(n,) polygons on the mean height of the ground, None of photographs that see the horizon."""
    corners = plan.footprints(adjusted)
    there = np.isfinite(corners).all(axis=(1, 2))
    polygons = np.full(len(corners), None)
    polygons[there] = shapely.polygons(corners[there])
    return polygons


def _greys() -> list[tuple[float, float, float]]:
    return [(grey, grey, grey) for grey in np.linspace(DARKEST, LIGHTEST, MOST).tolist()]


def _draw_classes(axes: Axes, found: Overlap) -> None:
    rows, columns = found.count.shape
    x, y = (found.corner[k] + found.cell * np.arange(size + 1) for k, size in enumerate((columns, rows)))
    shown = np.ma.masked_equal(np.minimum(found.count, MOST), 0)
    norm = BoundaryNorm(np.arange(0.5, MOST + 1.0), MOST)
    axes.pcolormesh(x, y, shown, cmap=ListedColormap(_greys()), norm=norm, zorder=0, rasterized=True)
    middle = (x[:-1] + 0.5 * found.cell, y[:-1] + 0.5 * found.cell)
    for number, hatch in HATCHES.items():
        own = (found.count == number).astype(float)
        if own.any() and min(own.shape) > 1:
            drawn = axes.contourf(*middle, own, levels=[0.5, 1.5], colors="none", hatches=[hatch], zorder=1)
            drawn.set_edgecolor("white")
            drawn.set_linewidth(0.0)
    if min(found.count.shape) > 1 and found.count.min() < ENOUGH <= found.count.max():
        axes.contour(*middle, found.count, levels=[ENOUGH - 0.5], colors=[INK], linewidths=1.1, zorder=2)


def _legend(figure: Figure, found: Overlap, at: tuple[float, float]) -> None:
    """The classes that occur, with their share of the ground that is seen."""
    width, height = figure.get_size_inches()
    handles: list[Patch | Line2D] = []
    for number, grey in enumerate(_greys(), start=1):
        share = found.area(number, number if number < MOST else None) / found.area(1)
        label = f"{number}{' or more' if number == MOST else ''}: {100 * share:.0f} %"
        handles.append(Patch(facecolor=grey, edgecolor="white" if number in HATCHES else GREY,
                             hatch=HATCHES.get(number), lw=0.6, label=label))  # fmt: skip
    handles.append(Line2D([], [], color=INK, lw=1.1, label=f"from {ENOUGH} on"))
    handles.append(Line2D([], [], ls="none", marker=".", color=INK, ms=3, label="centres"))
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(at[0] / width, at[1] / height), ncols=1,
                  borderaxespad=0.0, title="photographs", alignment="left", title_fontsize=8.5)  # fmt: skip


def _scale_bar(figure: Figure, axes: Axes, width: float) -> None:
    """A round length below the axes."""
    low, high = axes.get_xlim()
    length = nice_number((high - low) / 4.0)
    figure_width, figure_height = figure.get_size_inches()
    left, y = 0.95 / figure_width, 0.3 / figure_height
    right = left + length / (high - low) * width / figure_width
    figure.add_artist(Line2D([left, right], [y, y], color=INK, lw=2.5, solid_capstyle="butt"))
    figure.text(right + 0.08 / figure_width, y, length_text(length), va="center", fontsize=8.5)
