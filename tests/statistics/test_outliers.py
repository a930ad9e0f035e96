"""Limits of residuals: robust spread, Bonferroni, and which coordinate speaks for a ray."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from aerotri.statistics.outliers import judge_rays, spread, sure_value
from synthetic import make_adjusted_block


def test_spread_is_blind_to_gross_errors():
    rng = np.random.default_rng(3)
    w = rng.normal(0.0, 1.7, 20000)
    w[:1000] = 500.0
    assert spread(w) == pytest.approx(1.7, rel=0.08)
    assert spread(np.array([np.nan, 0.6744897501960817, -0.6744897501960817])) == pytest.approx(1.0)
    assert spread(np.full(4, np.nan)) == 1.0


def test_sure_value_holds_for_the_largest_of_many():
    """P(largest of n beyond it) = 1 − (1 − α/n)ⁿ ≈ α."""
    for count in (1, 30, 5000):
        single = 2.0 * norm.sf(sure_value(0.01, count))
        assert 1.0 - (1.0 - single) ** count == pytest.approx(0.01, rel=0.01)


def test_rays_are_judged_by_their_larger_residual():
    run = make_adjusted_block(2, 5, 80)
    w, v, r = run.rays.w.copy(), run.rays.v.copy(), run.rays.r.copy()
    row = int(np.flatnonzero(run.rays.status == 0)[4])
    w[row], v[row], r[row] = [2.0, -40.0], [0.001, 0.018], [0.5, 0.4]
    status = run.rays.status.copy()
    off = int(np.flatnonzero(status == 0)[9])
    w[off], status[off] = [99.0, 99.0], 2
    tests = judge_rays(replace(run, rays=replace(run.rays, w=w, v=v, r=r, status=status)))
    assert tests.order[0] == row
    assert tests.w[row] == -40.0
    assert tests.axis[row] == 1
    assert tests.estimated_mm[row] == pytest.approx(-0.045)
    assert tests.estimated_px[row] == pytest.approx(-5.0)
    assert np.isnan(tests.w[off])
    assert tests.limit == pytest.approx(3.2905 * tests.scale, rel=1e-4)
    assert tests.sure > tests.limit
