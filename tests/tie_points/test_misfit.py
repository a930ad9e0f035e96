"""σ of tie points from their parallaxes, whatever a first orientation that is not exact adds to them."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri.functional_model.rotation import exponential
from aerotri.tie_points.misfit import base_in, parallaxes, without_smooth_part


def pair(sigma: tuple[float, float], seed: int = 4):
    """Two photographs of 2000 points: their orientation, and the tangents of the rays with noise."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform([-60.0, -40.0, -5.0], [90.0, 40.0, 5.0], (2000, 3))
    centre = np.array([[0.0, 0.0, 100.0], [30.0, 2.0, 101.0]])
    rotation = np.array([exponential(rng.normal(0.0, 0.03, 3)) for _ in range(2)])
    tangent = []
    for k in (0, 1):
        u = (xyz - centre[k]) @ rotation[k]
        tangent.append(-u[:, :2] / u[:, 2:] + rng.normal(0.0, sigma[k], (2000, 2)))
    return (centre, rotation), tangent


@pytest.mark.parametrize("sigma", [(1e-4, 1e-4), (3e-4, 5e-5)])
def test_parallaxes_over_their_sigma(sigma):
    """Of exact orientations: normal with a standard deviation of 1, also where one photograph is better."""
    orientation, tangent = pair(sigma)
    z = parallaxes(orientation, (0, 1), tuple(tangent), tuple(np.full(2000, s) for s in sigma))
    assert np.std(z) == pytest.approx(1.0, abs=0.06)
    assert abs(np.mean(z)) < 0.1


def test_what_is_smooth_is_taken_off():
    """Orientations off by three times the noise, a lens by ten times, one ray in fifty wrong: σ is 1 all the same."""
    sigma = 1e-4
    (centre, rotation), tangent = pair((sigma, sigma))
    turned = rotation @ np.array([exponential(np.array([3e-4, -3e-4, 2e-4])), np.eye(3)])
    bent = [t * (1.0 + 3e-3 * (t**2).sum(axis=1, keepdims=True)) for t in tangent]
    bent[0][::50] += 0.01
    z = parallaxes((centre + [[0.0, 0.1, -0.1], [0.0, 0.0, 0.0]], turned), (0, 1), tuple(bent),
                   (np.full(2000, sigma), np.full(2000, sigma)))  # fmt: skip
    assert 1.4826 * np.median(np.abs(z)) > 2.0
    along = bent[1] @ base_in((centre, turned), (0, 1))
    assert 1.4826 * np.median(np.abs(without_smooth_part(z, bent[0], along))) == pytest.approx(1.0, abs=0.08)
