"""One thing has the same options in every command, and rasters are written alike."""

from __future__ import annotations

import numpy as np
import pytest
import rasterio
import typer

import aerotri
from aerotri.cli import app
from aerotri.rasters.grids import Grid, write_raster
from aerotri.rasters.surface_files import make_cloud_optimised


@pytest.mark.parametrize("command", ["dsm", "dtm", "ortho", "compare", "run"])
def test_the_cell_has_two_names_everywhere(command):
    known = typer.main.get_command(app).commands[command].params
    names = [set(one.opts) for one in known if one.name in ("cell", "resolution")]
    assert names == [{"--cell", "--resolution"}]


def _layout(path):
    with rasterio.open(path) as file:
        return file.tags(ns="IMAGE_STRUCTURE").get("LAYOUT"), file.overviews(1), file.descriptions, file.read(1)


def test_a_raster_written_anew_is_cloud_optimised_and_the_same(tmp_path):
    rng = np.random.default_rng(1)
    z = rng.normal(100.0, 1.0, (700, 600)).astype(np.float32)
    path = tmp_path / "a.tif"
    write_raster(path, z.copy(), Grid(700, 600, 0.0, 700.0, 1.0, 1.0), "EPSG:25832", "Z, m")
    make_cloud_optimised(path)
    layout, overviews, descriptions, values = _layout(path)
    assert (layout, overviews, descriptions) == ("COG", [2], ("Z, m",))
    np.testing.assert_array_equal(values, z)
    assert [one.name for one in tmp_path.iterdir()] == ["a.tif"]


def test_differences_and_thickness_are_cloud_optimised(tmp_path):
    rng = np.random.default_rng(2)
    first, second = (
        aerotri.Surface.of_array(rng.normal(100.0, 1.0, (40, 40)), left=0.0, top=40.0, cell=1.0) for _ in range(2)
    )
    aerotri.compare(first, second).save(tmp_path / "comparison", plots=False)
    found = aerotri.volume(first, base=99.0)
    found.save(tmp_path / "volume", plots=False)
    for name in ("comparison/difference.tif", "volume/thickness.tif"):
        layout, _, descriptions, values = _layout(tmp_path / name)
        assert layout == "COG"
        assert "m" in descriptions[0]
        assert np.isfinite(values).any()
