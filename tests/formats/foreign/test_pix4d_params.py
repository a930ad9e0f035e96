"""Pix4D's calibrated cameras: its knowledge base's formulas by hand, rows of real files, and what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest

import aerotri
from aerotri.conventions import InputError, px_from_mm
from aerotri.formats.assembly.camera_spec import CameraSpec, cameras_of
from aerotri.formats.convert import detect_format
from aerotri.formats.foreign.pix4d_params import read_pix4d_camera, read_pix4d_params
from aerotri.functional_model.additional_parameters import lens
from aerotri.functional_model.rotation import rotation_from_angles
from formats.foreign.metashape_sample import ANGLES, CENTRES

TITLE = """\
fileName imageWidth imageHeight
camera matrix K [3x3]
radial distortion [3x1]
tangential distortion [2x1]
camera position t [3x1]
camera rotation R [3x3]
camera model m = K [R|-Rt] X

"""
REAL = (
    TITLE
    + """\
P1000852_1400496954965.JPG 4592 3448
3837.04710692373510028119 0 2287.77960528229596093297
0 3837.04710692373510028119 1742.83970496531173921539
0 0 1
-0.04930618424089858870 0.04239222797251372687 -0.02928533838596112174
0.00028446432839522286 -0.00085023797648524325
53.81054947407682931271 2.73450993122391761148 109.15739203396617540420
-0.30242406816031625061 -0.95203343934820727767 0.04660486412583432492
-0.95061868820348527365 0.30483019730717991758 0.05833232764043053825
-0.06974089643565797858 -0.02666235496892283355 -0.99720876760679444395
"""
)
CAM = """\
Pix4D camera calibration file 0

#Focal Length mm assuming a sensor width of 17.49998592000000030566x13.12498944000000200560mm
F 15.01175404934517487732
#Principal Point mm
Px 8.48210511970419922534
Py 6.33434629978042273990
#Symmetrical Lens Distortion Coeffs
K1 0.03833474118270804865
K2 -0.01750917966495743258
K3 0.02049798716391852335
#Tangential Lens Distortion Coeffs
T1 0.00240851666319534747
T2 0.00292562392135245920
"""
SIZE, K, R, T = (4000, 3000), (2400.5, 2011.75, 1491.0), (-0.05, 0.01, -0.002), (1e-3, -2e-3)
NAMES = ("DJI_0.JPG", "DJI_1.JPG", "DJI_2.JPG")
OFFSET = np.array([500000.0, 5400000.0, 300.0])


def project(x: np.ndarray, centre: np.ndarray, camera_from_world: np.ndarray) -> np.ndarray:
    """(n, 2) pixels by m = K·R·(X − t) and OpenCV's distortion."""
    u, v, w = camera_from_world @ (x - centre).T
    u, v = u / w, v / w
    r2 = u * u + v * v
    radial = 1 + R[0] * r2 + R[1] * r2**2 + R[2] * r2**3
    a = radial * u + 2 * T[0] * u * v + T[1] * (r2 + 2 * u * u)
    b = radial * v + 2 * T[1] * u * v + T[0] * (r2 + 2 * v * v)
    return np.column_stack([K[0] * a + K[1], K[0] * b + K[2]])


def params() -> str:
    text = TITLE
    down = np.diag([1.0, -1.0, -1.0])
    for k, name in enumerate(NAMES):
        turn = down @ rotation_from_angles(ANGLES)[k].T
        rows = [f"{K[0]} 0 {K[1]}", f"0 {K[0]} {K[2]}", "0 0 1", " ".join(map(str, R)), " ".join(map(str, T))]
        rows += [" ".join(map(repr, CENTRES[k].tolist())), *(" ".join(map(repr, row)) for row in turn.tolist())]
        text += "\n".join([f"{name} {SIZE[0]} {SIZE[1]}", *rows, ""])
    return text


def test_a_project(tmp_path):
    """Cameras, orientations and the files beside; image points of another file fit them."""
    path = tmp_path / "site_calibrated_camera_parameters.txt"
    path.write_text(params())
    (tmp_path / "site_offset.xyz").write_text(" ".join(map(str, OFFSET)))
    (tmp_path / "site_calibrated_internal_camera_parameters.cam").write_text(
        CAM.replace("17.49998592000000030566x13.12498944000000200560", "16.0x12.0")
    )
    assert detect_format(path) == "pix4d-params"
    points = np.array([[10.0, 5, 0], [30, 8, 1], [20, -5, -1], [45, 3, 2], [60, 1, 0], [25, 15, 1.5]])
    turns = np.diag([1.0, -1.0, -1.0]) @ rotation_from_angles(ANGLES).transpose(0, 2, 1)
    lines = []
    for k, name in enumerate(NAMES):
        px = project(points, CENTRES[k], turns[k])
        inside = ((px > 0) & (px < SIZE)).all(axis=1)
        mm = (px - np.array(SIZE) / 2) * [0.004, -0.004]
        lines.append(f"{name} P1")
        lines += [f"{j} {x!r} {y!r}" for j, (x, y) in enumerate(mm.tolist()) if inside[j]] + ["-99"]
    (tmp_path / "tp_bingo.txt").write_text("\n".join(lines) + "\n")
    reading = aerotri.read(path, image_points=[f"bingo:{tmp_path / 'tp_bingo.txt'}"], crs="EPSG:25832")
    block = reading.block
    np.testing.assert_allclose(block.images.centre, CENTRES[:3] + OFFSET)
    assert block.cameras[0].pixel_um == pytest.approx(4.0)
    assert len(block.image_points) > 8
    said = "\n".join(reading.messages)
    assert "offset of site_offset.xyz added" in said
    fit = re.search(r"fit the given orientations to (\S+) px", said)
    assert fit is not None
    assert float(fit[1]) < 0.02


def test_rows_of_a_real_file(tmp_path):
    """The photograph looks down; the lens is OpenCV's."""
    path = tmp_path / "x.txt"
    path.write_text(REAL)
    reading = read_pix4d_params(path, pixel_um=3.77)
    block = reading.block
    rotation = rotation_from_angles(block.images.angles)[0]
    np.testing.assert_allclose(
        -rotation[:, 2], [-0.06974089643565797, -0.02666235496892283, -0.997208767606794], atol=1e-8
    )
    np.testing.assert_allclose(block.images.centre, [[53.810549474, 2.734509931, 109.157392034]])
    (camera,) = block.cameras
    column_row = px_from_mm(np.array(camera.principal_point_mm), camera.size_px, camera.pixel_mm)
    np.testing.assert_allclose(column_row, [2287.779605282296, 1742.8397049653117])
    bent = lens.distort(np.array([0.3]), np.array([-0.2]), lens.vector_of(camera))[0]
    # u = 0.3, v = 0.2 with y down
    r2, k, t = 0.13, (-0.0493061842, 0.0423922280, -0.0292853384), (0.000284464328, -0.000850237976)
    radial = 1 + k[0] * r2 + k[1] * r2**2 + k[2] * r2**3
    expected = [0.3 * radial + 0.12 * t[0] + t[1] * 0.31, 0.2 * radial + 0.12 * t[1] + t[0] * 0.21]
    np.testing.assert_allclose(bent, [expected[0], -expected[1]], rtol=1e-8)
    assert any("there is no _offset.xyz" in text for text in reading.messages)


def test_a_calibration(tmp_path):
    """A real .cam: the same camera in pixels as in the list of its project, 4608 × 3456."""
    path = tmp_path / "maize.cam"
    path.write_text(CAM)
    pixel_um = 17.49998592 / 4608 * 1e3
    (camera,) = cameras_of(CameraSpec(path, pixel_um=pixel_um), (), np.zeros(0, str), np.zeros(0))
    assert camera.size_px == (4608, 3456)
    assert camera.focal_length_mm / camera.pixel_mm == pytest.approx(3952.81247514184, rel=1e-9)
    column_row = px_from_mm(np.array(camera.principal_point_mm), camera.size_px, camera.pixel_mm)
    np.testing.assert_allclose(column_row, [2233.4612479272, 1667.9252133585], rtol=1e-9)
    assert camera.interior["focal_length_mm"].fixed
    assert {name: prior.value for name, prior in camera.lens.items()} == {
        "k1": 0.03833474118270804865, "k2": -0.01750917966495743258, "k3": 0.02049798716391852335,
        "p1": -0.00240851666319534747, "p2": 0.00292562392135245920,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("2400.5 0 2011.75", "2400.5 1 2011.75", "skew"),
        ("2400.5 0 2011.75", "2400.5 0", "is no row of 3 numbers"),
        ("2400.5 0 2011.75", "-2400.5 0 2011.75", "values that no camera has"),
        ("4000 3000", "4000 x", "holds no photographs|is no row of name, width and height"),
        ("DJI_2.JPG", "DJI_1.JPG", "called 'DJI_1.JPG'"),
        ("fileName ", "file ", "does not begin with fileName"),
        ("40.0 0.0 101.0", "40.0 0.0 nan", "is no row of 3 numbers"),
    ],
)
def test_what_is_refused(tmp_path, old, new, says):
    path = tmp_path / "x.txt"
    text = params()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=says) as caught:
        read_pix4d_params(path)
    assert caught.value.file == path
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("sensor width of", "sensor of", "size of the sensor"),
        ("T2 0.0029", "C 0.0029", "is not understood"),
        ("T2 0.00292562392135245920\n", "", "holds no T2"),
        ("F 15", "F -15", "values that no camera has"),
        ("#Principal", "Pix4D camera calibration file 1\n#Principal", "holds 2 cameras"),
    ],
)
def test_calibrations_that_are_refused(tmp_path, old, new, says):
    path = tmp_path / "x.cam"
    assert old in CAM
    path.write_text(CAM.replace(old, new))
    with pytest.raises(InputError, match=says) as caught:
        read_pix4d_camera(path, 3.8)
    assert caught.value.remedy
