"""What was measured."""

from aerotri.observations.block import (
    AdjustmentSettings,
    Block,
    Camera,
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
    "Control",
    "GnssIns",
    "GnssSettings",
    "ImagePoints",
    "Images",
    "InsSettings",
    "Prior",
    "Settings",
]
