"""Simulated drone blocks with and without lens errors that change from strip to strip."""

from dataclasses import replace

import numpy as np

from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.observations import Block
from aerotri.simulation import parse_spec, simulate
from small_blocks import with_adjustment

FLIGHT = {"gsd_m": 0.02, "strips": 8, "images_per_strip": 8, "end_lap": 0.7, "side_lap": 0.5, "heading_deg": 30.0,
          "attitude_sigma_deg": [1, 1, 2], "position_sigma_m": [1, 1, 1]}  # fmt: skip
DRONE = {
    "name": "drone", "camera": {"p1": {"size_px": [8192, 5460], "pixel_um": 4.4, "focal_length_mm": 35.0}},
    "flight": FLIGHT,
    "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 4.0, "wavelength_m": 200.0},
    "tie_points": {"per_image": 80, "probability": 0.9, "sigma_um": 2.0},
    "control": {"positions": [[0.05, 0.05], [0.05, 0.95], [0.95, 0.05], [0.95, 0.95], [0.5, 0.5]],
                "sigma_m": [0.01, 0.01, 0.01], "check_points": 0},
    "start_values": {"kind": "perturbed", "position_sigma_m": 0.3, "angle_sigma_deg": 0.05},
}  # fmt: skip


def with_changing_strips(block: Block, seed: int, moving_um: float) -> Block:
    """The block with a lens that errs in every strip by other terms of second and third order, so many µm RMS."""
    rays, rng = block.image_points, np.random.default_rng(1000 + seed)
    xy, strip = rays.xy.copy(), block.images.strip[rays.image].astype(str)
    x, y = rays.xy[:, 0] / 18.0, rays.xy[:, 1] / 12.0
    terms = np.stack([x * y, x * x, y * y, x * x * y, x * y * y, x**3], axis=1)
    for name in np.unique(strip):
        error = terms[strip == name] @ rng.normal(size=(6, 2))
        xy[strip == name] += error * moving_um * 1e-3 / np.sqrt(np.mean(error**2))
    return replace(block, image_points=replace(rays, xy=xy))


def drone_block(seed: int, moving_um: float = 0.0, **flight):
    """A drone block of eight strips; the lens of every strip errs by other terms of second and third order."""
    block, truth = simulate(parse_spec(DRONE | {"flight": FLIGHT | flight}), seed)
    block = with_adjustment(block, additional_parameters=parse_parameters("brown:K1+K2+P1+P2"))
    return (with_changing_strips(block, seed, moving_um) if moving_um else block), truth


def few_strips(seed: int, moving_um: float = 0.0, strips: int = 3):
    """The same of three strips or one, of twelve photographs each."""
    return drone_block(seed, moving_um, strips=strips, images_per_strip=12)
