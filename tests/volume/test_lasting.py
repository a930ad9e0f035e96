"""Errors of dense matching that do not average out, in sums of heights."""

import numpy as np
import pytest

from aerotri.volume.lasting import Lasting, lasting_variance, lasting_variance_of_cells

ERRORS = Lasting(0.02, 12.0)


def double_sum(xy, weight, lasting):
    away = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    return lasting.sigma_m**2 * float(weight @ np.exp(-away / lasting.length_m) @ weight)


@pytest.mark.parametrize("spacing", [0.5, 1.0, 4.0])
def test_variance_is_the_double_sum(spacing):
    rng = np.random.default_rng(3)
    row, column = np.nonzero(rng.random((40, 50)) < 0.8)
    xy, weight = spacing * np.column_stack([column, row]), rng.uniform(0.5, 1.0, len(row))
    assert lasting_variance(xy, weight, ERRORS) == pytest.approx(double_sum(xy, weight, ERRORS), rel=0.03)


def test_a_raster_is_its_cells():
    weight = np.zeros((30, 40))
    weight[5:25, 10:30] = 0.25
    row, column = np.nonzero(weight)
    xy = np.column_stack([0.5 * column, 0.5 * row])
    found = lasting_variance_of_cells(weight, (0.5, 0.5), ERRORS)
    assert found == pytest.approx(double_sum(xy, weight[row, column], ERRORS), rel=0.03)


def test_small_areas_have_one_error_and_large_ones_many():
    one = lasting_variance(np.zeros((9, 2)), np.ones(9), ERRORS)
    assert one == pytest.approx(81.0 * 0.02**2, rel=0.2)
    side = 800
    weight = np.ones((side, side))
    # of an endless area: 2πℓ² a cell, less at the edge
    endless = 0.02**2 * side**2 * 2.0 * np.pi * 12.0**2
    assert lasting_variance_of_cells(weight, (1.0, 1.0), ERRORS) == pytest.approx(endless, rel=0.06)


def test_opposite_weights_side_by_side_cancel_and_none_is_none():
    xy = np.array([[0.0, 0.0], [0.1, 0.0]])
    assert lasting_variance(xy, np.array([1.0, -1.0]), ERRORS) < 1e-3 * ERRORS.sigma_m**2
    assert lasting_variance(xy, np.ones(2), Lasting()) == 0.0
    assert lasting_variance(np.zeros((0, 2)), np.zeros(0), ERRORS) == 0.0
