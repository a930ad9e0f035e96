"""Which cross sections are shown."""

from __future__ import annotations

import numpy as np

from aerotri.volume.sections import Sections


def sections_of(cut, fill):
    sums = np.zeros((len(cut), 5))
    sums[:, 0], sums[:, 1] = cut, fill
    return Sections(0.0, np.zeros(2), 2.0 * np.arange(len(cut)), sums)


def test_none_lies_between_two_piles():
    cut = np.array([0.0, 4.0, 9.0, 4.0, 0.0, 0.0, 0.0, 2.0, 6.0, 2.0, 0.0])
    chosen = sections_of(cut, np.zeros(11)).chosen()
    assert len(chosen) == 3
    assert (cut[(chosen / 2.0).astype(int)] > 0.0).all()


def test_cut_and_fill_count_alike():
    areas = np.array([1.0, 3.0, 5.0, 3.0, 1.0])
    by_cut, by_fill = (sections_of(*pair).chosen() for pair in ((areas, 0.0 * areas), (0.0 * areas, areas)))
    np.testing.assert_array_equal(by_cut, by_fill)
    assert by_cut[1] == 4.0


def test_they_are_spread_evenly_where_nothing_lies():
    np.testing.assert_array_equal(sections_of(np.zeros(8), np.zeros(8)).chosen(), [2.0, 6.0, 10.0])
