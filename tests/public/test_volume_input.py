"""What a volume makes of outlines, units, height systems and σ that are stated: taken as meant, told, or refused."""

from __future__ import annotations

import json
import re
from importlib.resources import files
from types import SimpleNamespace

import jsonschema
import numpy as np
import pyproj
import pytest
import rasterio
import shapely
import shapely.affinity
from pyproj import Transformer
from rasterio import Affine

import aerotri
from aerotri import InputError
from aerotri.commands.volume import outcome_lines
from aerotri.public.change_areas import notes_of_areas
from aerotri.rasters.metric import MetricReader
from aerotri.report.documents.volume import _base_name
from aerotri.report.documents.words import Words
from aerotri.report.pages.volume import volume_html
from aerotri.volume.accuracy import _model_in_words, _notes
from aerotri.volume.settings import SigmaOptions

LEFT, TOP, CELL, COUNT = 500000.0, 5600100.0, 0.5, 200
RADIUS, HEIGHT = 12.0, 5.0
CONE = np.pi * RADIUS**2 * HEIGHT / 3.0
MIDDLE = (LEFT + 30.0, TOP - 50.0)
CRS = "EPSG:25832"


def heights(with_cone=True):
    """A cone on a plane that slopes by 2 %, (rows, columns) m."""
    at = (np.arange(COUNT) + 0.5) * CELL
    x, y = np.meshgrid(LEFT + at, TOP - at)
    ground = 100.0 + 0.02 * (x - LEFT) + 0.01 * (y - TOP)
    cone = np.maximum(HEIGHT * (1.0 - np.hypot(x - MIDDLE[0], y - MIDDLE[1]) / RADIUS), 0.0)
    return ground + cone if with_cone else ground


def surface(z, crs=CRS, name="cone"):
    return aerotri.Surface.of_array(z, left=LEFT, top=TOP, cell=CELL, crs=crs, name=name)


@pytest.fixture(scope="module")
def cone():
    return surface(heights())


@pytest.fixture(scope="module")
def ground():
    return surface(heights(with_cone=False), name="ground")


AROUND = shapely.Point(MIDDLE).buffer(14.0, quad_segs=64)


@pytest.mark.parametrize("hole", [
    shapely.box(MIDDLE[0] - 1.0, MIDDLE[1] - 1.0, MIDDLE[0] + 1.0, MIDDLE[1] + 1.0),
    shapely.box(MIDDLE[0] + 3.0, MIDDLE[1], MIDDLE[0] + 6.0, MIDDLE[1] + 3.0),
])  # fmt: skip
@pytest.mark.parametrize("base", ["boundary", "plane"])
def test_a_hole_on_the_pile_does_not_lift_the_base(cone, ground, hole, base):
    outline = AROUND.difference(hole)
    true = aerotri.volume(cone, outline, base=ground)
    found = aerotri.volume(cone, outline, base=base)
    assert found.net == pytest.approx(true.net, rel=0.002)
    assert any("1 hole:" in text for text in found.warnings)
    assert not any("hole" in text for text in true.warnings)


def test_outlines_that_share_a_line_are_told(cone):
    west, east = (shapely.intersection(AROUND, shapely.box(*box)) for box in (
        (LEFT, TOP - 100.0, MIDDLE[0], TOP), (MIDDLE[0], TOP - 100.0, LEFT + 100.0, TOP),
    ))  # fmt: skip
    piles = {"west": west, "east": east}
    shared = "the outlines of west and east share 28.1 m"
    assert any(shared in text for text in aerotri.volume(cone, piles).warnings)
    over = aerotri.volume(cone, piles, base="plane:500000,5600100,100;500100,5600100,102;500000,5600000,99")
    assert not any("share" in text for text in over.warnings)
    assert over.net == pytest.approx(CONE, rel=0.005)
    apart = {"west": west, "east": shapely.affinity.translate(east, 3.0)}
    assert not any("share" in text for text in aerotri.volume(cone, apart).warnings)


def in_file(path, z, unit=None, crs=CRS, no_data=-9999.0):
    """A raster of heights as other programs write it."""
    place = Affine(CELL, 0.0, LEFT, 0.0, -CELL, TOP)
    with rasterio.open(path, "w", driver="GTiff", height=COUNT, width=COUNT, count=1, dtype="float32", crs=crs,
                       transform=place, nodata=no_data) as file:  # fmt: skip
        file.write(z.astype(np.float32), 1)
        if unit is not None:
            file.units = [unit]
    return path


@pytest.mark.parametrize(("unit", "factor"), [("cm", 0.01), ("Centimeters", 0.01), ("mm", 0.001), ("dm", 0.1),
                                              ("km", 1000.0), ("metre", 1.0), (None, 1.0)])  # fmt: skip
def test_heights_in_the_unit_of_their_band(tmp_path, unit, factor):
    found = aerotri.volume(in_file(tmp_path / "z.tif", heights() / factor, unit), AROUND)
    assert found.net == pytest.approx(CONE, rel=0.005)
    assert any("multiplied by" in text for text in found.warnings) is (factor != 1.0)


@pytest.mark.parametrize("crs", [CRS, f"{CRS}+7837"])
def test_a_unit_that_is_not_known_is_refused(tmp_path, crs):
    path = in_file(tmp_path / "z.tif", heights(), "fathom", crs)
    with pytest.raises(InputError, match="'fathom'") as refused:
        aerotri.volume(path, AROUND)
    assert refused.value.file == path
    assert "gdal_edit.py -units" in refused.value.remedy


@pytest.mark.parametrize(("vertical", "unit", "factor", "agree"), [
    ("7837", "cm", 0.01, False), ("7837", "m", 1.0, True), ("7837", None, 1.0, True),
    ("8228", "ft", 0.3048, True), ("8228", None, 0.3048, True), ("8228", "US survey foot", 0.3048, True),
    ("8228", "m", 0.3048, False), ("6360", "feet", 1200.0 / 3937.0, True),
])  # fmt: skip
def test_the_units_of_band_and_crs_have_to_agree(tmp_path, vertical, unit, factor, agree):
    path = in_file(tmp_path / "z.tif", heights() / factor, unit, f"{CRS}+{vertical}")
    if agree:
        assert aerotri.volume(path, AROUND).net == pytest.approx(CONE, rel=0.005)
        return
    with pytest.raises(InputError, match=f"'{unit}' by the unit of the band, and in '(metre|foot)' by its CRS") as told:
        aerotri.volume(path, AROUND)
    assert told.value.file == path
    assert "gdal_edit.py -units" in told.value.remedy


@pytest.mark.parametrize("units", [("cm", ""), ("cm", "cm"), ("", ""), ("", "cm")])
def test_a_sigma_counts_in_the_unit_of_the_heights_unless_it_states_its_own(tmp_path, units):
    place = Affine(CELL, 0.0, LEFT, 0.0, -CELL, TOP)
    with rasterio.open(tmp_path / "z.tif", "w", driver="GTiff", height=COUNT, width=COUNT, count=2, dtype="float32",
                       crs=CRS, transform=place) as file:  # fmt: skip
        file.write(np.full((2, COUNT, COUNT), [[[12345.0]], [[2.0]]], np.float32))
        file.set_band_description(2, "σ, as the heights")
        file.units = units
    own = units[0], units[1] or units[0]
    for band, (value, unit) in enumerate(zip((12345.0, 2.0), own, strict=True), start=1):
        with MetricReader(tmp_path / "z.tif", band) as reader:
            assert reader.read(3, 3, 1, 1)[0, 0] == pytest.approx(value * (0.01 if unit == "cm" else 1.0))


def test_heights_that_land_does_not_have_are_told(tmp_path, cone):
    z = heights()
    z[100, 60] = -9999.0
    said = "does its file state its value for no data"
    found = aerotri.volume(in_file(tmp_path / "z.tif", z, no_data=None), AROUND)
    assert any("from -9999 to" in text and said in text for text in found.warnings)
    kept = aerotri.volume(in_file(tmp_path / "known.tif", z), AROUND)
    assert not any(said in text for one in (kept, aerotri.volume(cone, AROUND)) for text in one.warnings)


def test_heights_of_the_base_that_land_does_not_have_are_told(tmp_path, cone):
    z = heights(with_cone=False)
    z[95:105, 55:65] = -9999.0
    with pytest.raises(InputError, match=r"hole\.tif: has cells of exactly -9999 m") as refused:
        aerotri.volume(cone, AROUND, base=in_file(tmp_path / "hole.tif", z, no_data=None))
    assert "gdal_edit.py -a_nodata -9999" in refused.value.remedy
    z[95:105, 55:65] = -9000.0
    said = "the base (odd.tif) has heights from -9000 to"
    found = aerotri.volume(cone, AROUND, base=in_file(tmp_path / "odd.tif", z, no_data=None))
    assert [text for text in found.warnings if said in text and "does its file state its value for no data" in text]
    assert not any("the surface has heights" in text for text in found.warnings)
    z[95:105, 55:65] = -9999.0
    known = aerotri.volume(cone, AROUND, base=in_file(tmp_path / "known.tif", z))
    assert not any("has heights from" in text for text in known.warnings)
    level = aerotri.volume(cone, AROUND, base=10_000.0).warnings
    assert any("has heights from 10000 to 10000 m" in text and "are they right" in text for text in level)


@pytest.mark.parametrize(("crs", "left", "top"), [("EPSG:3857", 1_000_000.0, 6_500_000.0),
                                                  ("EPSG:3395", 1_000_000.0, 6_500_000.0)])  # fmt: skip
def test_a_projection_that_stretches_areas_is_refused(tmp_path, crs, left, top):
    z = 100.0 + np.zeros((40, 40))
    held = aerotri.Surface.of_array(z, left=left, top=top, cell=1.0, crs=crs, name="mercator")
    path = held.save(tmp_path / "mercator.tif")
    for surface_like in (held, path):
        with pytest.raises(InputError, match="1 m² of ground counts as 2") as refused:
            aerotri.volume(surface_like, base=99.0)
        assert "UTM" in refused.value.remedy
    with pytest.raises(InputError, match="1 m² of ground counts as 2"):
        aerotri.change(path, path, align="none")


@pytest.mark.parametrize(("crs", "left", "top"), [
    ("EPSG:3857", 1_000_000.0, 500_000.0), ("EPSG:25832+7837", LEFT, TOP), ("EPSG:25833", LEFT - 400_000.0, TOP),
    ("EPSG:3035", 2_800_000.0, 1_800_000.0), ("EPSG:2056", 2_600_000.0, 1_200_000.0), (None, 0.0, 0.0),
    ("EPSG:27572", 650_000.0, 2_627_000.0), ("EPSG:2154", 1_200_000.0, 6_100_000.0),
    ("EPSG:27700", 400_000.0, 300_000.0), ("EPSG:3003", 1_500_000.0, 4_700_000.0),
])  # fmt: skip
def test_a_projection_that_keeps_areas_is_not(crs, left, top):
    held = aerotri.Surface.of_array(100.0 + np.zeros((40, 40)), left=left, top=top, cell=1.0, crs=crs)
    assert aerotri.volume(held, base=99.0).net == pytest.approx(39.0**2)


@pytest.mark.parametrize(("crs", "lon", "lat", "percent"), [
    ("EPSG:32632", 9.0, 50.0, -0.08), ("EPSG:32632", 12.0, 0.0, 0.20), ("EPSG:32632", 15.0, 0.0, 1.03),
    ("EPSG:32632", 15.0, 45.0, 0.47), ("EPSG:32632", 15.0, 60.0, 0.19), ("EPSG:2154", 9.2, 41.4, 0.58),
])  # fmt: skip
def test_how_far_projections_change_areas(crs, lon, lat, percent):
    """What the page of the theory states, by the area of a square of 100 m on the ellipsoid; none is refused."""
    x, y = Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(lon, lat)
    to_degrees = Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
    square = shapely.transform(shapely.box(x - 50.0, y - 50.0, x + 50.0, y + 50.0),
                               lambda xy: np.column_stack(to_degrees.transform(*xy.T)))  # fmt: skip
    on_ellipsoid = abs(pyproj.CRS.from_user_input(crs).get_geod().geometry_area_perimeter(square)[0])
    assert 100.0 * (1e4 / on_ellipsoid - 1.0) == pytest.approx(percent, abs=0.006)
    held = aerotri.Surface.of_array(np.full((40, 40), 100.0), left=x - 20.0, top=y + 20.0, cell=1.0, crs=crs)
    assert aerotri.volume(held, base=99.0).net == pytest.approx(39.0**2)


def test_what_is_stated_counts_without_an_adjustment(cone):
    """σ of the base times the area, that of a corner by ∮, that of the density times the volume."""
    plain = aerotri.volume(cone, AROUND, base=100.0)
    assert plain.summary["stated_sigma"] is None
    found = aerotri.volume(cone, AROUND, base=100.0, base_sigma=0.05, density=1.8, density_sigma=0.1)
    assert found.sigma is None
    assert found.summary["mass"]["sigma_t"] is None
    stated = found.summary["stated_sigma"]
    assert stated["parts_m3"] == {"base": pytest.approx(0.05 * AROUND.area), "boundary": 0.0}
    assert found.summary["mass"]["stated_sigma_t"] == pytest.approx(np.hypot(1.8 * 0.05 * AROUND.area, 0.1 * found.net))
    assert any("errors of the surface are not in it" in text for text in found.warnings)
    alone = aerotri.volume(cone, AROUND, density=1.8, density_sigma=0.1).summary
    assert alone["stated_sigma"] is None
    assert alone["mass"]["stated_sigma_t"] == pytest.approx(0.1 * alone["net_m3"])
    # a step of 2 m at the edge: a corner that is off by σ moves half of its two edges
    high = surface(np.full((COUNT, COUNT), 102.0))
    square = shapely.box(LEFT + 20.0, TOP - 40.0, LEFT + 40.0, TOP - 20.0)
    edge = aerotri.volume(high, square, base=100.0, boundary_sigma=0.2).summary["stated_sigma"]
    assert edge["sigma_m3"] == pytest.approx(0.2 * 2.0 * np.sqrt(4 * 2 * 10.0**2), rel=1e-6)


def test_what_is_stated_of_piles(cone, tmp_path):
    piles = {"A": AROUND, "B": shapely.affinity.translate(AROUND, 40.0)}
    found = aerotri.volume(cone, piles, base=98.0, base_sigma=0.05, boundary_sigma=0.1)
    each = [one["stated_sigma_m3"] for one in found.summary["piles"]]
    both = found.summary["stated_sigma"]["parts_m3"]
    assert both["base"] == pytest.approx(0.05 * 2.0 * AROUND.area)
    edges = [np.sqrt(one**2 - (0.05 * AROUND.area) ** 2) for one in each]
    assert both["boundary"] == pytest.approx(np.hypot(*edges))
    content = json.loads((found.save(tmp_path / "out") / "volume.json").read_text(encoding="utf-8"))
    schema = json.loads(files("aerotri.reference").joinpath("schema_files/volume.schema.json").read_text("utf-8"))
    jsonschema.validate(content, schema)


@pytest.mark.parametrize(("options", "match"), [
    ({"base_sigma": -0.5}, "base_sigma = -0.5 m"),
    ({"boundary_sigma": float("nan")}, "boundary_sigma = nan"),
    ({"matching_window": -1.0}, "matching_window = -1 m"),
    ({"density": 1.8, "density_sigma": 5.0}, "larger than the density"),
    ({"density_sigma": 0.1}, "belongs to a density"),
])  # fmt: skip
def test_impossible_sigmas_are_refused(cone, options, match):
    with pytest.raises(InputError, match=match):
        aerotri.volume(cone, AROUND, base=100.0, **options)


def test_infinities_are_no_data(tmp_path, cone):
    z = heights()
    z[100, 60], z[90, 62] = np.inf, -np.inf
    left_out = 2.0 * CELL**2
    for held in (surface(z), in_file(tmp_path / "z.tif", z), in_file(tmp_path / "none.tif", z, no_data=None)):
        found = aerotri.volume(held, AROUND, method="grid")
        assert found.summary["no_data_area_m2"] == pytest.approx(left_out)
        assert np.isfinite(found.methods["net_m3"]).all()
        assert found.net == pytest.approx(aerotri.volume(cone, AROUND).net, rel=0.01)
        assert any("have no height" in text for text in found.warnings)


@pytest.mark.parametrize("method", ["prisms", "simpson"])
def test_heights_without_neighbours_are_told_and_count_by_cells(method):
    gaps = np.full((COUNT, COUNT), 102.0)
    gaps[:, 1::2] = np.nan
    with pytest.raises(InputError, match=f"no four neighbouring cells .* and method '{method}'") as refused:
        aerotri.volume(surface(gaps), AROUND, base=100.0, method=method)
    assert "--method grid" in refused.value.remedy
    found = aerotri.volume(surface(gaps), AROUND, base=100.0, method="grid")
    assert found.net == pytest.approx(AROUND.area, rel=0.01)


def test_a_surface_of_one_row_counts_by_cells():
    row, strip = surface(np.full((1, COUNT), 102.0)), shapely.box(LEFT + 5.0, TOP - 0.4, LEFT + 20.0, TOP - 0.1)
    with pytest.raises(InputError, match="no four neighbouring cells"):
        aerotri.volume(row, strip, base=100.0)
    assert aerotri.volume(row, strip, base=100.0, method="grid").net == pytest.approx(2.0 * strip.area)


def test_two_systems_of_heights_are_refused(ground):
    top, below = surface(heights(), "EPSG:25832+7837"), surface(ground.z, "EPSG:25832+5783", "base")
    with pytest.raises(InputError, match=r"EPSG:5783.*EPSG:7837") as refused:
        aerotri.volume(top, AROUND, base=below)
    assert "one system of heights" in refused.value.remedy


def in_plan_of_feet(path, vertical, feet=1200.0 / 3937.0):
    """10 m of height over San Francisco, in the state plane of California with heights in feet."""
    place = Affine(10.0, 0.0, 6.0e6, 0.0, -10.0, 2.1e6)
    with rasterio.open(path, "w", driver="GTiff", height=60, width=60, count=1, dtype="float32",
                       crs=f"EPSG:2227+{vertical}", transform=place) as file:  # fmt: skip
        file.write(np.full((60, 60), 10.0 / feet, np.float32), 1)
    return path


def over_the_same_place(base, vertical):
    """A surface of 12 m in UTM over the middle of a base."""
    with MetricReader(base, target="EPSG:26910") as reader:
        left, bottom, right, top = reader.grid.bounds
    left, top = (left + right) / 2.0 - 20.0, (bottom + top) / 2.0 + 20.0
    crs = f"EPSG:26910+{vertical}"
    return aerotri.Surface.of_array(np.full((40, 40), 12.0), left=left, top=top, cell=1.0, crs=crs, name="top")


@pytest.mark.parametrize("vertical", ["6360", "8228"])
def test_heights_in_feet_are_in_the_system_of_their_datum(tmp_path, vertical):
    feet = 0.3048 if vertical == "8228" else 1200.0 / 3937.0
    base = in_plan_of_feet(tmp_path / "base.tif", vertical, feet)
    found = aerotri.volume(over_the_same_place(base, "5703"), base=base)
    assert found.net == pytest.approx(2.0 * 39.0**2, rel=1e-5)
    assert not any("in which system" in text for text in found.warnings)
    plain = in_file(tmp_path / "z.tif", heights() / feet, crs=f"{CRS}+{vertical}")
    metric = aerotri.volume(plain, AROUND)
    assert metric.summary["crs"] == f"{CRS}+5703"
    with MetricReader(metric.thickness.path) as reader:
        assert reader.note == ""
        assert reader.system == f"{CRS}+5703"
    assert np.nanmax(metric.thickness.z) == pytest.approx(HEIGHT, abs=0.3)


def test_heights_in_feet_of_another_datum_are_refused(tmp_path):
    base = in_plan_of_feet(tmp_path / "base.tif", "5702")
    with pytest.raises(InputError, match=r"EPSG:7968 \(NGVD29 height \(m\)\).*EPSG:5703 \(NAVD88 height\)") as refused:
        aerotri.volume(over_the_same_place(base, "5703"), base=base)
    assert refused.value.file == base


@pytest.mark.parametrize(("own", "other", "said"), [
    ("EPSG:25832", "EPSG:25832+7837", ["cone does not say in which system"]),
    ("EPSG:25832+7837", "EPSG:25832", ["base does not say in which system"]),
    ("EPSG:25832", None, ["base has no CRS"]), (None, "EPSG:25832", ["cone has no CRS"]),
    ("EPSG:25832+7837", None, ["base has no CRS", "base does not say in which system"]),
    ("EPSG:25832", "EPSG:25832", []), ("EPSG:25832+7837", "EPSG:25832+7837", []), (None, None, []),
])  # fmt: skip
def test_a_system_that_one_does_not_say_is_told(ground, own, other, said):
    found = aerotri.volume(surface(heights(), own), AROUND, base=surface(ground.z, other, "base"))
    assert found.net == pytest.approx(CONE, rel=0.005)
    told = [text for text in found.warnings if "does not say" in text or "has no CRS" in text]
    assert len(told) == len(said)
    assert all(any(text in one for one in told) for text in said)


def test_heights_stay_in_their_system_when_degrees_are_brought_to_metres(tmp_path):
    place = Affine(1e-5, 0.0, 9.0, 0.0, -1e-5, 50.5)
    with rasterio.open(tmp_path / "z.tif", "w", driver="GTiff", height=COUNT, width=COUNT, count=1, dtype="float32",
                       crs="EPSG:4326+5773", transform=place) as file:  # fmt: skip
        file.write(np.full((COUNT, COUNT), 100.0, np.float32), 1)
    assert aerotri.volume(tmp_path / "z.tif", base=99.0).summary["crs"] == "EPSG:32632+5773"


def collection(path, polygons, crs=CRS, **members):
    """GeoJSON of polygons with their attributes."""
    content = {"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": own, "geometry": json.loads(shapely.to_geojson(polygon))}
        for own, polygon in polygons
    ]}  # fmt: skip
    if crs is not None:
        content["crs"] = {"type": "name", "properties": {"name": crs}}
    path.write_text(json.dumps(content | members), encoding="utf-8")
    return path


@pytest.mark.parametrize("base", ["boundary", 100.0])
def test_a_boundary_beside_the_surface_is_told_by_place(tmp_path, cone, base):
    away = shapely.affinity.translate(AROUND, 500.0)
    with pytest.raises(
        InputError, match=r"'away' does not meet the surface.*X 500516 to 500544.*EPSG:25832"
    ) as refused:
        aerotri.volume(cone, {"here": AROUND, "away": away}, base=base)
    assert refused.value.file is not None
    alone = collection(tmp_path / "out.geojson", [({}, away)])
    with pytest.raises(InputError, match=r"'out.geojson' does not meet the surface"):
        aerotri.volume(cone, alone, base=base)


def test_a_pile_without_heights_along_its_outline_is_named(tmp_path):
    z = heights()
    z[:, 130:] = np.nan
    hidden = shapely.affinity.translate(AROUND, 54.0)
    path = in_file(tmp_path / "z.tif", z)
    with pytest.raises(InputError, match=r"pile 'B': .*not known along the boundary 'B'") as refused:
        aerotri.volume(path, {"A": AROUND, "B": hidden})
    assert refused.value.file == path


def test_a_boundary_of_another_kind_names_those_that_are_read(tmp_path, cone):
    (tmp_path / "b.tab").write_text("!table", encoding="utf-8")
    with pytest.raises(InputError, match="is no polygon") as refused:
        aerotri.volume(cone, tmp_path / "b.tab")
    assert all(kind in refused.value.remedy for kind in ("GeoPackage", "GeoJSON", "WKT"))


def test_geojson_that_names_its_crs_by_name(tmp_path, cone):
    forward = Transformer.from_crs(CRS, "EPSG:25833", always_xy=True)
    there = shapely.transform(AROUND, lambda xy: np.column_stack(forward.transform(*xy.T)))
    found = aerotri.volume(cone, collection(tmp_path / "named.geojson", [({}, there)], "ETRS89 / UTM zone 33N"))
    assert found.net == pytest.approx(CONE, rel=0.005)
    assert any("brought from EPSG:25833" in text for text in found.warnings)
    unknown = aerotri.volume(cone, collection(tmp_path / "site.geojson", [({}, AROUND)], "site grid"))
    assert any("names the CRS 'site grid', which is not known" in text for text in unknown.warnings)


def test_a_second_band_that_is_no_sigma_is_refused_with_the_rule(tmp_path):
    place = Affine(CELL, 0.0, LEFT, 0.0, -CELL, TOP)
    with rasterio.open(tmp_path / "z.tif", "w", driver="GTiff", height=COUNT, width=COUNT, count=2, dtype="float32",
                       crs=CRS, transform=place) as file:  # fmt: skip
        file.write(heights().astype(np.float32), 1)
        file.write(np.ones((COUNT, COUNT), np.float32), 2)
    with pytest.raises(InputError, match="has 2 bands") as refused:
        aerotri.volume(tmp_path / "z.tif")
    assert "description begins with 'σ'" in refused.value.remedy


@pytest.mark.parametrize("command", ["ortho", "dsm", "dtm"])
def test_help_shows_four_numbers_as_they_are_typed(command):
    from typer.testing import CliRunner

    from aerotri.cli.app import app

    shown = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "200", "NO_COLOR": "1"}).output
    assert "X Y X Y" in shown
    assert "float,float" not in shown.lower()


PILES = {"A": AROUND, "B": shapely.affinity.translate(AROUND, 40.0)}


@pytest.mark.parametrize(("base", "name"), [
    ("boundary", "a base for each of 2 piles: spline through its outline"),
    ("lowest", "a base for each of 2 piles: lowest level along its outline"), ("plane", "plane fitted to the boundary"),
])  # fmt: skip
def test_the_base_of_several_piles_says_what_it_is(cone, base, name):
    found = aerotri.volume(cone, PILES, base=base)
    assert found.summary["base"]["name"] == name
    assert found.net == pytest.approx(sum(aerotri.volume(cone, one, base=base).net for one in PILES.values()))
    words = Words("de")
    assert ("2 Haufwerken" in _base_name(found.summary, words)) is (base != "plane")
    assert ("niedrigste" in _base_name(found.summary, words)) is (base == "lowest")


def test_a_page_without_sigma_does_not_speak_of_it(cone):
    found = aerotri.volume(cone, PILES, base=98.0)
    page = volume_html(found.summary, {}, found.head)
    assert "Every pile" in page
    assert "σ of the sum" not in page
    assert "system not named" in page
    assert "above the ellipsoid" not in page


@pytest.mark.parametrize(("attributes", "names", "said"), [
    ([{"Bezeichnung": "Kies", "who": "me"}, {"Bezeichnung": "Sand", "who": "me"}], ["Kies", "Sand"], "Bezeichnung"),
    ([{"who": "me", "NOM": "gravier"}, {"who": "me", "NOM": "sable"}], ["gravier", "sable"], "NOM"),
    ([{"Name": "x", "t": "a"}, {"Name": "y", "t": "b"}], ["x", "y"], ""),
    ([{"who": "me"}, {"who": "me"}], ["1", "2"], ""), ([{"n": 7}, {"n": 8}], ["1", "2"], ""),
    ([{"t": "a"}, {"t": None}], ["1", "2"], ""),
])  # fmt: skip
def test_names_of_piles(tmp_path, cone, attributes, names, said):
    path = collection(tmp_path / "b.geojson", zip(attributes, PILES.values(), strict=True))
    found = aerotri.volume(cone, path, base=98.0)
    assert [one["name"] for one in found.summary["piles"]] == names
    told = [text for text in found.warnings if "names the polygons" in text]
    assert told == ([f"b.geojson: the attribute '{said}' names the polygons"] if said else [])


@pytest.mark.parametrize(("attributes", "name"), [
    ({"name": "Kies"}, "Kies"), ({"Bezeichnung": "Kies"}, "Kies"), ({"a": "x", "b": "y"}, ""), ({}, ""),
    ({"name": "alone"}, "alone"), ({"name": "1"}, "1"), ({"Name": 1}, "1"), ({"name": None}, ""),
])  # fmt: skip
def test_the_name_of_a_single_polygon_is_kept(tmp_path, cone, attributes, name):
    path = collection(tmp_path / "alone.geojson", [(attributes, AROUND)])
    content = aerotri.volume(cone, path, base=98.0).summary
    assert (content["boundary"]["name"], content["boundary"]["polygon"]) == ("alone.geojson", name)
    line = outcome_lines(content, tmp_path)[0]
    assert line.endswith(f"inside alone.geojson, polygon '{name}'" if name in ("Kies", "1") else "inside alone.geojson")


def test_text_has_no_powers_of_ten(cone, tmp_path):
    content = aerotri.volume(cone, PILES, base=98.0).summary
    large = {"net_m3": 12345678.0, "cut_m3": 12345678.0, "fill_m3": 0.00402402}
    sigma = {"sigma_m3": 23456.7, "parts_m3": {"adjustment": 23456.7},
             "curvature": {"value_m3": 887.4, "sigma_m3": 302.4},
             "systematic": {"in_the_volume": False,
                            "variants": [{"variant": "free", "value_m3": -26.02, "sigma_m3": 124.0}]}}  # fmt: skip
    text = "\n".join(outcome_lines(content | large | {"sigma": sigma}, tmp_path))
    assert "e+" not in text
    assert text.startswith("net 12\u2009345\u2009678 ± 23\u2009457 m³ (1 σ): cut 12345678 m³, fill 0 m³; ")
    assert "+887 ± 302 m³" in text
    assert "−26 ± 124 m³" in text


POWER = re.compile(r"\de[+-]?\d")


def test_what_is_told_of_large_surfaces_has_no_powers_of_ten(tmp_path):
    """20 km with a hole, heights that land does not have, piles that overlap and that touch."""
    z = 1e3 * np.random.default_rng(1).normal(size=(COUNT, COUNT)) + 2e7
    z[80:120, 30:70] = np.nan
    held = aerotri.Surface.of_array(z, left=LEFT, top=TOP, cell=100.0, crs=CRS, name="large")
    west, east, over = (shapely.box(LEFT + a, TOP - 1.85e4, LEFT + b, TOP - 5e2)
                        for a, b in ((1e3, 9e3), (9e3, 1.8e4), (8e3, 1.8e4)))  # fmt: skip
    apart = aerotri.volume(held, {"west": west, "east": east}, base="plane", method="trapezoidal")
    both = aerotri.volume(held, {"west": west, "over": over}, base=2e7)
    said = "\n".join([*apart.warnings, *both.warnings, *both.methods["note"], both.html(), repr(both)])
    for words in ("share 18020 m", "overlap by 18000000 m²", "the methods differ", "have no height", "the surface has"):
        assert words in said
    assert not POWER.search(said)
    hole = shapely.box(LEFT + 3e3, TOP - 1.2e4, LEFT + 7e3, TOP - 7_940.0)
    assert any("16198800 m² (100 %) inside" in text for text in aerotri.volume(held, hole, base=2e7).warnings)


def test_what_is_told_of_large_areas_of_a_change_has_no_powers_of_ten():
    volumes = [SimpleNamespace(name="pit", area=1.0, no_data_area=1234567.0), SimpleNamespace(name="whole")]
    (said,) = notes_of_areas(SimpleNamespace(volumes=volumes), "whole")
    assert said.startswith("pit: 1234570 m² (100 %) of the area")


def test_what_is_told_of_large_parts_of_sigma_has_no_powers_of_ten():
    off = SimpleNamespace(settings=SimpleNamespace(adjustment=SimpleNamespace(model_part="off")))
    part = SimpleNamespace(unseen=1234567.0, between=None, calibration=SimpleNamespace(
        local=SimpleNamespace(model_part=None),
        system=SimpleNamespace(unknowns=SimpleNamespace(block=off))))  # fmt: skip
    unseen = _notes(part, None, SimpleNamespace(name=""), 0.0, SigmaOptions())[0]
    assert unseen.startswith("1235000 m² are seen by too few")
    assert "4e" not in _model_in_words(part, {"adjustment": 30000.0, "model": 40000.0})
    assert "50000 m³ instead of 30000 m³" in _model_in_words(part, {"adjustment": 30000.0, "model": 40000.0})


def test_a_surface_in_memory_in_a_system_in_feet_is_saved_in_metres(tmp_path):
    """Its heights are metres; read from the file they would else be brought from feet once more."""
    surface = aerotri.Surface.of_array(
        np.full((5, 5), 100.0), left=500000.0, top=4000000.0, cell=1.0, crs="EPSG:26910+8228"
    )
    path = surface.save(tmp_path / "surface.tif")
    np.testing.assert_allclose(aerotri.Surface(path).z, 100.0)


def test_a_volume_without_an_adjustment_says_why_it_has_no_sigma(cone):
    plain = aerotri.volume(cone, AROUND)
    assert [text for text in plain.warnings if text.startswith("no σ: give --adjustment")]
    stated = aerotri.volume(cone, AROUND, base_sigma=0.1)
    assert not any(text.startswith("no σ:") for text in stated.warnings)


def test_the_origin_of_a_boundary_without_an_adjustment_is_refused(cone, tmp_path):
    with pytest.raises(InputError, match="boundary_from='product' belongs to an adjustment") as refused:
        aerotri.volume(cone, AROUND, boundary_from="product")
    assert "no effect" in refused.value.remedy
    from aerotri.cli.app import invoke

    path = cone.save(tmp_path / "cone.tif")
    with pytest.raises(InputError, match="--boundary-from product belongs to --adjustment"):
        invoke(["volume", str(path), "--boundary-from", "product", "--out", str(tmp_path / "out")])


def test_a_folder_without_a_surface_is_told_as_that(tmp_path):
    with pytest.raises(InputError, match=r"holds no surface: there is no dsm.tif") as refused:
        aerotri.volume(tmp_path)
    assert "the folder that dsm or dtm wrote" in refused.value.remedy


def test_a_file_without_a_coordinate_system_is_told(cone, tmp_path):
    path = aerotri.Surface.of_array(cone.z, left=LEFT, top=TOP, cell=1.0).save(tmp_path / "site.tif")
    said = "site.tif does not say its coordinate system"
    assert any(said in text for text in aerotri.volume(path).warnings)
    assert not any("does not say its" in text for text in aerotri.volume(cone, AROUND).warnings)


def test_methods_differ_in_the_digits_of_the_page(cone, tmp_path):
    """Rounded to whole cubic metres all methods would be alike, and the table would show nothing."""
    found = aerotri.volume(cone, AROUND, base=100.0)
    page = (found.save(tmp_path / "volume") / "volume.html").read_text(encoding="utf-8")
    table = page[page.index("By every method") :]
    nets = re.findall(r"<td>[a-z, 0-9]+</td><td class=\"n\">([^<]+)</td>", table)
    assert len(nets) == len(found.methods["net_m3"])
    assert len(set(nets)) >= 4
    for text, value in zip(nets, found.methods["net_m3"].tolist(), strict=True):
        assert float(text.replace("\u2009", "").replace("−", "-")) == pytest.approx(value, abs=0.0051)
