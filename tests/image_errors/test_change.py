"""Change of the image errors between groups: a camera that stayed as it was, and one that did not."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri.image_errors import change, group_changes
from aerotri.pipeline import adjust
from small_blocks import small_block, with_adjustment

FLIGHT = {
    "gsd_m": 0.1, "strips": 4, "images_per_strip": 6, "end_lap": 0.6, "side_lap": 0.4, "days": 2,
    "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0],
}  # fmt: skip


def two_days(seed: int, parameters: str, day_change_um: float = 0.0):
    """A camera with errors of 3 µm, flown on two days."""
    errors = {"physical": {"rms_um": 3.0, "day_change_um": day_change_um}}
    camera = {"ucd": {"preset": "ultracam_d", "errors": errors}}
    block, _ = small_block(seed, parameters, flight=FLIGHT, camera=camera)
    return adjust(with_adjustment(block, parameter_groups="day"))


@pytest.mark.parametrize("parameters", ["ebner", "legendre:4x4", "collocation:7x5"])
def test_one_camera_on_two_days(parameters):
    """F is about 1 where nothing changed: what the sets leave unexplained is common to both days."""
    found = [group_changes(two_days(seed, parameters)) for seed in range(40, 46)]
    assert all(len(changes) == 1 for changes in found)
    statistic = np.array([changes[0].statistic for changes in found])
    freedom = np.array([changes[0].freedom for changes in found])
    assert (freedom >= 5).all()
    assert np.average(statistic, weights=freedom) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / freedom.sum()))
    assert sum(changes[0].changed for changes in found) <= 1


@pytest.mark.parametrize("parameters", ["legendre:4x4", "collocation:7x5"])
def test_a_camera_that_changed(parameters):
    adjusted = two_days(50, parameters, day_change_um=2.0)
    (found,) = group_changes(adjusted)
    assert found.changed
    assert found.p < 1e-4
    assert found.field.rms > 1e-3
    assert "differ" in found.sentence
    turned = change(adjusted, found.second, found.first)
    assert turned.statistic == pytest.approx(found.statistic, rel=1e-6)
    np.testing.assert_allclose(turned.field.d, -found.field.d, atol=1e-12)


def test_statistic_of_free_parameters():
    """Δᵀ·C⁻¹·Δ/f, written out."""
    adjusted = two_days(51, "bluh:1-4+9")
    (found,) = group_changes(adjusted)
    p = adjusted.parameters
    d = np.hstack([np.eye(5), -np.eye(5)])
    delta, c = d @ p.value, d @ p.covariance @ d.T
    assert found.freedom == 5
    assert found.statistic == pytest.approx(delta @ np.linalg.solve(c, delta) / 5, rel=1e-7)


def test_nothing_to_compare():
    block, _ = small_block(52, "bluh:1-4")
    assert group_changes(adjust(block)) == ()
    assert group_changes(two_days(52, "none")) == ()
