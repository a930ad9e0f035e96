"""Kernels of the start values."""

import numpy as np
import pytest

from aerotri.adjustment._intersection_kernels import median


@pytest.mark.parametrize("values", [[3.0], [2.0, 1.0], [5.0, -1.0, 3.0], [4.0, 4.0, 1.0, 2.0], [1.0, 7, 7, 0, 2]])
def test_median(values):
    beyond = np.array([*values, -100.0])
    assert median(beyond, len(values), np.empty(len(beyond))) == np.median(values)
