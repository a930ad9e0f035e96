"""Flights designed for a volume, as flight plans."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

FILM_MM, FOCAL_MM = 230.0, 153.0
"""The wide-angle film camera of the theory."""
END_LAP = 0.6
"""Share of a photograph that the next one shows too: 60 %, that of the theory (Kubik, paper 001)."""
SIGMA0_SHARE = 2e-4
"""σ of a height from one model over the flying height (Kubik, paper 001)."""


@dataclass(frozen=True)
class VolumeDesign:
    """A flight over an area by a wide-angle film camera, 60 % end lap.

    Parameters
    ----------
    height : m, flying height over the ground.
    length, width : m, of the area, along and across the strips.
    bridging : m, between control points along the strips.
    sigma0_share : σ of a height from one model over the flying height.
    """

    height: float
    length: float
    width: float
    bridging: float
    sigma0_share: float = SIGMA0_SHARE

    @property
    def base(self) -> float:
        """m, from the end lap of the format."""
        return (1.0 - END_LAP) * FILM_MM / FOCAL_MM * self.height

    @property
    def models(self) -> float:
        """Number of stereo models, as a share of one is counted too."""
        return (self.length / self.base + 1.0) * (self.width / (2.0 * self.base) + 1.0)


def volume_flight(design: VolumeDesign, pointing: float = 1.0) -> dict[str, Any]:
    """The plan of a flight: strips along X as the theory has them, with two control points in every strip at the
    distance that is bridged.

    The image σ is the one that gives σ0 to a height from one model: σ0 = √2·(H/B)·(H/c)·σ.

    Parameters
    ----------
    pointing : σ of an image point of a control point over that of a tie point.
    """
    base, sigma0 = design.base, design.sigma0_share * design.height
    sigma_um = 1e3 * sigma0 / (np.sqrt(2.0) * design.height / base * design.height / FOCAL_MM)
    strips = max(1, round(design.width / (2.0 * base)))
    images = max(2, round(design.length / base) + 1)
    return {
        "name": "design",
        "camera": {"film": {"model": "frame", "size_px": [11500, 11500], "pixel_um": 20.0,
                            "focal_length_mm": FOCAL_MM, "flight_axis": "+x"}},
        "flight": {"height_m": design.height, "strips": strips, "images_per_strip": images, "end_lap": END_LAP,
                   "side_lap": 0.2, "heading_deg": 90.0, "attitude_sigma_deg": [0.5, 0.5, 0.5]},
        "terrain": {"kind": "flat", "height_m": 0.0},
        "tie_points": {"per_image": 15.0, "distribution": "nodes", "pattern": [3, 3], "sigma_um": sigma_um},
        "control": {"positions": _control(images - 1, round(design.bridging / base), strips),
                    "sigma_m": [0.001, 0.001, 0.001], "image_sigma_um": pointing * sigma_um},
        "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.02},
    }  # fmt: skip


def _control(models: int, bridged: int, strips: int) -> list[list[float]]:
    """Places (along, across) in shares of the block."""
    along = [min(k / models, 1.0) for k in range(0, models + 1, max(bridged, 1))]
    across = [(strip + 0.5 + side) / strips for strip in range(strips) for side in (-0.4, 0.4)]
    return [[a, c] for a in along for c in across]
