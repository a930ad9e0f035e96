"""DEMs corrected from Python: what is taken off is the deformation of the model; from memory as from files."""

from __future__ import annotations

import gc
import json
from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri import InputError

CELLS = 40


@pytest.fixture(scope="module")
def flat(result):
    """A level of 100 m below the second and third photograph, and their names."""
    names = tuple(result.images["image"][1:3].tolist())
    x, y = (result.images[axis][1:3].mean() for axis in ("X0", "Y0"))
    half = CELLS / 2.0
    return aerotri.Surface.of_array(np.full((CELLS, CELLS), 100.0), left=x - half, top=y + half, cell=1.0,
                                    name="flat"), names  # fmt: skip


def test_what_is_taken_off_is_the_deformation(result, flat):
    dem, pair = flat
    found = aerotri.correct_dem(dem, result, pair=pair)
    model = aerotri.deform(result, pair=pair, spacing=2.0)
    assert found.summary["corrected"] == CELLS**2
    np.testing.assert_allclose(found.dem.z, dem.z - found.dz.z, atol=1e-4)
    row = np.rint(dem.grid.row(model.y)).astype(int)
    column = np.rint(dem.grid.column(model.x)).astype(int)
    inside = np.ix_((row >= 2) & (row < CELLS - 2), (column >= 2) & (column < CELLS - 2))
    cells = np.ix_(row[inside[0].ravel()], column[inside[1].ravel()])
    off = model.dZ[inside] - found.dz.z[cells]
    size = np.nanmax(np.abs(model.dZ[inside]))
    assert size > 1e-3
    # places of nodes and cells differ by half a cell, heights of the ground by some metres of a hundred
    assert np.nanmax(np.abs(off)) < 0.15 * size
    np.testing.assert_allclose(np.nanmedian(found.sigma_dz.z[cells]), np.nanmedian(model.sigma_dZ[inside]), rtol=0.2)


def test_rasters_outlive_the_result_they_come_from(result, flat):
    """`correct_dem(…).dz` keeps its file although nobody keeps the rest; without users nothing is left on the disk."""
    dem, pair = flat
    dz = aerotri.correct_dem(dem, result, pair=pair).dz
    place = dz.path
    assert np.isfinite(dz.z).all()
    del dz
    gc.collect()
    assert not place.exists()


def test_from_memory_as_from_files(result, flat, tmp_path):
    dem, pair = flat
    path, folder = dem.save(tmp_path / "dem.tif"), result.save(tmp_path / "result", plots=False)
    held, read = aerotri.correct_dem(dem, result, pair=pair), aerotri.correct_dem(path, folder, pair=pair)
    np.testing.assert_allclose(held.dem.z, read.dem.z, atol=1e-5)
    out = read.save(tmp_path / "out.tif")
    assert sorted(p.name for p in tmp_path.glob("out*")) == [
        "out.tif", "out_dZ.tif", "out_demcor.json", "out_sigma_dZ.tif",
    ]  # fmt: skip
    assert json.loads((tmp_path / "out_demcor.json").read_text(encoding="utf-8")) == read.summary
    np.testing.assert_array_equal(aerotri.Surface(out).z, read.dem.z)
    assert read.save(out) == out
    with pytest.raises(InputError, match="source and target are the same"):
        read.save(path)
    (tmp_path / "mine.tif").write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        read.save(tmp_path / "mine.tif")
    assert "cells corrected" in held._repr_html_()
    place = held.spool.folder
    del held
    assert not place.exists()


def test_maps_of_models(result, flat, tmp_path):
    """Of a whole block as `deform` finds it, in memory and as its files; a single model is no map."""
    dem, pair = flat
    block = aerotri.deform(result, spacing=4.0)
    folder = block.save(tmp_path / "map", plots=False)
    held = aerotri.correct_dem(dem, result, models=block)
    read = aerotri.correct_dem(dem, result, models=folder / "model.tif")
    table = aerotri.correct_dem(dem, result, models=folder / "model.tif", model_table=folder / "models.csv")
    for found in (read, table):
        np.testing.assert_array_equal(found.dem.z, held.dem.z)
    assert held.summary["corrected"] > 0
    assert len(held.seams) <= held.summary["seams"]["count"]
    with pytest.raises(InputError, match="no map of models"):
        aerotri.correct_dem(dem, result, models=aerotri.deform(result, pair=pair, spacing=4.0))


def test_a_terrain_model_of_pairs_knows_its_models(measured):
    _, result, model, folder = measured
    held = aerotri.correct_dem(model, result, models=model)
    read = aerotri.correct_dem(folder / "dsm.tif", result, models=folder / "model.tif")
    np.testing.assert_array_equal(held.dem.z, read.dem.z)
    assert held.summary["corrected"] > 100


def test_orientations(result, flat, tmp_path):
    """Without parameters: computed, of a result in memory, of its folder, and of its table."""
    dem, pair = flat
    plain = aerotri.adjust(result.block, parameters="none")
    folder = plain.save(tmp_path / "plain", plots=False)
    own = aerotri.correct_dem(dem, result, pair=pair)
    held = aerotri.correct_dem(dem, result, pair=pair, orientation=plain)
    for orientation in (folder, folder / "images.csv"):
        found = aerotri.correct_dem(dem, result, pair=pair, orientation=orientation)
        assert found.summary["variant"] == "given"
        np.testing.assert_allclose(found.dem.z, held.dem.z, atol=1e-4)
    assert aerotri.correct_dem(dem, result, pair=pair, orientation="absorbed").summary["variant"] == "absorbed"
    assert np.abs(held.dem.z - own.dem.z).max() > 1e-3


def test_what_makes_no_sense(result, flat):
    dem, pair = flat
    far = replace(dem, source=replace(dem.source, grid=replace(dem.grid, left=9e5)))
    plain = aerotri.adjust(result.block, parameters="none")
    for match, surface, used, options in (
        ("either a pair or a map", dem, result, {}),
        ("either a pair or a map", dem, result, {"pair": pair, "models": "map.geojson"}),
        ("no photograph 'nobody'", dem, result, {"pair": (pair[0], "nobody")}),
        ("flat: lies outside the models", far, result, {"pair": pair}),
        ("has no image errors", dem, plain, {"pair": pair}),
        ("no such file or result", dem, result, {"pair": pair, "orientation": "nowhere.csv"}),
        ("is no raster", "nowhere.tif", result, {"pair": pair}),
    ):
        with pytest.raises(InputError, match=match):
            aerotri.correct_dem(surface, used, **options)
