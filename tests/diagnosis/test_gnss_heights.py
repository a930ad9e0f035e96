"""Heights of PPK positions from the ellipsoid beside control points from sea level are seen before an adjustment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.diagnosis.gnss_heights import doubts_of_gnss_heights
from small_blocks import small_block


@pytest.mark.parametrize(
    ("lift", "sigma", "crs", "words"),
    [
        (45.6, 0.02, "EPSG:25832", "45.6 m above where control points put the photographs: do control points count"),
        (-45.6, 0.02, "EPSG:25832+7837", "45.6 m below where control points put the photographs: is the geoid"),
        (45.6, 10.0, "EPSG:25832", ""),
        (0.5, 0.02, "EPSG:25832", ""),
    ],
)
def test_heights_from_two_places(lift, sigma, crs, words):
    gnss = {"sigma_m": [0.02, 0.02, 0.02], "shift_sigma_m": [0.0, 0.0, 0.0], "lever_arm_m": [0.0, 0.0, 0.0]}
    flight = {"gsd_m": 0.01, "strips": 2, "images_per_strip": 4, "end_lap": 0.6, "side_lap": 0.4, "heading_deg": 30.0}
    ground = {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 1.0, "wavelength_m": 90.0}
    block, truth = small_block(
        2, flight=flight, terrain=ground, gnss=gnss, tie_points={"per_image": 12, "sigma_um": 2.0}
    )
    assert block.gnss_ins is not None
    high = replace(
        block.gnss_ins, xyz=block.gnss_ins.xyz + [0.0, 0.0, lift], sigma=np.full_like(block.gnss_ins.sigma, sigma)
    )
    images = replace(block.images, centre=truth.centre)
    said = doubts_of_gnss_heights(replace(block, images=images, gnss_ins=high, crs=crs))
    assert [words in text for text in said] == ([True] if words else [])
