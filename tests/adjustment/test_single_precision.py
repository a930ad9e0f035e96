"""Factors in single precision: the same minimum, and a double factor wherever rounding could hide a defect."""

from dataclasses import replace

import numpy as np
import pytest
from test_sparse_cholesky import random_bordered

from aerotri.adjustment import dense, single_precision
from aerotri.adjustment.panels import DOUBLE, SINGLE
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.solve import SolveOptions, minimise
from aerotri.adjustment.sparse_cholesky import NotPositiveDefiniteError, Symbolic
from aerotri.observations import Control
from aerotri.statistics.summarise import count_observations
from small_blocks import small_block, with_adjustment


@pytest.fixture
def single(monkeypatch):
    """Single precision for blocks of any size."""
    monkeypatch.setattr(single_precision, "LEAST_WORK", 0.0)


def adjusted(block):
    """The system and where it ends."""
    prepared = prepare(block)
    system, state = prepared.system, prepared.state
    return system, minimise(system, state, count_observations(system).redundancy, SolveOptions())


def precisions_used(monkeypatch, system_of):
    """What a function gives, and the precisions of the factors that it took."""
    used, whole = [], Symbolic.factorise

    def factorise(self, matrix, precision=DOUBLE):
        used.append(precision)
        return whole(self, matrix, precision)

    monkeypatch.setattr(Symbolic, "factorise", factorise)
    return system_of(), used


def test_factor_in_single_precision_solves_to_five_digits():
    symbolic, matrix, full = random_bordered(150, 11, seed=1)
    right = np.random.default_rng(2).normal(size=len(full)) * np.sqrt(np.diagonal(full))
    exact = symbolic.factorise(matrix).solve(right)
    rough = symbolic.factorise(matrix, SINGLE).solve(right)
    error = (rough - exact) * np.sqrt(np.diagonal(full))
    assert 0.0 < np.abs(error).max() < 1e-5 * np.abs(exact * np.sqrt(np.diagonal(full))).max()


def test_double_factor_after_a_single_one_is_as_without():
    symbolic, matrix, full = random_bordered(60, 4, seed=3)
    right = np.ones((len(full), 2))
    before = symbolic.factorise(matrix).solve(right)
    symbolic.factorise(matrix, SINGLE)
    np.testing.assert_array_equal(symbolic.factorise(matrix).solve(right), before)


def test_small_pivots_are_refused_in_single_precision_alone():
    symbolic, matrix, _ = random_bordered(7, 0, seed=5)
    blocks = matrix.blocks.copy()
    # two unknowns of a photograph that are all but one
    blocks[0, 1, :], blocks[0, :, 1] = blocks[0, 0, :], blocks[0, :, 0]
    blocks[0, 1, 1] = blocks[0, 0, 0] * (1.0 + 1e-7)
    off = np.flatnonzero((symbolic.block_row != symbolic.block_col) & (symbolic.block_row == 0))
    blocks[off, 1, :] = blocks[off, 0, :]
    near = type(matrix)(blocks, matrix.border, matrix.corner)
    symbolic.factorise(near)
    with pytest.raises(NotPositiveDefiniteError):
        symbolic.factorise(near, SINGLE)


@pytest.mark.parametrize("parameters", ["none", "brown:K1+K2+P1+P2"])
def test_same_minimum(single, monkeypatch, parameters):
    block, _ = small_block(parameters=parameters)
    (system, rough), used = precisions_used(monkeypatch, lambda: adjusted(block))
    assert used[0] == SINGLE
    monkeypatch.setattr(single_precision, "LEAST_WORK", np.inf)
    _, fine = adjusted(block)
    assert rough.status == fine.status == "converged"
    assert rough.equations.cost == pytest.approx(fine.equations.cost, rel=1e-10)
    # what the next step would change, over σ: both ends are at the minimum
    factor = system.factorise(rough.equations)
    left = abs(float(factor.solve(rough.equations.right) @ rough.equations.right))
    assert left <= 1e-10 * rough.equations.cost / count_observations(system).redundancy


def test_right_side_is_in_double_precision(single):
    """A first step that rounding bends does not bend the minimum."""
    block, _ = small_block(seed=4)
    system, found = adjusted(block)
    equations = system.assemble(found.state, 0.0, found.estimator)
    assert equations.right.dtype == DOUBLE
    np.testing.assert_allclose(equations.cost, found.equations.cost, rtol=1e-13)


def test_what_is_not_sure_is_factorised_again(single, monkeypatch):
    block, _ = small_block(seed=2)
    monkeypatch.setattr(single_precision, "SURE_EIGENVALUE", 1.0)
    (_, found), used = precisions_used(monkeypatch, lambda: adjusted(block))
    assert used[:2] == [SINGLE, DOUBLE]
    assert SINGLE not in used[1:]
    monkeypatch.setattr(single_precision, "LEAST_WORK", np.inf)
    _, plain = adjusted(block)
    # bit for bit: the attempt leaves nothing behind
    np.testing.assert_array_equal(found.state.points, plain.state.points)


def test_free_datum_is_named_as_before(single):
    block, _ = small_block()
    free = with_adjustment(block, datum="control")
    control = free.control
    one = replace(free, control=Control(control.point[:1], control.xyz[:1], control.sigma[:1], np.zeros(1, dtype=bool)))
    _, found = adjusted(one)
    assert found.status == "rank deficient"
    assert "datum" in " ".join(found.defects)


def test_robust_adjustment_takes_double_factors(single, monkeypatch):
    block, _ = small_block()
    _, used = precisions_used(monkeypatch, lambda: adjusted_robustly(block))
    assert SINGLE not in used


def adjusted_robustly(block):
    """With Huber's estimator."""
    prepared = prepare(block)
    system = prepared.system
    return minimise(system, prepared.state, count_observations(system).redundancy, SolveOptions(robust="huber"))


def test_matrices_of_two_precisions_are_refused():
    lower, right = np.eye(3, order="F"), np.ones((2, 3), dtype=np.float32, order="F")
    with pytest.raises(ValueError, match="one precision"):
        dense.solve_from_right(lower, right, transposed=True)
