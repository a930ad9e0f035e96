"""Lists of orientations and cameras: Pix4D, Metashape, plain lists, columns by name."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from oriented_sample import oriented_sample

from aerotri.conventions import InputError
from aerotri.formats.assembly.kinds import ORIENTATIONS, kind_of
from aerotri.formats.foreign.metashape import read_metashape, write_metashape
from aerotri.formats.foreign.named_lists import read_named_orientations
from aerotri.formats.foreign.orientation_list import is_ortho_camera, read_orientation_list, read_ortho_camera
from aerotri.formats.foreign.pix4d import read_pix4d_eo, read_pix4d_offset, write_pix4d_eo
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles

EO = "imageName X Y Z Omega Phi Kappa\na 1.jpg 1 2 3 0.5 -0.25 90\nb.jpg 4 5 6 0 0 0\n"
OPK = "# Cameras (2)\n# PhotoID, X, Y, Z, Omega, Phi, Kappa, r11, r12, r13, r21, r22, r23, r31, r32, r33\n"
PLAIN = "a 1 2 3 0.5 -0.25 90\nb 4 5 6 0 0 0\n"
NAMED = "filename,y,x,z,omega,phi,kappa,flown\na,2,1,3,0.5,-0.25,90,x\nb,5,4,6,0,0,0,y\n"
YAML = """\
# a camera
camera:
  name: Some DMC         # its name
  type: pinhole
  im_size: [ 640, 1152 ]
  focal_len: 120.
  sensor_size: [ 92.160, 165.888 ]
  cx: 0.001
  cy: -0.002
ortho:
  crs:
"""


def rows(separator, matrix=None):
    """Two rows of Metashape's list."""
    angles = np.radians([[0.5, -0.25, 90.0], [0, 0, 0]])
    lines = []
    for name, xyz, rotation, degrees in zip(
        ("a b,1.jpg" if separator == "\t" else "a.jpg", "b.jpg"),
        ("1 2 3", "4 5 6"),
        rotation_from_angles(angles),
        np.degrees(angles),
        strict=True,
    ):
        given = rotation if matrix is None else matrix(rotation)
        words = [name, *xyz.split(), *(repr(float(v)) for v in degrees), *(f"{v:.10f}" for v in given.ravel())]
        lines.append(separator.join(words))
    return OPK + "\n".join(lines) + "\n"


def read(reader, tmp_path, text, name="file.txt", *arguments):
    path = tmp_path / name
    path.write_text(text)
    return reader(path, *arguments)


def assert_the_two(found):
    np.testing.assert_array_equal(found.centre, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_allclose(
        np.degrees(angles_from_rotation(found.rotation)), [[0.5, -0.25, 90], [0, 0, 0]], atol=1e-12
    )


def test_pix4d(tmp_path):
    found = read(read_pix4d_eo, tmp_path, EO)
    assert_the_two(found)
    assert found.images.tolist() == ["a 1.jpg", "b.jpg"]
    (tmp_path / "x_offset.xyz").write_text("100.000 200.000 0.000\n")
    offset = read_pix4d_offset(tmp_path / "x_offset.xyz")
    moved = read(read_pix4d_eo, tmp_path, EO, "again.txt", offset)
    np.testing.assert_array_equal(moved.centre[1], [104, 205, 6])
    with pytest.raises(InputError, match="is no offset"):
        read(read_pix4d_offset, tmp_path, "1 2\n")


@pytest.mark.parametrize("separator", ["\t", ", "])
@pytest.mark.parametrize("matrix", [None, np.transpose])
def test_metashape(tmp_path, separator, matrix):
    found = read(read_metashape, tmp_path, rows(separator, matrix))
    assert_the_two(found)
    assert found.images[0] == ("a b,1.jpg" if separator == "\t" else "a.jpg")


def test_metashape_without_orientation(tmp_path):
    text = OPK + "a.jpg\t\t\t\t\t\t\nb.jpg\t4\t5\t6\t0\t0\t0\n"
    found = read(read_metashape, tmp_path, text)
    assert found.images.tolist() == ["b.jpg"]
    assert found.messages == ("1 photograph without orientation left out",)


def test_plain_and_named(tmp_path):
    assert_the_two(read(read_orientation_list, tmp_path, PLAIN))
    found = read(read_named_orientations, tmp_path, NAMED)
    assert_the_two(found)
    assert found.messages == ("file.txt: columns not carried over: flown",)


@pytest.mark.parametrize(
    ("text", "kind"), [(EO, "pix4d-eo"), (rows("\t"), "metashape"), (PLAIN, "opk-list"), (NAMED, "opk-csv")]
)
def test_kinds_are_told(tmp_path, text, kind):
    (tmp_path / "file").write_text(text)
    assert kind_of(tmp_path / "file", ORIENTATIONS) == kind


@pytest.mark.parametrize(("writer", "reader"), [(write_pix4d_eo, read_pix4d_eo), (write_metashape, read_metashape)])
def test_there_and_back(tmp_path, writer, reader):
    oriented = oriented_sample(shift=(717000.0, 1606000.0, 0.0))
    rotation = oriented.rotation.copy()
    rotation[2] = np.nan
    lost = writer(replace(oriented, rotation=rotation), tmp_path / "out.txt")
    assert lost[-1] == "could not be carried over: 1 photograph without orientation"
    assert "could not be carried over: 74 image points" in lost
    found = reader(tmp_path / "out.txt")
    assert found.images.tolist() == ["p0.jpg", "p1.jpg", "p3.jpg"]
    np.testing.assert_allclose(found.centre, oriented.centre[[0, 1, 3]], rtol=0, atol=5.1e-7)
    np.testing.assert_allclose(found.rotation, oriented.rotation[[0, 1, 3]], rtol=0, atol=1e-12)
    with pytest.raises(InputError, match="has no orientations"):
        writer(replace(oriented, rotation=np.full((4, 3, 3), np.nan)), tmp_path / "none.txt")


def test_ngi(shared_data):
    """Four DMC photographs of South Africa; the list, its copy by orthority, and the camera from two files."""
    folder = shared_data("dmc_ngi")
    found = read_orientation_list(folder / "camera_pos_ori.txt")
    copied = read_named_orientations(folder / "io" / "ngi_xyz_opk.csv")
    assert found.images.tolist() == copied.images.tolist()
    np.testing.assert_allclose(found.centre, copied.centre, rtol=0, atol=5.1e-4)
    angles, rounded = (np.degrees(angles_from_rotation(one.rotation)) for one in (found, copied))
    np.testing.assert_allclose(angles, rounded, rtol=0, atol=5.1e-4)
    camera = read_ortho_camera(folder / "config.yaml")
    assert (camera.name, camera.size_px, camera.focal_length_mm) == ("Integraph DMC", (640, 1152), 120.0)
    assert camera.pixel_um == pytest.approx(144.0)
    assert is_ortho_camera(folder / "io" / "ngi_int_param.yaml")
    assert read_ortho_camera(folder / "io" / "ngi_int_param.yaml") == camera


def test_ortho_camera(tmp_path):
    camera = read(read_ortho_camera, tmp_path, YAML, "camera.yaml")
    assert camera.name == "Some DMC"
    # parts of the width, y down
    np.testing.assert_allclose(camera.principal_point_mm, [0.09216, 0.18432])


def metashape(path):
    return read_metashape(path)


WRONG = {
    "pix4d header": (read_pix4d_eo, EO.replace("Kappa", "Yaw"), 1, "does not begin with imageName"),
    "pix4d row": (read_pix4d_eo, EO.replace("b.jpg 4", "4"), 3, "has 6 entries"),
    "pix4d number": (read_pix4d_eo, EO.replace("-0.25", "x"), 2, "'x' is not a number"),
    "pix4d twice": (read_pix4d_eo, EO.replace("b.jpg", "a 1.jpg"), 3, "'a 1.jpg' is there twice"),
    "metashape empty": (metashape, OPK, 2, "holds no photographs"),
    "metashape row": (metashape, rows("\t").replace("\t4\t5", "\t4"), 4, "has 15 entries"),
    "metashape matrix": (metashape, rows("\t", lambda r: r * [1, -1, -1]), 3, "contradicts omega, phi, kappa"),
    "metashape number": (metashape, rows("\t").replace("\t4\t", "\t4m\t"), 4, "'4m' is not a number"),
    "metashape twice": (metashape, rows(", ").replace("b.jpg", "a.jpg"), 4, "'a.jpg' is there twice"),
    "plain empty": (read_orientation_list, "# nothing\n", 1, "holds no photographs"),
    "plain row": (read_orientation_list, PLAIN[:-3], 2, "has 6 entries"),
    "plain twice": (read_orientation_list, PLAIN.replace("b", "a"), 2, "'a' is there twice"),
    "named column": (read_named_orientations, NAMED.replace("kappa", "cappa"), 2, "a value is missing"),
    "named empty": (read_named_orientations, NAMED.replace(",90,", ",,"), 2, "a value is missing"),
    "named row": (read_named_orientations, NAMED[:-4], 3, "has 7 cells, the header has 8"),
    "yaml none": (read_ortho_camera, "a:\n  b: c\n", None, "describes no camera"),
    "yaml no entry": (read_ortho_camera, YAML.replace("  type: pinhole", "  pinhole"), 4, "is no entry"),
    "yaml type": (read_ortho_camera, YAML.replace("pinhole", "fisheye"), 4, "is of type 'fisheye'"),
    "yaml missing": (read_ortho_camera, YAML.replace("focal_len", "focal"), None, "has no focal_len"),
    "yaml size": (read_ortho_camera, YAML.replace("640, 1152", "640"), 5, "is not 2 numbers"),
    "yaml number": (read_ortho_camera, YAML.replace("120.", "x"), 6, "'x' is not a number"),
    "yaml zero": (read_ortho_camera, YAML.replace("120.", "0"), 5, "a size is not possible"),
    "yaml pixels": (read_ortho_camera, YAML.replace("165.888", "160"), 5, "not square"),
    "yaml half a pixel": (read_ortho_camera, YAML.replace("640,", "640.5,"), 5, "no whole number of pixels"),
}


@pytest.mark.parametrize(("reader", "content", "line", "says"), WRONG.values(), ids=WRONG)
def test_errors(tmp_path, reader, content, line, says):
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        read(reader, tmp_path, content, "bad.yaml")
    assert caught.value.line == line
