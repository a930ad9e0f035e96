"""Curvature learnt from the steps, on quadratic functions whose minimum and curvature are known."""

import numpy as np
import pytest

from aerotri.adjustment.secants import Secants

SIZE = 40


class Normals:
    """Stands for the factor of a normal matrix."""

    def __init__(self, matrix):
        self.matrix = matrix

    def solve(self, right):
        return np.linalg.solve(self.matrix, right)


def problem(curvatures, seed=1):
    """Normal matrix, the true matrix, whose curvature along some directions is that many times the normals', and x."""
    rng = np.random.default_rng(seed)
    root = np.linalg.qr(rng.normal(size=(SIZE, SIZE)))[0] * 10.0 ** rng.uniform(-2.0, 2.0, SIZE)
    factor = np.ones(SIZE)
    factor[: len(curvatures)] = curvatures
    return Normals(root @ root.T), root @ np.diag(factor) @ root.T, rng.normal(size=SIZE)


def decrements(normals, truth, minimum, secants, count):
    """Decrements gᵀH⁻¹g before every step of an iteration from zero."""
    x, found = np.zeros(SIZE), []
    for _ in range(count):
        right = truth @ (minimum - x)
        found.append(float((minimum - x) @ right))
        step = secants.solve(normals, right) if secants is not None else normals.solve(right)
        x = x + step
        if secants is not None:
            secants.learn(step, right, truth @ (minimum - x))
    return np.array(found)


@pytest.mark.parametrize("curvatures", [(2.5, 2.1, 2.3), (0.2, 0.15), (2.5, 2.1, 0.2, 0.3)])
def test_steps_that_swing_or_fall_short_settle(curvatures):
    """Whole steps overshoot more and more beyond twice the curvature, and fall short of it below."""
    normals, truth, minimum = problem(curvatures)
    plain = decrements(normals, truth, minimum, None, 16)
    learnt = decrements(normals, truth, minimum, Secants(), 16)
    assert learnt[-1] < 1e-9 * learnt[0]
    assert learnt[-1] < 1e-3 * plain[-1]


def test_step_without_secants_is_the_one_of_the_normals():
    normals, truth, minimum = problem(())
    right = truth @ minimum
    np.testing.assert_array_equal(Secants().solve(normals, right), normals.solve(right))


def test_nothing_is_learnt_from_a_slope_that_bends_away():
    secants, step = Secants(), np.ones(SIZE)
    assert not secants.learn(step, step, 2.0 * step)
    assert not secants.learn(step, step, np.full(SIZE, np.nan))
    assert len(secants) == 0
    assert secants.learn(step, step, 0.5 * step)
    assert len(secants) == 1
    secants.forget()
    assert len(secants) == 0
