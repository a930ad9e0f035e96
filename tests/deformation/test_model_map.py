"""Which model a cell lies in: polygons of GeoJSON and GeoPackage, rasters of numbers; rasters in general."""

import json
import sqlite3
import struct

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.deformation.model_map import number_map, read_number_table, read_polygons
from aerotri.deformation.seam_steps import added_steps, window_steps
from aerotri.rasters.grids import Grid, RasterReader, RasterWriter, write_raster

GRID = Grid(12, 10, 100.0, 220.0, 2.0, 2.0)
LEFT_HALF = [[100.0, 196.0], [109.9, 196.0], [109.9, 220.0], [100.0, 220.0], [100.0, 196.0]]
RIGHT_HALF = [[109.9, 196.0], [116.0, 196.0], [116.0, 220.0], [109.9, 220.0], [109.9, 196.0]]
HOLE = [[102.0, 200.0], [104.0, 200.0], [104.0, 204.0], [102.0, 204.0], [102.0, 200.0]]
EXPECTED = np.tile([0, 0, 0, 0, 0, 1, 1, 1, -1, -1], (12, 1))
EXPECTED[8:10, 1] = -1


def feature(rings, left, right, kind="Polygon"):
    coordinates = rings if kind == "Polygon" else [rings]
    return {
        "type": "Feature",
        "properties": {"left": left, "right": right},
        "geometry": {"type": kind, "coordinates": coordinates},
    }


def write_geojson(path, features, **more):
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features, **more}))
    return path


def wkb_polygon(rings, order, z):
    mark = "<" if order == 1 else ">"
    out = struct.pack("B", order) + struct.pack(mark + "II", 3 + 1000 * z, len(rings))
    for ring in rings:
        out += struct.pack(mark + "I", len(ring))
        for point in ring:
            out += struct.pack(mark + "d" * (2 + z), *point, *[7.0] * z)
    return out


def write_gpkg(path, rows, srs=25832):
    """A GeoPackage with no more in it than a reader needs."""
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE gpkg_geometry_columns (table_name, column_name, srs_id)")
        database.execute("INSERT INTO gpkg_geometry_columns VALUES ('the \"models\"', 'geom', ?)", (srs,))
        columns = '(fid INTEGER PRIMARY KEY, geom BLOB, "Left" TEXT, "right" TEXT)'
        database.execute('CREATE TABLE "the ""models"""' + columns)
        for geometry, left, right in rows:
            database.execute(
                'INSERT INTO "the ""models""" (geom, "Left", "right") VALUES (?, ?, ?)', (geometry, left, right)
            )
    database.close()
    return path


def gpkg_blob(rings, order=1, z=0, envelope=0, several=False):
    header = b"GP" + struct.pack("BB", 0, (envelope << 1) | 1) + struct.pack("<i", 25832)
    header += b"\0" * (0, 32, 48, 48, 64)[envelope]
    polygon = wkb_polygon(rings, order, z)
    if several:
        polygon = struct.pack("B", 1) + struct.pack("<II", 6, 1) + polygon
    return header + polygon


def test_geojson(tmp_path):
    features = [feature([LEFT_HALF, HOLE], "a", "b"), feature([RIGHT_HALF], "b", "c", "MultiPolygon")]
    found = read_polygons(write_geojson(tmp_path / "m.geojson", features), "EPSG:25832")
    assert found.names == (("a", "b"), ("b", "c"))
    np.testing.assert_array_equal(found.numbers(GRID, 0, 0, 12, 10), EXPECTED)
    # windows, also beyond the edges
    np.testing.assert_array_equal(found.numbers(GRID, 5, 3, 4, 4), EXPECTED[5:9, 3:7])
    np.testing.assert_array_equal(found.numbers(GRID, -2, 6, 4, 4)[2:], EXPECTED[:2, 6:])
    assert (found.numbers(GRID, 100, 100, 5, 5) == -1).all()


@pytest.mark.parametrize(("order", "z", "envelope", "several"), [(1, 0, 0, False), (0, 1, 1, False), (1, 1, 3, True)])
def test_geopackage(tmp_path, order, z, envelope, several):
    rows = [
        (gpkg_blob([LEFT_HALF, HOLE], order, z, envelope, several), "a", "b"),
        (gpkg_blob([RIGHT_HALF], order, z, envelope, several), "b", "c"),
    ]
    found = read_polygons(write_gpkg(tmp_path / "m.gpkg", rows), "EPSG:25832")
    assert found.names == (("a", "b"), ("b", "c"))
    np.testing.assert_array_equal(found.numbers(GRID, 0, 0, 12, 10), EXPECTED)
    assert found.note == ""
    moved = read_polygons(tmp_path / "m.gpkg", "EPSG:25833")
    assert "from EPSG:25832 to EPSG:25833" in moved.note
    assert np.abs(moved.bounds - found.bounds)[:, 0].min() > 1000.0


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "is not JSON"),
        ('{"type": "FeatureCollection", "features": []}', "no polygons"),
        (json.dumps({"features": [feature([LEFT_HALF], "", "b")]}), "attribute"),
        (
            json.dumps({"features": [{"properties": {}, "geometry": {"type": "Point", "coordinates": [0, 0]}}]}),
            "polygon",
        ),
        (json.dumps({"features": [{"properties": {}, "geometry": None}]}), "polygon"),
        (json.dumps({"crs": {"properties": {"name": "urn:ogc:def:crs:EPSG::4326"}}, "features": []}), "no polygons"),
    ],
)
def test_bad_polygons(tmp_path, content, message):
    (tmp_path / "m.geojson").write_text(content)
    with pytest.raises(InputError, match=message):
        read_polygons(tmp_path / "m.geojson", "EPSG:25832")


def test_files_that_are_none(tmp_path):
    (tmp_path / "not.gpkg").write_text("no database")
    for name in ("not.gpkg", "none.gpkg", "none.geojson"):
        with pytest.raises(InputError, match=name):
            read_polygons(tmp_path / name)


def test_raster_of_numbers_on_another_grid(tmp_path):
    """Cells of 6 m and numbers as they come; every cell of the DEM takes that of the cell its centre lies in."""
    coarse = Grid(3, 3, 100.0, 214.0, 6.0, 6.0)
    numbers = np.array([[7, 7, 30], [7, 5, 30], [99, 5, 30]], np.int32)
    write_raster(tmp_path / "n.tif", numbers, coarse)
    (tmp_path / "n.csv").write_text("number,left,right\n30,c,d\n7,a,b\n5,b,c\n")
    table = read_number_table(tmp_path / "n.csv")
    with RasterReader(tmp_path / "n.tif") as reader:
        found = number_map(reader, table)
        assert found.names == (("b", "c"), ("a", "b"), ("c", "d"))
        expected = np.full((12, 10), -1)
        place = {5: 0, 7: 1, 30: 2, 99: -1}
        for i in range(12):
            for j in range(10):
                row, column = int((214.0 - GRID.y(i)) // 6.0), int((GRID.x(j) - 100.0) // 6.0)
                if 0 <= row < 3 and 0 <= column < 3:
                    expected[i, j] = place[int(numbers[row, column])]
        np.testing.assert_array_equal(found.numbers(GRID, 0, 0, 12, 10), expected)
        np.testing.assert_array_equal(found.numbers(GRID, 4, 2, 3, 3), expected[4:7, 2:5])


@pytest.mark.parametrize(
    ("text", "message"),
    [("number,left\n1,a\n", ":2"), ("number,left,right\n", "no rows"), ("number,left,right\n1,a,b\n1,c,d\n", ":3"),
     ("number,left,right\nx,a,b\n", ":2"), ("number,left,right\n1,a,\n", ":2")],
)  # fmt: skip
def test_bad_tables(tmp_path, text, message):
    (tmp_path / "n.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        read_number_table(tmp_path / "n.csv")


def test_steps_at_a_border():
    """A tilted plane with a step of 0.3 m between models, one row missing; the slope does not count."""
    y, x = np.mgrid[:20, :30].astype(float)
    number = np.where(x < 12, 4, 2).astype(np.int32)
    z = 100.0 + 0.2 * x - 0.1 * y + np.where(x < 12, 0.3, 0.0)
    z[5] = np.nan
    steps = window_steps(z, z - np.where(x < 12, 0.3, 0.0), number)
    np.testing.assert_array_equal(steps.pair, [[2, 4]])
    assert steps.count[0] == 19
    # of the model with the smaller number less the other
    np.testing.assert_allclose(steps.before[0] / steps.count, [-0.3, 0.09, 0.3 / 19], atol=1e-12)
    np.testing.assert_allclose(steps.after, 0.0, atol=1e-12)
    upright = window_steps(z.T.copy(), z.T.copy(), number.T.copy())
    np.testing.assert_allclose(upright.before, steps.before)
    both = added_steps(steps, upright)
    assert both.count[0] == 38
    assert both.rms("before") == pytest.approx(0.3)
    number[:, 15:] = -1
    assert window_steps(z, z, np.where(number == 2, -1, number)).count.sum() == 0


def test_sampling_a_raster(tmp_path):
    """A plane at places between the cells; the last cells of a raster count, beyond there is nothing."""
    rows, columns = np.mgrid[:12, :10].astype(np.float32)
    z = 5.0 + 2.0 * columns - 3.0 * rows
    z[3, 4] = np.nan
    write_raster(tmp_path / "z.tif", z, GRID, "EPSG:25832")
    with RasterReader(tmp_path / "z.tif") as reader:
        assert reader.plan == "EPSG:25832"
        column, row = np.array([0.0, 9.0, 7.3, 2.5, 3.5, -0.1, 5.0]), np.array([0.0, 11.0, 8.9, 7.0, 2.5, 2.0, 11.1])
        found = reader.sample(GRID.x(column), GRID.y(row))
        expected = 5.0 + 2.0 * column - 3.0 * row
        expected[[4, 5, 6]] = np.nan
        np.testing.assert_allclose(found, expected, atol=1e-6)
        np.testing.assert_allclose(reader.column(1) if hasattr(reader, "column") else 0.0, 0.0)


def test_windows_of_a_raster(tmp_path):
    values = np.arange(120.0, dtype=np.float32).reshape(12, 10)
    write_raster(tmp_path / "v.tif", values, GRID)
    with RasterReader(tmp_path / "v.tif") as reader:
        assert reader.grid == GRID
        window = reader.read(-1, 8, 4, 5)
        assert np.isnan(window[0]).all()
        assert np.isnan(window[:, 2:]).all()
        np.testing.assert_array_equal(window[1:, :2], values[:3, 8:])
        assert np.isnan(reader.read(50, 50, 2, 2)).all()


def test_whole_numbers_are_heights_too(tmp_path):
    with RasterWriter(tmp_path / "i.tif", GRID, np.int16, no_data=-32768) as writer:
        z = np.arange(120, dtype=np.int16).reshape(12, 10)
        z[2, 3] = -32768
        writer.write(0, 0, z)
    with RasterReader(tmp_path / "i.tif") as reader:
        found = reader.read(0, 0, 12, 10)
        assert found.dtype == np.float32
        assert np.isnan(found[2, 3])
        assert np.isnan(found).sum() == 1
        assert found[5, 5] == 55.0


def test_rasters_that_are_refused(tmp_path):
    import rasterio

    (tmp_path / "text.tif").write_text("no raster")
    options = {"driver": "GTiff", "width": 4, "height": 4, "dtype": "float32"}
    turned = rasterio.Affine(1.0, 0.1, 0.0, 0.1, -1.0, 0.0)
    north_up = rasterio.Affine(1.0, 0.0, 0.0, 0.0, -1.0, 0.0)
    for name, more in (("two", {"count": 2, "transform": north_up}), ("turned", {"count": 1, "transform": turned})):
        with rasterio.open(tmp_path / f"{name}.tif", "w", **options, **more) as file:
            file.write(np.zeros((more["count"], 4, 4), np.float32))
    for name, message in (("text", "no raster"), ("two", "2 bands"), ("turned", "turned"), ("none", "none.tif")):
        with pytest.raises(InputError, match=message):
            RasterReader(tmp_path / f"{name}.tif")
