"""Files of IGN: the real ones, with their conventions as the image points tell them."""

from __future__ import annotations

import re

import numpy as np
import pytest
from oriented_sample import oriented_sample

from aerotri.conventions import InputError
from aerotri.formats.assembly.assemble import Statements
from aerotri.formats.assembly.project import Request, read_project
from aerotri.formats.foreign.ign import (
    read_ign_app,
    read_ign_camera,
    read_ign_mes,
    read_ign_opk,
    without_linear_alteration,
    write_ign_opk,
)
from aerotri.functional_model.rotation import angles_from_rotation

CAMERA = "Name = cam 1\nPPAx = 13210.00\nPPAy = 8500.00\nfocal = 30975.00\nwidth = 26460\nheight = 17004\n"
OPK = "NOM\tX\tY\tZ\tO\tP\tK\tCAMERA\r\na 1 2 3 0.1 0.2 0.3 cam\r\nb 4 5 6 0 0 90 cam\r\n"
MES = '\r\n"1" a 10 20\r\nt a 1.5 2.5\r\nt b 0 0\r\n'
APP = '"1" 13 815601.510 6283629.280 54.960 \r\n2 3 833670.94 6281965.4 52.63'


def write(tmp_path, name, text):
    path = tmp_path / name
    path.write_bytes(text.encode())
    return path


def test_single_files(tmp_path):
    given = read_ign_opk(write(tmp_path, "a.opk", OPK))
    np.testing.assert_array_equal(given.centre, [[1, 2, 3], [4, 5, 6]])
    assert given.cameras.tolist() == ["cam", "cam"]
    assert [name for name, _ in given.choices] == ["degrees", "gon", "radians"]
    np.testing.assert_allclose(
        np.degrees(angles_from_rotation(given.rotation)), [[0.1, 0.2, 0.3], [0, 0, 90]], atol=1e-12
    )
    rays = read_ign_mes(write(tmp_path, "a.mes", MES))
    np.testing.assert_array_equal(rays.xy, [[10, 20], [1.5, 2.5]])
    assert (rays.images.tolist(), rays.points.tolist(), rays.unit) == (["a"], ["1", "t"], "px")
    assert rays.messages == ("a.mes: 1 row of 0 0 left out: not measured",)
    control = read_ign_app(write(tmp_path, "a.app", APP))
    assert control.points.tolist() == ["1", "2"]
    np.testing.assert_array_equal(control.xyz[1], [833670.94, 6281965.4, 52.63])
    camera = read_ign_camera(write(tmp_path, "camera.txt", CAMERA), 4.0)
    assert (camera.name, camera.size_px, camera.pixel_um) == ("cam 1", (26460, 17004), 4.0)
    assert camera.focal_length_mm == pytest.approx(123.9)
    # 20 pixels left of the middle, 2 above it
    np.testing.assert_allclose(camera.principal_point_mm, [-0.08, 0.008])


def test_opk_comes_back(tmp_path):
    oriented = oriented_sample()
    lost = write_ign_opk(oriented, tmp_path / "out.OPK")
    assert lost[-1] == "heights are those of the block, without a correction for the scale of the projection"
    given = read_ign_opk(tmp_path / "out.OPK")
    np.testing.assert_allclose(given.centre, oriented.centre, rtol=0, atol=5.1e-5)
    np.testing.assert_allclose(given.rotation, oriented.rotation, rtol=0, atol=1e-13)
    assert given.images.tolist() == oriented.block.images.names.tolist()


def test_linear_alteration():
    """Heights above the ground grow with the scale of the projection; taking it off gives them back."""
    true, ground, scale = np.array([1770.0, 1000.0]), 5.0, np.array([1.0003, 0.9998])
    altered = true + (scale - 1.0) * (true - ground)
    np.testing.assert_allclose(without_linear_alteration(altered, ground, scale), true, rtol=1e-15)


def stated(folder, **changes):
    geoid = folder / "fr_ign_RAF20.tif"
    return Statements(crs="EPSG:2154+5720", geoid=geoid, control_sigma_m=(0.05, 0.05, 0.05), **changes)


def read_eagle(shared_data, **changes):
    from aerotri.formats.assembly.camera_spec import CameraSpec

    folder = shared_data("ultracam_eagle_m3")
    return read_project(
        Request(str(folder), "eagle", camera=CameraSpec(pixel_um=4.0), stated=stated(folder, **changes))
    )


def residuals(reading):
    """Median residuals in pixels of all rays, and of those of control points, that the messages tell."""
    text = "\n".join(reading.messages)
    rays = re.search(r"fit the given orientations to ([\d.]+) px \(median of (\d+) rays\)", text)
    control = re.search(r"fit the given coordinates to ([\d.]+) px \(median of (\d+) rays\)", text)
    assert rays is not None
    assert control is not None
    return float(rays[1]), int(rays[2]), float(control[1]), int(control[2])


def test_ultracam_eagle(shared_data):
    """All files of the folder: 7 photographs, 17 tie points and 7 of control; degrees, by reprojection."""
    reading = read_eagle(shared_data, control_heights="ellipsoidal", linear_alteration_m=5.0)
    block = reading.block
    assert (len(block.images), len(block.image_points), len(block.points), len(block.control)) == (7, 24, 10, 3)
    assert [camera.name for camera in block.cameras] == ["UCE-M3-f120-s06"]
    assert "camera 'UCE-M3-f120-s07' has no photographs and was left out" in reading.messages
    assert "terrain_test0.mes: 7 rows of 0 0 left out: not measured" in reading.messages
    assert any("rotations are degrees, by the median residual" in said for said in reading.messages)
    # undulation of RAF20 there: 49.35 m
    np.testing.assert_allclose(block.control.xyz[0], [815601.51, 6283629.28, 54.96 - 49.346], atol=1e-3)
    rays, count, control, of_control = residuals(reading)
    assert (count, of_control) == (24, 7)
    assert rays < 0.15
    assert control < 0.7


def test_what_the_heights_of_ultracam_eagle_are(shared_data):
    """Control is ellipsoidal and heights of photographs are corrected for scale: anything else fits worse."""
    right = residuals(read_eagle(shared_data, control_heights="ellipsoidal", linear_alteration_m=5.0))[2]
    altered = residuals(read_eagle(shared_data, control_heights="ellipsoidal"))[2]
    above_geoid = residuals(read_eagle(shared_data, linear_alteration_m=5.0))[2]
    assert right < 0.25 * altered
    assert above_geoid > 200.0


def test_observed_orientations(shared_data):
    reading = read_eagle(shared_data, orientation_sigma_m=(0.1, 0.1, 0.2), orientation_sigma_deg=(0.002, 0.002, 0.003))
    observed, block = reading.block.gnss_ins, reading.block
    assert observed is not None
    np.testing.assert_array_equal(observed.xyz, block.images.centre)
    np.testing.assert_array_equal(observed.angles, block.images.angles)
    np.testing.assert_allclose(np.degrees(observed.angles_sigma[3]), [0.002, 0.002, 0.003])
    assert (block.settings.gnss.shift, block.settings.ins.boresight) == ("off", "off")


WRONG = {
    "opk empty": (read_ign_opk, "", 1, "does not begin with NOM"),
    "opk header": (read_ign_opk, OPK.replace("NOM", "IMAGE"), 1, "does not begin with NOM"),
    "opk none": (read_ign_opk, OPK[: OPK.index("a 1")], 1, "holds no photographs"),
    "opk row": (read_ign_opk, OPK.replace("0 0 90 cam", "0 0 9"), 3, "the row has 7 entries, the header 8"),
    "opk number": (read_ign_opk, OPK.replace("0.2", "0,2"), 2, "'0,2' is not a number"),
    "opk twice": (read_ign_opk, OPK.replace("b 4", "a 4"), 3, "photograph 'a' is there twice, first in line 2"),
    "mes row": (read_ign_mes, MES.replace("t b 0 0", "t b 0"), 4, "has 3 entries"),
    "mes number": (read_ign_mes, MES.replace("2.5", "2.5.1"), 3, "'2.5.1' is not a number"),
    "mes twice": (read_ign_mes, MES.replace("t b", "t a"), 4, "point 't' in photograph 'a' is there twice"),
    "app row": (read_ign_app, APP.replace(" 54.960", ""), 1, "is no control point"),
    "app code": (read_ign_app, APP.replace('"1" 13', '"1" x'), 1, "is no control point"),
    "app twice": (read_ign_app, APP.replace("\n2 ", "\n1 "), 2, "point '1' is there twice"),
    "camera key": (
        lambda p: read_ign_camera(p, 4.0),
        CAMERA.replace("focal", "fokal"),
        None,
        "has no line 'focal = …'",
    ),
    "camera number": (lambda p: read_ign_camera(p, 4.0), CAMERA.replace("8500.00", "x"), 3, "'x' is not a number"),
    "camera focal": (lambda p: read_ign_camera(p, 4.0), CAMERA.replace("30975.00", "0"), 4, "0 is not possible here"),
    "camera width": (
        lambda p: read_ign_camera(p, 4.0),
        CAMERA.replace("26460", "26460.5"),
        5,
        "26460.5 is not possible",
    ),
}


@pytest.mark.parametrize(("reader", "content", "line", "says"), WRONG.values(), ids=WRONG)
def test_errors(tmp_path, reader, content, line, says):
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        reader(write(tmp_path, "bad", content))
    assert caught.value.line == line


def test_folder_with_two_orientation_files(tmp_path):
    write(tmp_path, "a.OPK", OPK)
    write(tmp_path, "b.opk", OPK)
    with pytest.raises(InputError, match=r"holds 2 files \.opk"):
        read_project(Request(str(tmp_path), "x"))
