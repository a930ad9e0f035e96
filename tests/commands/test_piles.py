"""Several polygons in one boundary, tonnes, and volumes on dense surfaces: as a user meets them."""

from __future__ import annotations

import csv
import json
import shutil

import numpy as np
import pytest
import shapely

import aerotri
from aerotri import InputError
from aerotri.commands.volume import VolumeInput, run_volume
from aerotri.rasters.grids import RasterReader
from aerotri.rasters.surface_files import write_raster_parts, write_surface_parts
from aerotri.volume.settings import SectionPlan, SigmaOptions
from small_blocks import adjusted_place

CELL, COUNT, NOISE, LENGTH = 2.0, 120, 0.04, 7.0


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Two heaps on ground that slopes, as `aerotri dsm` writes them, with the block they were measured in."""
    folder = tmp_path_factory.mktemp("piles")
    grid, middle, x, y = adjusted_place(folder, CELL, COUNT)
    z = 100.0 + 0.02 * x
    for at, high in ((-60.0, 12.0), (60.0, 8.0)):
        z += np.maximum(high * (1.0 - np.hypot(x - at, y) / 35.0), 0.0)
    (folder / "dsm").mkdir()
    tags = {"NOISE_LENGTH_M": f"{LENGTH}"}
    write_surface_parts(folder / "dsm" / "dsm.tif", [(0, 0, z, np.full_like(z, 0.2))], grid, None, "DSM Z, m", tags)
    sigma = np.full_like(z, NOISE)
    what = "σ of Z of matching alone, m"
    write_raster_parts(folder / "dsm" / "matching.tif", [(0, 0, sigma)], grid, None, what, np.dtype("f4"), -9999.0)
    polygons = {name: shapely.Point(middle[0] + at, middle[1]).buffer(45.0) for name, at in (("A", -60.0), ("B", 60.0))}
    features = [
        {"type": "Feature", "properties": {"Name": name}, "geometry": json.loads(shapely.to_geojson(polygon))}
        for name, polygon in polygons.items()
    ]
    (folder / "piles.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return folder, polygons


def measured(place, boundary, **settings):
    return aerotri.volume(place[0] / "dsm", boundary, adjustment=place[0] / "result", **settings)


def test_noise_of_a_dense_surface_counts_with_its_length(place):
    """Cells of one σ: the volume's is σ·length·√area, whatever the cell; a length that is stated counts instead."""
    polygon = place[1]["A"]
    found = measured(place, polygon, base=100.0)
    assert found.parts["sigma_m3"][1] == pytest.approx(NOISE * LENGTH * np.sqrt(polygon.area), rel=0.02)
    other = measured(place, polygon, base=100.0, matching_window=14.0)
    assert other.parts["sigma_m3"][1] == pytest.approx(2.0 * found.parts["sigma_m3"][1], rel=1e-6)
    assert other.parts["sigma_m3"][0] == pytest.approx(found.parts["sigma_m3"][0], rel=1e-12)


def test_a_cell_counts_in_as_many_photographs_as_measured_it(place, tmp_path):
    """photographs.tif beside the surface says in how many; where it says nothing, two."""
    folder = shutil.copytree(place[0] / "dsm", tmp_path / "dsm")
    with RasterReader(folder / "dsm.tif") as reader:
        grid = reader.grid
    count = np.full((COUNT, COUNT), 3.0)
    count[:, : COUNT // 2] = 0.0
    write_raster_parts(folder / "photographs.tif", [(0, 0, count)], grid, None, "photographs", np.dtype("u1"), 0.0)
    own, before = (
        {name: aerotri.volume(dsm, polygon, base=100.0, adjustment=place[0] / "result").summary["sigma"]
         for name, polygon in place[1].items()} for dsm in (folder, place[0] / "dsm")
    )  # fmt: skip
    assert own["A"]["rays"] == 2 * own["A"]["pickets"] == before["A"]["rays"]
    assert own["B"]["rays"] == 3 * own["B"]["pickets"]
    parts = [one["B"]["parts_m3"] for one in (own, before)]
    assert parts[0]["matching"] == pytest.approx(parts[1]["matching"], rel=1e-6)  # σ of the cells says that
    assert parts[0]["adjustment"] != pytest.approx(parts[1]["adjustment"], rel=1e-3)
    write_raster_parts(
        folder / "photographs.tif", [(0, 0, count[1:])], grid.window(1, 0, COUNT - 1, COUNT), None, "photographs",
        np.dtype("u1"), 0.0,
    )  # fmt: skip
    with pytest.raises(InputError, match=r"has other cells than dsm\.tif beside it"):
        aerotri.volume(folder, place[1]["A"], base=100.0, adjustment=place[0] / "result")


def test_piles_add_up_with_what_they_share(place):
    """Over a level the sum is one functional over both: the same σ as that of the two polygons as one boundary."""
    polygons = place[1]
    found = measured(place, polygons, base=98.0)
    whole = measured(place, shapely.union_all(list(polygons.values())), base=98.0)
    piles = found.piles
    assert list(piles["name"]) == ["A", "B", "all together"]
    for name in ("net_m3", "cut_m3", "area_m2"):
        assert piles[name][2] == pytest.approx(piles[name][0] + piles[name][1], rel=1e-12)
    assert found.net == pytest.approx(whole.net, rel=1e-9)
    np.testing.assert_allclose(found.parts["sigma_m3"][:2], whole.parts["sigma_m3"][:2], rtol=1e-6)
    alone = measured(place, polygons["A"], base=98.0)
    assert piles["sigma_m3"][0] == pytest.approx(alone.sigma, rel=1e-9)
    # neighbouring heaps go up and down together
    assert found.sigma > 1.1 * np.hypot(*piles["sigma_m3"][:2])


def test_every_pile_has_its_own_base(place):
    """The lowest place around each; through both boundaries at once there would be one level only."""
    found = measured(place, place[0] / "piles.geojson", base="lowest", density=1.8, density_sigma=0.09)
    each = [measured(place, polygon, base="lowest") for polygon in place[1].values()]
    np.testing.assert_allclose(found.piles["net_m3"][:2], [one.net for one in each], rtol=1e-9)
    assert found.net == pytest.approx(sum(one.net for one in each), rel=1e-9)
    mass = found.summary["piles"][0]["mass"]
    assert mass["net_t"] == pytest.approx(1.8 * each[0].net)
    assert mass["sigma_t"] == pytest.approx(np.hypot(1.8 * each[0].sigma, 0.09 * each[0].net))


def test_the_table_and_the_page(place, tmp_path):
    given = VolumeInput(
        place[0] / "dsm", "plane", str(place[0] / "piles.geojson"), "prisms", place[0] / "result", None, None,
        density=1.6,
    )  # fmt: skip
    out = tmp_path / "out"
    assert run_volume(given, SectionPlan(10.0, 0.0), SigmaOptions(), out, True, True) == 0
    content = json.loads((out / "volume.json").read_text())
    rows = list(csv.DictReader((out / "piles.csv").open()))
    assert [row["name"] for row in rows] == ["A", "B", "all together"]
    assert float(rows[2]["sigma_m3"]) == pytest.approx(content["sigma"]["sigma_m3"])
    assert float(rows[2]["net_t"]) == pytest.approx(1.6 * content["net_m3"])
    page = (out / "volume.html").read_text()
    assert "<td>A</td>" in page
    assert "mass of" in page


def test_polygons_drawn_side_by_side_that_overlap_by_slivers_count_one_by_one(place):
    """A tenth of a millimetre along the side of two outlines that were drawn by hand."""
    left, bottom, right, top = place[1]["A"].bounds
    middle = 0.5 * (left + right)
    west, east = shapely.box(left, bottom, middle + 1e-4, top), shapely.box(middle, bottom, right, top)
    found = aerotri.volume(place[0] / "dsm", {"west": west, "east": east}, base=100.0)
    assert [one["name"] for one in found.summary["piles"]] == ["west", "east"]
    assert any(f"overlap by {(top - bottom) * 1e-4:.4g} m²" in text for text in found.warnings)
    whole = aerotri.volume(place[0] / "dsm", shapely.box(left, bottom, right, top), base=100.0)
    assert found.net == pytest.approx(whole.net, rel=1e-4)
    # more than a thousandth of the smaller one is no sliver
    wide = shapely.box(left, bottom, middle + 2e-3 * (right - left), top)
    together = aerotri.volume(place[0] / "dsm", {"west": wide, "east": east}, base=100.0)
    assert together.summary["piles"] == []


def test_polygons_that_overlap_count_together(place):
    polygon = place[1]["A"]
    found = aerotri.volume(place[0] / "dsm", {"one": polygon, "two": polygon.buffer(-10.0)}, base=100.0)
    assert found.summary["piles"] == []
    assert any("overlap" in text for text in found.warnings)
    with pytest.raises(InputError, match="not possible"):
        aerotri.volume(place[0] / "dsm", polygon, base=100.0, density=1800.0)
