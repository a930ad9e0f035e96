"""Rings before the first adjustment: where control points are, by start values, or by GNSS alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.bench.places import places_of
from aerotri.bench.records import pixels_of_rays
from aerotri.bench.rough_prediction import rough_prediction
from aerotri.bench.session import Bench
from aerotri.formats.block.folder import write_block
from aerotri.observations import GnssIns
from small_blocks import small_block


def off(block) -> np.ndarray:
    """(k,) px between measured control and check points and where they are predicted; NaN where they are not."""
    rays, prediction = block.image_points, rough_prediction(block)
    given = dict(zip(block.control.point.tolist(), block.control.xyz, strict=True))
    rows = np.flatnonzero(np.isin(rays.point, block.control.point))
    measured = pixels_of_rays(block, rows, rays.xy[rows])
    found = [prediction.pixels(int(rays.image[k]), given[int(rays.point[k])][None])[0] for k in rows.tolist()]
    return np.hypot(*(np.array(found) - measured).T)


@pytest.fixture(scope="module")
def block():
    return small_block(seed=4)[0]


def test_by_start_values(block):
    error = off(block)
    assert np.isfinite(error).mean() > 0.9
    assert np.nanmedian(error) < 60.0


def test_by_gnss_alone_in_the_right_quarter_of_the_photograph(block):
    n = len(block.images)
    nothing, one = np.full((n, 3), np.nan), np.full((n, 3), 0.1)
    gnss = GnssIns(np.arange(n), block.images.centre, one, nothing, nothing, np.full(n, np.nan))
    images = replace(block.images, centre=nothing, angles=nothing)
    error = off(replace(block, images=images, gnss_ins=gnss))
    assert np.isfinite(error).mean() > 0.5
    assert np.nanmedian(error) < 0.1 * max(block.cameras[0].size_px)


def test_without_positions_there_is_none(block):
    nothing = np.full((len(block.images), 3), np.nan)
    images = replace(block.images, centre=nothing, angles=nothing)
    assert rough_prediction(replace(block, images=images, gnss_ins=None)) is None


def test_bench_of_a_block_shows_rings_of_unmarked_control(block, tmp_path):
    rays = block.image_points
    keep = ~np.isin(rays.point, block.control.point)
    unmarked = replace(block, image_points=replace(
        rays, image=rays.image[keep], point=rays.point[keep], xy=rays.xy[keep], sigma=rays.sigma[keep]))  # fmt: skip
    write_block(unmarked, tmp_path / "unmarked")
    bench = Bench(places_of(tmp_path / "unmarked"))
    bench.wait()
    shown = [bench.photograph(k)["expected"] for k in range(len(block.images))]
    names = bench.records.block.points
    seen = {str(names[point]) for one in shown for point, *_ in one}
    assert seen == set(block.points[block.control.point].tolist())
    assert bench.summary()["is_rough"]
