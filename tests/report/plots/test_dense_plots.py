"""Pictures of a dense surface: as far as it was measured, with the σ of heights and the number of photographs."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from aerotri.public.dense_plots import DensePlots
from aerotri.rasters.grids import Grid
from aerotri.report.plots.dense import DrawnSurface, plot_colours, plot_dense, plot_dense_sigma, plot_photographs
from aerotri.terrain.dense.tile_files import tile_windows

MEDIANS = {"median": 0.077, "matching": 0.012}
MEASURED = np.s_[10:20, 5:35]


@pytest.fixture
def drawn():
    grid = Grid(40, 50, 1000.0, 2000.0, 0.5, 0.5)
    z, sigma = np.full((40, 50), np.nan), np.full((40, 50), np.nan)
    rows, columns = np.mgrid[MEASURED]
    z[MEASURED] = 0.3 * rows + 0.1 * columns
    sigma[MEASURED] = 0.01 + 0.001 * columns
    count = np.where(np.isfinite(z), 2 + np.arange(50) % 9, 0)
    z[12, 7] = sigma[12, 7] = np.nan
    count[12, 7] = 0
    return DrawnSurface(grid, z, sigma, count, 0.5, "block", True)


def words(figure):
    FigureCanvasAgg(figure).draw()
    return " ".join(text.get_text() for text in figure.findobj(Text))


def values(figure):
    return np.ma.filled(np.ma.asarray(figure.axes[0].images[0].get_array(), dtype=float), np.nan)


def test_the_pictures_end_where_measured_cells_end(drawn):
    known = np.isfinite(drawn.z)
    colours = np.zeros((40, 50, 3), np.uint16)
    for figure in (
        plot_dense(drawn), plot_dense_sigma(drawn, MEDIANS), plot_photographs(drawn),
        plot_colours(drawn.grid, colours, known, "block", True),
    ):  # fmt: skip
        assert figure.axes[0].images[0].get_extent() == [1002.5, 1017.5, 1990.0, 1995.0]
        assert figure.axes[0].get_xlabel() == "X (local) [m]"


def test_sigma_is_drawn_as_it_is(drawn):
    figure = plot_dense_sigma(drawn, MEDIANS)
    np.testing.assert_array_equal(values(figure), drawn.sigma[MEASURED])
    said = words(figure)
    assert "median 0.077 m; of matching alone 0.012 m" in said
    assert "σ of Z [m]" in said


def test_photographs_are_counted_and_many_look_alike(drawn):
    figure = plot_photographs(drawn)
    shown, count = values(figure), drawn.count[MEASURED]
    np.testing.assert_array_equal(np.isnan(shown), count == 0)
    np.testing.assert_array_equal(shown[count > 0], np.clip(count[count > 0], 2, 8))
    assert [text.get_text() for text in figure.axes[1].get_yticklabels()] == ["2", "3", "4", "5", "6", "7", "≥ 8"]
    # what is measured by few is darker than what is measured by many
    image = figure.axes[0].images[0]
    few, many = (image.cmap(image.norm(k))[0] for k in (2, 8))
    assert few < many < 1.0


def test_every_cell_that_is_drawn_is_of_one_tile():
    """Also where tiles end between two cells that are drawn, and where the last one is a row high."""
    rng = np.random.default_rng(4)
    for rows, columns in [(2401, 1300), (1202, 2402), *rng.integers(1, 5000, (30, 2)).tolist()]:
        grid = Grid(rows, columns, 0.0, 0.0, 1.0, 1.0)
        plots = DensePlots(SimpleNamespace(grid=grid), "block", MEDIANS)
        drawn = np.zeros((plots._drawn.rows, plots._drawn.columns), int)
        for window in tile_windows(grid, int(rng.integers(16, 700))):
            taken, place = plots._place(window)
            drawn[place] += np.ones((window.rows, window.columns), int)[taken]
        assert (drawn == 1).all()
