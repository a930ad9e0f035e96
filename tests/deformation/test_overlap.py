"""Photographs per cell: counted as known rectangles say, whatever their number."""

import time

import numpy as np
import shapely

from aerotri.deformation.overlap import CELLS, overlap_of


def squares(corners, side):
    polygons = np.full(len(corners), None)
    polygons[:] = [shapely.box(x, y, x + side, y + side) for x, y in corners]
    return polygons


def test_counts_of_known_squares():
    """Two squares of 200 m that share a strip of 100 m: 2 there, 1 beside, 0 nowhere within."""
    found = overlap_of(squares([(0.0, 0.0), (100.0, 0.0)], 200.0), np.array([[100.0, 100.0], [200.0, 100.0]]))
    x = found.corner[0] + found.cell * (np.arange(found.count.shape[1]) + 0.5)
    y = found.corner[1] + found.cell * (np.arange(found.count.shape[0]) + 0.5)
    inside = (y > 0) & (y < 200)
    for low, high, number in ((0, 100, 1), (100, 200, 2), (200, 300, 1)):
        cells = found.count[np.ix_(inside, (x > low) & (x < high))]
        assert cells.size
        assert (cells == number).all()
    assert (found.count[~inside] == 0).all()
    assert (found.count[:, (x < 0) | (x > 300)] == 0).all()
    # a row of cells at the border may count or not
    assert abs(found.area(1) - 60_000.0) < 2 * 500 * found.cell
    assert abs(found.area(2) - 20_000.0) < 600 * found.cell
    assert found.area(1) == found.area(1, 1) + found.area(2, 2)
    assert not found.inside.any()


def test_rows_go_up_and_the_hull_is_that_of_the_centres():
    found = overlap_of(
        squares([(0.0, 0.0), (300.0, 100.0)], 100.0), np.array([[0.0, 0.0], [400.0, 0.0], [0.0, 200.0], [np.nan, 1.0]])
    )
    row, column = (int(v) for v in ((150.0 - found.corner[1]) / found.cell, (350.0 - found.corner[0]) / found.cell))
    assert found.count[row, column] == 1
    assert found.count[int((50.0 - found.corner[1]) / found.cell), column] == 0
    assert abs(found.inside.sum() * found.cell**2 - 40_000.0) < 1000 * found.cell
    assert found.area(0, 0, inside=True) < found.area(0, 0)


def test_photographs_without_footprint():
    none = np.full(3, None)
    assert overlap_of(none, np.zeros((3, 2))) is None
    none[1] = shapely.box(0, 0, 10, 10)
    assert overlap_of(none, np.full((3, 2), np.nan)).count.max() == 1


def test_many_photographs_in_bounded_time_and_memory():
    """60 000 photographs: the grid stays as small, and the count is right in the middle."""
    column, row = np.divmod(np.arange(60_000), 200)
    # edges that pass through the middles of cells count to neither side
    column, row = column + 0.137, row + 0.119
    begun = time.process_time()
    found = overlap_of(
        squares(np.column_stack([column * 50.0, row * 50.0]), 200.0), np.column_stack([column * 50.0, row * 50.0])
    )
    assert time.process_time() - begun < 60.0
    assert max(found.count.shape) <= CELLS + 2
    middle = found.count[20:-20, 20:-20]
    assert middle.min() >= 9
    assert middle.max() <= 25
    assert abs(middle.mean() - 16.0) < 0.5
