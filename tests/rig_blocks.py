"""Small simulated blocks flown with rigs."""

from __future__ import annotations

from aerotri.observations import Block
from aerotri.simulation import Truth, parse_spec, simulate
from small_blocks import small_spec

OBLIQUE = {"size_px": [6000, 4000], "pixel_um": 4.0, "focal_length_mm": 35.0}
NADIR = {"size_px": [6000, 4000], "pixel_um": 4.0, "focal_length_mm": 25.0}
MOUNTINGS = {
    "left": {"position_m": [-0.05, 0.01, 0.02], "rotation_deg": [1.0, -40.5, -91.0]},
    "right": {"position_m": [0.05, -0.01, 0.02], "rotation_deg": [-0.5, 40.0, 89.0]},
    "fore": {"position_m": [0.0, 0.06, 0.03], "rotation_deg": [41.0, 0.8, 0.5]},
    "aft": {"position_m": [0.0, -0.06, 0.03], "rotation_deg": [-40.0, 0.3, 179.0]},
}
"""True mountings of four oblique cameras beside a nadir camera."""
EXACT = {"position_sigma_m": [0.005, 0.005, 0.005]}


def rig_spec(cameras: tuple[str, ...] = tuple(MOUNTINGS), mounting: dict | None = None, **changes) -> dict:
    """Two strips of five stations and a cross strip of three; `mounting` adds to what is stated of every camera."""
    rig = changes.pop("rig", {})
    return small_spec(
        name="rig",
        camera={"nadir": NADIR, **dict.fromkeys(cameras, OBLIQUE)},
        flight={
            "gsd_m": 0.1, "strips": 2, "images_per_strip": 5, "end_lap": 0.7, "side_lap": 0.5, "heading_deg": 30.0,
            "cross_strips": [{"position": 0.5, "images": 3}], "attitude_sigma_deg": [1.0, 1.0, 2.0],
            "position_sigma_m": [5.0, 5.0, 3.0],
        },
        tie_points={"per_image": 40, "probability": 0.9, "sigma_um": 2.0},
        rig={"frame": {
            "reference": "nadir", "camera": {name: MOUNTINGS[name] | (mounting or {}) for name in cameras}, **rig,
        }},
    ) | changes  # fmt: skip


def rig_block(seed: int = 1, **changes) -> tuple[Block, Truth]:
    """A simulated block flown with a rig."""
    return simulate(parse_spec(rig_spec(**changes)), seed)
