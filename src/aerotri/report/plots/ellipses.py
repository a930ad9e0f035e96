"""Error ellipses of the object points on the plan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

from aerotri.quantiles import chi_square_quantile
from aerotri.report.plots import plan
from aerotri.report.plots.accuracy import heights_with_sigma, shade_classes
from aerotri.report.plots.canvas import INK, LIGHT, WIDTH, axes_at, length_text, new_figure, nice_number, plain, styled
from aerotri.results.adjusted_block import AdjustedBlock

CELLS = 22
"""Cells along the longer side, one ellipse in each; chosen [C]: more of them touch."""
PROBABILITY = 0.95
FILLED = 0.9
"""Share of a cell that a large ellipse fills; chosen [C]: neighbours then do not touch."""


@dataclass(frozen=True, eq=False)
class Ellipses:
    """Error ellipses in plan of n points.

    Parameters
    ----------
    point : (n,) index into the block's points. major, minor : (n,) m, semi-axes for `PROBABILITY`.
    angle : (n,) degrees of the longer one, from X towards Y. height : (n,) m, σ of Z.
    """

    point: np.ndarray
    major: np.ndarray
    minor: np.ndarray
    angle: np.ndarray
    height: np.ndarray


def error_ellipses(adjusted: AdjustedBlock) -> Ellipses:
    """The ellipses of all points that have a covariance, with the model part of σ where there is one."""
    point = np.flatnonzero(heights_with_sigma(adjusted))
    covariance = adjusted.points.total_covariance[point]
    size, axes = np.linalg.eigh(covariance[:, :2, :2])
    root = np.sqrt(np.maximum(size, 0.0) * float(chi_square_quantile(PROBABILITY, 2)))
    angle = np.degrees(np.arctan2(axes[:, 1, 1], axes[:, 0, 1]))
    return Ellipses(point, root[:, 1], root[:, 0], angle, np.sqrt(covariance[:, 2, 2]))


@styled
def plot_error_ellipses(adjusted: AdjustedBlock) -> Figure | None:
    """One ellipse in every cell of a grid, that of the point of median size; the darker the larger σ of its height.

    Returns
    -------
    None where no point has a covariance.
    """
    found = error_ellipses(adjusted)
    if not len(found.point):
        return None
    xy = adjusted.points.xyz[found.point, :2]
    extent = plan.extent_of(xy)
    width, height = plan.plan_size(extent, WIDTH - 2.4, 6.4)
    cell = max(extent.width, extent.height) / CELLS
    shown = one_a_cell(xy, found.major, cell)
    larger = nice_number(FILLED * cell / (2.0 * float(np.quantile(found.major[shown], 0.75))))
    worst = int(np.argmax(found.major))
    name = plain(adjusted.block.points[found.point[worst]], 24)
    subtitle = (
        f"{100 * PROBABILITY:.0f} % ellipses, {_enlarged(larger)} than the plan; {len(shown)} of {len(xy)} points: the "
        "one of median size in every cell\n"
        f"longer semi-axis of all: median {np.median(found.major):.3g} m, 95 % below "
        f"{np.quantile(found.major, 0.95):.3g} m, largest {found.major[worst]:.3g} m ({name})"
    )
    figure = new_figure(1.1 + height + 0.9, f"Error ellipses – {plain(adjusted.block.name)}", subtitle)
    axes = plan.plan_axes(figure, (0.95, 1.1, width, height), extent, plan.axis_names(adjusted))
    axes.plot(*adjusted.images.centre[:, :2].T, ".", ms=1.5, color=LIGHT, zorder=1)
    norm, shades = shade_classes(found.height[shown])
    ellipses = EllipseCollection(
        2.0 * larger * found.major[shown], 2.0 * larger * found.minor[shown], found.angle[shown], units="xy",
        offsets=xy[shown], offset_transform=axes.transData, facecolors=shades(norm(found.height[shown])),
        edgecolors=INK, linewidths=0.7, zorder=3,
    )  # fmt: skip
    axes.add_collection(ellipses, autolim=False)
    scale = axes_at(figure, 0.95 + width + 0.2, 1.1, 0.16, height)
    figure.colorbar(ScalarMappable(norm, shades), cax=scale).set_label("σ of Z [m]")
    _scale(figure, larger, (axes.get_xlim()[1] - axes.get_xlim()[0]) / width)
    return figure


def _enlarged(factor: float) -> str:
    """'20 times larger'."""
    return f"{factor:.10g} times larger" if factor >= 1.0 else f"{1.0 / factor:.10g} times smaller"


def one_a_cell(xy: np.ndarray, size: np.ndarray, cell: float) -> np.ndarray:
    """Rows of the point of median size in every cell of a grid.

    Parameters
    ----------
    xy : (n, 2) m. size : (n,). cell : m, side of a cell.
    """
    column, row = np.floor((xy - xy.min(axis=0)) / cell).astype(np.int64).T
    key = row * (column.max() + 1) + column
    order = np.lexsort((size, key))
    _, first, count = np.unique(key[order], return_index=True, return_counts=True)
    return order[first + (count - 1) // 2]


def _scale(figure: Figure, larger: float, metres_per_inch: float) -> None:
    """A round length as the semi-axes are drawn, below the plan."""
    length = nice_number(0.7 * metres_per_inch / larger)
    inches = length * larger / metres_per_inch
    width, height = figure.get_size_inches()
    axes = axes_at(figure, 0.95, 0.2, inches, 0.2)
    axes.plot([0, 1], [0.5, 0.5], color=INK, lw=2.0, solid_capstyle="butt")
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1)
    axes.axis("off")
    text = f"{length_text(length)} of a semi-axis"
    figure.text((0.95 + inches + 0.1) / width, 0.3 / height, text, va="center", fontsize=8.5)
