"""A surface far from the ground of the block that it is used with is told."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

import aerotri
from aerotri.public.ground_of_block import off_the_ground

PLAN = {
    "name": "level",
    "camera": {"cam": {"size_px": [1000, 750], "pixel_um": 30.0, "focal_length_mm": 30.0}},
    "flight": {"gsd_m": 0.5, "strips": 1, "images_per_strip": 4, "heading_deg": 0.0},
    "terrain": {"kind": "flat", "height_m": 50.0},
    "tie_points": {"per_image": 40, "sigma_um": 3.0},
    "control": {"distance_bases": 1.0, "sigma_m": [0.02, 0.02, 0.02]},
}


@pytest.fixture(scope="module")
def result():
    return aerotri.adjust(aerotri.simulate(PLAN, seed=1).block, explain=False)


def level(result, height, scatter=0.0):
    """A surface over the whole block, in memory."""
    xyz = np.asarray(result.record.result.points.xyz)
    low, high = xyz[:, :2].min(axis=0) - 20.0, xyz[:, :2].max(axis=0) + 20.0
    columns, rows = (int(n) for n in np.ceil((high - low) / 5.0))
    z = height + np.random.default_rng(1).normal(scale=scatter, size=(rows, columns))
    return aerotri.Surface.of_array(z, left=float(low[0]), top=float(low[1]) + 5.0 * rows, cell=5.0, name="level")


@pytest.mark.parametrize(("height", "said"), [(50.0, ""), (51.5, ""), (23.0, "27.0 m below"), (97.3, "47.3 m above")])
def test_how_far_it_lies(result, height, said):
    found = off_the_ground(level(result, height).reader(), result.record)
    assert said in found
    assert bool(found) == bool(said)


def test_rough_ground_and_few_points_say_nothing(result):
    assert off_the_ground(level(result, 45.0, scatter=15.0).reader(), result.record) == ""
    small = aerotri.Surface.of_array(np.full((4, 4), 0.0), left=0.0, top=4.0, cell=1.0)
    assert off_the_ground(small.reader(), result.record) == ""


def test_a_volume_says_it(result):
    xyz = np.asarray(result.record.result.points.xyz)
    pile = shapely.Point(*np.median(xyz[:, :2], axis=0)).buffer(60.0)
    good = aerotri.volume(level(result, 50.0), pile, base=40.0, adjustment=result)
    assert not any("points of the adjustment" in text for text in good.warnings)
    low = aerotri.volume(level(result, 23.0), pile, base=20.0, adjustment=result)
    assert any("level lies 27.0 m below the points of the adjustment" in text for text in low.warnings)
    base = aerotri.volume(
        level(result, 50.0), pile, base=level(result, 97.3), adjustment=result, base_adjustment=result
    )
    assert any("47.3 m above" in text for text in base.warnings)
