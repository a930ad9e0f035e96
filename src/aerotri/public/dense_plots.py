"""Plots of a dense surface: its shape, its colours, the σ of its heights, and how many photographs measured it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aerotri.rasters.grids import Grid
    from aerotri.report.plots.dense import DrawnSurface
    from aerotri.terrain.dense.measure import DenseOutcome
    from aerotri.terrain.dense.tile_files import TileWindow

DRAWN = 1200
"""Cells drawn along a side, the others skipped."""


@dataclass(frozen=True, eq=False)
class DensePlots:
    """Plots of a dense surface, each a matplotlib Figure.

    Parameters
    ----------
    record : what was measured. block : name of the block. medians : m, of σ, as sigma_Z_m of dsm.json has them.
    """

    record: DenseOutcome
    block: str
    medians: Mapping[str, float]

    def surface(self) -> Figure:
        """The surface, lit from the north-west as far as it was measured."""
        from aerotri.report.plots.dense import plot_dense

        return plot_dense(self._layers)

    def sigma(self) -> Figure:
        """The σ of the heights, of matching and adjustment together."""
        from aerotri.report.plots.dense import plot_dense_sigma

        return plot_dense_sigma(self._layers, self.medians)

    def photographs(self) -> Figure:
        """How many photographs measured a cell."""
        from aerotri.report.plots.dense import plot_photographs

        return plot_photographs(self._layers)

    def colours(self) -> Figure:
        """The measured cells in the colours of the photographs.

        Raises
        ------
        InputError
            When a photograph cannot be read any more.
        """
        from aerotri.report.plots.dense import plot_colours
        from aerotri.terrain.dense.colours import Colours

        o, drawn = self.record, self._drawn
        colours = Colours(o.photographs, o.paths, drawn.cell_x)
        shown, known = np.zeros((drawn.rows, drawn.columns, 3), np.uint16), np.zeros((drawn.rows, drawn.columns), bool)
        for window, tile in o.files.read_all(list(o.windows)):
            taken, place = self._place(window)
            z = tile.z[taken]
            i, j = np.nonzero(np.isfinite(z))
            xyz = np.column_stack([drawn.x(j + place[1].start), drawn.y(i + place[0].start), z[i, j]])
            # the first of the cells that are drawn as one
            xyz[:, 0] -= 0.5 * (drawn.cell_x - o.grid.cell_x)
            xyz[:, 1] += 0.5 * (drawn.cell_y - o.grid.cell_y)
            shown[place][i, j] = colours.of(xyz, tile.shown_by[taken][i, j])
            known[place] = np.isfinite(z)
        return plot_colours(drawn, shown, known, self.block, o.photographs.places.frame is None)

    @cached_property
    def _layers(self) -> DrawnSurface:
        """The cells that are drawn."""
        from aerotri.report.plots.dense import DrawnSurface

        o, drawn = self.record, self._drawn
        z, total, count = (np.full((drawn.rows, drawn.columns), np.nan) for _ in range(3))
        for window, tile in o.files.read_all(list(o.windows)):
            grid = o.grid.window(window.row, window.column, window.rows, window.columns)
            taken, place = self._place(window)
            sigma = np.hypot(tile.sigma, o.shared.over(grid))
            for whole, part in ((z, tile.z), (total, sigma), (count, tile.count)):
                whole[place] = part[taken]
        is_local = o.photographs.places.frame is None
        return DrawnSurface(drawn, z, total, np.nan_to_num(count).astype(np.int16), o.grid.cell_x, self.block, is_local)

    @property
    def _step(self) -> int:
        """Cells of the surface from one that is drawn to the next."""
        return max(-(-max(self.record.grid.rows, self.record.grid.columns) // DRAWN), 1)

    @property
    def _drawn(self) -> Grid:
        return self.record.grid.coarser(self._step)

    def _place(self, window: TileWindow) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
        """Cells of a tile that are drawn, and where among all that are drawn."""
        step = self._step
        taken, place = [], []
        for start, size in ((window.row, window.rows), (window.column, window.columns)):
            first = -start % step
            begin = (start + first) // step
            taken.append(slice(first, None, step))
            place.append(slice(begin, begin + len(range(first, size, step))))
        return (taken[0], taken[1]), (place[0], place[1])

    def all(self) -> dict[str, Figure]:
        """Every plot by the name of its file."""
        return {
            "surface": self.surface(), "colours": self.colours(), "sigma": self.sigma(),
            "photographs": self.photographs(),
        }  # fmt: skip
