"""The seven-parameter transformation: exact recovery, parts of coordinates, what does not determine it."""

import numpy as np
import pytest

from aerotri.functional_model.rotation import exponential, logarithm
from aerotri.statistics.similarity import fit_similarity


@pytest.fixture
def points():
    return np.random.default_rng(2).uniform([0, 0, 0], [4000, 3000, 200], (9, 3)) + [600000, 5600000, 100]


def moved(points, translation, turn, scale):
    middle = points.mean(axis=0)
    return scale * (points - middle) @ exponential(np.array(turn)).T + middle + translation


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (1e-3, -2e-3, 5e-3), (0.1, -0.2, 0.9)])
def test_recovers_a_transformation(points, turn):
    given = moved(points, [3.0, -4.0, 12.0], turn, 1.0 + 250e-6)
    found = fit_similarity(points, given, np.full((9, 3), 0.05))
    assert found is not None
    np.testing.assert_allclose(found.residual, 0.0, atol=1e-6)
    np.testing.assert_allclose(found.translation, [3.0, -4.0, 12.0], atol=1e-6)
    np.testing.assert_allclose(found.rotation, logarithm(exponential(np.array(turn))), atol=1e-10)
    assert found.scale == pytest.approx(1.0 + 250e-6, abs=1e-10)
    assert found.redundancy == 20


def test_height_only_and_plan_only_points_take_part(points):
    given = moved(points, [1.0, 2.0, 3.0], (1e-4, 2e-4, -1e-3), 1.0)
    given[3, :2] = np.nan
    given[4, 2] = np.nan
    given[5, 2] += 0.6
    found = fit_similarity(points, given, np.full((9, 3), 0.05))
    assert found is not None
    assert found.redundancy == 17
    assert np.isnan(found.residual[3, :2]).all()
    assert np.isnan(found.residual[4, 2])
    rows, axes = np.unravel_index(np.nanargmax(np.abs(found.residual)), found.residual.shape)
    assert (rows, axes) == (5, 2)
    assert found.residual[5, 2] < -0.3


def test_residuals_are_those_of_least_squares(points):
    """Weighted residuals are orthogonal to all seven motions."""
    rng = np.random.default_rng(8)
    given = moved(points, [1.0, 2.0, 3.0], (1e-4, 2e-4, -1e-3), 1.0) + rng.normal(0, 0.05, (9, 3))
    sigma = rng.uniform(0.02, 0.2, (9, 3))
    found = fit_similarity(points, given, sigma)
    assert found is not None
    weighted = found.residual / sigma**2
    place = given + found.residual - given.mean(axis=0)
    np.testing.assert_allclose(weighted.sum(axis=0), 0.0, atol=1e-6)
    np.testing.assert_allclose(np.cross(place, weighted).sum(axis=0), 0.0, atol=1e-3)
    assert np.sum(place * weighted) == pytest.approx(0.0, abs=1e-3)


def test_what_does_not_determine_it(points):
    sigma = np.full((9, 3), 0.05)
    assert fit_similarity(points[:2], points[:2], sigma[:2]) is None
    in_line = points[:1] + np.arange(5)[:, None] * np.array([100.0, 50.0, 1.0])
    assert fit_similarity(in_line, in_line, sigma[:5]) is None
    heights = points.copy()
    heights[:, :2] = np.nan
    assert fit_similarity(points, heights, sigma) is None
