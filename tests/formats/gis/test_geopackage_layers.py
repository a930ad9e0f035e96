"""result.gpkg read with SQLite alone: layers, geometries and attributes against the tables of the result."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely

import aerotri
from aerotri.formats.block.folder import write_block
from aerotri.formats.gis.layers import spacing_of
from aerotri.formats.gis.styles import STYLES
from aerotri.reference.export_files import layers as described_layers
from aerotri.vectors.geopackage import read_geopackage
from aerotri.vectors.geopackage_writer import Layer, write_geopackage
from gis_blocks import in_crs, layers_of, odd_names, plain_block
from places import PROJECT
from small_blocks import with_adjustment

KINDS = {
    "footprints": "MultiPolygon", "projection_centres": "Point", "strips": "LineString", "points": "Point",
    "error_ellipses": "Polygon", "control_vectors": "LineString", "check_vectors": "LineString",
    "largest_residuals": "Point", "work_list": "MultiPoint",
}  # fmt: skip


@pytest.fixture(scope="module")
def result():
    return aerotri.adjust(odd_names(plain_block()), explain=False)


@pytest.fixture(scope="module")
def written(result, tmp_path_factory):
    return aerotri.export(result, tmp_path_factory.mktemp("gis") / "out").folder / "result.gpkg"


@pytest.fixture(scope="module")
def layers(written):
    return layers_of(written)


def same(rows, table, columns=None):
    """Whether rows have the values of a table, in its order; NULL where it has no number."""
    assert len(rows) == len(table)
    for name in columns or table.columns:
        expected, found = table[name], [row[name] for row in rows]
        if expected.dtype.kind in "OU":
            assert found == expected.tolist(), name
        else:
            np.testing.assert_array_equal(np.array(found, dtype=float), expected.astype(float), err_msg=name)


def test_layers_and_kinds(layers):
    assert set(KINDS) | {"findings", "layer_styles"} == set(layers)
    for name, kind in KINDS.items():
        shapes = [row["geom"] for row in layers[name] if row["geom"] is not None]
        assert {one.geom_type for one in shapes} == {kind}, name
        assert all(one.is_valid for one in shapes), name


def test_attributes_are_those_of_the_tables(result, layers):
    same(layers["points"], result.points)
    same(layers["projection_centres"], result.images)
    same(layers["work_list"], result.work_list)
    same(layers["findings"], result.findings)
    for name, table in (("control", result.control), ("check", result.check)):
        plan = [row for row in layers[f"{name}_vectors"] if row["component"] == "plan"]
        same(plan, table)


def test_places(result, layers):
    for rows, names in ((layers["points"], "XYZ"), (layers["projection_centres"], ("X0", "Y0", "Z0"))):
        for row in rows:
            expected = [row[name] for name in names]
            assert (row["geom"] is None) == (expected[0] is None)
            if row["geom"] is not None:
                np.testing.assert_array_equal(shapely.get_coordinates(row["geom"], include_z=True)[0], expected)


def test_vectors_are_the_differences_times_k(layers):
    for name in ("control_vectors", "check_vectors"):
        assert layers[name]
        for row in layers[name]:
            begin, end = shapely.get_coordinates(row["geom"])
            drawn = [row["dX"], row["dY"]] if row["component"] == "plan" else [0.0, row["dZ"]]
            np.testing.assert_allclose((end - begin) / row["k"], drawn, atol=1e-9)
            np.testing.assert_array_equal(begin, [row["X"], row["Y"]])


def test_ellipses_are_those_of_the_covariance(result, layers):
    """Every corner d of an ellipse has dᵀC⁻¹d = k² with the total covariance of X and Y, and the azimuth is its own."""
    row_of = {str(name): k for k, name in enumerate(result.block.points)}
    covariance = result.adjusted.points.total_covariance[:, :2, :2]
    for row in layers["error_ellipses"]:
        corners = shapely.get_coordinates(row["geom"])
        k = row_of[row["point"]]
        d = (corners - result.adjusted.points.xyz[k, :2]) / row["k"]
        np.testing.assert_allclose(np.einsum("ni,ij,nj->n", d, np.linalg.inv(covariance[k]), d), 1.0, rtol=1e-6)
        longest = d[np.argmax(np.hypot(*d.T))]
        assert np.hypot(*longest) == pytest.approx(row["ellipse_a_m"], rel=1e-6)
        turn = np.degrees(np.arctan2(*longest)) - row["ellipse_azimuth_deg"]
        if row["ellipse_a_m"] > 1.001 * row["ellipse_b_m"]:
            assert abs((turn + 90.0) % 180.0 - 90.0) < 0.1


def test_stated_scale(result, tmp_path):
    found = layers_of(aerotri.export(result, tmp_path / "out", scale=250.0).folder / "result.gpkg")
    for name in ("error_ellipses", "control_vectors", "check_vectors"):
        assert {row["k"] for row in found[name]} == {250.0}


def test_largest_residuals(result, layers):
    rows, rays = layers["largest_residuals"], result.rays
    size = np.fmax(np.abs(rays["wx"]), np.abs(rays["wy"]))
    assert len(rows) == 100
    np.testing.assert_allclose([abs(row["w"]) for row in rows], np.sort(size[np.isfinite(size)])[::-1][:100], atol=1e-3)
    known = dict(zip(zip(rays["image"].tolist(), rays["point"].tolist(), strict=True), range(len(rays)), strict=True))
    for row in rows:
        k = known[row["image"], row["point"]]
        assert row["w"] == rays[f"w{row['axis']}"][k]
        assert row["beyond_limit"] == (abs(row["w"]) > row["limit"])


def test_strips_go_through_their_photographs(result, layers):
    names = result.block.images.names.tolist()
    assert {row["strip"] for row in layers["strips"]} == set(result.block.images.strip.tolist())
    for row in layers["strips"]:
        xyz = shapely.get_coordinates(row["geom"], include_z=True)
        assert len(xyz) == row["exposures"]
        np.testing.assert_array_equal(xyz[0], result.adjusted.images.centre[names.index(row["first"])])
        assert row["length_m"] == pytest.approx(np.hypot(*np.diff(xyz[:, :2], axis=0).T).sum())


def test_strips_without_names_are_found_along_the_track(result, tmp_path):
    block = result.block
    nameless = replace(block, images=replace(block.images, strip=np.full(len(block.images), "", dtype=object)))
    found = aerotri.adjust(nameless, explain=False)
    rows = layers_of(aerotri.export(found, tmp_path / "out").folder / "result.gpkg")["strips"]
    assert len(rows) >= 3
    assert not any(row["is_named"] for row in rows)


def test_work_list_is_where_its_things_are():
    """A point moved by 5 m, and a photograph with wrong rays, are found at their places."""
    block = plain_block()
    xyz = block.control.xyz.copy()
    own = np.flatnonzero(~block.control.is_check)
    xyz[own[0], 0] += 5.0
    result = aerotri.adjust(replace(block, control=replace(block.control, xyz=xyz)), explain=False)
    from aerotri.diagnosis.work_list import work_list
    from aerotri.formats.gis.layers import work_layer

    work = work_list(result.record.local)
    layer = work_layer(result.adjusted, work)
    name = str(block.points[block.control.point[own[0]]])
    rows = [k for k, item in enumerate(work.items) if item.where == name]
    assert rows
    place = shapely.get_coordinates(layer.geometries[rows[0]], include_z=True)[0]
    np.testing.assert_array_equal(place, result.adjusted.points.xyz[block.control.point[own[0]]])
    rays = [item for item in work.items if item.kind in ("ray", "control ray") and item.points]
    for item in rays:
        assert item.where == f"{block.points[item.points[0]]} in {block.images.names[item.images[0]]}"


def test_styles(written, layers):
    """A default style of every layer: well-formed, of its kind of geometry, every colour grey, rules with symbols."""
    rows = {row["f_table_name"]: row for row in layers["layer_styles"]}
    assert set(rows) == set(KINDS) == set(STYLES)
    shapes = {"Point": "0", "MultiPoint": "0", "LineString": "1", "Polygon": "2", "MultiPolygon": "2"}
    for name, row in rows.items():
        assert row["useAsDefault"] == 1
        assert row["f_geometry_column"] == "geom"
        root = ElementTree.fromstring(row["styleQML"])
        assert root.findtext("layerGeometryType") == shapes[KINDS[name]]
        symbols = {one.get("name") for one in root.findall("renderer-v2/symbols/symbol")}
        rules = root.findall("renderer-v2/rules/rule")
        assert {one.get("symbol") for one in rules} == symbols
        for option in root.iter("Option"):
            if option.get("name", "").endswith("color"):
                red, green, blue, _ = option.get("value").split(",")
                assert red == green == blue
        label = root.find("labeling/settings/text-style")
        if label is not None:
            assert label.get("fieldName") in layers[name][0]
        with closing(sqlite3.connect(written)) as database:
            # filters are SQL too: their columns exist, and every feature has a rule
            filters = [one.get("filter") for one in rules if one.get("filter")]
            count = database.execute(f'SELECT count(*) FROM "{name}" WHERE {" OR ".join(filters) or 1}').fetchone()[0]
            left_out = sum(row.get("status") == "set aside" for row in layers[name])
            assert count == len(layers[name]) - left_out


def test_photographs_are_named_where_the_map_has_room(layers, result):
    """15 mm between neighbours of an even spread."""
    rows = {row["f_table_name"]: row["styleQML"] for row in layers["layer_styles"]}
    shown = {name: ElementTree.fromstring(text).find("labeling/settings/rendering") for name, text in rows.items()}
    centre = result.adjusted.images.centre[:, :2]
    spacing = np.sqrt(np.prod(np.ptp(centre, axis=0)) / len(centre))
    assert float(shown["projection_centres"].get("scaleMax")) == pytest.approx(spacing / 0.015, rel=1e-3)
    assert shown["control_vectors"].get("scaleVisibility") is None
    line = [shapely.Point(x, 0.0) for x in (0.0, 10.0, 20.0, 30.0)]
    assert spacing_of([*line, None]) == pytest.approx(7.5)
    assert spacing_of(line[:1]) is None


def test_every_column_is_described_with_its_unit(written, layers):
    """Columns are those of the reference in its order; the file says of each what it is."""
    with closing(sqlite3.connect(written)) as database:
        said = {(t, c): text for t, c, text in database.execute(
            "SELECT table_name, column_name, description FROM gpkg_data_columns")}  # fmt: skip
    for described in described_layers():
        columns = [name for name in layers[described.name][0] if name not in ("fid", "geom")]
        items = {item.name: item for item in described.items}
        assert [name for name in items if name in columns] == columns
        assert len({name.lower() for name in columns}) == len(columns)
        for name in columns:
            assert items[name].text in said[described.name, name]
            assert items[name].unit in said[described.name, name]
    optional = {name for one in described_layers() for name in one.columns} - {name for _, name in said}
    assert all(item.optional for one in described_layers() for item in one.items if item.name in optional)


def test_local_coordinates_have_no_system(written):
    with closing(sqlite3.connect(written)) as database:
        assert {row[0] for row in database.execute("SELECT srs_id FROM gpkg_geometry_columns")} == {-1}
        assert database.execute("PRAGMA integrity_check").fetchone()[0] == "ok"
        assert database.execute("PRAGMA foreign_key_check").fetchall() == []


def test_block_in_a_crs(tmp_path):
    result = aerotri.adjust(in_crs(plain_block()), explain=False)
    path = aerotri.export(result, tmp_path / "out").folder / "result.gpkg"
    with closing(sqlite3.connect(path)) as database:
        assert {row[0] for row in database.execute("SELECT srs_id FROM gpkg_geometry_columns")} == {25832}
        boxes = database.execute("SELECT min_x, max_y FROM gpkg_contents WHERE data_type = 'features'").fetchall()
    assert all(300000 < x < 420000 and 5.4e6 < y < 5.5e6 for x, y in boxes)
    same(layers_of(path)["points"], result.points)
    assert {srs for _, srs, _ in read_geopackage(path)} == {"EPSG:25832"}


def test_rows_entered_in_pieces_are_the_same(result, layers, tmp_path, monkeypatch):
    monkeypatch.setattr("aerotri.vectors.geopackage_writer.ROWS_AT_A_TIME", 7)
    found = layers_of(aerotri.export(result, tmp_path / "out").folder / "result.gpkg")
    assert {name: rows for name, rows in found.items() if name != "layer_styles"} == {
        name: rows for name, rows in layers.items() if name != "layer_styles"
    }


def test_a_result_that_is_not_accepted_says_so(tmp_path):
    found = aerotri.adjust(with_adjustment(plain_block(), datum="inner"), explain=False)
    assert found.verdict != "accepted"
    (note,) = aerotri.export(found, tmp_path / "out").notes
    assert note == f"the adjustment is {found.verdict}: {found.reasons[0]}"


@pytest.mark.filterwarnings("error")
def test_layers_without_features(tmp_path):
    """Without check points, and held control that is not moved: the layers are there with all their columns."""
    block = plain_block()
    control = block.control
    own = ~control.is_check
    rows = replace(control, point=control.point[own], xyz=control.xyz[own], sigma=np.zeros((own.sum(), 3)),
                   is_check=control.is_check[own])  # fmt: skip
    result = aerotri.adjust(replace(block, control=rows), explain=False)
    path = aerotri.export(result, tmp_path / "out").folder / "result.gpkg"
    found = layers_of(path)
    assert found["check_vectors"] == []
    assert any(row["geom"] is None for row in found["control_vectors"])
    with closing(sqlite3.connect(path)) as database:
        columns = [(row[1], row[2]) for row in database.execute('PRAGMA table_info("check_vectors")')]
        box = database.execute("SELECT min_x FROM gpkg_contents WHERE table_name = 'check_vectors'").fetchone()
    assert ("dX", "REAL") in columns
    assert ("rays", "INTEGER") in columns
    assert box == (None,)
    assert [list(rows) for name, _, rows in read_geopackage(path) if name == "check_vectors"] == [[]]


@pytest.mark.parametrize(
    ("crs", "number", "organization"),
    [("EPSG:25832", 25832, "EPSG"), ("EPSG:25832+5941", 5972, "EPSG"), ("EPSG:25832+7837", 100000, "NONE")],
)
def test_heights_have_their_system(tmp_path, crs, number, organization):
    """A plan with heights: by the code of both together where there is one, else as a system of the file's own."""
    layer = Layer("a", "POINT", [shapely.Point(5e5, 5e6, 10.0), None], {"name": ["p", "q"]}, z=True)
    write_geopackage(tmp_path / "a.gpkg", [layer], crs)
    with closing(sqlite3.connect(tmp_path / "a.gpkg")) as database:
        query = "SELECT srs_id, organization, definition FROM gpkg_spatial_ref_sys WHERE srs_id NOT IN (-1, 0, 4326)"
        ((found, by, definition),) = database.execute(query).fetchall()
    assert (found, by) == (number, organization)
    assert definition.startswith("COMPD_CS" if "+" in crs else "PROJCS")
    assert [row["geom"] for row in layers_of(tmp_path / "a.gpkg")["a"]] == [shapely.Point(5e5, 5e6, 10.0), None]


@pytest.mark.parametrize(
    "name",
    [
        "frederiksstad_ultracam", "frederiksstad_dmc", "frederiksstad_rmk", "drone_site",
        pytest.param("dsk_saar_ultracam", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_blocks_of_the_project(name, tmp_path):
    folder = PROJECT / "blocks" / name
    if not (folder / "block.toml").exists():
        block = aerotri.simulate(folder / "simulation.toml", seed=1).block
        write_block(block, tmp_path / "block")
        folder = tmp_path / "block"
    result = aerotri.adjust(folder, explain=False)
    found = layers_of(aerotri.export(result, tmp_path / "out").folder / "result.gpkg")
    same(found["points"], result.points, ("point", "X", "sZ", "rays"))
    adjusted = np.isfinite(result.images["X0"]).sum()
    assert len(found["footprints"]) == adjusted
    given = np.isfinite([result.control["dX"], result.control["dZ"]])
    assert len(found["control_vectors"]) == given.sum()
    gsd = np.array([row["gsd_m"] for row in found["footprints"]])
    pixels = np.array([np.prod(camera.size_px) for camera in result.block.cameras])[0]
    area = np.array([row["area_m2"] for row in found["footprints"]])
    np.testing.assert_allclose(area, gsd**2 * pixels, rtol=0.35)
