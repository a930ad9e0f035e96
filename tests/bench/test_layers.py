"""Surfaces and orthophotos below the plan."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from aerotri.bench.layers import Layer, layer_picture, layers_beside, names_of, open_layer
from aerotri.bench.places import places_of
from aerotri.bench.session import Bench
from aerotri.conventions import InputError
from aerotri.rasters.grids import Grid, write_raster
from aerotri.rasters.images import create_image

GRID = Grid(80, 120, 1000.0, 5000.0, 2.0, 2.0)


@pytest.fixture
def surface(tmp_path):
    """A plane that falls to the southeast, with a hole."""
    rows, columns = np.meshgrid(np.arange(80.0), np.arange(120.0), indexing="ij")
    heights = 100.0 - 0.8 * rows - 0.8 * columns
    heights[:10, :10] = np.nan
    write_raster(tmp_path / "dsm.tif", heights.astype(np.float32), GRID)
    return tmp_path / "dsm.tif"


def opened(jpeg: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)


def test_heights_are_shaded_and_holes_white(surface):
    layer = open_layer(surface)
    assert layer.bounds == GRID.bounds
    shown = opened(layer_picture(layer))
    assert shown.shape == (80, 120, 3)
    assert shown[2:7, 2:7].min() > 240
    assert shown[40:, 40:].max() < 230


def test_slope_to_the_light_is_brighter(tmp_path):
    rows = np.tile(np.arange(80.0)[:, None], (1, 120))
    for name, heights in (("north", rows), ("south", -rows)):
        write_raster(tmp_path / f"{name}.tif", heights.astype(np.float32) + 100.0, GRID)
    north, south = (opened(layer_picture(open_layer(tmp_path / f"{name}.tif"))).mean() for name in ("south", "north"))
    assert abs(north - south) > 20.0


def test_colours_are_shown_as_they_are(tmp_path):
    from rasterio.transform import Affine

    pixels = np.zeros((4, 80, 120), np.uint8)
    pixels[0], pixels[3] = 200, 255
    pixels[3, :, :60] = 0
    transform = Affine(2.0, 0.0, 1000.0, 0.0, -2.0, 5000.0)
    with create_image(tmp_path / "ortho.tif", 120, 80, 4, "uint8", transform=transform) as writer:
        writer.write(0, pixels)
    shown = opened(layer_picture(open_layer(tmp_path / "ortho.tif")))
    assert shown[40, 100, 2] == pytest.approx(200, abs=6)
    assert shown[40, 20].min() > 245


def test_file_that_is_no_raster_or_has_no_place_is_told(tmp_path):
    (tmp_path / "a.tif").write_bytes(b"no raster")
    with pytest.raises(InputError, match=r"a\.tif: cannot be read"):
        open_layer(tmp_path / "a.tif")
    with create_image(tmp_path / "b.tif", 10, 10, 1, "uint8") as writer:
        writer.write(0, np.zeros((1, 10, 10), np.uint8))
    with pytest.raises(InputError, match="without georeference"):
        open_layer(tmp_path / "b.tif")


def test_rasters_of_a_run_are_found_beside_its_result(surface, tmp_path):
    result = tmp_path / "project" / "result"
    (tmp_path / "project" / "dsm").mkdir(parents=True)
    surface.rename(tmp_path / "project" / "dsm" / "dsm.tif")
    assert layers_beside(result) == []
    (tmp_path / "project" / "run.json").write_text("{}")
    assert layers_beside(result) == [tmp_path / "project" / "dsm" / "dsm.tif"]


def test_two_files_of_one_name_are_told_apart_by_their_folders():
    layers = [
        Layer(Path(name), (0.0, 0.0, 1.0, 1.0)) for name in ("p/ortho/ortho.tif", "p/dsm/dsm.tif", "p/dtm/dsm.tif")
    ]
    assert names_of(layers) == ["ortho.tif", "dsm/dsm.tif", "dtm/dsm.tif"]


def test_bounds_count_from_the_origin_of_the_plan(result, surface):
    bench = Bench(places_of(result), None, (surface,))
    bench.wait()
    found, origin = bench.layers()["layers"], bench.plan()["origin"]
    assert found[0]["name"] == "dsm.tif"
    assert found[0]["bounds"][0] + origin[0] == pytest.approx(GRID.bounds[0])
    assert found[0]["bounds"][3] + origin[1] == pytest.approx(GRID.bounds[3])
    assert bench.layer(0)[:2] == b"\xff\xd8"
    with pytest.raises(InputError, match="no layer 1"):
        bench.layer(1)
