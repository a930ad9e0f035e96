"""Residuals by photograph: the numbers of the records, the wrong photograph found, chance not named."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.report.tables.photographs import photograph_residuals_table
from aerotri.statistics.photograph_residuals import photograph_residuals
from synthetic import make_adjusted_block


def test_numbers_of_the_records():
    adjusted = make_adjusted_block(3, 8, 300)
    found = photograph_residuals(adjusted)
    rays, pixel = adjusted.block.image_points, adjusted.block.cameras[0].pixel_mm
    own = (rays.image == 5) & (adjusted.rays.status == 0)
    assert found.rays[5] == own.sum()
    assert found.rms_px[5] == pytest.approx(np.sqrt((adjusted.rays.v[own] ** 2).mean(axis=0)) / pixel)
    table = photograph_residuals_table(found, adjusted)
    worst = int(np.nanargmax(found.ratio))
    assert table.rows[0][:2] == (adjusted.block.images.names[worst], found.rays[worst])
    assert table.rows[0][2] == pytest.approx(found.rms_px[worst, 0])
    assert table.rows[-1][0] == "all"
    assert table.rows[-1][1] == found.rays.sum()


@pytest.mark.parametrize("tails", [False, True])
def test_the_wrong_photograph_and_no_other(tails):
    """Of 40 blocks hardly one names a photograph by chance, heavy tails or not; one with residuals of 2 σ is named."""
    adjusted = make_adjusted_block(4, 10, 300)
    rays, r = adjusted.block.image_points, adjusted.rays.r
    named = 0
    for seed in range(40):
        random = np.random.default_rng(seed)
        z = random.standard_t(5, r.shape) if tails else random.normal(size=r.shape)
        v = 2.5e-3 * np.sqrt(r) * z
        named += photograph_residuals(replace(adjusted, rays=replace(adjusted.rays, v=v))).beyond.any()
    # 2 are expected; 7 or more in one of 200 cases with the normal distribution
    assert named < (10 if tails else 7)
    v[rays.image == 17] *= 2.0
    found = photograph_residuals(replace(adjusted, rays=replace(adjusted.rays, v=v)))
    assert found.beyond[17]
    assert found.worst_first[0] == 17


def test_photographs_without_rays():
    adjusted = make_adjusted_block(2, 5, 80)
    status = np.where(adjusted.block.image_points.image == 3, 1, adjusted.rays.status)
    found = photograph_residuals(replace(adjusted, rays=replace(adjusted.rays, status=status)))
    assert found.rays[3] == 0
    assert np.isnan(found.ratio[3])
    assert 3 not in found.worst_first
    nothing = photograph_residuals(replace(adjusted, rays=replace(adjusted.rays, status=np.ones_like(status))))
    assert not len(nothing.worst_first)
