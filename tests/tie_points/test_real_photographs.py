"""Real photographs beside the project: a drone without control, and a metric camera with its given orientation."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
import rasterio

from aerotri.commands.tiepoints import TiePointOptions, run_tiepoints
from aerotri.formats.assembly.assemble import Statements
from aerotri.formats.assembly.camera_spec import CameraSpec
from aerotri.formats.assembly.reprojection import residuals_at_start
from aerotri.formats.block.folder import read_block
from aerotri.pipeline import adjust


def test_drone_without_control(shared_data, tmp_path):
    """data/brighton, eight of its photographs at 1000 px: residuals below a pixel, GNSS to a metre, f as EXIF has it.

    EXIF says 3.61 mm, and positions of a consumer's drone; nothing else is given.
    """
    (tmp_path / "photographs").mkdir()
    for number in (19, 20, 21, 25, 26, 27, 31, 32):
        shutil.copy2(shared_data("brighton") / "images" / f"DJI_00{number}.JPG", tmp_path / "photographs")
    out = tmp_path / "block"
    run_tiepoints(tmp_path / "photographs", out, TiePointOptions(features=4000, feature_size_px=1000), True)
    content = json.loads((out / "tiepoints.json").read_text())
    assert (content["crs"], content["photographs"], content["left_out"]) == ("EPSG:32615", 8, [])
    block = read_block(out)
    assert block.cameras[0].focal_length_mm == pytest.approx(3.61, rel=0.1)
    adjusted = adjust(block)
    assert adjusted.outcome.status == "converged"
    pixel = block.cameras[0].pixel_mm
    # where the first orientation comes out otherwise, a photograph is tied too weakly and set aside
    residual = np.hypot(*adjusted.rays.v.T)
    residual = residual[np.isfinite(residual)]
    assert len(residual) > 0.7 * len(adjusted.rays.v)
    assert np.median(residual) / pixel < 1.0
    off = adjusted.images.centre[block.gnss_ins.image] - block.gnss_ins.xyz
    assert np.sqrt(np.nanmean(off**2, axis=0)).max() < 1.0
    # a drone 30 to 45 m above the trees and the beach
    above = np.nanmedian(adjusted.images.centre[:, 2]) - np.nanmedian(adjusted.points.xyz[:, 2])
    assert 28.0 < above < 45.0


def test_metric_camera_with_its_orientation(shared_data, tmp_path):
    """data/dmc_ngi: tie points of four DMC photographs, 5.8 m a pixel, lie on the DEM to a pixel of ground."""
    data = shared_data("dmc_ngi")
    (tmp_path / "photographs").mkdir()
    for path in data.glob("*_RGB.tif"):
        shutil.copy2(path, tmp_path / "photographs")
    options = TiePointOptions(
        orientation=str(data / "camera_pos_ori.txt"), camera=CameraSpec(file=data / "config.yaml"), stated=Statements()
    )
    run_tiepoints(tmp_path / "photographs", tmp_path / "block", options, True)
    block = read_block(tmp_path / "block")
    assert len(block.images) == 4
    assert len(block.points) > 1000
    given = np.array([[float(w) for w in line.split()[1:]] for line in (data / "camera_pos_ori.txt").open()])
    np.testing.assert_allclose(block.images.centre, given[:, :3], atol=1e-6)
    found = residuals_at_start(block)
    assert found.median_px < 0.3
    with rasterio.open(data / "dem.tif") as dem:
        height = np.array([value[0] for value in dem.sample(found.points[:, :2])], float)
        height[height == dem.nodata] = np.nan
    off = found.points[:, 2] - height
    off = off[np.isfinite(off)]
    gsd = (given[:, 2].mean() - np.median(height)) * 0.144 / 120.0
    assert len(off) > 1000
    assert abs(np.median(off)) < 0.5 * gsd
    assert 1.4826 * np.median(np.abs(off - np.median(off))) < 1.2 * gsd
