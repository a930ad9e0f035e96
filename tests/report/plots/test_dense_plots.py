"""Pictures of a dense surface: as far as it was measured, with the σ of heights."""

from types import SimpleNamespace

import numpy as np
from matplotlib.text import Text

from aerotri.public.dense_plots import DensePlots
from aerotri.rasters.grids import Grid
from aerotri.report.plots.terrain import plot_dense
from aerotri.terrain.dense.tile_files import tile_windows


def test_the_picture_ends_where_measured_cells_end():
    grid = Grid(40, 50, 1000.0, 2000.0, 0.5, 0.5)
    z, matching = np.full((40, 50), np.nan), np.full((40, 50), np.nan)
    rows, columns = np.mgrid[10:20, 5:35]
    z[10:20, 5:35] = 0.3 * rows + 0.1 * columns
    matching[10:20, 5:35] = 0.01 + 0.001 * columns
    z[12, 7] = matching[12, 7] = np.nan
    figure = plot_dense(grid, z, matching, 0.077, "block", True)
    for axes in figure.axes[:2]:
        assert axes.images[0].get_extent() == [1002.5, 1017.5, 1990.0, 1995.0]
    drawn = np.ma.filled(np.ma.asarray(figure.axes[1].images[0].get_array()), np.nan)
    np.testing.assert_array_equal(drawn, matching[10:20, 5:35])
    words = " ".join(text.get_text() for text in figure.findobj(Text))
    assert "0.077 m" in words
    assert "σ of Z [m]" in words


def test_every_cell_that_is_drawn_is_of_one_tile():
    """Also where tiles end between two cells that are drawn, and where the last one is a row high."""
    rng = np.random.default_rng(4)
    for rows, columns in [(2401, 1300), (1202, 2402), *rng.integers(1, 5000, (30, 2)).tolist()]:
        grid = Grid(rows, columns, 0.0, 0.0, 1.0, 1.0)
        plots = DensePlots(SimpleNamespace(grid=grid), "block")
        drawn = np.zeros((plots._drawn.rows, plots._drawn.columns), int)
        for window in tile_windows(grid, int(rng.integers(16, 700))):
            taken, place = plots._place(window)
            drawn[place] += np.ones((window.rows, window.columns), int)[taken]
        assert (drawn == 1).all()
