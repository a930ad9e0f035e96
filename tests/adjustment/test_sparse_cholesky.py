"""The block sparse factor against dense algebra."""

import numpy as np
import pytest

from aerotri.adjustment.sparse_cholesky import BorderedMatrix, NotPositiveDefiniteError, StaleFactorError, Symbolic


def random_bordered(n, n_border, seed, ties=2.6):
    """A random positive definite block matrix over photographs on a plane, ties among neighbours; also dense."""
    rng = np.random.default_rng(seed)
    side = int(np.ceil(np.sqrt(n)))
    position = np.column_stack([np.arange(n) % side, np.arange(n) // side]) + rng.normal(0, 0.1, (n, 2))
    distance = np.linalg.norm(position[:, None] - position[None], axis=2)
    row, col = np.nonzero(np.triu(distance < ties, 1))
    block_row, block_col = np.concatenate([np.arange(n), row]), np.concatenate([np.arange(n), col])
    size = 6 * n + n_border
    dense = np.zeros((size, size))
    for i, j in zip(block_row, block_col, strict=True):
        dense[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] = rng.normal(size=(6, 6))
    dense[:, 6 * n :] = rng.normal(size=(size, n_border))
    dense = np.triu(dense, 1)
    dense = dense + dense.T
    dense += np.diag(np.abs(dense).sum(axis=1) + 1.0)
    units = 10.0 ** rng.uniform(-3, 3, size)
    dense *= units[:, None] * units[None, :]
    blocks = np.stack([dense[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] for i, j in zip(block_row, block_col, strict=True)])
    matrix = BorderedMatrix(
        blocks, np.swapaxes(dense[: 6 * n, 6 * n :].reshape(n, 6, n_border), 1, 2).copy(), dense[6 * n :, 6 * n :]
    )
    return Symbolic(n, block_row, block_col, position, n_border), matrix, dense


@pytest.mark.parametrize(("n", "n_border"), [(1, 0), (1, 3), (7, 2), (60, 0), (150, 11)])
def test_solve_and_inverse_against_dense(n, n_border):
    symbolic, matrix, dense = random_bordered(n, n_border, seed=n)
    unit = 1.0 / np.sqrt(np.diagonal(dense))
    inverse = np.linalg.inv(dense * np.outer(unit, unit)) * np.outer(unit, unit)
    scale = np.sqrt(np.diagonal(inverse))
    factor = symbolic.factorise(matrix)
    rhs = np.random.default_rng(3).normal(size=(len(dense), 2)) / scale[:, None]
    np.testing.assert_allclose(
        factor.solve(rhs) / scale[:, None], inverse @ rhs / scale[:, None], rtol=1e-9, atol=1e-10
    )
    pattern = factor.inverse_on_pattern()
    normed = inverse / scale[:, None] / scale[None, :]
    for b, (i, j) in enumerate(zip(symbolic.block_row, symbolic.block_col, strict=True)):
        si, sj = scale[6 * i : 6 * i + 6], scale[6 * j : 6 * j + 6]
        got = pattern.blocks[b] / si[:, None] / sj[None, :]
        np.testing.assert_allclose(got, normed[6 * i : 6 * i + 6, 6 * j : 6 * j + 6], atol=1e-10)
    flat = np.swapaxes(pattern.border, 1, 2).reshape(6 * n, n_border) / scale[: 6 * n, None] / scale[None, 6 * n :]
    np.testing.assert_allclose(flat, normed[: 6 * n, 6 * n :], atol=1e-10)
    np.testing.assert_allclose(
        pattern.corner / np.outer(scale[6 * n :], scale[6 * n :]), normed[6 * n :, 6 * n :], atol=1e-10
    )
    columns = factor.columns(np.array([0, len(dense) - 1]))
    np.testing.assert_allclose(columns / scale[:, None], inverse[:, [0, -1]] / scale[:, None], rtol=1e-8, atol=1e-10)


def test_order_is_a_permutation_and_factor_is_sparse():
    symbolic, _, _ = random_bordered(400, 0, seed=5, ties=1.5)
    assert sorted(symbolic.tree.order) == list(range(400))
    assert symbolic.factor_entries < 0.35 * (6 * 400) ** 2 / 2


def test_two_separate_blocks():
    rng = np.random.default_rng(0)
    n = 60
    position = np.concatenate([rng.uniform(0, 1, (30, 2)), rng.uniform(50, 51, (30, 2))])
    row, col = np.nonzero(np.triu(np.kron(np.eye(2), np.ones((30, 30))), 1))
    block_row, block_col = np.concatenate([np.arange(n), row]), np.concatenate([np.arange(n), col])
    blocks = 0.01 * rng.normal(size=(len(block_row), 6, 6))
    blocks[:n] = np.eye(6)
    symbolic = Symbolic(n, block_row, block_col, position, 0)
    dense = np.zeros((6 * n, 6 * n))
    for b, (i, j) in enumerate(zip(block_row, block_col, strict=True)):
        dense[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] = blocks[b]
        dense[6 * j : 6 * j + 6, 6 * i : 6 * i + 6] = blocks[b].T
    factor = symbolic.factorise(BorderedMatrix(blocks, np.zeros((n, 0, 6)), np.zeros((0, 0))))
    rhs = rng.normal(size=6 * n)
    np.testing.assert_allclose(dense @ factor.solve(rhs), rhs, atol=1e-10)


def test_factor_repeats_bit_for_bit():
    symbolic, matrix, _ = random_bordered(80, 4, seed=2)
    first = symbolic.factorise(matrix).inverse_on_pattern().blocks
    np.testing.assert_array_equal(first, symbolic.factorise(matrix).inverse_on_pattern().blocks)


def test_singular_matrix_is_refused():
    symbolic, matrix, _ = random_bordered(10, 0, seed=1)
    matrix.blocks[3] = np.outer(np.ones(6), np.ones(6))
    with pytest.raises(NotPositiveDefiniteError):
        symbolic.factorise(matrix)


def test_memory_is_predicted_and_refused(monkeypatch):
    from aerotri.adjustment import parallel
    from aerotri.conventions import InputError

    symbolic, _, _ = random_bordered(60, 3, seed=1)
    assert symbolic.bytes_needed > 8 * symbolic.factor_entries
    monkeypatch.setattr(parallel, "available_bytes", lambda: symbolic.bytes_needed - 1)
    with pytest.raises(InputError, match="the normal equations of 60 photographs need"):
        random_bordered(60, 3, seed=1)


def test_a_factor_refuses_to_answer_for_another_matrix():
    """Factors share the memory of their `Symbolic`: after the next factorisation the older one would answer wrongly."""
    n = 2
    symbolic = Symbolic(n, np.arange(n), np.arange(n), np.array([[0.0, 0.0], [1.0, 0.0]]), 0)
    blocks = np.tile(np.eye(6), (n, 1, 1))
    nothing = np.zeros((n, 0, 6)), np.zeros((0, 0))
    older = symbolic.factorise(BorderedMatrix(2.0 * blocks, *nothing))
    assert np.allclose(older.solve(np.ones(6 * n)), 0.5)
    newer = symbolic.factorise(BorderedMatrix(4.0 * blocks, *nothing))
    for ask in (lambda: older.solve(np.ones(6 * n)), older.inverse_on_pattern, older.border_inverse):
        with pytest.raises(StaleFactorError, match="factorise anew"):
            ask()
    assert np.allclose(newer.solve(np.ones(6 * n)), 0.25)
