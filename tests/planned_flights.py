"""Small plans."""

from __future__ import annotations

import numpy as np

from aerotri.planning.area import Area, read_area
from aerotri.planning.cameras import camera_of_plan
from aerotri.planning.given_control import NONE
from aerotri.planning.ground import Ground, level_ground
from aerotri.planning.options import PlanOptions, Target
from aerotri.planning.plan import PlanRecord, make_plan

TRIANGLE = "SRID=25832;POLYGON ((500000 5800000, 500200 5800000, 500160 5800120, 500000 5800000))"
FIELD = "POLYGON ((0 0, 160 30, 140 150, 20 120, 0 0))"


def hill(height: float = 18.0) -> Ground:
    """A hill in the middle of FIELD, on a level of 100 m."""
    x = np.arange(-300.0, 501.0, 5.0)
    east, north = np.meshgrid(x, x)
    z = 100.0 + height * np.exp(-((east - 80.0) ** 2 + (north - 75.0) ** 2) / (2.0 * 40.0**2))
    return Ground(z, -300.0, -300.0, 5.0, "hill")


def area_of(text: str = FIELD) -> Area:
    return read_area(text)


def planned(
    options: PlanOptions, ground: Ground | None = None, target: Target | None = None, wanted: int | None = None,
    text: str = FIELD,
) -> PlanRecord:  # fmt: skip
    camera = camera_of_plan("p1", options.self_calibration != "none")
    return make_plan(area_of(text), ground or level_ground(100.0), camera, options.checked(), target, NONE, wanted)
