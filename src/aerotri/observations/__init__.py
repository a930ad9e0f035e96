"""What was measured: the records that a block is made of.

`dataclasses.replace` gives a block with something changed; names are arrays of text, everything else refers to them by
number; image coordinates in mm from the image centre, x right, y up, object coordinates in m, angles in rad.

>>> import numpy as np
>>> from aerotri import observations
>>> held = {name: observations.Prior(value, fixed=True) for name, value in
...         (("focal_length_mm", 100.0), ("x0_mm", 0.0), ("y0_mm", 0.0))}
>>> camera = observations.Camera("cam", "frame", (16000, 11000), 10.0, held)
>>> camera.half_format_mm
(80.0, 55.0)
"""

from aerotri.observations.block import Block, Camera, Constraints, Control, GnssIns, ImagePoints, Images
from aerotri.observations.prior import Prior
from aerotri.observations.rigs import Mounting, Rig
from aerotri.observations.rolling_shutter import RollingShutter
from aerotri.observations.settings import (
    AdjustmentSettings,
    CollocationSettings,
    DeviationSettings,
    GnssSettings,
    InsSettings,
    PhotographFieldSettings,
    Settings,
)

__all__ = [
    "AdjustmentSettings",
    "Block",
    "Camera",
    "CollocationSettings",
    "Constraints",
    "Control",
    "DeviationSettings",
    "GnssIns",
    "GnssSettings",
    "ImagePoints",
    "Images",
    "InsSettings",
    "Mounting",
    "PhotographFieldSettings",
    "Prior",
    "Rig",
    "RollingShutter",
    "Settings",
]
