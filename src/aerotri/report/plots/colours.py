"""The cells of a dense surface in the colours of the photographs, as a picture."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from aerotri.rasters.grids import Grid
from aerotri.report.plots.canvas import WIDTH, axes_at, coordinate_axes, length_text, new_figure, plain, styled
from aerotri.report.plots.terrain import HIGHEST, between

DARKEST, BRIGHTEST = 0.5, 99.5
"""Per cent of the colours that are drawn black and white, or beyond."""


@styled
def plot_colours(grid: Grid, colour: np.ndarray, known: np.ndarray, name: str, is_local: bool) -> Figure:
    """A surface as it looks from above.

    Parameters
    ----------
    colour : (rows, columns, 3) of the cells. known : (rows, columns) bool, which were measured.
    """
    rows, columns = (between(known.sum(axis=axis)) for axis in (1, 0))
    part = np.s_[rows[0] : rows[1] + 1, columns[0] : columns[1] + 1]
    shown, there = colour[part].astype(float), known[part]
    low, high = np.percentile(shown[there], [DARKEST, BRIGHTEST]) if there.any() else (0.0, 1.0)
    picture = np.clip((shown - low) / max(high - low, 1e-9), 0.0, 1.0)
    picture[~there] = 1.0
    own = grid.window(rows[0], columns[0], *there.shape)
    left, bottom, right, top = own.bounds
    ratio = (top - bottom) / (right - left)
    width = min(WIDTH - 1.6, HIGHEST / ratio)
    subtitle = (
        f"each cell in the colour of a photograph that measured it, drawn every "
        f"{length_text(float(f'{grid.cell_x:.3g}'))}; white: not measured"
    )
    figure = new_figure(width * ratio + 1.75, f"Surface in colours – {plain(name)}", subtitle)
    axes = axes_at(figure, 0.95, 0.75, width, width * ratio)
    axes.imshow(picture, extent=(left, right, bottom, top), interpolation="nearest")
    coordinate_axes(axes, width, width * ratio, ("X (local) [m]", "Y (local) [m]") if is_local else ("E [m]", "N [m]"))
    return figure
