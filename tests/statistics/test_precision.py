"""Precision: correlations by name, weakest parts, ellipsoids, theoretical against practical precision."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.pipeline import adjust
from aerotri.statistics.precision import (
    centre_ellipsoids,
    ellipsoids,
    parameter_correlations,
    photograph_correlations,
    practical_precision,
    precision_against_truth,
    theoretical_precision,
    weakest_photographs,
    weakest_points,
)
from small_blocks import small_block
from synthetic import make_adjusted_block


@pytest.fixture(scope="module")
def simulated():
    block, truth = small_block(40, "bluh:1-12")
    return adjust(block), truth


def test_correlations_of_a_photograph_by_name():
    """X0 and φ tied by a covariance written down by hand; all other elements free of one another."""
    adjusted = make_adjusted_block(2, 5, 80)
    covariance = adjusted.images.covariance.copy()
    covariance[3, 0, 4] = covariance[3, 4, 0] = 0.999 * np.sqrt(covariance[3, 0, 0] * covariance[3, 4, 4])
    covariance[1, 1, 3] = covariance[1, 3, 1] = -0.97 * np.sqrt(covariance[1, 1, 1] * covariance[1, 3, 3])
    adjusted = replace(adjusted, images=replace(adjusted.images, covariance=covariance))
    names = adjusted.block.images.names
    found = photograph_correlations(adjusted)
    assert [c.text for c in found] == [f"X0–phi of photo {names[3]}: +99.9 %", f"Y0–omega of photo {names[1]}: -97.0 %"]
    assert len(photograph_correlations(adjusted, most=1)) == 1


def test_a_flat_block_ties_centres_to_angles(simulated):
    found = photograph_correlations(simulated[0], 0.9)
    assert {("X0", "phi"), ("Y0", "omega")} & {(c.first, c.second) for c in found}
    sizes = [abs(c.value) for c in found]
    assert sizes == sorted(sizes, reverse=True)


def test_correlations_of_parameters(simulated):
    """Those that the result names for each parameter alone are among them."""
    p = simulated[0].parameters
    found = {frozenset((c.first, c.second)): c.value for c in parameter_correlations(p, 0.3)}
    k = int(np.argmax(np.abs(p.max_correlation)))
    assert found[frozenset((p.names[k], p.max_correlation_with[k]))] == pytest.approx(p.max_correlation[k])
    assert max(map(abs, found.values())) == pytest.approx(abs(p.max_correlation[k]))


def test_weakest_parts(simulated):
    adjusted, _ = simulated
    points = weakest_points(adjusted, 2.0)
    sigma = adjusted.points.sigma
    median = np.nanmedian(sigma, axis=0)
    worst = int(np.nanargmax((sigma / median).max(axis=1)))
    assert points[0].name == adjusted.block.points[worst]
    assert points[0].ratio == pytest.approx((sigma[worst] / median).max())
    assert points[0].rays == adjusted.points.rays[worst]
    assert all(part.ratio >= 2.0 for part in points)
    photographs = weakest_photographs(adjusted, 1.0, most=5)
    assert len(photographs) == 5
    assert photographs[0].sigma == pytest.approx(photographs[0].ratio * photographs[0].median)


def test_ellipsoids_against_their_covariances():
    """Axes written down, turned at random, found again; the 90 % ellipsoid holds 90 % of draws."""
    rng = np.random.default_rng(8)
    axes = np.array([0.3, 0.1, 0.05])
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    covariance = turn @ np.diag(axes**2) @ turn.T
    found = ellipsoids(np.stack([covariance, np.full((3, 3), np.nan)]))
    np.testing.assert_allclose(found.semi_axes[0], axes, rtol=1e-12)
    np.testing.assert_allclose(np.abs(np.sum(found.directions[0] * turn, axis=0)), 1.0, atol=1e-9)
    assert np.linalg.det(found.directions[0]) == pytest.approx(1.0)
    assert np.isnan(found.semi_axes[1]).all()
    draws = rng.multivariate_normal(np.zeros(3), covariance, 20000) @ found.directions[0]
    wide = ellipsoids(covariance[None], probability=0.9).semi_axes[0]
    assert np.mean(np.sum((draws / wide) ** 2, axis=1) < 1.0) == pytest.approx(0.9, abs=0.01)


def test_direction_of_an_ellipsoid():
    """North-east and 30° up."""
    up, flat = np.sin(np.radians(30.0)), np.cos(np.radians(30.0))
    axis = np.array([flat * np.sin(np.radians(45.0)), flat * np.cos(np.radians(45.0)), up])
    found = ellipsoids((np.eye(3) * 0.01 + np.outer(axis, axis))[None])
    assert np.degrees(found.azimuth[0, 0]) == pytest.approx(45.0)
    assert np.degrees(found.elevation[0, 0]) == pytest.approx(30.0)


def test_ellipsoids_keep_the_trace(simulated):
    adjusted, _ = simulated
    found = centre_ellipsoids(adjusted)
    trace = np.trace(adjusted.images.covariance[:, :3, :3], axis1=1, axis2=2)
    np.testing.assert_allclose(np.sum(found.semi_axes**2, axis=1), trace, rtol=1e-10)


def test_theory_and_practice_agree(simulated):
    """Points of four rays and more against the truth: within a third, for their errors are correlated."""
    adjusted, truth = simulated
    chosen = adjusted.points.rays >= 4
    theory = theoretical_precision(adjusted, chosen)
    practice = precision_against_truth(adjusted, truth.points, chosen)
    assert theory.count == practice.count == chosen.sum()
    for name in ("mean", "x", "y", "z"):
        assert getattr(practice, name) == pytest.approx(getattr(theory, name), rel=0.35), name
    assert theory.mean == pytest.approx(np.sqrt((theory.x**2 + theory.y**2 + theory.z**2) / 3.0))
    check = practical_precision(adjusted)
    assert check.count == len(adjusted.check)
    assert check.z == pytest.approx(np.sqrt(np.mean(adjusted.check.difference[:, 2] ** 2)))


def test_nothing_to_compare():
    adjusted = make_adjusted_block(2, 5, 80, n_check=0)
    assert practical_precision(adjusted).count == 0
    assert np.isnan(practical_precision(adjusted).mean)
