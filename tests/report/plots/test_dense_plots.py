"""Pictures of a dense surface: as far as it was measured, with the σ of matching."""

import numpy as np
from matplotlib.text import Text

from aerotri.rasters.grids import Grid
from aerotri.report.plots.terrain import plot_dense


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
    assert "σ of matching [m]" in words
