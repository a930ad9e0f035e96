"""Kubik's results to their digits, and their derivation by numbers (paper 001)."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri.volume import theory


def chain(d, n):
    """(unknowns, equations) of a strip of n models, control every d points, written out."""
    unknown = [i for i in range(n + 1) if i % d]
    rows = np.zeros((n - 1, n + 1))
    for i in range(1, n):
        rows[i - 1, i - 1 : i + 2] = 1.0, -2.0, 1.0
    return rows[:, unknown]


@pytest.mark.parametrize(("d", "n"), [(2, 8), (3, 12), (5, 20), (8, 32), (10, 40)])
def test_result_1_is_the_variance_span_by_span(d, n):
    """Each span between two known points adjusted alone, spans independent: (d⁴ − 1)/(120 n) exactly."""
    one = np.zeros((d - 1, d + 1))
    for i in range(d - 1):
        one[i, i : i + 3] = 1.0, -2.0, 1.0
    a = one[:, 1:-1]
    of_span = np.ones(d - 1) @ np.linalg.inv(a.T @ a) @ np.ones(d - 1)
    exact = n / d * of_span / n**2
    assert theory.strip_exact(d, n) ** 2 == pytest.approx(exact, rel=1e-9)
    assert theory.strip(d, n) == pytest.approx(theory.strip_exact(d, n), rel=0.04)


def test_result_1_as_printed():
    """001_dbf08877a74a1074.txt: σ_Zmean = √(d⁴/(120 n))·σ0 (its equation 1; the digits from the proof)."""
    assert theory.strip(5, 10) == pytest.approx(np.sqrt(625 / 1200), rel=1e-12)


def test_result_2_is_ten_times_what_is_printed():
    """Printed '0.4 x 10-5 D²/√(H A)'; by substitution in (1) it is 3.93e-5."""
    coefficient = theory.strip_by_size(3000.0, 1500.0, 20000.0) * np.sqrt(1500.0 * 20000.0) / 3000.0**2
    assert coefficient == pytest.approx(3.93e-5, abs=0.005e-5)
    # in metric scale throughout, whatever the sizes
    other = theory.strip_by_size(5000.0, 900.0, 31000.0) * np.sqrt(900.0 * 31000.0) / 5000.0**2
    assert other == pytest.approx(coefficient, rel=1e-12)


def test_result_3_and_its_asymptote():
    """√(n³/20)·σ0; the sum itself is 0.967 … 0.998 of it in the paper's indices."""
    assert theory.free_strip_exact(5) / theory.free_strip(5) == pytest.approx(0.967, abs=5e-4)
    assert theory.free_strip_exact(20) / theory.free_strip(20) == pytest.approx(0.998, abs=1e-3)
    errors = np.random.default_rng(1).normal(size=(19, 20000))
    heights = np.cumsum(np.cumsum(errors, axis=0), axis=0)  # of points 2 … 20; those of 0 and 1 are known
    assert np.std(heights.sum(axis=0) / 20) == pytest.approx(theory.free_strip_exact(20), rel=0.03)
    assert theory.free_strip_exact(2000) / theory.free_strip(2000) == pytest.approx(1.0, abs=2e-3)
    assert theory.free_strip(20) == pytest.approx(20.0, rel=1e-12)


def test_result_4_as_printed():
    """001_dbf08877a74a1074.txt: σ = 4.3e-5·D²/√(A·B), whatever the flying height."""
    coefficient = theory.block_by_size(4000.0, 20000.0, 12000.0) * np.sqrt(20000.0 * 12000.0) / 4000.0**2
    assert coefficient == pytest.approx(4.30e-5, abs=0.005e-5)
    assert theory.block(4, 12, 9) == pytest.approx(theory.strip(4, 12) / 3.0)


@pytest.mark.parametrize(("d", "n"), [(2, 8), (3, 12), (4, 16), (5, 25), (6, 60), (10, 40)])
def test_joint_adjustment_by_dense_inversion(d, n):
    a = chain(d, n)
    q = np.linalg.inv(a.T @ a)
    assert theory.joint(d, n) == pytest.approx(np.sqrt(q.sum()) / n, rel=1e-9)


@pytest.mark.parametrize("d", sorted(theory.EDGE))
def test_joint_adjustment_in_closed_form(d):
    for n in (4 * d, 8 * d, 20 * d):
        assert theory.joint_fitted(d, n) == pytest.approx(theory.joint(d, n), rel=3e-3)
    assert theory.joint(d, 40 * d) < theory.strip_exact(d, 40 * d)


def test_the_joint_one_is_down_to_two_fifths_of_the_span_wise_one():
    assert theory.joint(30, 3000) / theory.strip_exact(30, 3000) == pytest.approx(0.41, abs=0.01)


@pytest.mark.parametrize("tie", [0.0, 0.1, 10.0])
def test_ties_between_strips_do_not_change_the_mean(tie):
    """The paper's claim for m = 2, 3 and on, for any weight of the ties."""
    for m in (1, 2, 3, 6):
        assert theory.joint_block(4, 12, m, tie) == pytest.approx(theory.joint(4, 12) / np.sqrt(m), rel=1e-9)


def test_by_simulation():
    """Random transfer errors, double sums, heights fitted into control: the scatter of the mean."""
    d, n, runs = 4, 24, 4000
    rng = np.random.default_rng(3)
    a = chain(d, n)
    e = rng.normal(size=(n - 1, runs))
    means = np.linalg.lstsq(a, e, rcond=None)[0].sum(axis=0) / n
    assert np.std(means) == pytest.approx(theory.joint(d, n), rel=0.05)


def test_prediction():
    found = theory.predict_volume(1500.0, 18000.0, 3600.0, 3600.0)
    assert (found.d, found.n, found.m) == (4, 20, 2)
    assert found.spanwise == pytest.approx(4.30e-5 * 3600.0**2 / np.sqrt(18000.0 * 3600.0), rel=2e-3)
    assert found.joint < found.spanwise < found.free
