"""Intervals between pickets: Tran's formula against what the paper chose, and the law of error pickets."""

import numpy as np
import pytest

from aerotri.terrain.interval import (
    K_MOUNTAINS,
    K_PLAIN,
    chosen_interval,
    expected_error_pickets,
    interval_by_formula,
    interval_by_rule,
    interval_of_gsd,
    interval_of_surface,
    k_of_slope,
)

AREAS = [
    # Tran 2007, Table 1 (scan µm, scale) and the optimal intervals of sections 3.1 to 3.4
    ("Co Loa", 28.0, 7000.0, K_PLAIN, (30.0, 40.0)),
    ("Duong Lam", 16.0, 33000.0, K_PLAIN, (50.0, 70.0)),
    ("Ba Vi 1", 20.0, 32000.0, K_PLAIN, (80.0, 100.0)),
    ("Ba Vi 2", 20.0, 32000.0, K_MOUNTAINS, (60.0, 80.0)),
    ("Lang Son", 32.0, 35000.0, K_MOUNTAINS, (80.0, 100.0)),
]


@pytest.mark.parametrize(("name", "scan", "scale", "k", "chosen"), AREAS, ids=[area[0] for area in AREAS])
def test_formula_meets_the_chosen_intervals(name, scan, scale, k, chosen):
    """Every interval of the formula within a tenth of those the paper calls optimal."""
    low, high = (interval_by_formula(scan, scale, value) for value in k)
    assert high > 0.9 * chosen[0]
    assert low < 1.1 * chosen[1]


def test_formula_by_hand():
    assert interval_by_formula(28.0, 7000.0, 0.1) == pytest.approx(44.27, abs=0.01)
    # P·Ma·1e-6 is the GSD
    assert interval_of_gsd(28.0 * 7000.0 * 1e-6, 0.1) == pytest.approx(44.27, abs=0.01)
    assert interval_by_rule(0.196) == pytest.approx(5.88)


def test_error_pickets_of_co_loa():
    """Tran 2007, Table 2: 552 error pickets of 6634 at 20 m; equation 6 then says 138 at 40 m (141 found)."""
    area = 6634 * 20.0**2
    assert expected_error_pickets(552 / 6634, area, 20.0) == pytest.approx(552.0)
    np.testing.assert_allclose(expected_error_pickets(552 / 6634, area, np.array([30.0, 40.0, 60.0])),
                               [245.3, 138.0, 61.3], atol=0.1)  # fmt: skip


def test_slope_decides():
    assert k_of_slope(0.02) == (pytest.approx(0.1), "plain")
    assert k_of_slope(0.4) == (pytest.approx(0.085), "mountains")


def test_chosen_interval_is_where_the_error_reaches_the_tolerance():
    interval = np.array([10.0, 20.0, 40.0, 80.0])
    rmse = 0.01 * interval
    for tolerance in (0.15, 0.33, 0.7):
        assert chosen_interval(interval, rmse, tolerance) == pytest.approx(100.0 * tolerance)
    assert chosen_interval(interval, rmse, 0.05) == pytest.approx(5.0)
    assert chosen_interval(interval, rmse, 9.0) == pytest.approx(80.0)
    assert chosen_interval(interval, np.full(4, np.nan), 1.0) == 80.0


def test_interval_of_a_surface_gives_small_ground_pickets_enough():
    """Aerial photographs keep the formula; a drone's 100 m × 100 m the older rule, or 50 000 nodes."""
    assert interval_of_surface(0.2, 0.1, 1e10) == (pytest.approx(44.72, abs=0.01), "100 · √GSD")
    assert interval_of_surface(0.02, 0.1, 1e4) == (pytest.approx(0.6), "30 times the GSD")
    interval, source = interval_of_surface(0.02, 0.1, 2e5)
    assert (interval, source) == (pytest.approx(2.0), "50000 places in the area")
