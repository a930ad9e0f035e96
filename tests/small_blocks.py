"""Small simulated blocks for the tests of adjustment and statistics."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import aerotri
from aerotri.formats.block.folder import write_block
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.observations import Block
from aerotri.rasters.grids import Grid
from aerotri.simulation import Truth, parse_spec, simulate

ERRING = {"camera": {"ucd": {"preset": "ultracam_d", "errors": {"physical": {"rms_um": 4.0, "seed": 2}}}}}
"""For `small_spec`: a camera that errs by physics."""
LONG_FLIGHT = {
    "gsd_m": 0.1, "strips": 3, "images_per_strip": 14, "end_lap": 0.6, "side_lap": 0.4, "heading_deg": 30.0,
    "attitude_sigma_deg": [1.0, 1.0, 2.0],
}  # fmt: skip
"""For `small_spec`: long enough to be cut into parts."""


def small_spec(**changes) -> dict:
    """An UltraCamD block of 3 × 6 photographs at 60/40 % with a cross strip; `changes` replace whole tables."""
    spec = {
        "name": "small",
        "camera": {"ucd": {"preset": "ultracam_d"}},
        "flight": {
            "gsd_m": 0.1,
            "strips": 3,
            "images_per_strip": 6,
            "end_lap": 0.6,
            "side_lap": 0.4,
            "heading_deg": 30.0,
            "cross_strips": [{"position": 0.5, "images": 5}],
            "attitude_sigma_deg": [1.0, 1.0, 2.0],
            "position_sigma_m": [5.0, 5.0, 3.0],
        },
        "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 30.0, "wavelength_m": 900.0},
        "tie_points": {"per_image": 60, "probability": 0.9, "sigma_um": 2.0},
        "control": {"distance_bases": 3.0, "sigma_m": [0.03, 0.03, 0.05], "check_points": 8},
        "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.05},
    }
    return spec | changes


def small_block(seed: int = 1, parameters: str = "none", **changes) -> tuple[Block, Truth]:
    """A simulated block with settings for the additional parameters to be estimated."""
    block, truth = simulate(parse_spec(small_spec(**changes)), seed)
    return with_adjustment(block, additional_parameters=parse_parameters(parameters)), truth


def with_adjustment(block: Block, **settings) -> Block:
    """The block with other settings of its adjustment."""
    adjustment = replace(block.settings.adjustment, **settings)
    return replace(block, settings=replace(block.settings, adjustment=adjustment))


def with_gross_errors(block: Block, count: int = 30, size_mm: float = 0.05) -> Block:
    """Some image points far off."""
    rng = np.random.default_rng(1)
    xy = block.image_points.xy.copy()
    wrong = rng.choice(len(xy), count, replace=False)
    xy[wrong] += rng.normal(0.0, size_mm, (count, 2))
    return replace(block, image_points=replace(block.image_points, xy=xy))


def adjusted_place(folder: Path, cell: float, count: int) -> tuple[Grid, np.ndarray, np.ndarray, np.ndarray]:
    """A square of cells in the middle of a block whose result is written: its grid, (x, y) of its middle, m, and
    (rows, columns) how far cells lie east and north of it."""
    block, truth = small_block(5, "bluh:1-12")
    write_block(block, folder / "block")
    aerotri.adjust(folder / "block").save(folder / "result", plots=False)
    middle = np.round(np.median(truth.centre[:, :2], axis=0))
    half = cell * count / 2.0
    grid = Grid(count, count, middle[0] - half, middle[1] + half, cell, cell)
    x, y = np.meshgrid(grid.x(np.arange(count)) - middle[0], grid.y(np.arange(count)) - middle[1])
    return grid, middle, x, y
