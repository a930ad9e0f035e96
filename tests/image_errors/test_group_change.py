"""The test of "no change" between two groups: its χ² by hand, over simulations, and against a camera that changed."""

import numpy as np
import pytest
from scipy.stats import chi2

from aerotri.image_errors import group_change
from aerotri.pipeline import adjust
from small_blocks import small_block, small_spec, with_adjustment
from synthetic import make_adjusted_block

SEEDS = 20


def two_days(seed, physical=None):
    spec = small_spec()
    camera = {"ucd": {"preset": "ultracam_d"} | ({} if physical is None else {"errors": {"physical": physical}})}
    flight = spec["flight"] | {"days": 2, "cross_strips": [{"position": p, "images": 5, "day": d} for p, d in
                                                           ((0.3, 1), (0.7, 2))]}  # fmt: skip
    block, _ = small_block(seed, "bluh:1-12", camera=camera, flight=flight)
    return adjust(with_adjustment(block, parameter_groups="day"))


def test_by_the_parameters_themselves():
    """Where both groups have the same parameters, χ² of the field is that of the parameters' differences."""
    adjusted = make_adjusted_block(2, 4, 60, groups="day")
    change = group_change(adjusted, "day 1", "day 2")
    p = adjusted.parameters
    one, two = (np.flatnonzero((p.groups == day) & (p.kinds == "additional")) for day in ("day 1", "day 2"))
    assert p.names[one].tolist() == p.names[two].tolist()
    d = p.value[one] - p.value[two]
    q = p.covariance
    covariance = q[np.ix_(one, one)] + q[np.ix_(two, two)] - q[np.ix_(one, two)] - q[np.ix_(two, one)]
    scale = np.sqrt(np.diagonal(covariance))
    expected = (d / scale) @ np.linalg.solve(covariance / np.outer(scale, scale), d / scale)
    assert change.freedom == len(one)
    assert change.chi2 == pytest.approx(expected, rel=1e-6)
    assert change.probability == pytest.approx(chi2.sf(expected, len(one)), rel=1e-6, abs=1e-300)
    assert change.limit(0.01) == pytest.approx(chi2.ppf(0.99, len(one)))


def test_a_group_has_not_changed_against_itself():
    change = group_change(make_adjusted_block(2, 4, 60), "ucd2", "ucd2")
    assert (change.chi2, change.freedom, change.probability) == (0.0, 0, 1.0)


def test_over_simulations_of_a_camera_that_stays():
    changes = [group_change(adjust_result, "1", "2") for adjust_result in map(two_days, range(1, SEEDS + 1))]
    assert {change.freedom for change in changes} == {12}
    low, high = chi2.ppf([0.0005, 0.9995], 12 * SEEDS)
    assert low < sum(change.chi2 for change in changes) < high


def test_a_camera_that_changed_is_found():
    stays = {"rms_um": 3.0, "seed": 2, "weights": {"ccd": 0.0, "ccd_tilt": 0.0, "stitching": 0.0}}
    change = group_change(two_days(1, stays | {"day_change_um": 3.0}), "1", "2")
    assert change.probability < 1e-6
    assert change.chi2 > change.limit()
