"""Supernodes worked on beside one another: all of them, in order, and the same numbers with any number of threads."""

import threading

import numpy as np
import pytest
from test_sparse_cholesky import random_bordered

from aerotri.adjustment import dense, subtrees
from aerotri.adjustment.photograph_pairs import photograph_pairs


@pytest.mark.parametrize("threads", ["1", "3"])
def test_children_come_first(threads, monkeypatch):
    monkeypatch.setenv("AEROTRI_THREADS", threads)
    monkeypatch.setattr(subtrees, "SMALL_TREE", 0.0)
    symbolic, _, _ = random_bordered(400, 0, seed=2)
    done, lock = [], threading.Lock()

    def visit(k):
        with lock:
            done.append(k)
        return k

    assert sorted(symbolic.schedule.upwards(visit)) == list(range(len(symbolic.fronts)))
    place = np.empty(len(done), int)
    place[done] = np.arange(len(done))
    below = np.flatnonzero(symbolic.tree.parent >= 0)
    assert len(symbolic.schedule.branches) > 1
    assert (place[below] < place[symbolic.tree.parent[below]]).all()


def test_threads_change_no_bit_of_factor_and_inverse(monkeypatch):
    symbolic, matrix, _ = random_bordered(300, 5, seed=4)
    monkeypatch.setattr(subtrees, "SMALL_TREE", 0.0)
    found = []
    for threads in ("1", "2", "4"):
        monkeypatch.setenv("AEROTRI_THREADS", threads)
        factor = symbolic.factorise(matrix)
        found.append((factor.solve(np.ones(symbolic.size)), *factor.inverse_on_pattern()))
    for other in found[1:]:
        for one, same in zip(found[0], other, strict=True):
            np.testing.assert_array_equal(one, same)


def test_dense_routines_do_what_they_say():
    rng = np.random.default_rng(1)
    root, b = np.asfortranarray(np.tril(rng.normal(size=(5, 5))) + 6.0 * np.eye(5)), rng.normal(size=(3, 5))
    a = np.asfortranarray(root @ root.T)
    assert dense.cholesky(a)
    np.testing.assert_allclose(np.tril(a), root)
    np.testing.assert_allclose(_after(dense.solve_from_right, root, b, transposed=True), b @ np.linalg.inv(root).T)
    np.testing.assert_allclose(_after(dense.solve_from_right, root, b, transposed=False), b @ np.linalg.inv(root))
    c = rng.normal(size=(3, 3))
    left = np.asfortranarray(c)
    dense.subtract_square(np.asfortranarray(b), left)
    np.testing.assert_allclose(np.tril(left), np.tril(c - b @ b.T))
    assert not dense.cholesky(np.asfortranarray(-np.eye(2)))
    with pytest.raises(ValueError, match="Fortran"):
        dense.cholesky(np.ones((2, 2)) + np.eye(2))


def _after(routine, lower, b, **options):
    changed = np.asfortranarray(b)
    routine(lower, changed, **options)
    return changed


def test_pairs_of_photographs_are_those_that_share_a_point():
    start, image = np.array([0, 3, 5, 5, 7]), np.array([0, 2, 5, 2, 5, 1, 4])
    pairs = photograph_pairs(start, image, 7, np.array([[6, 3], [5, 2]]))
    named = list(zip(pairs.first.tolist(), pairs.second.tolist(), strict=True))
    assert named == [(0, 2), (0, 5), (1, 4), (2, 5), (3, 6)]
    assert [named[k] for k in pairs.of_rays] == [(0, 2), (0, 5), (2, 5), (2, 5), (1, 4)]
    assert [named[k] for k in pairs.of_ties] == [(3, 6), (2, 5)]
