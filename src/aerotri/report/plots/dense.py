"""A dense surface as maps: its shape, its colours, the σ of its heights, and how many photographs measured a cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from aerotri.rasters.grids import Grid
from aerotri.report.plots.canvas import length_text, plain, styled
from aerotri.report.plots.maps import extent_of, scale_beside, single_map
from aerotri.report.plots.terrain import plot_grey, plot_shape
from aerotri.report.quality import two_digits

OUTLYING = 0.002
"""Share of the measured cells at each side of a picture that may lie beyond it [C]: a few far cells would shrink it."""
DARKEST, BRIGHTEST = 0.5, 99.5
"""Per cent of the colours that are drawn black and white, or beyond."""
LEAST_TOLD, MOST_TOLD = 2, 8
"""Photographs of a cell that have a grey tone of their own; more look alike."""


@dataclass(frozen=True, eq=False)
class DrawnSurface:
    """A dense surface, or every so many of its cells.

    Parameters
    ----------
    grid : of the cells. z, sigma : (rows, columns) m, heights and their σ, NaN where not measured.
    count : (rows, columns) photographs that measured a cell. cell : m, of the surface itself.
    name : of the block. is_local : whether it has no CRS.
    """

    grid: Grid
    z: np.ndarray
    sigma: np.ndarray
    count: np.ndarray
    cell: float
    name: str
    is_local: bool

    @property
    def cut(self) -> DrawnSurface:
        """As far as nearly all measured cells reach."""
        grid, part = measured_part(self.grid, np.isfinite(self.z))
        arrays = {name: getattr(self, name)[part] for name in ("z", "sigma", "count")}
        return replace(self, grid=grid, **arrays)


def measured_part(grid: Grid, known: np.ndarray) -> tuple[Grid, tuple[slice, slice]]:
    """The part of a grid that holds nearly all cells that are known, (rows, columns) bool."""
    (top, last_row), (left, last_column) = (_between(known.sum(axis=axis)) for axis in (1, 0))
    part = slice(top, last_row + 1), slice(left, last_column + 1)
    return grid.window(top, left, last_row + 1 - top, last_column + 1 - left), part


def _between(counts: np.ndarray) -> tuple[int, int]:
    """First and last row, or column, between which nearly all measured cells lie."""
    share = np.cumsum(counts) / max(int(counts.sum()), 1)
    first, last = np.searchsorted(share, [OUTLYING, 1.0 - OUTLYING])
    return int(first), int(min(last, len(counts) - 1))


def plot_dense(drawn: DrawnSurface) -> Figure:
    """The surface lit from the north-west."""
    d = drawn.cut
    subtitle = (
        f"cells of {_length(d.cell)}; heights {np.nanmin(d.z):.1f} … {np.nanmax(d.z):.1f} m; white: not measured"
    ).replace("-", "−")
    return plot_shape(d.grid, d.z, f"Surface – {plain(d.name)}", subtitle, d.is_local)


def plot_dense_sigma(drawn: DrawnSurface, medians: Mapping[str, float]) -> Figure:
    """The σ of the heights, of matching and adjustment together.

    Parameters
    ----------
    medians : m, over all cells: the whole as 'median', and that of 'matching' alone.
    """
    d = drawn.cut
    median, matching = (two_digits(medians[name]) for name in ("median", "matching"))
    subtitle = f"median {median} m; of matching alone {matching} m; white: not measured"
    return plot_grey(d.grid, d.sigma, (f"σ of the heights – {plain(d.name)}", subtitle, "σ of Z [m]"), d.is_local)


@styled
def plot_photographs(drawn: DrawnSurface) -> Figure:
    """How many photographs measured a cell: the number of its rays."""
    d = drawn.cut
    known = d.count > 0
    subtitle = f"mean {d.count[known].mean():.1f}; white: not measured" if known.any() else "nothing was measured"
    title = f"Photographs that measured a cell – {plain(d.name)}"
    figure, axes = single_map(title, subtitle, d.grid.bounds, d.is_local)
    most = int(np.clip(d.count.max(initial=0), LEAST_TOLD + 1, MOST_TOLD))
    classes = np.arange(LEAST_TOLD, most + 1)
    norm = BoundaryNorm(np.append(classes - 0.5, most + 0.5), len(classes))
    # the fewest are the doubtful ones: dark
    tones = colormaps["gray"].resampled(len(classes) + 2)(np.arange(1, len(classes) + 1))
    image = axes.imshow(
        np.where(known, np.clip(d.count, LEAST_TOLD, most), np.nan), cmap=ListedColormap(tones.tolist()), norm=norm,
        extent=extent_of(d.grid.bounds), interpolation="nearest",
    )  # fmt: skip
    scale = scale_beside(figure, axes, image, "photographs")
    beyond = int(d.count.max(initial=0)) > most
    names = [f"{k}" for k in classes[:-1]] + [f"≥ {most}" if beyond else f"{most}"]
    scale.set_ticks(classes.tolist(), labels=names)
    return figure


@styled
def plot_colours(grid: Grid, colour: np.ndarray, known: np.ndarray, name: str, is_local: bool) -> Figure:
    """A surface as it looks from above.

    Parameters
    ----------
    colour : (rows, columns, 3) of the cells. known : (rows, columns) bool, which were measured.
    """
    own, part = measured_part(grid, known)
    shown, there = colour[part].astype(float), known[part]
    low, high = np.percentile(shown[there], [DARKEST, BRIGHTEST]) if there.any() else (0.0, 1.0)
    picture = np.clip((shown - low) / max(high - low, 1e-9), 0.0, 1.0)
    picture[~there] = 1.0
    subtitle = (
        f"each cell in the colour of a photograph that measured it, drawn every {_length(grid.cell_x)}; "
        "white: not measured"
    )
    figure, axes = single_map(f"Surface in colours – {plain(name)}", subtitle, own.bounds, is_local)
    axes.imshow(picture, extent=extent_of(own.bounds), interpolation="nearest")
    return figure


def _length(metres: float) -> str:
    return length_text(float(f"{metres:.3g}"))
