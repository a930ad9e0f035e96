"""item.json: geometry in degrees, files that are there, times, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyproj
import pystac
import pytest
import shapely

import aerotri
from aerotri.formats.gis.stac import in_degrees, stac_item
from gis_blocks import PLAIN, in_crs, plain_block


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """A result in a CRS that was saved."""
    folder = tmp_path_factory.mktemp("gis") / "the result"
    return aerotri.open_result(aerotri.adjust(in_crs(plain_block()), explain=False).save(folder, plots=False))


@pytest.fixture(scope="module")
def exported(result, tmp_path_factory):
    out = tmp_path_factory.mktemp("gis") / "out put"
    for to in ("gpkg", "geoparquet", "stac"):
        aerotri.export(result, out, to)
    return out


@pytest.fixture(scope="module")
def item(exported):
    return json.loads((exported / "item.json").read_text(encoding="utf-8"))


def test_geometry_is_the_ground_of_the_photographs(result, item):
    """All points below the projection centres are in it, as PROJ transforms them on another way; wound as GeoJSON."""
    shape = shapely.geometry.shape(item["geometry"])
    assert shape.is_valid
    lonlat = pyproj.Proj(PLAIN)(*result.adjusted.images.centre[:, :2].T, inverse=True)
    assert shapely.contains_xy(shape, *lonlat).all()
    assert tuple(item["bbox"]) == shape.bounds
    assert all(part.exterior.is_ccw for part in shape.geoms)
    east = pyproj.Geod(ellps="GRS80").geometry_area_perimeter(shape)[0]
    xy = np.concatenate([result.adjusted.images.centre[:, :2], result.adjusted.points.xyz[:, :2]])
    hull = shapely.MultiPoint(xy[np.isfinite(xy).all(axis=1)]).convex_hull
    assert hull.area < 1.2 * east < 2.0 * hull.area


def test_files_that_are_there(result, exported, item):
    """Every link leads to a file; all tables of the result and what was exported before are among them."""
    assert {"adjustment.json", "points.csv", "residuals.parquet", "result.gpkg", "rays.parquet"} <= set(item["assets"])
    for asset in item["assets"].values():
        assert (exported / asset["href"]).is_file()
        assert asset["title"]
    assert item["assets"]["result.gpkg"]["href"] == "result.gpkg"
    assert item["assets"]["points.csv"]["type"] == "text/csv"


def test_pystac_reads_the_same(exported, item):
    """The reader of the standard finds the outline, the times and every file."""
    read = pystac.Item.from_file(str(exported / "item.json"))
    assert (read.id, read.bbox, read.geometry) == (item["id"], item["bbox"], item["geometry"])
    assert read.datetime == datetime.fromisoformat(item["properties"]["datetime"])
    assert {key: Path(asset.get_absolute_href()).resolve() for key, asset in read.assets.items()} == {
        key: (exported / asset["href"]).resolve() for key, asset in item["assets"].items()
    }


def test_properties(result, item):
    said = item["properties"]
    assert said["proj:code"] == PLAIN
    assert said["aerotri:verdict"] == result.verdict
    assert said["aerotri:points"] == np.isfinite(result.points["X"]).sum()
    rms = np.sqrt(np.nanmean(result.check["dZ"] ** 2))
    assert said["aerotri:check_rms_Z_m"] == pytest.approx(rms)
    made = datetime.fromtimestamp((result.folder / "adjustment.json").stat().st_mtime, UTC)
    assert abs((datetime.fromisoformat(said["datetime"]) - made).total_seconds()) < 1.0


@pytest.mark.parametrize(
    ("flown", "expected"),
    [
        ("2026-05-17", (None, "2026-05-17T00:00:00Z", "2026-05-17T23:59:59Z")),
        ("2026-05-17T10:30:00Z", ("2026-05-17T10:30:00Z", None, None)),
        ("2026-05-17T10:30:00", ("2026-05-17T10:30:00Z", None, None)),
        ("2026-05-17T10:30:00+02:00", ("2026-05-17T08:30:00Z", None, None)),
    ],
)
def test_time_of_the_flight(result, tmp_path, flown, expected):
    said = json.loads((aerotri.export(result, tmp_path / "out", "stac", flown=flown).folder / "item.json").read_text())
    found = said["properties"]
    assert (found["datetime"], found.get("start_datetime"), found.get("end_datetime")) == expected


def test_refused(result, tmp_path):
    with pytest.raises(aerotri.InputError, match=r"'in May' is no date.*2026-05-17"):
        aerotri.export(result, tmp_path / "out", "stac", flown="in May")
    local = aerotri.adjust(plain_block(), explain=False)
    with pytest.raises(aerotri.InputError, match=r"local coordinates.*EPSG:n"):
        aerotri.export(local, tmp_path / "out", "stac")
    assert not (tmp_path / "out").exists()


def test_result_that_was_not_saved_has_the_files_beside_the_item(tmp_path):
    result = aerotri.adjust(in_crs(plain_block()), explain=False)
    said = json.loads((aerotri.export(result, tmp_path / "out", "stac").folder / "item.json").read_text())
    assert said["assets"] == {}


def test_project_of_run_brings_its_surfaces(result, tmp_path):
    """Files of the steps beside the result, where a run.json says that they belong together."""
    result.save(tmp_path / "project" / "result", plots=False)
    (tmp_path / "project" / "dtm").mkdir()
    (tmp_path / "project" / "dtm" / "dsm.tif").write_bytes(b"II*\x00")
    again = replace(result, folder=tmp_path / "project" / "result")
    for known in (False, True):
        if known:
            (tmp_path / "project" / "run.json").write_text("{}")
        out = aerotri.export(again, tmp_path / f"out {known}", "stac").folder
        assets = json.loads((out / "item.json").read_text())["assets"]
        assert ("dtm/dsm.tif" in assets) == known
    assert assets["dtm/dsm.tif"]["type"] == "image/tiff; application=geotiff"


def test_block_across_the_date_line_is_cut():
    """Both sides of 180°, neither all around the earth; west is the larger longitude of the box."""
    east = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:32601", always_xy=True).transform(-180.0, 10.0)
    outline = shapely.MultiPolygon([shapely.box(east[0] - 5000.0, 1.1e6, east[0] + 5000.0, 1.11e6)])
    shape = in_degrees(outline, "EPSG:32601")
    bounds = sorted(part.bounds[0] for part in shape.geoms)
    assert len(bounds) == 2
    assert bounds[0] == pytest.approx(-180.0, abs=1e-3)
    assert bounds[1] == pytest.approx(179.95, abs=0.01)
    areas = pyproj.Geod(ellps="WGS84").geometry_area_perimeter(shape)[0]
    assert areas == pytest.approx(outline.area, rel=5e-3)


def test_without_footprints_the_points_bound_the_block(result, tmp_path):
    """Of a block whose photographs see no ground."""
    from aerotri.deformation.footprints import footprints

    found = footprints(result.record)
    blind = replace(found, polygons=np.full(len(found.polygons), None), gsd=np.full(len(found.gsd), np.nan))
    item = stac_item(result.adjusted, blind, tmp_path, [], datetime(2026, 1, 2, tzinfo=UTC))
    assert shapely.geometry.shape(item["geometry"]).area > 0.0
    assert "gsd" not in item["properties"]
