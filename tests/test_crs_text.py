"""A coordinate system as a text: by code where it has one, however a file writes it; else by its definition."""

from __future__ import annotations

import pytest
from pyproj import CRS

from aerotri.conventions import InputError
from aerotri.crs_text import crs_text, heights_of, plan_of, refuse_other_system, same_system, system_in_words

GEOID = """COMPD_CS["ETRS89 / UTM zone 32N + my geoid",%s,VERT_CS["my geoid",VERT_DATUM["mine",2005],UNIT["metre",1],
AXIS["Gravity-related height",UP]]]"""
LOCAL = 'LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0],UNIT["metre",1],AXIS["X",EAST],AXIS["Y",NORTH]]'
UNNAMED = "+proj=laea +lat_0=52 +lon_0=10 +x_0=5000 +y_0=5000 +ellps=GRS80 +units=m"


@pytest.mark.parametrize("code", [25832, 3006, 31467, 3035, 2180, 2393])
@pytest.mark.parametrize("version", ["WKT1_ESRI", "WKT1_GDAL", "WKT2_2019"])
def test_code_is_known_however_it_is_written(code, version):
    """Also where axes stand in another order than in the register, as northing and easting in Sweden.

    Two codes may differ by nothing but that order.
    """
    text = crs_text(CRS.from_wkt(CRS.from_epsg(code).to_wkt(version)))
    assert text.startswith("EPSG:")
    assert same_system(text, f"EPSG:{code}")


def test_shift_to_wgs84_that_is_none_leaves_the_code():
    wkt = CRS.from_user_input("+proj=utm +zone=32 +ellps=GRS80 +towgs84=0,0,0,0,0,0,0 +units=m +type=crs").to_wkt()
    assert crs_text(CRS.from_wkt(wkt)) == "EPSG:25832"


def test_plan_and_heights_apart():
    assert (plan_of("EPSG:25832+7837"), heights_of("EPSG:25832+7837")) == ("EPSG:25832", "7837")
    assert crs_text(CRS.from_user_input("EPSG:5555")) == "EPSG:25832+5783"
    whole = crs_text(CRS.from_wkt(GEOID % CRS.from_epsg(25832).to_wkt("WKT1_GDAL")))
    assert plan_of(whole) == "EPSG:25832"
    assert "my geoid" in heights_of(whole)
    assert (plan_of(""), heights_of("")) == ("", "")


def test_local_coordinates_are_no_system():
    assert crs_text(CRS.from_wkt(LOCAL)) == ""
    assert crs_text(None) == ""


def test_systems_without_a_code_are_alike_by_their_definition():
    first, other = (crs_text(CRS.from_user_input(UNNAMED + more)) for more in ("", " +type=crs"))
    moved = crs_text(CRS.from_user_input(UNNAMED.replace("x_0=5000", "x_0=6000")))
    assert same_system(first, other)
    assert not same_system(first, moved)
    assert "Lambert Azimuthal Equal Area" in system_in_words(first)
    refuse_other_system(first, "", "the surface", "a.tif")
    with pytest.raises(InputError, match=r"a\.tif: is in a CRS without an EPSG code"):
        refuse_other_system(first, "EPSG:25832", "the surface", "a.tif")
