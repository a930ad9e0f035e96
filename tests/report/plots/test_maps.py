"""Names on maps: none on another one or on a mark, the same every time."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from aerotri.rasters.grids import Grid
from aerotri.report.plots.maps import MARK, free_places, single_map, write_names
from aerotri.report.plots.ortho import middles_of

ROOM = np.array([6.0, 4.0])


def boxes(marks, sizes, found):
    names = [(m - s / 2, m + s / 2) for m, s in zip(found, sizes, strict=True) if m is not None]
    return names, [(m - MARK, m + MARK) for m in marks]


def meet(one, other):
    return bool((one[0] < other[1] - 1e-9).all() and (one[1] > other[0] + 1e-9).all())


@pytest.mark.parametrize("seed", range(5))
def test_no_name_lies_on_another_or_on_a_mark(seed):
    rng = np.random.default_rng(seed)
    marks = np.concatenate([rng.uniform(0.2, 0.8, (25, 2)) * ROOM, rng.normal(0.5, 0.04, (8, 2)) * ROOM])
    sizes = np.column_stack([rng.uniform(0.2, 0.7, len(marks)), np.full(len(marks), 0.14)])
    found = free_places(marks, sizes, ROOM)
    names, taken = boxes(marks, sizes, found)
    assert len(names) > 0.8 * len(marks)
    for k, one in enumerate(names):
        assert (one[0] >= 0.0).all()
        assert (one[1] <= ROOM).all()
        assert not any(meet(one, other) for other in (*names[:k], *taken))
    again = free_places(marks, sizes, ROOM)
    assert [m is None for m in found] == [m is None for m in again]
    np.testing.assert_array_equal([m for m in found if m is not None], [m for m in again if m is not None])


def test_points_side_by_side_have_their_names_to_either_side():
    marks = np.array([[3.0, 2.0], [3.02, 1.98]])
    sizes = np.array([[0.35, 0.14]] * 2)
    first, second = free_places(marks, sizes, ROOM)
    assert first is not None
    assert second is not None
    assert first[0] > 3.0 > second[0]


def test_a_name_without_room_is_left_out():
    crowd = np.array([[0.5, 0.5]] * 40)
    found = free_places(crowd, np.array([[0.5, 0.14]] * 40), np.array([1.0, 1.0]))
    assert any(one is None for one in found)
    assert any(one is not None for one in found)


def test_names_as_drawn_do_not_overlap():
    figure, axes = single_map("Map", "", (1000.0, 2000.0, 1070.0, 2050.0), True)
    places = np.array([[1052.0, 2010.0], [1052.3, 2009.8], [1020.0, 2030.0], [1069.9, 2049.9]])
    write_names(axes, places, ["K02", "C02", "a longer name", "at_the_corner"])
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    drawn = [text.get_window_extent(canvas.get_renderer()) for text in axes.texts]
    assert len(drawn) == 4
    inside = axes.get_window_extent(canvas.get_renderer())
    for k, box in enumerate(drawn):
        assert not any(box.overlaps(other) for other in drawn[:k])
        assert inside.x0 <= box.x0
        assert box.x1 <= inside.x1 + 1.0


def test_the_number_of_a_photograph_lies_within_its_part():
    number = np.full((20, 30), -1)
    number[:, :12], number[5:9, 12:30], number[15:, 20:25] = 4, 0, 7
    grid = Grid(20, 30, 100.0, 200.0, 2.0, 2.0)
    numbers, places = middles_of(number, grid)
    assert numbers == [4, 0, 7]
    for k, (x, y) in zip(numbers, places, strict=True):
        row, column = round(float(grid.row(y))), round(float(grid.column(x)))
        assert number[row, column] == k
