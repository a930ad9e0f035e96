"""A block of ten photographs with GNSS/INS, control and check points, and its measurements wrong in many ways."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.observations import Block
from aerotri.simulation import parse_spec, simulate

SPEC = {
    "name": "ten",
    "camera": {"ucd": {"preset": "ultracam_d"}},
    "flight": {
        "gsd_m": 0.1, "strips": 2, "images_per_strip": 5, "end_lap": 0.6, "side_lap": 0.4,
        "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0],
    },
    "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 30.0, "wavelength_m": 900.0},
    "tie_points": {"per_image": 60, "probability": 0.9, "sigma_um": 2.0},
    "control": {"distance_bases": 2.0, "sigma_m": [0.03, 0.03, 0.05], "check_points": 8},
    "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.05},
}  # fmt: skip
GNSS_INS = {"gnss": {"sigma_m": [0.05, 0.05, 0.08]}, "ins": {"sigma_deg": [0.005, 0.005, 0.01]}}


def ten_photographs(seed: int = 1, navigated: bool = True) -> Block:
    """The faultless block; control alone holds it where it is not navigated."""
    return simulate(parse_spec(SPEC | (GNSS_INS if navigated else {})), seed)[0]


def with_image_points(block: Block, image: int | None, change) -> Block:
    """The block with the measurements of one photograph, or of all, changed: `change` takes and gives (m, 2) mm."""
    points = block.image_points
    own = np.full(len(points), True) if image is None else points.image == image
    xy = points.xy.copy()
    xy[own] = change(xy[own])
    return replace(block, image_points=replace(points, xy=xy))
