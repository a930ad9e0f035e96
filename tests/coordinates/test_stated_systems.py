"""Coordinate systems as lists name them: the same system, units taken off, what cannot be used refused."""

import re

import numpy as np
import pytest
from pyproj import CRS

from aerotri.conventions import InputError
from aerotri.coordinates.stated_systems import stated_system

US_FOOT = 1200.0 / 3937.0
SHORTENED = 'PROJCS["WGS 84 / UTM zone 32N",GEOGCS["WGS 84"...]]'


@pytest.mark.parametrize(
    ("text", "crs"),
    [
        ("EPSG:25832", "EPSG:25832"), ("epsg: 25832", "EPSG:25832"), ("EPSG:25832+7837", "EPSG:25832+7837"),
        ("EPSG:25832+EPSG:7837", "EPSG:25832+7837"), ("WGS84", "EPSG:4326"), ("WGS 84", "EPSG:4326"),
        ("WGS84 UTM 16N", "EPSG:32616"), ("WGS84 UTM 7 s", "EPSG:32707"), ("UTM32N", "EPSG:32632"),
        ("UTM zone 32 N", "EPSG:32632"), ("ETRS89 / UTM zone 32N", "EPSG:25832"), ("ETRS89 UTM 32N", "EPSG:25832"),
        ("ETRS89 / UTM zone 32N + DHHN2016 height", "EPSG:25832+7837"),
        ("+proj=utm +zone=47 +ellps=WGS84 +datum=WGS84 +units=m +no_defs", "EPSG:32647"),
        ("+proj=utm +zone=21 +south +datum=WGS84 +units=m", "EPSG:32721"),
        ("+proj=longlat +datum=WGS84 +no_defs +type=crs", "EPSG:4326"),
        ("+proj=utm +zone=32 +ellps=GRS80 +towgs84=0,0,0", "EPSG:25832"),
        ('PROJCS["WGS 84 / UTM zone 32N",AUTHORITY["EPSG","32632"]]', "EPSG:32632"), (SHORTENED, "EPSG:32632"),
        ('LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0],UNIT["metre",1]]', ""), ("Local", ""),
        ("+proj=local +units=m", ""),
    ],
)  # fmt: skip
def test_systems_in_metres_and_degrees(text, crs):
    found = stated_system(text)
    assert (found.crs, found.plan_to_metre, found.height_to_metre, found.note) == (crs, 1.0, 1.0, "")


@pytest.mark.parametrize(
    ("text", "crs", "plan", "height"),
    [
        ("+proj=utm +zone=32 +datum=WGS84 +to_meter=0.3048", "EPSG:32632", 0.3048, np.nan),
        ("+proj=utm +zone=32 +datum=WGS84 +units=us-ft +vunits=m", "EPSG:32632", US_FOOT, 1.0),
        ("+proj=utm +zone=32 +datum=WGS84 +units=m +vunits=us-ft", "EPSG:32632", 1.0, US_FOOT),
        ("NAD83 / Texas Central (ftUS)", "EPSG:32139", US_FOOT, np.nan), ("EPSG:2277", "EPSG:32139", US_FOOT, np.nan),
        ("EPSG:2263+6360", "EPSG:32118+5703", US_FOOT, US_FOOT),
    ],
)  # fmt: skip
def test_units_become_factors_and_are_told(text, crs, plan, height):
    """What heights beside X and Y in feet count in is not known, unless it is stated."""
    found = stated_system(text)
    assert found.crs == crs
    np.testing.assert_allclose([found.plan_to_metre, found.height_to_metre], [plan, height], rtol=1e-12)
    assert "brought to metres" in found.note


@pytest.mark.parametrize("unit", ["0", "-1", ".", "1e999", "nan", ""])
def test_units_of_local_coordinates_that_are_none(unit):
    with pytest.raises(InputError, match=f"states a unit of '{unit}' m"):
        stated_system(f'LOCAL_CS["Local",LOCAL_DATUM["Local",0],UNIT["metre",{unit}]]')


def test_a_unit_of_nothing_of_a_projection():
    text = re.sub(r'UNIT\["metre",1', 'UNIT["metre",0', CRS("EPSG:32632").to_wkt("WKT1_GDAL"))
    with pytest.raises(InputError, match=r"states a unit of '0\.0' m"):
        stated_system(text)


@pytest.mark.parametrize("text", ["", "gcp", "hello", "EPSG:999999", "WGS84 UTM 61N", "a.jpg 1 2 3", "x" * 30_000])
def test_what_is_no_system(text):
    assert stated_system(text) is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("+proj=utm +zone=32 +ellps=bessel +towgs84=500,0,0", "states a shift of the datum"),
        (
            "+proj=utm +zone=32 +datum=WGS84 +geoidgrids=egm96_15.gtx",
            r"states \+geoidgrids=egm96_15\.gtx, which is not used",
        ),
        ("EPSG:4978", "earth-centred"),
    ],
)
def test_what_is_understood_and_cannot_be_used(text, says):
    with pytest.raises(InputError, match=says):
        stated_system(text)


def test_a_system_without_a_code_keeps_its_definition():
    found = stated_system("+proj=laea +lat_0=50 +lon_0=10 +ellps=GRS80")
    assert "Lambert Azimuthal Equal Area" in found.crs


@pytest.mark.parametrize(
    "text", ["+proj=utm +zone=32 +datum=WGS84 +pm=paris", "+proj=utm +zone=32 +datum=WGS84 +axis=neu",
             "+proj=pipeline +step +proj=utm +zone=32", "ESRI:102003+EPSG:5703"],
)  # fmt: skip
def test_no_key_is_dropped(text):
    with pytest.raises(InputError, match=r"which is not used|has no EPSG code"):
        stated_system(text)
