"""Chunks of points add up in common rows: the same as one after the other, whoever is first."""

from itertools import pairwise

import numpy as np
import pytest

from aerotri.adjustment.chunk_sums import SharedRows
from aerotri.adjustment.photograph_pairs import ordered, photograph_pairs


@pytest.fixture
def touched(rng):
    """Of four chunks, the rows that each adds to, some by several and some by none."""
    return [(rng.integers(0, 30, 25), rng.integers(10, 50, 12)) for _ in range(4)]


@pytest.fixture
def rng():
    return np.random.default_rng(8)


def test_rows_are_added_up_as_one_after_the_other(touched, rng):
    rows = SharedRows(60, touched)
    total, expected = rows.zeros(2), np.zeros((60, 2))
    for place, of_chunk in zip(rows.places, touched, strict=True):
        for row in np.concatenate(of_chunk):
            value = rng.normal(size=2)
            total[place[row]] += value
            expected[row] += value
    np.testing.assert_allclose(rows.added_up(total), expected, rtol=1e-14, atol=1e-14)


def test_no_two_chunks_add_to_the_same_row(touched):
    rows = SharedRows(60, touched)
    taken = [np.unique(place[np.concatenate(part)]) for place, part in zip(rows.places, touched, strict=True)]
    everything = np.concatenate(taken)
    assert len(np.unique(everything)) == len(everything)
    assert len(rows.zeros()) == everything.max() + 1


def test_items_of_one_key_keep_their_order(rng):
    key = rng.integers(0, 7, 200)
    first = np.concatenate([[0], np.cumsum(np.bincount(key, minlength=7))[:-1]])
    items = rng.permutation(200)
    expected = items[np.argsort(key[items], kind="stable")]
    np.testing.assert_array_equal(ordered(key, first, items), expected)


def test_numbers_of_pairs_are_those_found_one_by_one(rng):
    n, counts = 40, rng.integers(0, 9, 150)
    image = np.concatenate([np.sort(rng.choice(n, count, replace=False)) for count in counts])
    start = np.concatenate([[0], np.cumsum(counts)])
    tied = np.array([[3, 1], [38, 39], [7, 20]])
    pairs = photograph_pairs(start, image, n, tied, first_number=n)
    of_points = [image[a:b].tolist() for a, b in pairwise(start)]
    met = [(one, two) for seen in of_points for k, one in enumerate(seen) for two in seen[k + 1 :]]
    named = sorted({*met, (1, 3), (38, 39), (7, 20)})
    assert list(zip(pairs.first.tolist(), pairs.second.tolist(), strict=True)) == named
    assert pairs.of_rays.tolist() == [n + named.index(pair) for pair in met]
    assert pairs.of_ties.tolist() == [n + named.index(pair) for pair in [(1, 3), (38, 39), (7, 20)]]
    assert pairs.start.tolist() == np.concatenate([[0], np.cumsum(counts * (counts - 1) // 2)]).tolist()
