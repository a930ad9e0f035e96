"""Sums of χ² with weights against χ² and F where they are these, and against random numbers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, f

from aerotri.quantiles import noncentrality
from aerotri.statistics.weighted_chi_square import weighted_chi_square_exceedance


@pytest.mark.parametrize("freedom", [1, 4, 30])
@pytest.mark.parametrize("times", [0.4, 1.0, 2.0, 6.0])
def test_one_weight_is_chi_square(freedom, times):
    found = weighted_chi_square_exceedance(np.array([2.0]), np.array([float(freedom)]), 2.0 * times * freedom)
    assert found == pytest.approx(chi2.sf(times * freedom, freedom), rel=0.08 if freedom == 1 else 0.03)


def test_two_weights_of_either_sign_are_f():
    found = weighted_chi_square_exceedance(np.array([1.0 / 5.0, -2.5 / 200.0]), np.array([5.0, 200.0]), 0.0)
    assert found == pytest.approx(f.sf(2.5, 5, 200), rel=0.03)


def test_many_weights_beside_random_numbers():
    rng = np.random.default_rng(1)
    weights = rng.uniform(-0.2, 1.0, 30) ** 3
    sums = (rng.normal(size=(100_000, 30)) ** 2) @ weights
    for share in (0.9, 0.5, 0.1, 0.01):
        value = float(np.quantile(sums, 1.0 - share))
        # the quantile of 100 000 numbers is itself uncertain
        tolerance = 4.0 * np.sqrt(share * (1.0 - share) / 100_000) + 0.02 * share
        assert weighted_chi_square_exceedance(weights, np.ones(30), value) == pytest.approx(share, abs=tolerance)


def test_where_nothing_is_random():
    one = np.ones(1)
    assert weighted_chi_square_exceedance(one, one, -1.0) == 1.0
    assert weighted_chi_square_exceedance(-one, one, 1.0) == 0.0
    assert weighted_chi_square_exceedance(np.zeros(1), one, 1.0) == 0.0


def test_noncentrality_of_the_classical_test():
    """4.13 for 0.1 % and 80 %, Baarda's number."""
    assert np.sqrt(noncentrality(1.0, 0.001, 0.8)) == pytest.approx(4.132, abs=1e-3)
