"""Tiles of a dense surface go over into one another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rendered_blocks import rendered_block

from aerotri.rasters.grids import Grid
from aerotri.terrain.dense import measure
from aerotri.terrain.dense.measure import DensePlan, measure_surface
from aerotri.terrain.dense.tile_files import TileFiles, tile_windows
from aerotri.terrain.dense.tile_surface import TileSurface, empty_tile, rim_of
from aerotri.terrain.pickets import Area

SIDE, SPARE, PIXEL_M = 20, 4, 3.0


def written(folder, rows, columns, height_of) -> tuple[TileFiles, list]:
    """Tiles of a grid; height_of : (number of the tile, rows, columns) m, of cells beyond the edges too."""
    files = TileFiles(folder, 0, SIDE)
    windows = tile_windows(Grid(rows, columns, 0.0, 0.0, 1.0, 1.0), SIDE)
    for window in windows:
        number = window.row // SIDE, window.column // SIDE
        row, column = np.mgrid[-SPARE : window.rows + SPARE, -SPARE : window.columns + SPARE]
        z = height_of(number, row + window.row, column + window.column).astype(float)
        own = z[SPARE:-SPARE, SPARE:-SPARE]
        none = np.zeros((0, 2), int), np.zeros(0), np.nan, PIXEL_M
        tile = TileSurface(own, 0.1 * np.ones_like(own), np.ones_like(own, np.uint64), np.array([0]), 1.0, *none,
                           rim_of(z, SPARE))  # fmt: skip
        files.write(window, tile)
    return files, windows


def whole(files, windows, rows, columns):
    z = np.full((rows, columns), np.nan)
    for w, tile in files.read_all(windows):
        z[w.row : w.row + w.rows, w.column : w.column + w.columns] = tile.z
    return z


@pytest.mark.parametrize("shape", [(45, 63), (40, 60), (20, 41), (22, 20)])
def test_tiles_that_agree_stay_as_they_are(tmp_path, shape):
    """Whatever the last tiles of rows and columns have left."""

    def height_of(_, row, column):
        return 100.0 + 0.3 * row - 0.2 * column + np.sin(0.4 * row) * np.cos(0.3 * column)

    files, windows = written(tmp_path, *shape, height_of)
    truth = height_of(0, *np.mgrid[: shape[0], : shape[1]])
    np.testing.assert_allclose(whole(files, windows, *shape), truth, atol=1e-12)


def test_step_between_tiles_becomes_a_ramp_over_what_both_measured(tmp_path):
    files, windows = written(tmp_path, SIDE, 2 * SIDE, lambda number, row, _: 10.0 + number[1] + 0.0 * row)
    z = whole(files, windows, SIDE, 2 * SIDE)
    ramp = 10.0 + (np.arange(2 * SPARE) + 0.5) / (2 * SPARE)
    np.testing.assert_allclose(z, np.tile([*[10.0] * (SIDE - SPARE), *ramp, *[11.0] * (SIDE - SPARE)], (SIDE, 1)))


def test_four_tiles_that_meet_in_a_corner(tmp_path):
    """Nowhere a step larger than that of the ramps, and each tile's own height away from the others."""
    heights = np.array([[0.0, 1.0, 0.2], [2.0, 0.5, 1.4]])
    files, windows = written(tmp_path, 2 * SIDE, 2 * SIDE + 7, lambda number, row, _: heights[number] + 0.0 * row)
    z = whole(files, windows, 2 * SIDE, 2 * SIDE + 7)
    most = 2.0 / (2 * SPARE)
    assert max(np.abs(np.diff(z, axis=0)).max(), np.abs(np.diff(z, axis=1)).max()) <= most + 1e-12
    assert z[SIDE - 1 : SIDE + 1, SIDE - 1 : SIDE + 1].mean() == pytest.approx(heights[:, :2].mean())
    assert z[[3, 3, -3], [3, SIDE + 10, 3]].tolist() == [0.0, 1.0, 2.0]


def test_roof_of_one_tile_and_ground_of_the_other_are_not_averaged(tmp_path):
    def height_of(number, row, column):
        return np.where(row < 10, 1.2 * PIXEL_M, 0.5) * number[1] + 0.0 * column

    files, windows = written(tmp_path, SIDE, 2 * SIDE, height_of)
    z = whole(files, windows, SIDE, 2 * SIDE)
    assert set(np.unique(z[:10])) == {0.0, 1.2 * PIXEL_M}
    assert 0.2 < z[15, SIDE - 1] < 0.25 < z[15, SIDE] < 0.3


def test_holes_stay_and_empty_neighbours_change_nothing(tmp_path):
    def height_of(number, row, column):
        return np.where((row + column) % 5 == 0, np.nan, 5.0 + number[1])

    files, windows = written(tmp_path, SIDE, 3 * SIDE, height_of)
    files.write(windows[2], replace(empty_tile((SIDE, SIDE)), pixel=PIXEL_M))
    z = whole(files, windows, SIDE, 3 * SIDE)
    holes = np.isnan(height_of((0, 0), *np.mgrid[:SIDE, : 3 * SIDE]))
    holes[:, 2 * SIDE :] = True
    np.testing.assert_array_equal(np.isnan(z), holes)
    np.testing.assert_array_equal(z[:, SIDE + 10 : 2 * SIDE][~holes[:, SIDE + 10 : 2 * SIDE]], 6.0)


def test_what_a_tile_measures_beyond_its_edge_is_what_its_neighbour_measures(tmp_path, monkeypatch):
    """On the flank of a hill: a cell off would be a metre off."""
    monkeypatch.setattr(measure, "TILE_PX", 120)
    hill = rendered_block(tmp_path, kind="hill", hill_height_m=60.0, hill_radius_m=150.0)
    (tmp_path / "tiles").mkdir()
    area = Area(np.array([-120.0, -120.0]), np.array([120.0, 120.0]))
    found = measure_surface(hill.calibration, DensePlan(np.arange(4), hill.paths, tmp_path / "tiles", area=area))
    assert len(found.windows) >= 4
    tiles = {(w.row, w.column): found.files.read(w) for w in found.windows}
    apart = []
    for window in found.windows:
        own, spare = tiles[window.row, window.column], tiles[window.row, window.column].rim.spare
        behind = tiles.get((window.row, window.column + window.columns))
        below = tiles.get((window.row + window.rows, window.column))
        if behind is not None:
            apart.append((own.rim.behind - behind.z[:, :spare]) / behind.sigma[:, :spare])
            apart.append((behind.rim.before - own.z[:, -spare:]) / own.sigma[:, -spare:])
        if below is not None:
            apart.append((own.rim.below[:, spare:-spare] - below.z[:spare]) / below.sigma[:spare])
            apart.append((below.rim.above[:, spare:-spare] - own.z[-spare:]) / own.sigma[-spare:])
    z = np.concatenate([part[np.isfinite(part)] for part in apart])
    assert len(z) > 1000
    assert np.median(np.abs(z)) < 1.0
    assert (np.abs(z) > 4.0).mean() < 0.01
