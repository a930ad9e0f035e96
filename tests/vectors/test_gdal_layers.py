"""Boundaries and breaklines in Shapefile, FlatGeobuf, KML, KMZ and DXF: numbers known, or refused by name."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile

import numpy as np
import pyogrio
import pytest
import shapely
from pyproj import CRS, Transformer

from aerotri.conventions import InputError
from aerotri.formats.foreign.breaklines import breaklines_and_note
from aerotri.planning.area import read_area
from aerotri.volume.boundary import read_boundary

UTM = "EPSG:32632"
PLANT = "+proj=tmerc +lat_0=48 +lon_0=9.1 +k=0.99995 +x_0=1000 +y_0=2000 +ellps=WGS84 +units=m"
"""A system without a code."""
EAST = shapely.Polygon([(500010, 5300000), (500030, 5300000), (500030, 5300020), (500010, 5300020)])
WEST = shapely.Polygon([(499950, 5300000), (499980, 5300000), (499980, 5300010)])
DRIVERS = {".shp": "ESRI Shapefile", ".fgb": "FlatGeobuf", ".kml": "KML", ".gpkg": "GPKG"}


def written(path, geometries, crs=UTM, columns=None, kind="Polygon", **options):
    """A file by pyogrio itself."""
    columns = columns or {"name": ["east", "west"][: len(geometries)]}
    values = [np.array(own, dtype=object if isinstance(own[0], str) else None) for own in columns.values()]
    pyogrio.raw.write(
        path, np.array(shapely.to_wkb(geometries), dtype=object), values, list(columns), crs=crs and CRS(crs).to_wkt(),
        geometry_type=kind, driver=DRIVERS[path.suffix], **options,
    )  # fmt: skip
    return path


def to(crs, geometry, source=UTM):
    change = Transformer.from_crs(source, crs, always_xy=True)
    return shapely.transform(geometry, lambda xy: np.column_stack(change.transform(*xy.T)))


def lon_lat(geometry):
    return to("EPSG:4326", geometry)


@pytest.fixture
def shapefile(tmp_path):
    (tmp_path / "shape").mkdir()
    return written(tmp_path / "shape" / "piles.shp", [EAST, WEST])


def archive(path, files):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as own:
        for name, content in files.items():
            own.writestr(name, content)
    return path


def beside(path):
    return {f"deep/{own.name}": own.read_bytes() for own in path.parent.iterdir()}


def check(boundary, tolerance=1e-3):
    """Both piles by their names, wherever they stood in the file."""
    piles = dict(boundary.piles)
    assert sorted(piles) == ["east", "west"]
    for name, true in (("east", EAST), ("west", WEST)):
        assert piles[name].symmetric_difference(true).area < tolerance


@pytest.mark.parametrize("ending", [".shp", ".zip", ".shz", ".fgb"])
def test_piles_in_the_system_of_the_surface(ending, shapefile, tmp_path):
    path = shapefile
    if ending == ".fgb":
        path = written(tmp_path / "piles.fgb", [EAST, WEST])
    elif ending != ".shp":
        path = archive(tmp_path / f"piles{ending}", beside(shapefile))
    found = read_boundary(str(path), UTM)
    check(found)
    assert found.note == ""


@pytest.mark.parametrize("ending", [".shp", ".fgb"])
def test_system_without_a_code_is_brought(ending, tmp_path):
    path = written(tmp_path / f"piles{ending}", [to(PLANT, own) for own in (EAST, WEST)], PLANT)
    found = read_boundary(str(path), UTM)
    check(found)
    assert "brought from a CRS without an EPSG code" in found.note


@pytest.mark.parametrize("ending", [".kml", ".kmz"])
def test_kml_is_longitude_and_latitude(ending, tmp_path):
    path = written(tmp_path / "piles.kml", [lon_lat(EAST), lon_lat(WEST)], "EPSG:4326")
    if ending == ".kmz":
        path = archive(tmp_path / "piles.kmz", {"other.kml": b"nothing", "doc.kml": path.read_bytes()})
    check(read_boundary(str(path), UTM))
    area = read_area(str(path))
    assert area.crs == UTM
    assert area.polygon.area == pytest.approx(EAST.area + WEST.area, rel=1e-5)


def test_no_system_is_told(shapefile):
    shapefile.with_suffix(".prj").unlink()
    found = read_boundary(str(shapefile), UTM)
    check(found)
    assert found.note == "piles.shp names no CRS: taken for EPSG:32632"


FOLDER = "<Folder><name>{}</name>{}</Folder>"


def placemark(geometry):
    tag = {"Polygon": "<Polygon><outerBoundaryIs><LinearRing>{}</LinearRing></outerBoundaryIs></Polygon>",
           "Point": "<Point>{}</Point>"}[geometry.geom_type]  # fmt: skip
    text = " ".join(f"{x!r},{y!r}" for x, y in shapely.get_coordinates(lon_lat(geometry)).tolist())
    return f"<Placemark><name>east</name>{tag.format(f'<coordinates>{text}</coordinates>')}</Placemark>"


def kml(path, *folders):
    text = "".join(FOLDER.format(name, placemark(own)) for name, own in folders)
    path.write_text(f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{text}</Document></kml>')
    return str(path)


def test_layers_are_named(tmp_path):
    point = shapely.Point(500000.0, 5300000.0)
    found = read_boundary(kml(tmp_path / "a.kml", ("labels", point), ("piles", EAST)), UTM)
    assert found.polygon.area == pytest.approx(400.0, rel=1e-5)
    assert "layers without polygons, not used: 'labels' (Point)" in found.note
    with pytest.raises(InputError, match="2 layers with polygons: 'piles', 'stable'"):
        read_boundary(kml(tmp_path / "b.kml", ("piles", EAST), ("stable", WEST)), UTM)
    with pytest.raises(InputError, match="no polygons, it holds Point"):
        read_boundary(kml(tmp_path / "c.kml", ("labels", point)), UTM)


def test_layers_of_a_geopackage_are_named(tmp_path):
    path = written(tmp_path / "a.gpkg", [EAST], layer="piles")
    written(path, [WEST], layer="stable", append=True)
    with pytest.raises(InputError, match="has 2 layers: 'piles', 'stable'"):
        read_boundary(str(path), UTM)


def test_kinds_are_refused_by_name(tmp_path):
    path = written(tmp_path / "a.fgb", [EAST, shapely.LineString([(0, 0), (1, 1)])], kind="Unknown", SPATIAL_INDEX="NO")
    with pytest.raises(InputError, match="feature 2 is a LineString, no polygon"):
        read_boundary(str(path), UTM)


def test_drawing(tmp_path):
    """Arcs count with their corners, and what is no outline is named."""
    import ezdxf

    drawing = ezdxf.new("R2010", units=4)
    space = drawing.modelspace()
    space.add_lwpolyline(list(EAST.exterior.coords), dxfattribs={"layer": "east"})
    space.add_polyline2d(list(WEST.exterior.coords)[:-1], close=True, dxfattribs={"layer": "west"})
    space.add_circle((500100.0, 5300000.0), 10.0, dxfattribs={"layer": "round"})
    space.add_lwpolyline([(0.0, 0.0), (1.0, 1.0)])
    space.add_text("east")
    path = tmp_path / "piles.dxf"
    drawing.saveas(path)
    found = read_boundary(str(path), UTM)
    assert dict(found.piles)["east"].equals(EAST)
    assert dict(found.piles)["west"].equals(WEST)
    assert dict(found.piles)["round"].area == pytest.approx(np.pi * 100.0, rel=1e-3)
    for text in ("not used: 1 LWPOLYLINE, 1 TEXT", "millimetres", "names no CRS: taken for EPSG:32632"):
        assert text in found.note


LINE = shapely.LineString([(500000.0, 5300000.0, 100.5), (500010.0, 5300000.0, 101.5), (500020.0, 5300005.0, 99.25)])


@pytest.mark.parametrize("ending", [".shp", ".fgb"])
def test_breaklines_keep_their_heights(ending, tmp_path):
    path = written(tmp_path / f"lines{ending}", [LINE], kind="LineString Z")
    (found,), note = breaklines_and_note(path, UTM)
    np.testing.assert_array_equal(found, shapely.get_coordinates(LINE, include_z=True))
    assert note == ""
    moved = breaklines_and_note(path, "EPSG:32633")[0][0]
    np.testing.assert_array_equal(moved[:, 2], found[:, 2])
    flat = written(tmp_path / f"flat{ending}", [shapely.force_2d(LINE)], kind="LineString")
    with pytest.raises(InputError, match="line 1 has no heights"):
        breaklines_and_note(flat, UTM)


def test_kml_has_no_heights_for_breaklines(tmp_path):
    path = written(tmp_path / "lines.kml", [lon_lat(LINE)], "EPSG:4326", kind="LineString Z")
    with pytest.raises(InputError, match="heights in KML"):
        breaklines_and_note(path, UTM)


VRT = b"<OGRVRTDataSource><OGRVRTLayer name='a'><SrcDataSource>/etc/passwd</SrcDataSource></OGRVRTLayer>"
WRONG = {
    "a.fgb": (b"nonsense", "is no FlatGeobuf"),
    "b.fgb": (b"fgb\x03fgb\x01" + b"\xff" * 200, "cannot be read"),
    "a.kml": (b"<kml><Document>", "is not XML"),
    "b.kml": (VRT + b"</OGRVRTDataSource>", "is no KML"),
    "c.kml": (b"<kml><!-- " + VRT + b" --></kml>", "is no KML"),
    "d.kml": (b'<!DOCTYPE a [<!ENTITY b "c">]><kml>&b;</kml>', "document type"),
    "a.kmz": (b"PK\x03\x04nonsense", "is no archive"),
    "a.zip": (b"", "is no archive"),
    "a.shp": (b"nonsense", "is no Shapefile"),
    "a.dxf": (b"nonsense", "cannot be read"),
}


@pytest.mark.parametrize("name", WRONG)
def test_damaged_files_are_refused_by_name(name, tmp_path, capfd):
    content, says = WRONG[name]
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=says) as told:
        read_boundary(str(path), UTM)
    assert told.value.file == path
    assert told.value.remedy
    assert capfd.readouterr() == ("", "")


def test_a_missing_index_is_not_made(shapefile):
    shapefile.with_suffix(".shx").unlink()
    before = sorted(shapefile.parent.iterdir())
    with pytest.raises(InputError, match=r"its \.shx is missing"):
        read_boundary(str(shapefile), UTM)
    assert sorted(shapefile.parent.iterdir()) == before


@pytest.mark.parametrize("ending", [".shx", ".dbf"])
def test_files_of_another_state_are_refused(ending, shapefile, tmp_path):
    """An index or attributes of one shape beside a .shp of two: the second pile would be left out."""
    (tmp_path / "old").mkdir()
    old = written(tmp_path / "old" / "piles.shp", [EAST])
    shapefile.with_suffix(ending).write_bytes(old.with_suffix(ending).read_bytes())
    with pytest.raises(
        InputError,
        match={".shx": r"its \.shx lists 1 shapes, its \.dbf 2", ".dbf": r"shx lists 2 shapes, its \.dbf 1"}[ending],
    ):
        read_boundary(str(shapefile), UTM)
    shapefile.with_suffix(ending).unlink()
    shapefile.write_bytes(shapefile.read_bytes()[:-40])
    with pytest.raises(InputError, match="is missing" if ending == ".shx" else "is shorter than its"):
        read_boundary(str(shapefile), UTM)


def test_a_damaged_system_is_not_passed_over(shapefile):
    shapefile.with_suffix(".prj").write_text('PROJCS["a",GEOGCS["b"')
    with pytest.raises(InputError, match="its CRS cannot be read"):
        read_boundary(str(shapefile), UTM)


def test_archives(shapefile, tmp_path, monkeypatch):
    files = beside(shapefile)
    two = archive(tmp_path / "two.zip", files | {"second.shp": files["deep/piles.shp"]})
    with pytest.raises(InputError, match=r"holds 2 Shapefiles: .*'second\.shp'"):
        read_boundary(str(two), UTM)
    monkeypatch.setattr("aerotri.vectors.gdal_layers.LARGEST_BYTES", 5000)
    bomb = archive(tmp_path / "bomb.kmz", {"doc.kml": b"<kml>" + bytes(100_000)})
    with pytest.raises(InputError, match="unpacks to more than is read"):
        read_boundary(str(bomb), UTM)


@pytest.mark.skipif(os.name != "posix", reason="pipes and links as on POSIX systems")
def test_companions_that_are_no_files(shapefile):
    shapefile.with_suffix(".prj").unlink()
    shapefile.with_suffix(".prj").symlink_to("/nowhere/a.prj")
    with pytest.raises(InputError, match=r"piles\.prj"):
        read_boundary(str(shapefile), UTM)


@pytest.mark.parametrize(
    "source", ["/vsicurl/http://localhost:1/a.fgb", "http://localhost:1/a.kml", "zip:///tmp/a.shp"]
)
def test_addresses_are_not_followed(source):
    with pytest.raises(InputError, match=r"no such file|is no file|cannot be read"):
        read_boundary(source, UTM)


def test_pyogrio_is_imported_when_such_a_file_is_read_only():
    code = (
        "import sys, aerotri.cli, aerotri.volume.boundary; sys.exit('pyogrio' in sys.modules or 'ezdxf' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
