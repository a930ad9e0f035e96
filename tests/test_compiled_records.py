"""Records that kernels are given as one address: every field is what Python has."""

from __future__ import annotations

import gc
import sys
from typing import Any, NamedTuple

import numpy as np
import pytest

from aerotri.adjustment._pair_kernels import sort_first
from aerotri.compiled import kernel
from aerotri.compiled_records import RecordType, record


@record
class Inner(NamedTuple):
    """Arrays of one and three dimensions, and a number."""

    numbers: Any
    cube: Any
    factor: Any


@record
class Outer(NamedTuple):
    """A record within a record, between other fields."""

    flags: Any
    inner: Any
    count: Any
    plane: Any


@kernel
def summed(outer, out):
    """Every element by its own weight, so that no two fields can be taken for one another."""
    inner = outer.inner
    cube, plane = inner.cube, outer.plane
    out[0] = 0.0
    for i in range(cube.shape[0]):
        for j in range(cube.shape[1]):
            for k in range(cube.shape[2]):
                out[0] += cube[i, j, k] * (1 + i + 10 * j + 100 * k)
    out[1] = inner.factor * outer.count
    for i in range(len(inner.numbers)):
        if outer.flags[i]:
            out[1] += inner.numbers[i] * (i + 1)
    for i in range(plane.shape[0]):
        for j in range(plane.shape[1]):
            plane[i, j] += 10 * i + j


def example(plane: np.ndarray) -> Outer:
    random = np.random.default_rng(3)
    inner = Inner(np.arange(5) * 7, random.normal(size=(2, 3, 4)), 2.5)
    return Outer(np.array([True, False, True, True, False]), inner, 3, plane)


@pytest.mark.parametrize("strided", [False, True])
def test_fields_are_what_python_has(strided):
    plane = np.zeros((4, 6))[::2, ::3] if strided else np.zeros((2, 2))
    outer = example(plane)
    out = np.empty(2)
    summed(outer, out)
    i, j, k = np.indices(outer.inner.cube.shape)
    assert out[0] == pytest.approx((outer.inner.cube * (1 + i + 10 * j + 100 * k)).sum(), rel=1e-13)
    assert out[1] == 7.5 + (outer.inner.numbers * np.arange(1, 6))[outer.flags].sum()
    np.testing.assert_array_equal(plane, [[0, 1], [10, 11]])
    if hasattr(summed, "nopython_signatures"):
        assert isinstance(summed.nopython_signatures[-1].args[0], RecordType)


def test_nothing_is_held_or_freed():
    plane = np.zeros((2, 2))
    outer = example(plane)
    out = np.empty(2)
    summed(outer, out)
    held = [sys.getrefcount(one) for one in (plane, outer, outer.inner, outer.inner.cube)]
    for _ in range(50):
        summed(outer, out)
    gc.collect()
    assert [sys.getrefcount(one) for one in (plane, outer, outer.inner, outer.inner.cube)] == held


@kernel
def first_number(inner):
    return inner.numbers[0] * 2


def test_other_fields_stay_named_tuples():
    """None is nothing that could stand in a row of words."""
    assert first_number(Inner(np.array([4]), None, 1.0)) == 8


@pytest.mark.parametrize("count", [0, 1, 2, 3, 17, 400])
def test_the_first_numbers_are_sorted(count):
    numbers = np.random.default_rng(count).permutation(500)
    expected = np.concatenate([np.sort(numbers[:count]), numbers[count:]])
    sort_first(numbers, count)
    np.testing.assert_array_equal(numbers, expected)
