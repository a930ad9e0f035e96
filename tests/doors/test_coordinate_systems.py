"""A coordinate system is its definition, whether it has a code or not."""

from __future__ import annotations

import json

import pytest

from aerotri.conventions import InputError

VOLUME = "volume {} --boundary {} --base level:101 --out O --no-plots"


def _record(name="O/volume.json"):
    with open(name, encoding="utf-8") as file:
        return json.load(file)


def test_boundary_in_degrees_meets_a_surface_without_a_code(door, run):
    door("custom_crs")
    assert run(VOLUME.format("laea.tif", "lonlat.geojson")).exit_code == 0
    found = _record()
    assert not any("does not say" in text for text in found["warnings"])
    assert found["boundary"]["area_m2"] > 0.0


def test_boundary_beside_a_surface_without_a_code_is_refused(door, run):
    door("custom_crs")
    with pytest.raises(InputError, match="does not meet the surface"):
        run(VOLUME.format("laea.tif", "utm.geojson"))


@pytest.mark.parametrize(
    "line",
    [
        "compare laea.laz tm.tif",
        "compare laea.tif tm.tif",
        "compare laea.laz utm.tif",
        "change laea.tif tm.tif",
        "change laea.laz tm.laz --cylinder 1.5 --normal 3 --spacing 2",
        "volume laea.tif --base tm.tif",
    ],
)
def test_surfaces_in_two_systems_are_not_compared(line, door, run):
    """The same numbers, 524 km apart."""
    door("custom_crs")
    with pytest.raises(InputError, match=r"is in .* in .*CRS"):
        run(f"{line} --out O --no-plots")


@pytest.mark.parametrize(
    "line", ["compare laea.laz laea.tif", "change laea.laz laea.laz --cylinder 1.5 --normal 3 --spacing 2"]
)
def test_surfaces_in_one_system_without_a_code_are_compared(line, door, run):
    door("custom_crs")
    assert run(f"{line} --out O --no-plots").exit_code == 0


@pytest.mark.parametrize("boundary", ["p.esri.gpkg", "p.cust.gpkg"])
def test_geopackage_says_its_system_by_organisation_and_definition(boundary, door, run):
    """Numbers of its own list are no EPSG codes."""
    door("gpkg_srs")
    assert run(VOLUME.format("s.tif", boundary)).exit_code == 0
    assert _record()["boundary"]["area_m2"] == pytest.approx(1305.26, abs=0.05)


@pytest.mark.parametrize("form", ["f1", "f2"])
def test_single_feature_or_geometry_is_geojson(form, door, run):
    folder = door("geojson_forms")
    surface = folder.parent / "surface" / "s.tif"
    surface.parent.mkdir()
    surface.write_bytes((door("gpkg_srs") / "s.tif").read_bytes())
    assert run(VOLUME.format(surface, folder / f"{form}.geojson")).exit_code == 0
    assert _record()["boundary"]["area_m2"] == pytest.approx(1305.26, abs=0.05)


def test_two_piles_of_one_name_are_refused(door, run):
    folder = door("geojson_forms")
    surface = door("gpkg_srs") / "s.tif"
    with pytest.raises(InputError, match="two polygons called 'pile'"):
        run(VOLUME.format(surface, folder / "f17.geojson"))
