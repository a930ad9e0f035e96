"""Whether neighbouring rays of a photograph err alike: known correlations found, none where there is none."""

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.adjustment.ray_status import RayStatus
from aerotri.diagnosis.neighbouring_rays import of_neighbouring_rays
from aerotri.observations import ImagePoints
from aerotri.results.adjusted_block import RayResults
from aerotri.statistics.ray_correlation import CLIP, ray_correlation
from small_blocks import small_block

PHOTOGRAPHS, EACH = 40, 120
SHARED, LENGTH = 0.4, 0.03
"""Share of the variance that neighbours have in common, and its correlation length in half diagonals."""


def residuals(seed: int, shared: float):
    """A block's cameras with rays of which a share of the errors is a random field of every photograph."""
    rng, block = np.random.default_rng(seed), small_block()[0]
    reach = block.cameras[0].r_max_mm
    xy = rng.uniform(-0.35, 0.35, (PHOTOGRAPHS, EACH, 2))
    z = rng.normal(size=(PHOTOGRAPHS, EACH, 2)) * np.sqrt(1.0 - shared)
    for own, errors in zip(xy, z, strict=True):
        far = np.linalg.norm(own[:, None] - own[None], axis=2)
        root = np.linalg.cholesky(np.exp(-far / LENGTH) + 1e-9 * np.eye(EACH))
        errors += np.sqrt(shared) * root @ rng.normal(size=(EACH, 2))
    image, m = np.repeat(np.arange(PHOTOGRAPHS), EACH), PHOTOGRAPHS * EACH
    images = replace(block.images, camera=np.zeros(PHOTOGRAPHS, dtype=np.int64))
    rays = ImagePoints(image, np.arange(m), reach * xy.reshape(m, 2), np.ones((m, 2)))
    w, ones = z.reshape(m, 2), np.ones((m, 2))
    found = RayResults(w, ones, w, np.ones(m), np.full(m, RayStatus.USED))
    return replace(block, images=images, image_points=rays), found


def expected(found) -> np.ndarray:
    """Correlation in the middle of every class, of errors that are not clipped."""
    limits = found.limits_px / (small_block()[0].cameras[0].r_max_mm / small_block()[0].cameras[0].pixel_mm)
    middle = 2.0 / 3.0 * (limits[1:] ** 3 - limits[:-1] ** 3) / (limits[1:] ** 2 - limits[:-1] ** 2)
    return SHARED * np.exp(-middle / LENGTH)


def test_a_known_correlation_is_found_with_its_sigma():
    errors = []
    for seed in range(12):
        found = ray_correlation(*residuals(seed, SHARED))
        assert found.alike
        known = np.isfinite(found.correlation).all(axis=1)
        errors.append((found.correlation[known] - expected(found)[known, None]) / found.sigma[known])
    z = np.concatenate(errors).ravel()
    # neighbouring classes share photographs, not pairs; clipping at 3 σ makes correlations smaller by a hundredth
    assert CLIP == 3.0
    assert abs(z.mean()) < 0.5
    assert 0.8 < np.sqrt(np.mean(z**2)) < 1.25


def test_independent_errors_are_not_alike():
    p = [ray_correlation(*residuals(100 + seed, 0.0)).p for seed in range(40)]
    # uniform: of 40 the smallest is below 1e-5 with a probability of 4e-4, fewer than 7 above .5 with one of 1e-5
    assert min(p) > 1e-5
    assert sum(value > 0.5 for value in p) >= 7


def test_residuals_of_zero_tell_nothing():
    block, rays = residuals(1, 0.0)
    found = ray_correlation(block, replace(rays, w=0.0 * rays.w))
    assert not found.alike
    assert "do not scatter" in found.reason


def test_rays_that_do_not_take_part():
    block, rays = residuals(1, SHARED)
    off = np.arange(len(rays.status)) % 3 == 0
    wild = replace(rays, w=np.where(off[:, None], 1e6, rays.w), status=np.where(off, RayStatus.OFF, RayStatus.USED))
    kept = replace(block, image_points=replace(
        block.image_points, image=block.image_points.image[~off], point=block.image_points.point[~off],
        xy=block.image_points.xy[~off], sigma=block.image_points.sigma[~off],
    ))  # fmt: skip
    only = RayResults(*(getattr(rays, name)[~off] for name in ("v", "r", "w", "weight", "status")))
    assert ray_correlation(block, wild).as_dict() == ray_correlation(kept, only).as_dict()


def test_blocks_of_few_rays_say_why_there_is_no_test():
    block, rays = residuals(1, SHARED)
    few = replace(rays, status=np.where(block.image_points.image < 3, RayStatus.USED, RayStatus.OFF))
    assert "fewer than 5 photographs" in ray_correlation(block, few).reason
    apart = replace(block, image_points=replace(block.image_points, xy=100.0 * block.image_points.xy))
    assert ray_correlation(apart, rays).reason


TIES = {"per_image": 250, "probability": 0.9, "sigma_um": 2.0}


@pytest.mark.parametrize("shared_um", [0.0, 3.0])
def test_an_adjustment_says_it(shared_um):
    block = small_block(5, tie_points=TIES)[0]
    rays, rng, n = block.image_points, np.random.default_rng(7), len(block.images)
    waves, phase = rng.normal(0.0, 6.0, (n, 2, 2)), rng.uniform(0.0, 6.3, (n, 2))
    unit = rays.xy / block.cameras[0].r_max_mm
    moved = np.sin(np.einsum("rk,rak->ra", unit, waves[rays.image]) + phase[rays.image])
    block = replace(block, image_points=replace(rays, xy=rays.xy + 1e-3 * shared_um * moved))
    found = aerotri.adjust(block, explain=False).adjusted
    assert np.isfinite(found.ray_correlation.p)
    assert found.ray_correlation.alike == bool(shared_um)
    (finding,) = of_neighbouring_rays(found)
    assert finding.level == ("note" if shared_um else "good")
