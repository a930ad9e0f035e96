"""A self-calibrated small block, adjusted once, and pickets on a hill inside it."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from aerotri.pipeline import adjust_keeping_system
from aerotri.volume.boundary import boundary_of
from aerotri.volume.functionals import triangulated
from aerotri.volume.pickets import pickets_where_seen
from small_blocks import small_block

ERRING = {"camera": {"ucd": {"preset": "ultracam_d", "errors": {"physical": {"rms_um": 4.0, "seed": 2}}}}}
SIGMA_MM = 0.003


@pytest.fixture(scope="session")
def calibration():
    """With all parameters of the UltraCamD, of a camera that errs by physics."""
    return adjust_keeping_system(small_block(3, "bluh:1-12,ultracam_d:42-73", **ERRING)[0])


@pytest.fixture(scope="session")
def hill(calibration):
    """Pickets on a hill in the middle of the block, their triangles, and a boundary around it."""
    middle = np.nanmedian(calibration.result.points.xyz, axis=0)
    rng = np.random.default_rng(7)
    xy = middle[:2] + rng.uniform(-220.0, 220.0, (400, 2))
    height = middle[2] + 40.0 * np.exp(-np.sum((xy - middle[:2]) ** 2, axis=1) / (2 * 80.0**2))
    xyz = np.column_stack([xy, height + rng.normal(0.0, 1.0, len(xy))])
    pickets, seen = pickets_where_seen(calibration, xyz, SIGMA_MM, 3)
    assert seen.all()
    boundary = boundary_of(shapely.Point(*middle[:2]).buffer(170.0), "hill")
    return pickets, triangulated(pickets.xyz), boundary
