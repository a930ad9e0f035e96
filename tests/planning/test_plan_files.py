"""The files of a plan, read by other means than they were written by."""

from __future__ import annotations

import csv
import json
import sqlite3
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import rasterio
import shapely

import aerotri
from aerotri.cli.app import invoke
from planned_flights import TRIANGLE

KML = {"k": "http://www.opengis.net/kml/2.2"}


@pytest.fixture(scope="module")
def plan():
    return aerotri.plan_flight(TRIANGLE, camera="p1", gsd=0.03, ground=100.0, control=5, tie_points=60, cross_strips=1)


@pytest.fixture(scope="module")
def folder(plan, tmp_path_factory):
    return plan.save(tmp_path_factory.mktemp("plans") / "plan")


def test_geopackage(plan, folder):
    """Geometry is WKB behind the header of 40 bytes that an envelope in X and Y makes."""
    with sqlite3.connect(folder / "plan.gpkg") as database:
        tables = {row[0]: row[1] for row in database.execute("SELECT table_name, srs_id FROM gpkg_geometry_columns")}
        rows = database.execute("SELECT geom, image, altitude_m, heading_deg FROM exposures").fetchall()
        control = database.execute('SELECT geom, point, "order" FROM control ORDER BY "order"').fetchall()
        prints = database.execute("SELECT geom FROM footprints").fetchall()
    assert tables == dict.fromkeys(("area", "strips", "exposures", "footprints", "control"), 25832)
    places = np.array([shapely.get_coordinates(shapely.from_wkb(row[0][40:]), include_z=True)[0] for row in rows])
    assert places == pytest.approx(plan.record.flight.centre)
    assert [row[1] for row in rows] == plan.exposures["image"].tolist()
    assert [row[2] for row in control] == [1, 2, 3, 4, 5]
    # a footprint on level ground: the format at the scale of the height
    height = plan.record.flight.centre[0, 2] - 100.0
    size = 8192 * 5460 * (4.4e-3 * height / 35.0) ** 2
    assert [shapely.from_wkb(row[0][40:]).area for row in prints] == pytest.approx([size] * len(prints))


def test_gdal_reads_it(plan, folder):
    pyogrio = pytest.importorskip("pyogrio")
    assert len(pyogrio.list_layers(folder / "plan.gpkg")) == 5
    found = pyogrio.read_info(folder / "plan.gpkg", layer="exposures")
    assert found["features"] == len(plan.exposures)
    assert found["crs"] == "EPSG:25832"
    assert pyogrio.read_info(folder / "plan.kml", layer="exposures")["features"] == len(plan.exposures)


def test_kml(plan, folder):
    root = ElementTree.parse(folder / "plan.kml").getroot()
    names = [one.text for one in root.findall(".//k:Folder/k:name", KML)]
    assert names == ["area", "strips", "exposures", "control"]
    points = root.findall(".//k:Folder[k:name='exposures']/k:Placemark/k:Point/k:coordinates", KML)
    assert len(points) == len(plan.exposures)
    lon, lat, z = (float(part) for part in points[0].text.split(","))
    # UTM 32 has its central meridian at 9°: X = 500 000 m there
    assert lon == pytest.approx(9.0 + (plan.exposures["X"][0] - 500000.0) / 111320 / np.cos(np.radians(lat)), abs=1e-5)
    assert z == pytest.approx(plan.exposures["Z"][0], abs=0.01)


def test_waypoints(plan, folder):
    with (folder / "waypoints.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["X"]) for row in rows] == pytest.approx(plan.exposures["X"], abs=1e-3)
    assert [float(row["height_above_ground_m"]) for row in rows] == pytest.approx(plan.exposures["Z"] - 100.0, abs=0.01)
    assert (np.diff([float(row["time_s"]) for row in rows]) > 0.0).all()


def test_raster_has_the_sigma(plan, folder):
    with rasterio.open(folder / "sigma_z.tif") as file:
        assert file.crs.to_epsg() == 25832
        table = plan.ground_points
        found = np.array(list(file.sample(zip(table["X"], table["Y"], strict=True))))
    for band, name in enumerate(("sZ", "shared_sZ", "sX", "sY", "rays")):
        assert found[:, band] == pytest.approx(table[name], rel=1e-5)


def test_block_is_adjusted(plan, folder):
    result = aerotri.adjust(aerotri.read_block(folder / "block"))
    assert result.status == "converged"
    assert 0.9 < result.sigma0 < 1.1
    assert (folder / "block" / "truth" / "points.csv").is_file()


def test_page(plan, folder):
    page = (folder / "plan.html").read_text(encoding="utf-8")
    assert page.count('class="control"') == 2 * 5
    assert page.count('class="exposure"') == len(plan.exposures)
    assert "http" not in page.replace("http-equiv", "")


def test_hostile_names_are_written_as_text(tmp_path):
    area = tmp_path / "a&<b>.wkt"
    area.write_text(TRIANGLE)
    plan = aerotri.plan_flight(area, camera="p1", gsd=0.03, ground=0.0, control=4, tie_points=60)
    folder = plan.save(tmp_path / "plan")
    assert "a&<b>" not in (folder / "plan.html").read_text(encoding="utf-8")
    ElementTree.parse(folder / "plan.kml")


def test_local_plan_has_no_kml(tmp_path):
    plan = aerotri.plan_flight(
        TRIANGLE.partition(";")[2], camera="p1", gsd=0.03, ground=0.0, control=4, tie_points=60
    )  # fmt: skip
    folder = plan.save(tmp_path / "plan")
    assert not (folder / "plan.kml").exists()
    assert ",,," in (folder / "waypoints.csv").read_text().splitlines()[1]


def test_other_files_are_not_replaced(plan, tmp_path):
    (tmp_path / "mine.txt").write_text("x")
    with pytest.raises(aerotri.InputError, match="other files"):
        plan.save(tmp_path)


def test_given_control(tmp_path):
    table = tmp_path / "control.csv"
    table.write_text("point,X,Y,Z,role\nA,10,5,0,control\nB,150,10,0,control\nC,140,90,0,control\nK,90,50,0,check\n")
    text = "POLYGON ((0 0, 200 0, 160 120, 0 0))"
    found = aerotri.plan_flight(text, camera="p1", gsd=0.03, ground=0.0, control=table, tie_points=60)
    assert found.control["point"].tolist() == ["A", "B", "C"]
    more = aerotri.plan_flight(
        text, camera="p1", gsd=0.03, ground=0.0, control=table, tie_points=60, target="sigma-z 0.001", most_control=2
    )  # fmt: skip
    assert more.control["order"].tolist() == [0, 0, 0, 1, 2]
    table.write_text("point,X,Y,Z\nA,1e6,5,0\n")
    with pytest.raises(aerotri.InputError, match="fewer than two photographs"):
        aerotri.plan_flight(text, camera="p1", gsd=0.03, ground=0.0, control=table, tie_points=60)


def test_command(tmp_path, capsys):
    line = ["plan", TRIANGLE, "--camera", "p1", "--gsd", "0.03", "--ground", "100", "--positions-sigma", "0.02,0.03",
            "--target", "sigma-z 0.2", "--tie-points", "60", "--out", str(tmp_path / "out"), "--json"]  # fmt: skip
    assert invoke(line) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["target"]["met"] is True
    assert printed["control"] == []
    assert printed == json.loads((tmp_path / "out" / "plan.json").read_text())
