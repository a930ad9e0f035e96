"""Plots of a dense surface: its shape, the σ of its heights, and its colours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aerotri.rasters.grids import Grid
    from aerotri.terrain.dense.measure import DenseOutcome
    from aerotri.terrain.dense.tile_files import TileWindow

DRAWN = 1200
"""Cells drawn along a side, the others skipped."""


@dataclass(frozen=True, eq=False)
class DensePlots:
    """Plots of a dense surface, each a matplotlib Figure.

    Parameters
    ----------
    record : what was measured. block : name of the block.
    """

    record: DenseOutcome
    block: str

    def surface(self) -> Figure:
        """The surface, lit from the north-west as far as it was measured, and the σ of its heights."""
        from aerotri.report.plots.terrain import plot_dense

        o, drawn = self.record, self._drawn
        z, matching, total = (np.full((drawn.rows, drawn.columns), np.nan) for _ in range(3))
        for window, tile in o.files.read_all(list(o.windows)):
            grid = o.grid.window(window.row, window.column, window.rows, window.columns)
            taken, place = self._place(window)
            sigma = np.hypot(tile.sigma, o.shared.over(grid))
            for whole, part in ((z, tile.z), (matching, tile.sigma), (total, sigma)):
                whole[place] = part[taken]
        is_local = o.photographs.places.frame is None
        return plot_dense(drawn, z, total, float(np.nanmedian(matching)), self.block, is_local)

    def colours(self) -> Figure:
        """The measured cells in the colours of the photographs.

        Raises
        ------
        InputError
            When a photograph cannot be read any more.
        """
        from aerotri.report.plots.colours import plot_colours
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
        return {"surface": self.surface(), "colours": self.colours()}
