"""Simulated blocks and their photographs."""

from __future__ import annotations

import numpy as np
import pytest

import aerotri
from aerotri import InputError

PLAN = {
    "name": "tiny",
    "camera": {"ucd": {"preset": "ultracam_d", "size_px": [288, 188], "pixel_um": 360.0}},
    "flight": {"gsd_m": 2.0, "strips": 1, "images_per_strip": 3},
    "tie_points": {"per_image": 12, "sigma_um": 2.0},
}


@pytest.fixture(scope="module")
def tiny():
    return aerotri.simulate(PLAN, seed=1)


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_photographs_beside_the_block(tiny, tmp_path):
    """The looks that were asked for; photographs of an older block do not stay beside a new one."""
    import rasterio

    told = []
    folder = tiny.save(tmp_path / "b", photographs=True, only=["1_002"], noise=0.0,
                       progress=lambda stage, share: told.append((stage, share)))  # fmt: skip
    smooth = rasterio.open(folder / "photographs" / "1_002.tif").read(1).astype(float)
    assert ("rendering", 1.0) in told
    tiny.save(folder, photographs=True, only=["1_002", "1_003"], noise=500.0)
    grains = rasterio.open(folder / "photographs" / "1_002.tif").read(1) - smooth
    assert 450.0 < grains.std() < 550.0
    tiny.save(folder)
    assert not list((folder / "photographs").glob("*.tif"))


def test_files_of_others_are_kept(tiny, tmp_path):
    (tmp_path / "photographs").mkdir()
    (tmp_path / "photographs" / "1_001.tif").write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        tiny.save(tmp_path, photographs=True)
    assert not (tmp_path / "block.toml").exists()
    with pytest.raises(InputError, match="no photograph '9'"):
        tiny.save(tmp_path, photographs=True, only=["9"])
    tiny.save(tmp_path)
    assert (tmp_path / "photographs" / "1_001.tif").read_text() == "mine"
    assert len(aerotri.read_block(tmp_path).images) == 3


def test_looks_that_are_not_possible(tmp_path):
    flight = aerotri.simulate(aerotri.example_flight(), seed=3)
    with pytest.raises(InputError, match="contrast 2 or detail_px 2"):
        flight.save(tmp_path / "flight", photographs=True, contrast=2.0)


def test_true_ground_in_a_crs():
    """Points of the truth lie on the ground there too."""
    plan = aerotri.example_flight()
    plan["georeference"] = {"crs": "EPSG:32632", "origin": [500_000.0, 5_400_000.0, 300.0]}
    flight = aerotri.simulate(plan, seed=3)
    points = flight.truth.points
    assert np.allclose(flight.true_heights(points[:, :2]), points[:, 2], atol=1e-5)
