"""The spatial index of GeoPackages: used, and kept by GDAL when it edits a layer."""

from __future__ import annotations

import sqlite3
from contextlib import closing

import numpy as np
import pyogrio
import pytest
import shapely

from aerotri.vectors.geopackage_writer import Layer, write_geopackage


@pytest.fixture
def path(tmp_path):
    points = [*shapely.points(5e5 + np.arange(40.0), 5e6 + np.arange(40.0), np.zeros(40)).tolist(), None]
    layers = [
        Layer("points", "POINT", points, {"number": np.arange(41)}, z=True, fields={"number": "of the point"}),
        Layer("empty", "POLYGON", [], {"number": np.zeros(0)}),
        Layer("plain", "", [], {"number": np.arange(3)}),
    ]
    write_geopackage(tmp_path / "a.gpkg", layers, "EPSG:25832")
    return tmp_path / "a.gpkg"


def entries(path):
    """Numbers of the features in the index, and of those in a box."""
    query = "SELECT id FROM rtree_points_geom"
    with closing(sqlite3.connect(path)) as database:
        near = database.execute(f"{query} WHERE minx < 500003.5 AND maxx > 500001.5").fetchall()
        return {row[0] for row in database.execute(query)}, {row[0] for row in near}


def test_index_holds_every_feature_that_has_a_place(path):
    assert entries(path) == (set(range(1, 41)), {3, 4})
    assert bool(pyogrio.read_info(path, layer="points")["capabilities"]["fast_spatial_filter"])
    assert bool(pyogrio.read_info(path, layer="empty")["capabilities"]["fast_spatial_filter"])
    _, _, wkb, (numbers,) = pyogrio.raw.read(path, layer="points", bbox=(500001.5, 5e6, 500003.5, 5000100.0))
    assert numbers.tolist() == [2, 3]
    assert len(wkb) == 2


def test_gdal_keeps_the_index(path):
    new = np.array([shapely.to_wkb(shapely.Point(500002.5, 5e6, 1.0))], dtype=object)
    pyogrio.raw.write(
        path, new, [np.array([99])], ["number"], layer="points", driver="GPKG", geometry_type="Point Z", append=True,
        crs="EPSG:25832",
    )  # fmt: skip
    assert entries(path) == ({*range(1, 41), 42}, {3, 4, 42})
