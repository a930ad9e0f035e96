"""Holes without a declared value for no data are noticed; lakes, walls and seas are not taken for them."""

from __future__ import annotations

import numpy as np
import pytest
import rasterio

from aerotri.conventions import InputError
from aerotri.rasters.grids import Grid, RasterWriter
from aerotri.rasters.metric import MetricReader

GRID = Grid(300, 400, 500000.0, 5400000.0, 1.0, 1.0)
Y, X = np.mgrid[0:300, 0:400].astype(float)
HILLS = 100.0 + 3.0 * np.sin(X / 30.0) + 2.0 * np.cos(Y / 25.0)
GROUND = HILLS + np.random.default_rng(1).normal(0.0, 0.05, HILLS.shape)
HOLES = (np.hypot(X - 100, Y - 80) < 15) | (np.hypot(X - 300, Y - 200) < 25) | (X > 395)
PIT = np.hypot(X - 100, Y - 80) < 40
RAMP = (np.abs(Y - 80) < 3) & (X > 90) & (X < 200)


def written(path, heights, no_data=None):
    with RasterWriter(path, GRID, np.float32, crs="EPSG:25832", no_data=no_data) as writer:
        writer.write(0, 0, heights.astype(np.float32))
    return path


@pytest.mark.parametrize("value", [0.0, -9999.0, -32768.0, 32767.0, 9999.0])
def test_holes_are_noticed(tmp_path, value):
    path = written(tmp_path / "dem.tif", np.where(HOLES, value, GROUND))
    with pytest.raises(InputError, match=rf"dem\.tif: has cells of exactly {value:.10g} m") as caught:
        MetricReader(path)
    assert f"gdal_edit.py -a_nodata {value:.10g} dem.tif" in caught.value.remedy


@pytest.mark.parametrize(
    "heights",
    [
        GROUND,
        np.maximum(GROUND, 98.0),
        # a pit with a flat floor, and a ramp that leads down to it
        np.where(RAMP, np.maximum(60.0, np.minimum(100.0, 60.0 + 0.4 * (X - 100))), np.where(PIT, 60.0, GROUND)),
        np.maximum(GROUND - 100.0, 0.0),
        np.full_like(HILLS, 5.0),
    ],
    ids=["hills", "lake", "pit with a ramp", "sea", "flat"],
)
def test_ground_is_not(tmp_path, heights):
    with MetricReader(written(tmp_path / "dem.tif", heights)) as reader:
        assert reader.note == ""


@pytest.mark.parametrize(("step", "refused"), [(6.0, False), (20.0, True)])
def test_cliffs_are_measured_in_metres(tmp_path, step, refused):
    """A basin of 6 feet is not deep."""
    path = tmp_path / "feet.tif"
    with RasterWriter(path, GRID, np.float32, crs="EPSG:2263", no_data=None) as writer:
        writer.write(0, 0, np.where(HOLES, 0.0, step + 0.1 * (GROUND - HILLS)).astype(np.float32))
    with rasterio.open(path, "r+") as file:
        file.units = ["US survey foot"]
    if refused:
        with pytest.raises(InputError, match=r"exactly 0 units of 0\.3048006 m among heights of 19\.\d* to 20"):
            MetricReader(path)
        return
    with MetricReader(path) as reader:
        assert "brought" in reader.note


def test_what_is_declared_is_not_asked_about(tmp_path):
    with MetricReader(written(tmp_path / "dem.tif", np.where(HOLES, 0.0, GROUND), no_data=0.0)) as reader:
        assert np.isnan(reader.read(0, 0, 300, 400)[HOLES]).all()
    with MetricReader(written(tmp_path / "other.tif", np.where(HOLES, 0.0, GROUND), no_data=-9999.0)) as reader:
        assert (reader.read(0, 0, 300, 400)[HOLES] == 0.0).all()
