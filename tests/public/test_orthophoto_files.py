"""Files of an orthophoto as other programs take them, and σ over the surface of the same adjustment."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest
import rasterio
from photographed import PLAN
from rasterio.enums import ColorInterp

import aerotri
from aerotri.rasters.grids import Grid
from aerotri.rasters.surface_files import write_surface
from aerotri.vectors.geopackage import read_geopackage


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Photographs, their adjustment and the dense surface that was measured with it."""
    here = tmp_path_factory.mktemp("of one adjustment")
    flight = aerotri.simulate(PLAN, seed=3)
    flight.save(here / "block", photographs=True)
    result = aerotri.adjust(flight.block)
    surface = aerotri.dense_surface(result, here / "block" / "photographs")
    surface.save(here / "dsm", plots=False)
    return here, result, surface


def made_over(flown, surface, name, **settings):
    here, result, _ = flown
    return aerotri.orthophoto(result, here / "block" / "photographs", surface, here / name, plots=False, **settings)


def test_a_surface_of_the_same_adjustment_is_known(flown):
    """From memory, from its folder and from its file alike; a copy elsewhere is any other surface."""
    here, _, surface = flown
    (here / "copied").mkdir()
    shutil.copy(here / "dsm" / "dsm.tif", here / "copied" / "dsm.tif")
    of_folder, of_file, of_memory, of_copy = (
        made_over(flown, given, f"of {k}", cell=2.0)
        for k, given in enumerate((here / "dsm", here / "dsm" / "dsm.tif", surface, here / "copied" / "dsm.tif"))
    )
    assert [one.summary["of_one_adjustment"] for one in (of_folder, of_file, of_memory, of_copy)] == [True] * 3 + [
        False
    ]
    for one in (of_file, of_memory):
        np.testing.assert_allclose(one.record.accuracy.total, of_folder.record.accuracy.total, rtol=1e-5)
    own, other = of_folder.record.accuracy, of_copy.record.accuracy
    assert own.surface is not None
    assert other.surface is not None
    # matching is a part of σ of the heights
    there = np.isfinite(own.surface) & np.isfinite(other.surface)
    assert there.any()
    assert (own.surface[there] <= other.surface[there] * 1.001).all()
    whole = made_over(flown, replace(surface, adjustment="of another"), "of another", cell=2.0)
    assert not whole.summary["of_one_adjustment"]


def test_the_image_is_a_valid_cloud_optimised_geotiff(flown):
    """The rules of rio-cogeo: tiles, halved overviews down to one tile, directories and data in order."""
    here, _, _ = flown
    grid = Grid(100, 100, -150.0, 150.0, 3.0, 3.0)
    z = np.full((100, 100), 100.0)
    z[45:50, 45:52] = np.nan
    write_surface(here / "level.tif", z, np.full((100, 100), 0.2), grid, None, "Z, m")
    found = made_over(flown, here / "level.tif", "fine", cell=0.25)
    for name in ("ortho.tif", "photographs.tif"):
        with rasterio.open(found.folder / name) as file:
            assert set(file.block_shapes) == {(512, 512)}
            levels = file.overviews(1)
            assert levels == [2**k for k in range(1, len(levels) + 1)]
            assert max(file.width, file.height) / levels[-1] <= 512
            main, data = int(file.get_tag_item("IFD_OFFSET", "TIFF", bidx=1)), []
            directories = [int(file.get_tag_item("IFD_OFFSET", "TIFF", bidx=1, ovr=k)) for k in range(len(levels))]
            assert [main, *directories] == sorted([main, *directories])
            for k in range(len(levels)):
                data.append(first_data(file, k))
            # the smallest overview first, the whole image at the end
            assert data == sorted(data, reverse=True)
            assert first_data(file, None) > max(data)
            assert not (found.folder / f"{name}.ovr").exists()
    with rasterio.open(found.path) as file:
        assert file.colorinterp[-1] == ColorInterp.alpha
        mask, grey = file.read(file.count), file.read(1)
        assert set(np.unique(mask)) == {0, np.iinfo(mask.dtype).max}
        assert (grey[mask == 0] == 0).all()
        np.testing.assert_array_equal(file.dataset_mask() > 0, mask > 0)


def first_data(file, overview: int | None) -> int:
    """The place in the file of the first tile that is there, of the image or of an overview."""
    options = {} if overview is None else {"ovr": overview}
    size = 2 ** (0 if overview is None else overview + 1) * 512
    offsets = []
    for i in range(-(-file.height // size)):
        for j in range(-(-file.width // size)):
            value = file.get_tag_item(f"BLOCK_OFFSET_{j}_{i}", "TIFF", bidx=1, **options)
            offsets += [int(value)] if value else []
    return min(offsets)


def test_seams_lie_between_the_areas_of_two_photographs(flown):
    here, _, _ = flown
    found = made_over(flown, here / "dsm", "of seams", cell=1.0)
    layers = {name: list(rows) for name, _, rows in read_geopackage(found.folder / "seams.gpkg")}
    areas = {one.properties["photograph"] for one in layers["photographs"]}
    used = {one["photograph"] for one in found.summary["photographs"] if one["area_m2"] > 0.0}
    assert areas <= used
    assert layers["seams"]
    for one in layers["seams"]:
        assert {one.properties["photograph_1"], one.properties["photograph_2"]} <= areas
        assert one.properties["length_m"] > 0.0
