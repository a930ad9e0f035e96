"""Areas and DEMs: what is read, what is brought to metres, what is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

import aerotri
from aerotri.conventions import InputError
from aerotri.planning.area import read_area
from aerotri.planning.ground import ground_of_dem, level_ground
from aerotri.rasters.grids import Grid, write_raster

SQUARE = "POLYGON ((500000 5800000, 500200 5800000, 500200 5800100, 500000 5800100, 500000 5800000))"


def geojson(path, coordinates, crs=None):
    content = {"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": coordinates}}
    ]}  # fmt: skip
    if crs:
        content["crs"] = {"type": "name", "properties": {"name": crs}}
    path.write_text(json.dumps(content))
    return path


def test_degrees_become_utm(tmp_path):
    ring = [[9.0, 52.0], [9.01, 52.0], [9.01, 52.005], [9.0, 52.005], [9.0, 52.0]]
    area = read_area(str(geojson(tmp_path / "a.geojson", [ring])))
    assert area.crs == "EPSG:32632"
    # a hundredth of a degree of longitude at 52° and half of one of latitude
    assert area.polygon.area == pytest.approx(0.01 * 111320 * np.cos(np.radians(52.0)) * 0.005 * 111200, rel=0.01)
    wkt = read_area("SRID=4326;POLYGON ((9 52, 9.01 52, 9.01 52.005, 9 52.005, 9 52))")
    assert wkt.crs == "EPSG:32632"
    assert wkt.polygon.area == pytest.approx(area.polygon.area, rel=1e-9)


def test_projected_stays(tmp_path):
    ring = [[500000, 5800000], [500200, 5800000], [500200, 5800100], [500000, 5800000]]
    area = read_area(str(geojson(tmp_path / "a.geojson", [ring], "urn:ogc:def:crs:EPSG::25832")))
    assert area.crs == "EPSG:25832"
    assert area.polygon.area == pytest.approx(10000.0)
    assert read_area(SQUARE).crs is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("POLYGON EMPTY", "no polygon"), ("POLYGON ((0 0, 200 200, 200 0, 0 200, 0 0))", "not valid"),
        ("POLYGON ((0 0, 100 0, 200 0, 0 0))", "not valid|no area"), ("no_such_file.gpkg", "no such file"),
        ("no_such_file.wkt", "cannot be read"), ("POLYGON ((9 52, 9.1 52, 9.1 52.1, 9 52))", "longitudes"),
        ("SRID=2263;POLYGON ((0 0, 900 0, 900 900, 0 0))", "metres"), ("SRID=999999;" + SQUARE, "PROJ"),
        ("POLYGON ((nan 0, 100 0, 100 100, nan 0))", "not possible|not valid|no WKT"),
        ("POINT (0 0)", "cannot be read"),
    ],
)  # fmt: skip
def test_hostile_areas_are_refused(text, message):
    with pytest.raises(InputError, match=message):
        read_area(text)


def dem(path, left, top, rows, columns, cell, hole=False, crs="EPSG:25832"):
    grid = Grid(rows, columns, left, top, cell, cell)
    x, y = np.meshgrid(grid.x(np.arange(columns)), grid.y(np.arange(rows)))
    z = (0.01 * (x - 500000.0) + 0.02 * (y - 5800000.0) + 50.0).astype(np.float32)
    if hole:
        z[rows // 2 - 2 : rows // 2 + 2, columns // 2 - 2 : columns // 2 + 2] = np.nan
    write_raster(path, z, grid, crs)
    return path


def test_heights_of_a_dem(tmp_path):
    area = read_area("SRID=25832;" + SQUARE)
    ground = ground_of_dem(dem(tmp_path / "d.tif", 499900, 5800250, 60, 80, 5.0), area, 50.0)
    xy = np.array([[500010.0, 5800020.0], [500150.0, 5800077.0]])
    expected = 0.01 * (xy[:, 0] - 500000.0) + 0.02 * (xy[:, 1] - 5800000.0) + 50.0
    assert ground.heights(xy) == pytest.approx(expected, abs=1e-4)
    far = ground.heights(np.array([[400000.0, 5800050.0]]))
    assert np.isfinite(far).all()


@pytest.mark.parametrize("kind", ["beside", "hole"])
def test_dem_that_does_not_cover_is_refused(tmp_path, kind):
    area = read_area("SRID=25832;" + SQUARE)
    left, hole = (500100, False) if kind == "beside" else (499900, True)
    path = dem(tmp_path / "d.tif", left, 5800250, 80, 80, 5.0, hole)
    with pytest.raises(InputError, match="does not cover the area"):
        ground_of_dem(path, area, 50.0)


def test_dem_or_level():
    for given in ({}, {"dem": "a.tif", "ground": 3.0}):
        with pytest.raises(InputError, match=r"--dem or --ground"):
            aerotri.plan_flight(SQUARE, camera="p1", gsd=0.02, **given)
    with pytest.raises(InputError, match="camera 'phantom'"):
        aerotri.plan_flight(SQUARE, camera="phantom", gsd=0.02, ground=0.0)
    with pytest.raises(InputError, match="not possible"):
        level_ground(float("nan"))
