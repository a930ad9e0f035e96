"""Small simulated drone flights with a rolling shutter."""

from __future__ import annotations

from aerotri.observations import Block
from aerotri.simulation import Truth, parse_spec, simulate

CAMERA = {
    "size_px": [4000, 3000], "pixel_um": 2.4, "focal_length_mm": 8.8, "flight_axis": "+y",
    "interior": {"focal_length_mm": {}, "x0_mm": {}, "y0_mm": {}},
}  # fmt: skip


def rolling_spec(shutter: dict | None = None, camera: dict | None = None, **changes) -> dict:
    """Two strips of five photographs and a cross strip of four at 8 m/s, 2 cm a pixel, 30 ms from row to row."""
    rolling = {"readout_ms": 30.0} | (shutter or {})
    return {
        "name": "drone",
        "camera": {"cam": CAMERA | {"rolling_shutter": rolling} | (camera or {})},
        "flight": {
            "gsd_m": 0.02, "strips": 2, "images_per_strip": 5, "end_lap": 0.8, "side_lap": 0.6, "speed_m_s": 8.0,
            "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [0.3, 0.3, 0.3],
            "cross_strips": [{"position": 0.5, "images": 4}],
        },
        "terrain": {"kind": "undulating", "relief_rms_m": 2.0, "wavelength_m": 40.0},
        "tie_points": {"per_image": 40, "probability": 0.8, "sigma_um": 0.8},
        "control": {"distance_bases": 3, "check_points": 6, "sigma_m": [0.01, 0.01, 0.015]},
        "gnss": {"sigma_m": [0.02, 0.02, 0.03]},
    } | changes  # fmt: skip


def rolling_block(seed: int = 1, shutter: dict | None = None, **changes) -> tuple[Block, Truth]:
    """A simulated block with a rolling shutter."""
    return simulate(parse_spec(rolling_spec(shutter, **changes)), seed)
