"""Parallaxes are smoothed where they are continuous, and steps stay."""

import numpy as np
import pytest

from aerotri.terrain.dense._smoothing_kernels import POWER, REACH, smooth

STEP, DISTANCE, UNKNOWN = 0.7, 2.5, np.float32(-1e4)


def smoothed(value, known):
    out = np.empty_like(value)
    smooth(np.where(known, value, UNKNOWN).astype(np.float32), known, STEP, DISTANCE, UNKNOWN, out)
    return out


def test_means_are_those_of_the_formula_with_gaps_and_at_the_edge():
    rng = np.random.default_rng(3)
    value = rng.normal(5.0, 0.8, (9, 11)).astype(np.float32)
    known = rng.random(value.shape) > 0.1
    found = smoothed(value, known)
    k, m = np.mgrid[-REACH : REACH + 1, -REACH : REACH + 1]
    round_ = k**2 + m**2 <= REACH**2
    for i, j in ((0, 0), (4, 5), (8, 3), (1, 10), (6, 6)):
        if not known[i, j]:
            continue
        row, column = i + k[round_], j + m[round_]
        inside = (row >= 0) & (row < 9) & (column >= 0) & (column < 11)
        row, column, apart = row[inside], column[inside], (k**2 + m**2)[round_][inside]
        v = value[row, column].astype(float)
        off = v - float(value[i, j])
        weight = np.maximum(1.0 - off**2 / (2 * POWER * STEP**2), 0.0) ** POWER * np.exp(-0.5 * apart / DISTANCE**2)
        weight *= known[row, column]
        assert found[i, j] == pytest.approx((weight * v).sum() / weight.sum(), abs=1e-5)
    assert (found[~known] == UNKNOWN).all()


def test_a_step_stays_and_noise_gets_less():
    rng = np.random.default_rng(4)
    true = np.where(np.arange(60) < 30, 10.0, 14.0) * np.ones((40, 1))
    value = (true + rng.normal(0.0, 0.2, true.shape)).astype(np.float32)
    error = smoothed(value, np.ones(true.shape, bool)) - true
    assert np.abs(error[:, 28:32]).max() < 0.5
    assert error.std() < 0.5 * 0.2
    assert abs(error[:, :30].mean()) < 0.02
    assert abs(error[:, 30:].mean()) < 0.02
