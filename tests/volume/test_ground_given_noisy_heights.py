"""The covariance of ground between noisy heights: what the heights leave open, without what their noise does."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from aerotri.volume import between_sides
from aerotri.volume.counted import PLACES
from aerotri.volume.functionals import triangulated
from aerotri.volume.roughness import Roughness, ground_of

STEP, SIDE, S = 10.0, 9, 0.2


def covariance_of(xy):
    """Of fractional Brownian ground, H = ½, that is 0 at the first place."""
    at = xy + 1e4
    length = np.linalg.norm(at, axis=1)
    full = S**2 * (length[:, None] + length - np.linalg.norm(at[:, None] - at[None], axis=2))
    return full - full[:1] - full[:, :1] + full[0, 0]


@pytest.mark.parametrize("noise_m", [0.0, 0.5])
def test_noise_is_not_in_the_covariance_of_the_ground_but_in_its_mean(noise_m):
    """400 grounds: those less the mean of true heights scatter as told; noise adds to that of measured ones."""
    rng = np.random.default_rng(4)
    x, y = np.meshgrid(np.arange(SIDE) * STEP, np.arange(SIDE) * STEP)
    xy = np.column_stack([x.ravel(), y.ravel()])
    triangles = triangulated(np.column_stack([xy, np.zeros(len(xy))]))
    middle = xy[triangles].mean(axis=1)
    inner = triangles[np.abs(middle - 40.0).max(axis=1) < 15.0]
    places = np.einsum("qk,nkc->nqc", PLACES, xy[inner])
    root = np.linalg.cholesky(
        covariance_of(np.concatenate([xy, places.reshape(-1, 2)])) + 1e-9 * np.eye(len(xy) + places[..., 0].size)
    )
    flat = np.column_stack([xy, np.zeros(len(xy))])
    ground = ground_of(Roughness(S, 0.5), flat, triangles, np.ones(len(triangles)), noise_m**2)
    tree, left, by_noise = KDTree(xy), [], []
    for _ in range(400):
        z = root @ rng.normal(size=len(root))
        true, measured = (
            between_sides._at_places(replace(ground, xyz=one), tree, one[inner])
            for one in (
                np.column_stack([xy, z[: len(xy)]]),
                np.column_stack([xy, z[: len(xy)] + rng.normal(0.0, noise_m, len(xy))]),
            )
        )
        left.append(z[len(xy) :].reshape(true.mean.shape) - true.mean)
        by_noise.append(measured.mean - true.mean)
    told = np.einsum("tqq->tq", true.covariance).mean()
    assert np.mean(np.square(left)) == pytest.approx(told, rel=0.1)
    assert between_sides.sigma_at_places(ground) == pytest.approx(np.sqrt(told), rel=0.3)
    if noise_m:
        # the mean of heights around has a share of their noise that is not to be counted twice
        assert 0.15 < np.mean(np.square(by_noise)) / noise_m**2 < 1.0
