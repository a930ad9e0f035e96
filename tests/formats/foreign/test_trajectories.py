"""Trajectories and time stamps of GNSS: every way in which the formats write one flight is the same flight."""

from __future__ import annotations

import numpy as np
import pytest
from gnss_files import LEAP, SIGMA, START, WEEK, grafnav, mrk, places, rtklib

from aerotri.conventions import InputError
from aerotri.coordinates.ellipsoid import metres_of_units
from aerotri.formats.assembly.kinds import POSITIONS, kind_of
from aerotri.formats.foreign.dji_mrk import read_dji_mrk
from aerotri.formats.foreign.gnss_time import WEEK_S, calendar_seconds, gps_of_utc
from aerotri.formats.foreign.grafnav import read_grafnav
from aerotri.formats.foreign.rtklib import read_rtklib
from places import SHARED_DATA

SECONDS = np.arange(0.0, 4.0, 0.2)
GPS = WEEK * WEEK_S + START + SECONDS
RTKLIB = {
    "degrees": {}, "minutes": {"form": "dms"}, "earth-centred": {"form": "xyz"}, "baseline": {"form": "enu"},
    "UTC": {"clock": "UTC"}, "JST, week": {"clock": "JST", "calendar": False}, "week": {"calendar": False},
    "commas": {"separator": ","}, "week, semicolons, minutes": {"separator": ";", "calendar": False, "form": "dms"},
    "velocity": {"velocity": True},
}  # fmt: skip
GRAFNAV = {"GPS": {}, "UTC": {"utc": True}, "minutes": {"minutes": True}}


def written(folder, text):
    path = folder / "flight.pos"
    path.write_text(text, encoding="utf-8")
    return path


def check(found, sigma=SIGMA):
    np.testing.assert_allclose(found.time, GPS, atol=2e-6)
    apart = (found.place - places(SECONDS)) * metres_of_units(found.place)
    np.testing.assert_allclose(apart, 0.0, atol=2e-4)
    np.testing.assert_allclose(found.sigma, np.broadcast_to(sigma, (len(SECONDS), 3)), atol=1e-4)
    assert set(found.quality.tolist()) == {"fixed"}
    assert found.heights == "ellipsoidal"


@pytest.mark.parametrize("name", RTKLIB)
def test_solutions_of_rtklib(name, tmp_path):
    path = written(tmp_path, rtklib(SECONDS, **RTKLIB[name]))
    assert kind_of(path, POSITIONS) == "rtklib"
    check(read_rtklib(path))


@pytest.mark.parametrize("name", GRAFNAV)
def test_trajectories_of_grafnav(name, tmp_path):
    path = written(tmp_path, grafnav(SECONDS, **GRAFNAV[name]))
    assert kind_of(path, POSITIONS) == "grafnav"
    check(read_grafnav(path), (SIGMA[0], SIGMA[0], SIGMA[2]))


FEET = {"ft": 0.3048, "usft": 1200.0 / 3937.0}


@pytest.mark.parametrize("unit", FEET)
def test_heights_and_sigma_in_feet(unit, tmp_path):
    """Of GrafNav's columns each has its unit: the same flight in feet is the same flight."""
    # units end where their columns end
    text = grafnav(SECONDS, lengths=FEET[unit]).replace(" " * (len(unit) - 1) + "(m)", f"({unit})")
    found = read_grafnav(written(tmp_path, text))
    check(found, (SIGMA[0], SIGMA[0], SIGMA[2]))
    assert f"flight.pos: heights in {unit}, brought to metres" in found.messages
    with pytest.raises(InputError, match="counts in 'yd'"):
        read_grafnav(written(tmp_path, text.replace(f"({unit})", "(yd)")))


def test_columns_of_inertial_explorer(tmp_path):
    """A name that is cut off, a datum with an addition, and columns that are not used but named."""
    text = grafnav(SECONDS, more="  SD-VE Roll Pitch Heading").replace("SDHeight", " SDHeigh")
    path = written(tmp_path, text.replace("WGS84", "ETRS89, (processing datum)"))
    found = read_grafnav(path)
    check(found, (SIGMA[0], SIGMA[0], SIGMA[2]))
    assert found.datum == "ETRS89"
    assert "flight.pos: not used: sd-ve" in found.messages
    assert any("not used: roll, pitch, heading; positions may be those of the IMU" in text for text in found.messages)


def test_covariances_have_their_sign(tmp_path):
    """σ east, north, up of earth-centred σ with correlations; a lost sign would give others."""
    sigmas = (0.05, 0.02, 0.01)
    text = rtklib(SECONDS[:2], "xyz", sigmas=sigmas)
    row = text.splitlines()[-1].split()
    assert any(word.startswith("-") for word in row[10:13])
    np.testing.assert_allclose(read_rtklib(written(tmp_path, text)).sigma, [sigmas, sigmas], atol=1e-6)
    bare = read_rtklib(written(tmp_path, text.replace(" -0.", " 0."))).sigma
    assert np.abs(bare - sigmas).max() > 1e-3


def test_quality_and_heights(tmp_path):
    quality = np.array([1, 2, 3, 4, 5, 6] + [1] * 14)
    text = rtklib(SECONDS, quality=quality).replace("WGS84/ellipsoidal", "WGS84/geodetic")
    found = read_rtklib(written(tmp_path, text))
    assert found.quality[:6].tolist() == ["fixed", "float", "differential", "differential", "single point", "PPP"]
    assert found.heights == "sea level"
    found = read_grafnav(written(tmp_path, grafnav(SECONDS, quality=quality)))
    assert found.quality[:6].tolist() == ["fixed", "float", "float", "differential", "differential", "single point"]


def test_epochs_without_solution_are_left_out_and_said(tmp_path):
    found = read_rtklib(written(tmp_path, rtklib(SECONDS, quality=np.array([0, 0] + [1] * 18))))
    assert len(found) == 18
    assert found.messages == ("flight.pos: 2 epochs without solution",)


def test_baselines_need_their_base(tmp_path):
    text = "\n".join(line for line in rtklib(SECONDS, "enu").splitlines() if "ref pos" not in line)
    with pytest.raises(InputError, match="where the base is"):
        read_rtklib(written(tmp_path, text))


@pytest.mark.parametrize("first", ["2022/11/06", "2022/13/06 05:54:22.2", "x y", ""])
def test_rows_that_are_cut_off_or_no_time_have_their_line(first, tmp_path):
    lines = rtklib(SECONDS).splitlines()
    lines[-1] = first + lines[-1][23:] if " " in first else first + " 1"
    with pytest.raises(InputError) as error:
        read_rtklib(written(tmp_path, "\n".join(lines)))
    assert error.value.line == len(lines)


def test_leap_seconds():
    """The tables of IERS: 0 s in 1980, 13 s in 2000, 18 s since 2017."""
    utc = np.array([calendar_seconds(*day) for day in ((1980, 1, 6), (2000, 1, 1), (2016, 12, 31), (2017, 1, 1))])
    assert (gps_of_utc(utc) - utc).tolist() == [0.0, 13.0, 17.0, LEAP]
    assert calendar_seconds(2022, 11, 6) == 2235 * WEEK_S


def test_wrong_leap_seconds_are_refused(tmp_path):
    text = grafnav(SECONDS, utc=True).replace("UTC Offset:  18 s", "UTC Offset:  17 s")
    with pytest.raises(InputError, match="18 s"):
        read_grafnav(written(tmp_path, text))


def test_time_stamps_of_a_drone(tmp_path):
    path = tmp_path / "flight.MRK"
    path.write_text(mrk(SECONDS[:3], first=2))
    found = read_dji_mrk(path)
    assert kind_of(path, POSITIONS) == "dji-mrk"
    assert found.number.tolist() == [2, 3, 4]
    assert found.quality.tolist() == ["fixed"] * 3
    np.testing.assert_allclose(found.time, GPS[:3], atol=1e-6)
    np.testing.assert_allclose(found.offset[0], [0.574, -0.180, -0.233])
    np.testing.assert_allclose(found.sigma[0], [0.012, 0.013, 0.027])
    np.testing.assert_allclose(found.place, places(SECONDS[:3]), atol=6e-4)


@pytest.mark.parametrize(
    "damage", [("\t50,Q", ""), ("[2235]", "2235"), ("3\t212", "2\t212"), ("\t21262.6", "\t21262.1")]
)
def test_damaged_time_stamps_have_their_line(damage, tmp_path):
    path = tmp_path / "flight.MRK"
    lines = mrk(SECONDS[:3]).splitlines()
    path.write_text("\n".join([*lines[:2], lines[2].replace(*damage)]))
    with pytest.raises(InputError) as error:
        read_dji_mrk(path)
    assert error.value.line == 3


def test_real_files():
    folder = SHARED_DATA / "ppk"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    stamps = read_dji_mrk(folder / "p4rtk_timestamp.mrk")
    assert len(stamps) == 176
    assert stamps.number[0] == 2
    assert set(stamps.quality.tolist()) == {"fixed"}
    assert set(read_dji_mrk(folder / "m300_timestamp.mrk").quality.tolist()) == {"single point"}
    path = read_grafnav(folder / "m300_grafnav_5hz.txt")
    assert len(path) == 18602
    assert np.isclose(path.time[0], WEEK * WEEK_S + 21262.2)
    assert path.place[0].tolist() == [101.0186123216, 14.5172877378, 4.434]
