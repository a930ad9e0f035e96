"""Quantiles against scipy.stats, which is exact but slow to import."""

import numpy as np
import pytest
from scipy import stats

from aerotri.quantiles import (
    chi_square_exceedance,
    chi_square_quantile,
    f_exceedance,
    normal_quantile,
    student_quantile,
)


@pytest.mark.parametrize("p", [1e-6, 0.0005, 0.3, 0.8, 0.9995])
def test_quantiles(p):
    assert normal_quantile(p) == pytest.approx(stats.norm.ppf(p), rel=1e-12)
    for freedom in (1, 3, 12.5, 4000):
        np.testing.assert_allclose(chi_square_quantile([p, 0.5], freedom), stats.chi2.ppf([p, 0.5], freedom), rtol=1e-9)
        assert student_quantile(p, freedom) == pytest.approx(stats.t.ppf(p, freedom), rel=1e-9)
        beyond = stats.chi2.sf(1.3 * freedom, freedom)
        assert chi_square_exceedance(1.3 * freedom, freedom) == pytest.approx(beyond, rel=1e-9)
        assert f_exceedance(1.3, freedom, 40.0) == pytest.approx(stats.f.sf(1.3, freedom, 40.0), rel=1e-9)
