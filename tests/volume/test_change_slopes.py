"""Slopes by which a change of two surfaces is aligned: beside holes and at the edge as elsewhere."""

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.rasters.grids import Grid
from aerotri.volume.change.alignment import align, slopes_of

SIDE, SIGMA_M = 60, 0.03
GRID = Grid(SIDE, SIDE, 10.0, 90.0, 0.5, 0.25)
X, Y = np.meshgrid(GRID.x(np.arange(SIDE)), GRID.y(np.arange(SIDE)))


def holes(share):
    return np.random.default_rng(1).random((SIDE, SIDE)) < share


@pytest.mark.parametrize("share", [0.0, 0.4])
def test_slopes_of_a_plane_are_exact(share):
    z = np.where(holes(share), np.nan, 5.0 + 0.3 * X - 0.2 * Y)
    z[20:30, 5:40] = np.nan
    along, up = slopes_of(GRID, z)
    known = np.isfinite(z)
    assert np.isfinite(along[known]).mean() > 0.99
    assert np.isnan(along[~known]).all()
    np.testing.assert_allclose(along[np.isfinite(along)], 0.3, rtol=1e-9)
    np.testing.assert_allclose(up[np.isfinite(up)], -0.2, rtol=1e-9)


def test_a_lonely_cell_and_a_surface_without_heights_have_no_slope():
    z = np.full((SIDE, SIDE), np.nan)
    assert np.isnan(slopes_of(GRID, z)[0]).all()
    z[30, 30] = 1.0
    assert np.isnan(slopes_of(GRID, z)).all()


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_edges_and_holes_do_not_enlarge_a_shift(share):
    """The same noise with and without the shift, so that noise is not in the answer."""

    def ground(x, y):
        return 2.0 * np.sin(x / 6.0) * np.cos(y / 4.0)

    one, other = np.random.default_rng(2).normal(scale=SIGMA_M, size=(2, SIDE, SIDE))
    one = np.where(holes(share), np.nan, one)

    def shift(true):
        first, second = ground(X, Y) + one, ground(X - true[0], Y - true[1]) + other
        every, sigma = np.ones((SIDE, SIDE), bool), np.full((SIDE, SIDE), np.sqrt(2.0) * SIGMA_M)
        return align(GRID, 0.5 * (first + second), second - first, sigma, every, "shift").values[1:]

    true = np.array([0.1, 0.1])
    np.testing.assert_allclose(shift(true) - shift(0.0 * true), true, rtol=0.02)


@pytest.mark.parametrize("how", ["shift", "tilt"])
@pytest.mark.parametrize("slope", [0.0, 0.1])
def test_a_plane_determines_no_shift(how, slope):
    """Level ground as an airfield, or a ramp, without noise, as a DEM in whole metres has it."""
    z = 100.0 + slope * X
    every, sigma = np.ones((SIDE, SIDE), bool), np.full((SIDE, SIDE), SIGMA_M)
    with pytest.raises(InputError, match="does not determine a shift"):
        align(GRID, z, np.full(z.shape, 0.3), sigma, every, how)
    assert align(GRID, z, np.full(z.shape, 0.3), sigma, every, "height").values == pytest.approx([0.3])
