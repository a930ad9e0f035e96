"""A block in parts: what each leaves adds up to what the whole leaves; solution and inverse are those of the whole."""

import pickle

import numpy as np

from aerotri.adjustment.partial_factor import Eliminated, eliminate_inner, restored
from aerotri.adjustment.sparse_cholesky import BorderedMatrix, Symbolic

B, S = 6, 4


def strip_matrix(n: int, rng: np.random.Generator):
    """A positive definite matrix of n photographs in a row, each tied to the next three, with a border."""
    pairs = [(i, j) for i in range(n) for j in range(i + 1, min(i + 4, n))]
    row = np.array([*range(n), *(i for i, _ in pairs)])
    col = np.array([*range(n), *(j for _, j in pairs)])
    size = B * n + S
    dense = np.zeros((size, size))
    border = slice(B * n, None)
    for i, j in [(i, i) for i in range(n)] + pairs:
        columns = np.r_[B * i : B * i + B, B * j : B * j + B, B * n : size]
        a = rng.normal(size=(30, len(columns)))
        dense[np.ix_(columns, columns)] += a.T @ a
    blocks = np.stack([dense[B * i : B * i + B, B * j : B * j + B] for i, j in zip(row, col, strict=True)])
    of_border = np.stack([dense[border, B * i : B * i + B] for i in range(n)])
    position = np.column_stack([np.arange(n, dtype=float), np.zeros(n)])
    return dense, BorderedMatrix(blocks, of_border, dense[border, border].copy()), row, col, position


def test_what_is_left_is_the_schur_complement_and_leads_back():
    rng = np.random.default_rng(3)
    n, last = 60, np.array([0, 1, 2, 57, 58, 59])
    dense, matrix, row, col, position = strip_matrix(n, rng)
    symbolic = Symbolic(n, row, col, position, S, last)
    factor, left = eliminate_inner(symbolic, matrix)
    kept = np.concatenate([(B * last[:, None] + np.arange(B)).ravel(), B * n + np.arange(S)])
    inner = np.setdiff1d(np.arange(len(dense)), kept)
    expected = dense[np.ix_(kept, kept)] - dense[np.ix_(kept, inner)] @ np.linalg.solve(
        dense[np.ix_(inner, inner)], dense[np.ix_(inner, kept)]
    )
    np.testing.assert_allclose(left, expected, atol=1e-10 * np.abs(expected).max())

    right = rng.normal(size=len(dense))
    x = np.linalg.solve(dense, right)
    rest = factor.reduce_side(right)
    of_kept = np.linalg.solve(left, rest.right)
    np.testing.assert_allclose(of_kept, x[kept], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(factor.expand(rest.half, of_kept), x, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(rest.decrement + rest.right @ of_kept, right @ x, rtol=1e-10)

    inverse, q = factor.inverse_below(np.linalg.inv(left)), np.linalg.inv(dense)
    for b, (i, j) in enumerate(zip(row, col, strict=True)):
        np.testing.assert_allclose(inverse.blocks[b], q[B * i : B * i + B, B * j : B * j + B], atol=1e-12)
    np.testing.assert_allclose(inverse.border[30], q[B * n :, 180:186], atol=1e-12)
    np.testing.assert_allclose(inverse.corner, q[B * n :, B * n :], atol=1e-12)


def test_numbers_from_a_file_and_a_plan_that_travelled_do_the_same():
    rng = np.random.default_rng(4)
    n, last = 40, np.array([38, 39])
    _, matrix, row, col, position = strip_matrix(n, rng)
    symbolic = Symbolic(n, row, col, position, S, last)
    factor, left = eliminate_inner(symbolic, matrix)
    rest = factor.reduce_side(rng.normal(size=symbolic.size))
    solution = factor.expand(rest.half, np.linalg.solve(left, rest.right))
    numbers = Eliminated(factor.eliminated().panels.copy(), factor.eliminated().scale)
    content = pickle.dumps(symbolic)
    assert len(content) < symbolic.factor_entries * 8
    again = restored(pickle.loads(content), numbers)
    assert np.array_equal(again.expand(rest.half, np.linalg.solve(left, rest.right)), solution)


def test_a_part_whose_photographs_all_stay():
    rng = np.random.default_rng(5)
    dense, matrix, row, col, position = strip_matrix(5, rng)
    symbolic = Symbolic(5, row, col, position, S, np.arange(5))
    factor, left = eliminate_inner(symbolic, matrix)
    np.testing.assert_allclose(left, dense)
    right = rng.normal(size=len(dense))
    x = np.linalg.solve(left, factor.reduce_side(right).right)
    np.testing.assert_allclose(factor.expand(factor.reduce_side(right).half, x), np.linalg.solve(dense, right))
