"""Degrees and feet: brought to metres and said so, or refused with a remedy; vector files in their own CRS."""

from __future__ import annotations

import json
import sqlite3
from dataclasses import replace

import numpy as np
import pytest
import rasterio
import shapely
from pyproj import Transformer

from aerotri.commands.adjust import run_adjust
from aerotri.commands.compare import run_compare
from aerotri.commands.volume import VolumeInput, run_volume
from aerotri.conventions import InputError
from aerotri.coordinates.local_frame import local_frame
from aerotri.coordinates.metric import in_metres, outside_in_words
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.foreign.breaklines import breaklines_and_note
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.pipeline import adjust, adjust_keeping_system
from aerotri.rasters.grids import Grid, RasterReader, write_raster
from aerotri.rasters.metric import MetricReader, refuse_other_units, units_of
from aerotri.vectors.polygons import polygon_features
from aerotri.volume.boundary import read_boundary
from aerotri.volume.settings import SectionPlan, SigmaOptions
from dense_algebra import TINY
from small_blocks import small_block

UTM, LON_LAT = "EPSG:32632", "EPSG:4326"
LON, LAT = 7.0, 49.2
"""Away from the middle of zone 32, so that the convergence counts."""
SURVEY_FOOT = 1200.0 / 3937.0
TO_UTM = Transformer.from_crs(LON_LAT, UTM, always_xy=True)
MIDDLE = np.array(TO_UTM.transform(LON, LAT))
HEIGHT, RADIUS = 12.0, 80.0
TRUE = 2.0 * np.pi * 40.0**2 * HEIGHT * (1.0 - np.exp(-(RADIUS**2) / (2.0 * 40.0**2)))


def hill(x, y):
    """m, over (n,) UTM coordinates."""
    return 200.0 + HEIGHT * np.exp(-((x - MIDDLE[0]) ** 2 + (y - MIDDLE[1]) ** 2) / (2.0 * 40.0**2))


def written(path, crs, step, factor=1.0, unit=None, count=160):
    """The hill in another CRS, `step` of its units a cell, heights divided by `factor`."""
    forward = Transformer.from_crs(UTM, crs, always_xy=True)
    middle = np.array(forward.transform(*MIDDLE))
    grid = Grid(count, count, middle[0] - step * count / 2.0, middle[1] + step * count / 2.0, step, step)
    x, y = np.meshgrid(grid.x(np.arange(count)), grid.y(np.arange(count)))
    z = hill(*forward.transform(x.ravel(), y.ravel(), direction="INVERSE")).reshape(x.shape) / factor
    write_raster(path, z, grid, crs)
    if unit is not None:
        with rasterio.open(path, "r+") as file:
            file.units = [unit]
    return path


def circle(crs=None):
    """The boundary around the hill."""
    ring = shapely.Point(*MIDDLE).buffer(RADIUS, quad_segs=64)
    if crs is None:
        return ring
    forward = Transformer.from_crs(UTM, crs, always_xy=True)
    return shapely.transform(ring, lambda xy: np.column_stack(forward.transform(*xy.T)))


def geojson(path, geometry, crs=None):
    content = {"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": {}, "geometry": json.loads(shapely.to_geojson(geometry))}
    ]}  # fmt: skip
    if crs is not None:
        content["crs"] = {"type": "name", "properties": {"name": crs}}
    path.write_text(json.dumps(content))
    return path


def volume(dtm, boundary, out, base="level:200", adjustment=None):
    given = VolumeInput(dtm, base, str(boundary), "prisms", adjustment, None, None)
    assert run_volume(given, SectionPlan(10.0, 0.0), SigmaOptions(), out, False, True) == 0
    return json.loads((out / "volume.json").read_text())


@pytest.mark.parametrize(
    ("crs", "step", "factor", "unit"),
    [
        (UTM, 2.0, 1.0, None),
        (LON_LAT, 2e-5, 1.0, None),
        (UTM, 2.0, 0.3048, "ft"),
        ("EPSG:32632+8228", 2.0, 0.3048, None),
    ],
)
def test_a_volume_is_in_metres_whatever_the_file_counts_in(tmp_path, crs, step, factor, unit):
    if "+" in crs:
        plain = written(tmp_path / "plain.tif", UTM, step, factor)
        with RasterReader(plain) as reader:
            z, grid = reader.read(0, 0, 160, 160), reader.grid
        dtm = tmp_path / "dtm.tif"
        write_raster(dtm, z, grid, rasterio.CRS.from_string(crs))
    else:
        dtm = written(tmp_path / "dtm.tif", crs, step, factor, unit)
    found = volume(dtm, geojson(tmp_path / "circle.geojson", circle(LON_LAT)), tmp_path / "out")
    assert found["net_m3"] == pytest.approx(TRUE, rel=0.005)
    assert found["boundary"]["area_m2"] == pytest.approx(np.pi * RADIUS**2, rel=1e-3)
    metric = crs == UTM and unit is None
    assert any("dtm.tif: " in text for text in found["warnings"]) != metric
    assert any("RFC 7946" in text for text in found["warnings"])


def test_a_plan_in_feet_needs_the_unit_of_the_heights(tmp_path):
    """State plane of California in US survey feet."""
    grid = Grid(20, 20, 6.0e6, 2.0e6, 10.0, 10.0)
    z = np.full((20, 20), 328.0833333333333)
    write_raster(tmp_path / "feet.tif", z, grid, "EPSG:2225")
    with pytest.raises(InputError, match="US survey foot") as refused:
        MetricReader(tmp_path / "feet.tif")
    assert "gdal_edit.py -units" in refused.value.remedy
    for unit, height in (("US survey foot", 100.0), ("m", 328.0833333333333)):
        with rasterio.open(tmp_path / "feet.tif", "r+") as file:
            file.units = [unit]
        with MetricReader(tmp_path / "feet.tif") as reader:
            assert units_of(RasterReader(tmp_path / "feet.tif")).plan == "US survey foot"
            # NAD83 has a UTM of its own
            assert reader.plan == "EPSG:26910"
            assert reader.grid.cell_x == pytest.approx(10.0 * SURVEY_FOOT, rel=0.02)
            values = reader.read(0, 0, reader.grid.rows, reader.grid.columns)
            assert np.nanmedian(values) == pytest.approx(height, rel=1e-7)
            assert "US survey foot" in reader.note
    with RasterReader(tmp_path / "feet.tif") as reader, pytest.raises(InputError, match="gdalwarp"):
        refuse_other_units(reader)


def test_cells_outside_the_source_are_not_known(tmp_path):
    """A raster without a no-data value has none of its edge as height 0 either."""
    path = written(tmp_path / "dtm.tif", LON_LAT, 2e-5)
    with rasterio.open(path) as file:
        z, profile = file.read(1), file.profile
    profile["nodata"] = None
    with rasterio.open(tmp_path / "whole.tif", "w", **profile) as file:
        file.write(z, 1)
    with MetricReader(tmp_path / "whole.tif") as reader:
        values = reader.read(0, 0, reader.grid.rows, reader.grid.columns)
    assert np.isnan(values).any()
    assert np.nanmin(values) > 199.0


def compared(test, control, out):
    run_compare(test, control, out, "linear", "none", None, None, False, True)


def test_compare_counts_in_metres(tmp_path, capsys):
    written(tmp_path / "degrees.tif", LON_LAT, 2e-5)
    written(tmp_path / "metres.tif", UTM, 2.0)
    compared(tmp_path / "degrees.tif", tmp_path / "metres.tif", tmp_path / "out")
    printed = capsys.readouterr()
    content = json.loads(printed.out)
    assert content["cell_m"] == pytest.approx(2.0, rel=0.3)
    assert content["difference_m"]["max"] < 0.1
    assert f"brought from {LON_LAT}" in printed.err
    assert UTM in printed.err
    compared(tmp_path / "degrees.tif", tmp_path / "degrees.tif", tmp_path / "other")
    assert json.loads(capsys.readouterr().out)["cell_m"] > 0.5


def test_boundaries_in_their_own_crs(tmp_path):
    """GeoJSON by RFC 7946, with the old member, in coordinates of the surface; GeoPackage; WKT with its SRID."""
    plain, lon_lat = circle(), circle(LON_LAT)
    zone = circle("EPSG:32631")
    cases = {
        "rfc": (geojson(tmp_path / "rfc.geojson", lon_lat), "RFC 7946"),
        "old": (geojson(tmp_path / "old.geojson", zone, "urn:ogc:def:crs:EPSG::32631"), "EPSG:32631"),
        "crs84": (geojson(tmp_path / "84.geojson", lon_lat, "urn:ogc:def:crs:OGC:1.3:CRS84"), "OGC:CRS84"),
        "same": (geojson(tmp_path / "same.geojson", plain, "EPSG:32632"), ""),
        "none": (geojson(tmp_path / "none.geojson", plain), "names no CRS"),
        "gpkg": (package(tmp_path / "b.gpkg", zone, 32631), "EPSG:32631"),
        "srid": (f"SRID=4326;{lon_lat.wkt}", "EPSG:4326"),
        "wkt": (plain.wkt, ""),
    }
    for name, (source, note) in cases.items():
        found = read_boundary(str(source), "EPSG:32632")
        assert found.area == pytest.approx(plain.area, rel=1e-5), name
        assert found.polygon.hausdorff_distance(plain) < 0.01, name
        assert note in found.note, name
        assert bool(note) == bool(found.note), name
    # without a CRS of the surface nothing can be transformed
    assert read_boundary(str(tmp_path / "rfc.geojson")).area < 1e-4
    assert polygon_features(tmp_path / "old.geojson")[1]


def package(path, geometry, srs):
    """A GeoPackage of one polygon."""
    blob = b"GP\x00\x01" + int(srs).to_bytes(4, "little") + shapely.to_wkb(geometry, byte_order=1)
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE gpkg_geometry_columns (table_name, column_name, srs_id INTEGER)")
        database.execute("INSERT INTO gpkg_geometry_columns VALUES ('area', 'geom', ?)", (srs,))
        database.execute("CREATE TABLE area (geom BLOB)")
        database.execute("INSERT INTO area VALUES (?)", (blob,))
    return path


def test_breaklines_in_longitude_and_latitude(tmp_path):
    line = [[LON, LAT, 210.0], [LON + 0.001, LAT, 211.0], [LON, LAT + 0.001, 212.0]]
    feature = {"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": line}}
    (tmp_path / "lines.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    (found,), note = breaklines_and_note(tmp_path / "lines.geojson", UTM)
    np.testing.assert_allclose(found[:, :2], np.column_stack(TO_UTM.transform(*np.array(line)[:, :2].T)), atol=1e-6)
    np.testing.assert_array_equal(found[:, 2], [210.0, 211.0, 212.0])
    assert "RFC 7946" in note


@pytest.fixture(scope="module")
def blocks():
    """One block in UTM and in longitude and latitude, control and attitudes alike."""
    block = small_block(2, **TINY)[0]
    shift = np.append(MIDDLE, 0.0)
    block = replace(
        block, crs=UTM, images=replace(block.images, centre=block.images.centre + shift),
        control=replace(block.control, xyz=block.control.xyz + shift),
    )  # fmt: skip

    def lon_lat(xyz):
        lon, lat = TO_UTM.transform(xyz[:, 0], xyz[:, 1], direction="INVERSE")
        return np.column_stack([lon, lat, xyz[:, 2]])

    utm, geographic = local_frame(UTM, block.images.centre), local_frame(LON_LAT, lon_lat(block.images.centre))
    between = geographic.local_from_geocentric @ utm.local_from_geocentric.T
    rotation = rotation_from_angles(block.images.angles, block.rotation)
    places = lon_lat(block.images.centre)
    turned = np.swapaxes(geographic.axes_at(places), 1, 2) @ between @ utm.axes_at(block.images.centre) @ rotation
    from aerotri.functional_model.rotation import angles_from_rotation

    other = replace(
        block, crs=LON_LAT, control=replace(block.control, xyz=lon_lat(block.control.xyz)),
        images=replace(block.images, centre=places, angles=angles_from_rotation(turned, block.rotation)),
    )  # fmt: skip
    return block, other


def test_a_block_in_degrees_is_brought_to_its_zone(blocks):
    utm, degrees = blocks
    found, note = in_metres(degrees)
    assert found.crs == UTM
    assert LON_LAT in note
    assert UTM in note
    np.testing.assert_allclose(found.control.xyz, utm.control.xyz, atol=1e-5)
    np.testing.assert_allclose(found.images.centre, utm.images.centre, atol=1e-5)
    np.testing.assert_allclose(found.images.angles, utm.images.angles, atol=1e-9)
    # σ east and north, turned by the convergence of 1.5°
    np.testing.assert_allclose(found.control.sigma, utm.control.sigma, rtol=2e-3)
    assert in_metres(utm) == (utm, "")


def test_adjust_delivers_in_metres(blocks, tmp_path, capsys):
    utm, degrees = blocks
    write_block(degrees, tmp_path / "degrees")
    assert run_adjust(tmp_path / "degrees", tmp_path / "result", None, None, None, False, True) == 0
    printed = capsys.readouterr()
    assert f"brought to {UTM}" in printed.err
    json.loads(printed.out)
    expected = adjust(utm)
    again = read_block(tmp_path / "result" / "block")
    assert again.crs == UTM
    rows = [line.split(",") for line in (tmp_path / "result" / "images.csv").read_text().splitlines()]
    column = rows[0].index("X0")
    centres = np.array([[float(v) for v in row[column : column + 3]] for row in rows[1:]])
    np.testing.assert_allclose(centres, expected.images.centre, atol=2e-4)


def test_held_control_stays_held(blocks):
    _, degrees = blocks
    sigma = np.where(degrees.control.is_check[:, None], 0.05, [0.0, 0.0, 0.05])
    found, _ = in_metres(replace(degrees, control=replace(degrees.control, sigma=sigma)))
    assert (found.control.sigma[~degrees.control.is_check][:, :2] == 0.0).all()


def test_positions_outside_the_area_of_use_are_said(blocks):
    utm, _ = blocks
    assert outside_in_words(local_frame(UTM, utm.images.centre)) == ""
    away = np.array([600_000.0, 0.0, 0.0])
    moved = replace(
        utm, images=replace(utm.images, centre=utm.images.centre + away),
        control=replace(utm.control, xyz=utm.control.xyz + away),
    )  # fmt: skip
    text = outside_in_words(local_frame(UTM, moved.images.centre))
    assert "outside the area of use of EPSG:32632" in text
    assert "EPSG:32633" in text
    assert text in adjust_keeping_system(moved).result.outcome.warnings


def test_feet_in_a_block_are_refused_with_a_crs_in_metres():
    with pytest.raises(InputError, match="US survey foot") as refused:
        local_frame("EPSG:2225", np.array([[6.0e6, 2.0e6, 0.0]]))
    assert "EPSG:26910" in refused.value.remedy
