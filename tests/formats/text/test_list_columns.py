"""Names of columns as programs and people write them."""

import re

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.formats.foreign.named_lists import read_control_list
from aerotri.formats.text.list_columns import is_unit, list_column, looks_like_unit

US_FOOT = 1200.0 / 3937.0
KNOWN = {
    "name": "Label|GCP Label|imageName|PhotoID|# Punktnummer|Pkt-Nr|Nom|Punto|point_id|Marker",
    "X": "X/Easting|Easting|E|Rechtswert|Ostwert|Est|Este|x_gps|X0",
    "Y": "Y/Northing|northing|N|Hochwert|Nord|Norte|Y0",
    "Z": "Z/Altitude|Elev|Höhe|Hoehe|Hauteur|Cota|Quota|h|Ortho height",
    "h_ell": "Ellipsoidal height|Ell. Height",
    "lon": "X/Longitude|lng|Längengrad|Longitud",
    "lat": "Y/Latitude|Lat|Breite",
    "sX": "Accuracy_X/Easting|std_X|σX|Easting RMS|X acc",
    "sZ": "Elevation RMS|sigma_Z|Accuracy_Z|vertical accuracy",
    "s_plan": "Accuracy_X/Y|AccHor|accuracy horizontal|Lateral RMS",
    "s_all": "Accuracy|sigma|Accuracy_X/Y/Z",
    "yaw": "Yaw|Heading", "omega": "Omega", "kappa": "Kappa",
    "": "X_est|Y_error|Error|Yaw_est|Antenna height|Description|Code|Solution status|PDOP|Yaw accuracy|dX offset",
}  # fmt: skip


@pytest.mark.parametrize(("meaning", "names"), KNOWN.items())
def test_meanings(meaning, names):
    for name in names.split("|"):
        assert list_column(name).meaning == meaning, name


@pytest.mark.parametrize(
    ("name", "meaning", "factor"),
    [
        ("Easting (ft)", "X", 0.3048), ("Northing [US survey feet]", "Y", US_FOOT), ("Elev_ftUS", "Z", US_FOOT),
        ("Z [mm]", "Z", 1e-3), ("Height (m)", "Z", 1.0), ("E_usft", "X", US_FOOT), ("sigma_Z (cm)", "sZ", 1e-2),
        ("Kappa [gon]", "kappa", 0.9), ("Omega (rad)", "omega", np.degrees(1.0)), ("X (deg)", "lon", 1.0),
        ("X (US survey ft)", "X", US_FOOT), ("X (survey foot)", "X", US_FOOT),
        ("latitude [decimal degrees]", "lat", 1.0), ("Accuracy_(deg)", "", 1.0),
    ],
)  # fmt: skip
def test_units(name, meaning, factor):
    found = list_column(name)
    assert found.meaning == meaning
    assert found.factor == pytest.approx(factor)


def test_units_of_the_remedy_are_known(tmp_path):
    (tmp_path / "list.csv").write_text("name,X (yd),Y,Z\nA,1,2,3\n")
    with pytest.raises(InputError) as caught:
        read_control_list(tmp_path / "list.csv")
    units = re.findall(r"\(([^)]*)\)", caught.value.remedy)
    assert len(units) > 3
    assert all(map(is_unit, units))


@pytest.mark.parametrize("text", ["in feet", "ft US", "INTFT", "yards", "ddmmss", "arcsec", "deg min sec", "2 sigma"])
def test_units_that_are_not_known(text):
    assert looks_like_unit(text)


@pytest.mark.parametrize("text", ["after adjustment", "section 3", "shift", "admin", "footprint", "sigmar", "draft"])
def test_words_that_are_no_units(text):
    assert not looks_like_unit(text)


@pytest.mark.parametrize("name", ["Latitude (m)", "Z (varas)", "Höhe (NHN)", "Yaw (ft)"])
def test_units_that_do_not_fit_are_never_a_factor(name):
    assert np.isnan(list_column(name).factor)
