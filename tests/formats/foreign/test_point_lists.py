"""Lists of control points and positions: columns by name, Pix4D, OpenDroneMap."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from oriented_sample import oriented_sample

from aerotri.conventions import InputError
from aerotri.formats.assembly.kinds import CONTROL, POSITIONS, kind_of
from aerotri.formats.foreign.named_lists import read_control_list, read_positions
from aerotri.formats.foreign.odm import is_header, read_odm_gcp, read_odm_geo, write_odm_gcp
from aerotri.formats.foreign.pix4d import read_pix4d_gcp, read_pix4d_geo, write_pix4d_gcp, write_pix4d_geo

NAMED = "Name;Northing [m];Easting (m);Ellipsoidal Height;AccHor;AccVer;code\nA;2;1;3;0.02;0.05;x\nB;5;4;;0.02;0.05;y\n"
NATIVE = "point,X,Y,Z,sX,sY,sZ,role\np1,1,2,3,.1,.2,.3,control\np2,,,4,,,.3,check\n"
POSITIONS_LIST = "imageName,X_gps,Y_gps,Z_gps,X_acc,Y_acc,Z_acc\na.jpg,1,2,3,.01,.02,.03\nb.jpg,4,5,6,.1,.2,.3\n"
GCP = "g1,1,2,3,0.02,0.05\ng2,4,5,6,0.03,0.06\n"
GEO = "a.jpg,1,2,3,90,10,-5,0.5,1\nb.jpg,4,5,6,0,0,0,0.5,1\n"
ODM_GCP = """\
WGS84 UTM 47N
# a comment
100.5 200.5 30.25 10 20 a.jpg G1
100.5 200.5 30.25 11 21 b.jpg G1 and more
101 201 NaN 12 22 a.jpg G2
102 202 0 13 23 a.jpg G3
"""
ODM_GEO = """\
EPSG:32647
a.jpg 1 2 3 90 10 -5 0.5 1.0
b.jpg 4 5 6
c.jpg 7 8
d.jpg 7 8 0 1 2 3 mine
"""


def read(reader, tmp_path, text, *arguments):
    path = tmp_path / "file.txt"
    path.write_text(text)
    return reader(path, *arguments)


def test_columns_by_name(tmp_path):
    found = read(read_control_list, tmp_path, NAMED)
    np.testing.assert_array_equal(found.xyz, [[1, 2, 3], [4, 5, np.nan]])
    np.testing.assert_array_equal(found.sigma[0], [0.02, 0.02, 0.05])
    assert found.heights == "ellipsoidal"
    assert found.messages == ("file.txt: columns not carried over: code",)
    native = read(read_control_list, tmp_path, NATIVE)
    np.testing.assert_array_equal(native.xyz, [[1, 2, 3], [np.nan, np.nan, 4]])
    assert native.is_check.tolist() == [False, True]
    assert native.messages == ()
    positions = read(read_positions, tmp_path, POSITIONS_LIST)
    np.testing.assert_array_equal(positions.xyz, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(positions.sigma[0], [0.01, 0.02, 0.03])


def test_longitude_and_latitude(tmp_path):
    text = "image\tLatitude\tLongitude\tAltitude\tYaw\tPitch\tRoll\tAccuracy\na\t14.5\t101\t150\t90\t0\t0\t.1\n"
    found = read(read_positions, tmp_path, text)
    assert found.crs == "EPSG:4326"
    np.testing.assert_array_equal(found.xyz, [[101, 14.5, 150]])
    np.testing.assert_array_equal(found.sigma, [[0.1, 0.1, 0.1]])
    np.testing.assert_allclose(np.degrees(found.yaw_pitch_roll), [[90, 0, 0]])
    both = read(read_positions, tmp_path, "image,X,Y,Z,lat,lon\na,1,2,3,14,101\n")
    assert (both.crs, both.messages) == ("", ("file.txt: columns not carried over: lat, lon",))


def test_real_lists(shared_data):
    folder = shared_data("cu_sbr_p1")
    control = read_control_list(folder / "control_points.csv")
    assert control.points.tolist() == ["GCP02", "GCP10", "GCP11", "GCP13", "GCP15", "GCP24"]
    np.testing.assert_array_equal(control.xyz[0], [717429.126, 1606454.237, 3.4845])
    assert control.heights == "ellipsoidal"
    positions = read_positions(folder / "gnss_positions.csv")
    assert len(positions.images) == 581
    np.testing.assert_array_equal(positions.sigma, np.tile([0.02, 0.02, 0.05], (581, 1)))
    assert positions.messages == ()


@pytest.mark.parametrize(("axes", "first"), [("xy", [1, 2, 3]), ("yx", [2, 1, 3])])
def test_pix4d(tmp_path, axes, first):
    control = read(read_pix4d_gcp, tmp_path, GCP, axes)
    np.testing.assert_array_equal(control.xyz[0], first)
    np.testing.assert_array_equal(control.sigma[1], [0.03, 0.03, 0.06])
    positions = read(read_pix4d_geo, tmp_path, GEO, axes)
    np.testing.assert_array_equal(positions.xyz[0], first)
    np.testing.assert_array_equal(positions.sigma[0], [0.5, 0.5, 1])
    np.testing.assert_allclose(np.degrees(positions.yaw_pitch_roll[0]), [90, 10, -5])


@pytest.mark.parametrize(
    ("rest", "sigma", "angles"),
    [
        ("", [np.nan] * 3, [np.nan] * 3), (",0.5", [0.5] * 3, [np.nan] * 3), (",0.5,1", [0.5, 0.5, 1], [np.nan] * 3),
        (",1,2,3", [np.nan] * 3, [1, 2, 3]), (",1,2,3,0.5", [0.5] * 3, [1, 2, 3]),
    ],
)  # fmt: skip
def test_widths_of_pix4d_lists(tmp_path, rest, sigma, angles):
    found = read(read_pix4d_geo, tmp_path, f"a,1,2,3{rest}\n")
    np.testing.assert_array_equal(found.sigma, [sigma])
    np.testing.assert_allclose(np.degrees(found.yaw_pitch_roll), [angles])


def test_pix4d_there_and_back(tmp_path):
    block = oriented_sample(shift=(717000.0, 1606000.0, 0.0)).block
    said = write_pix4d_gcp(block, tmp_path / "gcp.csv")
    assert "1 check point written like control points: the format does not tell them apart" in said
    control = read_pix4d_gcp(tmp_path / "gcp.csv")
    np.testing.assert_allclose(control.xyz, block.control.xyz, rtol=0, atol=5.1e-7)
    np.testing.assert_array_equal(control.sigma, block.control.sigma)
    write_pix4d_geo(block, tmp_path / "geo.csv")
    positions = read_pix4d_geo(tmp_path / "geo.csv")
    assert block.gnss_ins is not None
    np.testing.assert_allclose(positions.xyz, block.gnss_ins.xyz, rtol=0, atol=5.1e-7)
    with pytest.raises(InputError, match="has no observed positions"):
        write_pix4d_geo(replace(block, gnss_ins=None), tmp_path / "none.csv")


def test_odm_control(tmp_path):
    found = read(read_odm_gcp, tmp_path, ODM_GCP)
    assert found.crs == "EPSG:32647"
    assert found.points.tolist() == ["G1", "G2", "G3"]
    np.testing.assert_array_equal(found.xyz, [[100.5, 200.5, 30.25], [101, 201, np.nan], [102, 202, 0]])
    assert found.messages == (
        "file.txt: the height of 1 point is 0 and taken as known: write NaN if it is unknown",
        "file.txt: the height of 1 point is unknown",
        "file.txt: what follows the known columns in 1 row was not carried over",
    )
    rays = found.rays
    assert rays is not None
    # pixel 0 is the centre of the first one there, its corner here
    np.testing.assert_array_equal(rays.xy, [[10.5, 20.5], [11.5, 21.5], [12.5, 22.5], [13.5, 23.5]])
    assert rays.images[rays.image].tolist() == ["a.jpg", "b.jpg", "a.jpg", "a.jpg"]
    unnamed = read(read_odm_gcp, tmp_path, "EPSG:32647\n1 2 3 5 5 a\n1 2 3 6 6 b\n4 5 6 7 7 a\n")
    assert unnamed.points.tolist() == ["gcp1", "gcp2"]


def test_odm_control_comes_back(tmp_path):
    block = replace(oriented_sample(shift=(717000.0, 1606000.0, 0.0)).block, crs="EPSG:32647")
    said = write_odm_gcp(block, tmp_path / "gcp_list.txt")
    assert "1 check point written like control points: the format does not tell them apart" in said
    found = read_odm_gcp(tmp_path / "gcp_list.txt")
    assert found.crs == "EPSG:32647"
    places = {name: xyz for name, xyz in zip(found.points.tolist(), found.xyz, strict=True)}
    for point, xyz in zip(block.points[block.control.point].tolist(), block.control.xyz, strict=True):
        np.testing.assert_allclose(places[point], xyz, rtol=0, atol=5.1e-7)
    assert found.rays is not None
    assert len(found.rays.image) == np.isin(block.image_points.point, block.control.point).sum()
    with pytest.raises(InputError, match="needs a coordinate system"):
        write_odm_gcp(replace(block, crs="local"), tmp_path / "none.txt")


def test_odm_positions(tmp_path):
    found = read(read_odm_geo, tmp_path, ODM_GEO)
    assert found.images.tolist() == ["a.jpg", "b.jpg", "d.jpg"]
    np.testing.assert_array_equal(found.xyz, [[1, 2, 3], [4, 5, 6], [7, 8, 0]])
    np.testing.assert_allclose(np.degrees(found.yaw_pitch_roll[[0, 2]]), [[90, 10, -5], [1, 2, 3]])
    np.testing.assert_array_equal(found.sigma[0], [0.5, 0.5, 1])
    assert np.isnan(found.sigma[1:]).all()
    assert found.messages == (
        "file.txt: the height of 1 photograph is 0 and taken as known: write NaN if it is unknown",
        "file.txt: 1 position without height left out",
        "file.txt: what follows the known columns in 1 row was not carried over",
    )


@pytest.mark.parametrize(
    ("header", "found"),
    [
        ("epsg:25832", True), ("WGS84 UTM 61N", True), ("+proj=lcc +lat_1=49", True), ("EPSG:x", True),
        ("a.jpg 1 2 3", False), ("", False),
    ],
)  # fmt: skip
def test_first_lines_of_odm(header, found):
    assert is_header(header) == found


@pytest.mark.parametrize(
    ("kinds", "text", "kind"),
    [
        (CONTROL, NAMED, "csv"), (CONTROL, NATIVE, "csv"), (CONTROL, GCP, "pix4d-gcp"), (CONTROL, ODM_GCP, "odm-gcp"),
        (CONTROL, '"1" 13 815601.510 6283629.280 54.960 \r\n', "ign-app"), (CONTROL, "1 2 3 4 1 0\n", "patb-con"),
        (POSITIONS, POSITIONS_LIST, "csv"), (POSITIONS, GEO, "pix4d-geo"), (POSITIONS, ODM_GEO, "odm-geo"),
        (POSITIONS, "nothing of the kind", None), (CONTROL, "\x00\x01", None), (CONTROL, "", None),
    ],
)  # fmt: skip
def test_kinds_are_told(tmp_path, kinds, text, kind):
    (tmp_path / "file").write_text(text)
    assert kind_of(tmp_path / "file", kinds) == kind


WRONG = {
    "named empty": (read_control_list, "", None, "is empty"),
    "named no header": (read_control_list, "A,1,2,3\n", 1, "does not begin with the names"),
    "named no name": (read_control_list, "X,Y,Z\n1,2,3\n", 1, "no column holds names"),
    "named twice": (read_control_list, "name,X,Easting\nA,2,3\n", 1, "columns 'X' and 'Easting' are both X"),
    "named row": (read_control_list, NAMED[:-3], 3, "the row has 6 cells"),
    "named number": (read_control_list, NAMED.replace("A;2;", "A;2,5,1;"), 2, "Y '2,5,1' is not a number"),
    "named nothing": (read_control_list, "name,lat,lon,X\nA,,,\n", 2, "has no coordinates"),
    "named point twice": (read_control_list, NAMED.replace("B;", "A;"), 3, "point 'A' is there twice"),
    "named sigma": (read_control_list, NAMED.replace("0.05;x", "-0.05;x"), 2, "is negative"),
    "named role": (read_control_list, NATIVE.replace("check", "checked"), 3, "role = 'checked'"),
    "positions missing": (read_positions, POSITIONS_LIST.replace(",5,", ",,"), 3, "a coordinate is missing"),
    "positions no rows": (read_positions, POSITIONS_LIST[:46], 1, "holds no photographs"),
    "gcp row": (read_pix4d_gcp, GCP[:-6], 2, "the row has 5 cells"),
    "gcp cells": (read_pix4d_gcp, GCP.replace(",5,6,0.03,0.06", ",5"), 2, "the row has 3 cells"),
    "gcp number": (read_pix4d_gcp, GCP.replace(",5,", ",x,"), 2, "'x' is not a number"),
    "gcp accuracy": (read_pix4d_gcp, GCP.replace("0.06", "-0.06"), 2, "accuracy is negative"),
    "geo twice": (read_pix4d_geo, GEO.replace("b.jpg", "a.jpg"), 2, "'a.jpg' is there twice"),
    "odm no crs": (
        read_odm_gcp,
        ODM_GCP.replace("WGS84 UTM 47N", "UTM"),
        1,
        "the coordinate system 'UTM' is not known",
    ),
    "odm no rows": (read_odm_gcp, "EPSG:1\n", 1, "has no rows"),
    "odm row": (read_odm_gcp, ODM_GCP.replace(" 13 23 a.jpg G3", " 13"), 6, "the row has 4 entries"),
    "odm number": (read_odm_gcp, ODM_GCP.replace("101 201", "101 2o1"), 5, "'2o1' is not a number"),
    "odm two places": (read_odm_gcp, ODM_GCP.replace("30.25 11", "30.35 11"), 4, "other coordinates than in line 3"),
    "odm twice": (
        read_odm_gcp,
        ODM_GCP.replace("b.jpg", "a.jpg"),
        4,
        "point 'G1' in photograph 'a.jpg' is there twice",
    ),
    "geo no crs": (read_odm_geo, ODM_GEO[11:], 1, "does not begin with a coordinate system"),
    "geo row": (read_odm_geo, ODM_GEO.replace("c.jpg 7 8", "c.jpg 7"), 4, "the row has 2 entries"),
    "geo plan": (read_odm_geo, ODM_GEO.replace("c.jpg 7 8", "c.jpg nan 8"), 4, "the plan position is missing"),
    "geo accuracy": (read_odm_geo, ODM_GEO.replace("0.5 1.0", "0.5 -1.0"), 2, "accuracy is not greater than 0"),
}


@pytest.mark.parametrize(("reader", "content", "line", "says"), WRONG.values(), ids=WRONG)
def test_errors(tmp_path, reader, content, line, says):
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        read(reader, tmp_path, content)
    assert caught.value.line == line
