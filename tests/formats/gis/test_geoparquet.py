"""points.parquet and rays.parquet: metadata of GeoParquet 1.1, geometries and columns against the tables."""

from __future__ import annotations

import json

import numpy as np
import pyarrow.parquet as pq
import pyproj
import pytest
import shapely

import aerotri
from aerotri.formats.gis import parquet
from aerotri.reference.export_files import export_files
from gis_blocks import PLAIN, in_crs, odd_names, plain_block

ITEMS = {one.name: {item.name: item for item in one.items} for one in export_files()}


@pytest.fixture(scope="module")
def result():
    return aerotri.adjust(odd_names(plain_block()), explain=False)


@pytest.fixture(scope="module")
def files(result, tmp_path_factory):
    folder = aerotri.export(result, tmp_path_factory.mktemp("gis") / "out", "geoparquet").folder
    return {name: pq.read_table(folder / f"{name}.parquet") for name in ("points", "rays")}


def metadata(table):
    return json.loads(table.schema.metadata[b"geo"])


def shapes(table):
    return shapely.from_wkb(table.column("geometry").to_numpy(zero_copy_only=False))


@pytest.mark.parametrize(("name", "kind"), [("points", "Point Z"), ("rays", "LineString Z")])
def test_metadata(files, name, kind):
    table, geo = files[name], metadata(files[name])
    assert (geo["version"], geo["primary_column"]) == ("1.1.0", "geometry")
    column = geo["columns"]["geometry"]
    assert column["encoding"] == "WKB"
    assert column["geometry_types"] == [kind]
    # null: not known; without the key it would be longitude and latitude
    assert column["crs"] is None
    found = shapes(table)
    xyz = shapely.get_coordinates(found, include_z=True)
    np.testing.assert_array_equal(column["bbox"], [*xyz.min(axis=0), *xyz.max(axis=0)])
    boxes = table.column("bbox").combine_chunks().flatten()
    assert column["covering"]["bbox"] == {side: ["bbox", side] for side in ("xmin", "ymin", "xmax", "ymax")}
    np.testing.assert_array_equal(np.column_stack([side.to_numpy(zero_copy_only=False) for side in boxes]),
                                  shapely.bounds(found))  # fmt: skip


def test_columns_are_those_of_the_tables(result, files):
    for table, expected in ((files["points"], result.points), (files["rays"], result.rays)):
        assert tuple(table.column_names[: len(expected.columns)]) == expected.columns
        assert len(table) == len(expected)
        for name in expected.columns:
            found = table.column(name).to_numpy()
            if expected[name].dtype.kind == "f":
                np.testing.assert_array_equal(found, expected[name])
            else:
                assert found.tolist() == expected[name].tolist()


def test_places(result, files):
    xyz = result.adjusted.points.xyz
    known = np.isfinite(xyz).all(axis=1)
    found = shapes(files["points"])
    np.testing.assert_array_equal([one is not None for one in found], known)
    np.testing.assert_array_equal(shapely.get_coordinates(found, include_z=True), xyz[known])
    rays = result.block.image_points
    lines = shapes(files["rays"])
    for k in range(0, len(rays), 97):
        ends = result.adjusted.images.centre[rays.image[k]], xyz[rays.point[k]]
        if lines[k] is None:
            assert not np.isfinite(ends).all()
        else:
            np.testing.assert_array_equal(shapely.get_coordinates(lines[k], include_z=True), ends)


def test_every_column_says_what_it_is(files):
    for name, table in files.items():
        items = ITEMS[f"{name}.parquet"]
        for column in table.schema:
            said = column.metadata[b"description"].decode()
            assert items[column.name].text in said
            assert items[column.name].unit in said


def test_block_in_a_crs(tmp_path):
    result = aerotri.adjust(in_crs(plain_block()), explain=False)
    folder = aerotri.export(result, tmp_path / "out", "geoparquet").folder
    for name in ("points", "rays"):
        crs = metadata(pq.read_table(folder / f"{name}.parquet"))["columns"]["geometry"]["crs"]
        assert pyproj.CRS.from_json_dict(crs).equals(pyproj.CRS(PLAIN))


def test_heights_are_part_of_the_system():
    assert pyproj.CRS.from_json_dict(parquet.projjson("EPSG:25832+7837")).is_compound
    assert parquet.projjson("local") is None


def test_groups_of_rows_change_nothing(result, files, tmp_path, monkeypatch):
    """Written in small pieces, some of them without any place."""
    monkeypatch.setattr(parquet, "ROWS_AT_A_TIME", 7)
    folder = aerotri.export(result, tmp_path / "out", "geoparquet").folder
    assert pq.ParquetFile(folder / "rays.parquet").metadata.num_row_groups > 100
    assert pq.read_table(folder / "points.parquet").equals(files["points"])
    assert pq.read_table(folder / "rays.parquet").equals(files["rays"])
