"""Cameras by name, with the fields of `[camera.*]` in block.toml."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

PRESETS: MappingProxyType[str, dict[str, Any]] = MappingProxyType(
    {
        # f = 101.4 mm fits every h/b of Spreckels et al.
        "ultracam_d": {
            "model": "ultracam_d",
            "size_px": [11500, 7500],
            "pixel_um": 9.0,
            "focal_length_mm": 101.4,
            "flight_axis": "+y",
        },
        "dmc": {
            "model": "dmc",
            "size_px": [13824, 7680],
            "pixel_um": 12.0,
            "focal_length_mm": 120.0,
            "flight_axis": "+y",
        },
        # a film of 230 mm, scanned
        "rmk_top_15": {
            "model": "frame",
            "size_px": [18400, 18400],
            "pixel_um": 12.5,
            "focal_length_mm": 153.0,
            "flight_axis": "+x",
        },
        "p1": {
            "model": "frame",
            "size_px": [8192, 5460],
            "pixel_um": 4.4,
            "focal_length_mm": 35.0,
            "flight_axis": "+y",
        },
    }
)
"""Formats, pixels and focal lengths are those of the makers; a comment says what was derived."""
