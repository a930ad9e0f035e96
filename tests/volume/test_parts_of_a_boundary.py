"""The parts of one feature are piles, however they are given."""

from __future__ import annotations

import json
import sqlite3
import struct

import numpy as np
import pytest
import shapely

import aerotri
from aerotri.conventions import InputError
from aerotri.vectors.geopackage import read_geopackage
from aerotri.volume.boundary import boundary_of_parts, boundary_of_piles, read_boundary

HOLED = shapely.Polygon(shapely.box(2.0, 2.0, 12.0, 12.0).exterior, [shapely.box(5.0, 5.0, 7.0, 7.0).exterior])
OTHER = shapely.box(20.0, 4.0, 30.0, 16.0)
BOTH = shapely.MultiPolygon([HOLED, OTHER])
COLLECTION = shapely.GeometryCollection([HOLED, shapely.MultiPolygon([OTHER])])
AREAS = [HOLED.area, OTHER.area]


def _geojson(path, geometries, names):
    features = [
        {"type": "Feature", "properties": {"name": name} if name else {}, "geometry": shapely.geometry.mapping(one)}
        for name, one in zip(names, geometries, strict=True)
    ]
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32632"}}
    path.write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": features}))
    return str(path)


def _checked(boundary, names):
    assert [name for name, _ in boundary.piles] == names
    assert [polygon.area for _, polygon in boundary.piles] == pytest.approx(AREAS, rel=1e-12)
    assert boundary.area == pytest.approx(sum(AREAS), rel=1e-12)


@pytest.mark.parametrize("geometry", [BOTH, COLLECTION], ids=["multipolygon", "collection"])
@pytest.mark.parametrize("srid", ["", "SRID=32632;"])
def test_parts_of_a_text_are_piles(geometry, srid):
    _checked(read_boundary(srid + geometry.wkt, "EPSG:32632"), ["1", "2"])


@pytest.mark.parametrize("geometry", [BOTH, COLLECTION], ids=["multipolygon", "collection"])
def test_parts_of_a_file_of_text_and_of_a_shape_are_piles(geometry, tmp_path):
    path = tmp_path / "piles.wkt"
    path.write_text(geometry.wkt)
    _checked(read_boundary(str(path)), ["1", "2"])
    _checked(boundary_of_parts(geometry, "given"), ["1", "2"])
    _checked(boundary_of_piles([("dump", geometry)], "given"), ["dump 1", "dump 2"])


@pytest.mark.parametrize("geometry", [BOTH, COLLECTION], ids=["multipolygon", "collection"])
def test_parts_of_a_feature_have_its_name_and_a_number(geometry, tmp_path):
    _checked(read_boundary(_geojson(tmp_path / "a.geojson", [geometry], ["dump"]), "EPSG:32632"), ["dump 1", "dump 2"])
    _checked(read_boundary(_geojson(tmp_path / "b.geojson", [geometry], [""]), "EPSG:32632"), ["1", "2"])
    third = shapely.box(40.0, 4.0, 50.0, 14.0)
    found = read_boundary(_geojson(tmp_path / "c.geojson", [third, geometry], ["", "dump"]), "EPSG:32632")
    assert [name for name, _ in found.piles] == ["1", "dump 1", "dump 2"]


def test_a_single_part_keeps_the_name_of_its_feature(tmp_path):
    found = read_boundary(_geojson(tmp_path / "a.geojson", [shapely.MultiPolygon([HOLED])], ["dump"]), "EPSG:32632")
    assert (found.piles, found.polygon_name) == ((), "dump")
    assert found.area == pytest.approx(HOLED.area)


def test_a_collection_in_a_geopackage(tmp_path):
    path = tmp_path / "piles.gpkg"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE gpkg_geometry_columns (table_name TEXT, column_name TEXT, srs_id INTEGER)")
        database.execute("INSERT INTO gpkg_geometry_columns VALUES ('piles', 'geom', 32632)")
        database.execute("CREATE TABLE piles (name TEXT, geom BLOB)")
        blob = b"GP\x00\x01" + struct.pack("<i", 32632) + shapely.to_wkb(COLLECTION, byte_order=1)
        database.execute("INSERT INTO piles VALUES ('dump', ?)", (blob,))
        mixed = shapely.GeometryCollection([HOLED, shapely.Point(1.0, 2.0)])
        database.execute("CREATE TABLE mixed (geom BLOB)")
        database.execute(
            "INSERT INTO mixed VALUES (?)",
            (b"GP\x00\x01" + struct.pack("<i", 32632) + shapely.to_wkb(mixed, byte_order=1),),
        )
    _checked(read_boundary(str(path), "EPSG:32632"), ["dump 1", "dump 2"])
    with sqlite3.connect(path) as database:
        database.execute("INSERT INTO gpkg_geometry_columns VALUES ('mixed', 'geom', 32632)")
    assert [row.kind for _, _, rows in read_geopackage(path) for row in rows] == ["MultiPolygon", "other"]


def test_parts_that_overlap_are_refused_as_one_polygon_that_is_not_valid():
    wrong = shapely.MultiPolygon([HOLED, shapely.box(10.0, 2.0, 20.0, 12.0)])
    with pytest.raises(InputError, match="not valid"):
        read_boundary(wrong.wkt)


def test_a_collection_with_a_line_is_refused():
    mixed = shapely.GeometryCollection([HOLED, shapely.LineString([(0.0, 0.0), (1.0, 1.0)])])
    with pytest.raises(InputError, match="other shapes"):
        read_boundary(mixed.wkt)
    with pytest.raises(InputError, match="other shapes"):
        boundary_of_parts(mixed, "given")


def _ground(rise=0.0):
    _, x = np.mgrid[0:20, 0:36] + 0.5
    z = 100.0 + 0.01 * x**2 + rise * (x > 18)
    return aerotri.Surface.of_array(z, left=0.0, top=20.0, cell=1.0, sigma=np.full(z.shape, 0.02))


def test_volumes_of_parts_are_those_of_features_and_their_sum():
    parts = aerotri.volume(_ground(), BOTH.wkt, base="boundary")
    features = aerotri.volume(_ground(), {"1": HOLED, "2": OTHER}, base="boundary")
    assert parts.net == pytest.approx(features.net, rel=1e-12)
    assert parts.piles["net_m3"].tolist() == pytest.approx(features.piles["net_m3"].tolist(), rel=1e-12)


def test_a_base_that_is_stated_gives_parts_the_sum_of_one():
    whole = aerotri.volume(_ground(), BOTH.wkt, base="level:99")
    each = [aerotri.volume(_ground(), one.wkt, base="level:99").net for one in (HOLED, OTHER)]
    assert whole.net == pytest.approx(sum(each), rel=1e-12)


@pytest.mark.parametrize("given", [BOTH, BOTH.wkt], ids=["shape", "text"])
def test_areas_of_a_change_are_parts(given):
    found = aerotri.change(_ground(), _ground(1.0), align="none", area=given)
    assert found.volumes["name"].tolist() == ["1", "2", "all together"]
    assert found.volumes["net_m3"].tolist() == pytest.approx([0.0, OTHER.area, OTHER.area])
