"""The specs of the sample blocks: each reads, plans what the paper prints, and scaled down simulates and adjusts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.pipeline import adjust
from aerotri.simulation import SimulationSpec, read_spec, simulate
from aerotri.simulation.cameras import true_camera
from aerotri.simulation.flight import flying_height, plan_flight
from places import PROJECT

BLOCKS = PROJECT / "blocks"
PRINTED = {
    # [P] Spreckels, Schlienkamp, Jacobsen, 5.1: "A subset of 2282 images", "GSD is 9cm", 1271 m − 252 m
    "dsk_saar_ultracam": (2282, 0.09, 1271.0 - 252.0, "day"),
    # [P] 5.2: "132 images with 80% end lap and 60% side lap, including a crossing flight line … 17cm GSD"
    "frederiksstad_ultracam": (132, 0.17, None, ""),
    # [P] 5.3: "115 images with image scale 1:7666 or 9.2cm GSD"
    "frederiksstad_dmc": (115, 0.092, 0.120 * 7666, ""),
    # [P] 6.3: "image scale 1:10600, corresponding to 1620m flying height above ground"
    "frederiksstad_rmk": (40, None, 1620.0, ""),
}
SPECS = [BLOCKS / name / "simulation.toml" for name in sorted(PRINTED)]


def test_every_block_is_tested():
    """Those after a paper here, the drone site in tests/commands/test_drone_site.py."""
    assert {path.parent.name for path in BLOCKS.glob("*/simulation.toml")} == {*PRINTED, "drone_site"}


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.parent.name)
def test_flown_as_printed(path):
    """Photographs, ground sampling distance and flying height."""
    photographs, gsd, height, day = PRINTED[path.parent.name]
    spec = read_spec(path)
    assert spec.name == path.parent.name
    camera = true_camera("own", next(iter(spec.camera.values()))).nominal
    flown, _ = plan_flight(spec.flight, [camera], spec.terrain.height_m, np.random.default_rng(1))
    assert len(flown) == photographs
    above_ground = flying_height(spec.flight, camera)
    if height is not None:
        assert above_ground == pytest.approx(height, rel=2e-3)
    if gsd is not None:
        assert above_ground * camera.pixel_mm / camera.focal_length_mm == pytest.approx(gsd, rel=6e-3)
    if day:
        assert set(flown.day.tolist()) == {"1", "2"}


def scaled_down(spec: SimulationSpec) -> SimulationSpec:
    """The same camera, height, overlap and ground over four strips of eight photographs and one across.

    So near its border a point has fewer rays than in the whole block: three on average.
    """
    cross = spec.flight.cross_strips[0].model_copy(update={"images": 6, "position": 0.5})
    flight = spec.flight.model_copy(update={"strips": 4, "images_per_strip": 8, "cross_strips": (cross,)})
    control = spec.control.model_copy(update={"check_points": 12, "distance_bases": 2.0})
    ties = spec.tie_points.model_copy(update={"rays_per_point": 3.0})
    return spec.model_copy(update={"flight": flight, "control": control, "tie_points": ties})


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.parent.name)
def test_scaled_down_it_simulates_and_self_calibration_helps(path):
    """Photographs, tie points and their rays as asked for; heights of check points better with the block's own set."""
    spec = read_spec(path)
    block, truth = simulate(scaled_down(spec), 1)
    assert len(block.images) == 38
    assert block.cameras[0].model == spec.camera[block.cameras[0].name].model
    assert block.settings.adjustment.additional_parameters
    ties = np.char.startswith(block.points.astype(str), "T")
    of_ties = ties[block.image_points.point]
    assert np.sum(of_ties) / len(block.images) == pytest.approx(spec.tie_points.per_image, rel=0.02)
    rays = np.bincount(block.image_points.point, minlength=len(block.points))[ties]
    assert rays.mean() == pytest.approx(3.0, rel=0.06)

    plain = replace(block.settings.adjustment, additional_parameters=())
    without = adjust(replace(block, settings=replace(block.settings, adjustment=plain)))
    calibrated = adjust(block)
    assert calibrated.outcome.sigma0 < without.outcome.sigma0
    rms = [np.sqrt(np.mean((r.points.xyz - truth.points)[ties, 2] ** 2)) for r in (without, calibrated)]
    assert rms[1] < 0.8 * rms[0]
