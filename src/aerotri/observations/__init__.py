"""What was measured."""

from aerotri.observations.block import (
    AdjustmentSettings,
    Block,
    Camera,
    CollocationSettings,
    Control,
    GnssIns,
    GnssSettings,
    ImagePoints,
    Images,
    InsSettings,
    Prior,
    Settings,
)

__all__ = [
    "AdjustmentSettings",
    "Block",
    "Camera",
    "CollocationSettings",
    "Control",
    "GnssIns",
    "GnssSettings",
    "ImagePoints",
    "Images",
    "InsSettings",
    "Prior",
    "Settings",
]
