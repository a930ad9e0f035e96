"""Surfaces from Python: measured in photographs, from arrays, from rasters; the numbers are those of the files."""

from __future__ import annotations

import inspect
import json
from importlib.util import find_spec

import numpy as np
import pytest
from matplotlib.figure import Figure

import aerotri
from aerotri import InputError
from aerotri.rasters.grids import Grid, RasterReader, write_raster


def test_the_model_is_that_of_its_files(measured):
    import pyarrow.csv
    import pyarrow.parquet

    _, _, model, folder = measured
    table = pyarrow.parquet.read_table(folder / "pickets.parquet")
    assert tuple(table.column_names) == model.pickets.columns
    np.testing.assert_array_equal(model.pickets["Z"], table.column("Z").to_numpy())
    assert model.summary == json.loads((folder / "dtm.json").read_text(encoding="utf-8"))
    assert model.summary["pickets"]["accepted"] > 150
    used = {one["key"]: one for one in model.summary["settings"]}
    assert used["interval"] == {"key": "interval", "value": 20.0, "unit": "m", "origin": "given"}
    assert {name for name, one in used.items() if one["origin"] == "given"} == {"interval", "pairs"}
    left = inspect.signature(aerotri.terrain).parameters.keys() - used.keys()
    assert left == {"result", "photographs", "executor", "scratch", "progress"}
    assert pyarrow.csv.read_csv(folder / "models.csv").to_pydict() == model.models.to_arrow().to_pydict()
    for name, surface in (("dsm", model.dsm), ("dtm", model.dtm)):
        saved = aerotri.Surface(folder / f"{name}.tif")
        assert saved.grid == surface.grid
        for one, other in ((saved.z, surface.z), (saved.sigma, surface.sigma)):
            np.testing.assert_array_equal(one.astype(np.float32), other.astype(np.float32))
    with RasterReader(folder / "dsm.tif") as file, model.dsm.reader() as held:
        for window in ((0, 0, 5, 7), (-2, -3, 9, 8), (file.grid.rows - 3, 1, 9, 4)):
            np.testing.assert_array_equal(file.read(*window), held.read(*window))
        x, y = np.meshgrid(file.grid.x([3.2, 20.7, 33.0]), file.grid.y([4.0, 11.4, 30.1]))
        np.testing.assert_array_equal(file.sample(x.ravel(), y.ravel()), held.sample(x.ravel(), y.ravel()))


def test_plots_and_pages(measured):
    _, _, model, folder = measured
    found = [*model.plot.all().values(), model.dsm.plot(), aerotri.Surface(folder / "dsm.tif").plot()]
    assert all(isinstance(figure, Figure) for figure in found)
    assert "pickets accepted" in model._repr_html_()
    assert "cells of" in model.dsm._repr_html_()
    assert "dsm.tif" in repr(model.dsm)


def test_settings_are_refused(measured):
    photographs, result, _, _ = measured
    for match, options in (
        ("no subset", {"subset": "third"}), ("is not possible", {"window": 16}), ("edge 0.5", {"edge": 0.5}),
        ("threshold 2 is not possible", {"threshold": 2.0}), ("most_photographs 1", {"most_photographs": 1}),
        ("the area is empty", {"area": (1, 1, 0, 0)}), ("no known kind", {"breaklines": "lines.tab"}),
    ):  # fmt: skip
        with pytest.raises(InputError, match=match):
            aerotri.terrain(result, photographs, **options)
    with pytest.raises(InputError, match="0 photographs"):
        aerotri.terrain(result, [photographs.parent / "truth"])


def test_models_need_pairs(measured):
    photographs, result, _, _ = measured
    told = []
    model = aerotri.terrain(result, photographs, interval=20.0, area=(-60.0, -60.0, 60.0, 60.0),
                            progress=lambda stage, share: told.append((stage, share)))  # fmt: skip
    assert {stage for stage, _ in told} == {"matching", "statistics", "surfaces"}
    assert all(0.0 <= share <= 1.0 for _, share in told)
    with pytest.raises(InputError, match="not measured in pairs"):
        model.models  # noqa: B018


def test_a_surface_of_an_array_is_kept(tmp_path):
    z = np.arange(12.0).reshape(3, 4)
    z[1, 2] = np.nan
    surface = aerotri.Surface.of_array(z, left=10.0, top=50.0, cell=2.0, crs="EPSG:32632", name="steps")
    path = surface.save(tmp_path / "steps.tif")
    again = aerotri.Surface(path)
    np.testing.assert_array_equal(again.z, z)
    assert again.grid == Grid(3, 4, 10.0, 50.0, 2.0, 2.0)
    with again.reader() as one, surface.reader() as other:
        assert one.plan == other.plan == "EPSG:32632"
    with pytest.raises(InputError, match="exists already"):
        surface.save(path)
    with_sigma = aerotri.Surface.of_array(z, left=10.0, top=50.0, cell=2.0, sigma=np.full_like(z, 0.5))
    found = aerotri.Surface(with_sigma.save(path, overwrite=True))
    assert np.nanmax(found.sigma) == 0.5
    with pytest.raises(InputError, match="are no surface"):
        aerotri.Surface.of_array(z, left=0.0, top=0.0, cell=1.0, sigma=z[:2])


def test_a_raster_in_feet_is_read_in_metres(tmp_path):
    import rasterio

    path = tmp_path / "feet.tif"
    write_raster(path, np.full((4, 4), 1000.0), Grid(4, 4, 5e5, 5e6, 1.0, 1.0), "EPSG:32632")
    with rasterio.open(path, "r+") as file:
        file.units = ["ft"]
    assert aerotri.Surface(path).z[0, 0] == pytest.approx(304.8)


def test_xarray(measured):
    _, _, model, _ = measured
    if find_spec("xarray") is None:
        for surface in (model, model.dsm):
            with pytest.raises(InputError, match="pip install xarray"):
                surface.to_xarray()
    else:
        assert set(model.to_xarray()) == {"Z_dsm", "sigma_Z_dsm", "Z_dtm", "sigma_Z_dtm"}
        assert model.dsm.to_xarray()["Z"].shape == model.dsm.z.shape
