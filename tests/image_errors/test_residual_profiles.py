"""Mean residuals by column and row: the means of the records, and a test that keeps its level."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.image_errors.residual_profiles import residual_profiles
from synthetic import make_adjusted_block


@pytest.fixture(scope="module")
def adjusted():
    return make_adjusted_block(4, 10, 500)


def with_residuals(adjusted, v):
    return replace(adjusted, rays=replace(adjusted.rays, v=np.where(np.isfinite(adjusted.rays.v), v, np.nan)))


def test_means_are_those_of_the_records(adjusted):
    """The third bin along the columns and the last along the rows, from the rays themselves."""
    found = residual_profiles(adjusted)
    camera, rays = adjusted.block.cameras[0], adjusted.block.image_points
    columns, rows = found.profiles
    assert (columns.axis, rows.axis) == (0, 1)
    px = camera.pixel_mm
    place = (rays.xy * [1, -1]) / px + np.array(camera.size_px) / 2
    for profile, axis, number in ((columns, 0, 2), (rows, 1, len(rows.count) - 1)):
        own = (place[:, axis] >= profile.edges[number]) & (place[:, axis] < profile.edges[number + 1])
        own &= adjusted.rays.status == 0
        assert profile.count[number] == own.sum()
        assert profile.photographs[number] == len(set(rays.image[own].tolist()))
        assert profile.mean[number] == pytest.approx(-adjusted.rays.v[own].mean(axis=0) / px, rel=1e-9)
        sums = np.array([-adjusted.rays.v[own & (rays.image == i)].sum(axis=0) / px for i in set(rays.image[own])])
        assert profile.sigma[number] == pytest.approx(np.sqrt((sums**2).sum(axis=0)) / own.sum(), rel=1e-9)


def test_level_of_noise_that_a_photograph_shares(adjusted):
    """Noise with a smooth part that all rays of a photograph share: called systematic in about 5 % of the blocks."""
    rays = adjusted.block.image_points
    said = []
    for seed in range(60):
        random = np.random.default_rng(seed)
        wave = random.normal(0, 1, (len(adjusted.block.images), 2))[rays.image] * np.cos(rays.xy / 20.0)
        v = 2e-3 * (random.normal(0, 1, rays.xy.shape) + 2.0 * wave)
        said.append(residual_profiles(with_residuals(adjusted, v)).systematic)
    # 3 are expected; 10 or more in one of 1000 cases
    assert sum(said) < 10


def test_a_curve_is_found_where_it_is(adjusted):
    """An error of y that depends on the row: filled there and nowhere else, and with its sign."""
    rays, random = adjusted.block.image_points, np.random.default_rng(3)
    v = random.normal(0, 2e-3, rays.xy.shape)
    v[:, 1] -= 3e-3 * np.sin(rays.xy[:, 1] / 8.0)
    found = residual_profiles(with_residuals(adjusted, v))
    assert found.systematic
    assert found.p == pytest.approx(1 / 500)
    columns, rows = found.profiles
    camera = adjusted.block.cameras[0]
    middle = 0.5 * (rows.edges[1:] + rows.edges[:-1])
    y = (camera.size_px[1] / 2 - middle) * camera.pixel_mm
    expected = 3e-3 * np.sin(y / 8.0) / camera.pixel_mm
    assert np.corrcoef(rows.mean[:, 1], expected)[0, 1] > 0.9
    assert (rows.t[:, 1] > found.limit).sum() >= 3
    assert (columns.t > found.limit).sum() <= 1


def test_too_few_photographs():
    found = residual_profiles(make_adjusted_block(1, 4, 100))
    assert found.profiles == ()
    assert np.isnan(found.p)
    assert not found.systematic
