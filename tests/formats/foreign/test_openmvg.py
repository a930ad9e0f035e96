"""sfm_data of OpenMVG and AliceVision: the layout of real files, lenses by OpenCV's formulas, and what is refused."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import aerotri
from aerotri.conventions import InputError
from aerotri.formats.convert import detect_format
from aerotri.formats.foreign.alicevision import read_alicevision
from aerotri.formats.foreign.openmvg import read_openmvg
from aerotri.functional_model.rotation import rotation_from_angles
from formats.foreign.metashape_sample import ANGLES, CENTRES, Sample

SIZE, FOCAL, CENTRE = (4000, 3000), 2400.5, (2011.75, 1491.0)
K, T, F = (-0.05, 0.01, -0.002), (1e-3, -2e-3), (0.02, -0.003, 0.001, -0.0002)
POINTS = Sample().points
DOWN = np.diag([1.0, -1.0, -1.0])
CAMERA_FROM_WORLD = [DOWN @ turn.T for turn in rotation_from_angles(ANGLES)]


def pixels(k: int, kind: str) -> np.ndarray:
    """(n, 2) of the points in a photograph."""
    x, y, z = CAMERA_FROM_WORLD[k] @ (POINTS - CENTRES[k]).T
    u, v = x / z, y / z
    if kind in ("fisheye", "equidistant"):
        r, lens = np.hypot(u, v), F if kind == "fisheye" else ()
        theta = np.arctan(r)
        scale = theta * (1 + sum(f * theta ** (2 * i + 2) for i, f in enumerate(lens))) / r
        return np.column_stack([FOCAL * scale * u + CENTRE[0], FOCAL * scale * v + CENTRE[1]])
    t1, t2 = T if kind == "brown" else (0.0, 0.0)
    r2 = u * u + v * v
    radial = 1 + K[0] * r2 + K[1] * r2**2 + K[2] * r2**3
    a = radial * u + 2 * t1 * u * v + t2 * (r2 + 2 * u * u)
    b = radial * v + 2 * t2 * u * v + t1 * (r2 + 2 * v * v)
    return np.column_stack([FOCAL * a + CENTRE[0], FOCAL * b + CENTRE[1]])


def observations(kind: str) -> list[list[tuple[int, float, float]]]:
    """Photograph and pixels of every point."""
    px = np.array([pixels(k, kind) for k in range(6)])
    inside = ((px > 0) & (px < SIZE)).all(axis=2)
    return [[(k, *px[k, j].tolist()) for k in np.flatnonzero(inside[:, j]).tolist()] for j in range(len(POINTS))]


def openmvg(kind: str = "brown", control: int = 4) -> dict:
    """As OpenMVG's cereal writes it."""
    own = {"width": SIZE[0], "height": SIZE[1], "focal_length": FOCAL, "principal_point": list(CENTRE)}
    data = {
        "brown": {"value0": own, "disto_t2": [*K, *T]}, "radial": own | {"disto_k3": list(K)},
        "fisheye": {"value0": own, "fisheye": list(F)},
    }[kind]  # fmt: skip
    views = [
        {"key": k, "value": {"polymorphic_id": 1073741824, "ptr_wrapper": {"id": 2147483649 + k, "data": {
            "local_path": "", "filename": f"DJI_{k}.JPG", "width": SIZE[0], "height": SIZE[1], "id_view": k,
            "id_intrinsic": 0, "id_pose": k}}}}
        for k in range(6)
    ]  # fmt: skip
    structure = [
        {"key": j, "value": {"X": POINTS[j].tolist(), "observations": [
            {"key": k, "value": {"id_feat": 0, "x": [x, y]}} for k, x, y in seen]}}
        for j, seen in enumerate(observations(kind))
    ]  # fmt: skip
    return {
        "sfm_data_version": "0.3", "root_path": "/photos", "views": views,
        "intrinsics": [{"key": 0, "value": {"polymorphic_id": 2147483649, "polymorphic_name": "x",
                                            "ptr_wrapper": {"id": 2147483660, "data": data}}}],
        "extrinsics": [{"key": k, "value": {"rotation": CAMERA_FROM_WORLD[k].tolist(), "center": CENTRES[k].tolist()}}
                       for k in range(6)],
        "structure": structure[control:], "control_points": structure[:control],
    }  # fmt: skip


def alicevision(old: bool = False, kind: str = "radial", control: int = 0) -> dict:
    """As AliceVision writes it, numbers as texts and matrices column by column."""
    camera = {"intrinsicId": "77", "width": str(SIZE[0]), "height": str(SIZE[1]), "type": "pinhole",
              "distortionType": "radialk3", "distortionParams": [str(k) for k in K], "locked": "false"}  # fmt: skip
    if old:
        camera |= {"type": "radial3", "pxFocalLength": str(FOCAL), "principalPoint": [str(c) for c in CENTRE]}
        del camera["distortionType"]
    else:
        offset = [str(c - side / 2) for c, side in zip(CENTRE, SIZE, strict=True)]
        camera |= {"sensorWidth": "13.2", "sensorHeight": "9.9", "focalLength": repr(FOCAL * 13.2 / SIZE[0]),
                   "pixelRatio": "1", "principalPoint": offset}  # fmt: skip
    if kind == "equidistant":
        camera |= {"type": kind, "distortionType": "none", "distortionParams": "",
                   "fisheyeCircleCenterX": "0", "fisheyeCircleCenterY": "0", "fisheyeCircleRadius": "1500"}  # fmt: skip
    points = [
        {"landmarkId": str(j), "descType": "sift", "X": [repr(v) for v in POINTS[j].tolist()],
         "observations": [{"observationId": str(100 + k), "featureId": "0", "x": [repr(x), repr(y)]}
                          for k, x, y in seen]} for j, seen in enumerate(observations(kind))
    ]  # fmt: skip
    return {
        "version": ["1", "0", "0"] if old else ["1", "2", "8"],
        "views": [{"viewId": str(100 + k), "poseId": str(100 + k), "intrinsicId": "77", "path": f"/photos/DJI_{k}.JPG"}
                  for k in range(6)],
        "intrinsics": [camera],
        "poses": [{"poseId": str(100 + k), "pose": {"transform": {
            "rotation": [repr(v) for v in CAMERA_FROM_WORLD[k].T.ravel().tolist()],
            "center": [repr(v) for v in CENTRES[k].tolist()]}, "locked": "0"}} for k in range(6)],
        "structure": points[control:], "controlPoints": points[:control],
    }  # fmt: skip


def check(reading, kind: str) -> None:
    block = reading.block
    assert block.images.names.tolist() == [f"DJI_{k}.JPG" for k in range(6)]
    np.testing.assert_allclose(block.images.centre, CENTRES, atol=1e-12)
    np.testing.assert_allclose(rotation_from_angles(block.images.angles), rotation_from_angles(ANGLES), atol=1e-9)
    assert len(block.image_points) == sum(map(len, observations(kind)))
    fit = [float(found[1]) for text in reading.messages if (found := re.search(r"fit the given \w+ to (\S+) px", text))]
    assert max(fit) < 1e-3


@pytest.mark.parametrize("kind", ["brown", "radial", "fisheye"])
def test_openmvg(tmp_path, kind):
    path = tmp_path / "sfm_data.json"
    path.write_text(json.dumps(openmvg(kind)))
    assert detect_format(path) == "openmvg"
    reading = aerotri.read(path, pixel_um=4.0)
    check(reading, kind)
    block = reading.block
    assert [str(block.points[k]) for k in block.control.point] == [f"control {k}" for k in range(4)]
    np.testing.assert_allclose(block.control.xyz, POINTS[:4])
    assert block.cameras[0].projection == ("fisheye" if kind == "fisheye" else "perspective")


def of_version_1_2_1() -> dict:
    """Focal lengths in pixels, principal points from the image centre."""
    content = alicevision() | {"version": ["1", "2", "1"]}
    camera = content["intrinsics"][0]
    camera["pxFocalLength"] = [camera.pop("focalLength") and repr(FOCAL)] * 2
    return content


def half_circle() -> dict:
    """An image circle of half the radius, in a sensor whose focal length is twice as long."""
    content = alicevision(kind="equidistant")
    content["intrinsics"][0] |= {"fisheyeCircleRadius": "750", "focalLength": repr(2 * FOCAL * 13.2 / SIZE[0])}
    return content


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        (alicevision(True), "radial"),
        (alicevision(), "radial"),
        (of_version_1_2_1(), "radial"),
        (alicevision(kind="equidistant"), "equidistant"),
        (half_circle(), "equidistant"),
    ],
    ids=["1.0.0", "1.2.8", "1.2.1", "equidistant", "half circle"],
)
def test_alicevision(tmp_path, content, kind):
    path = tmp_path / "sfm.abc.sfm"
    path.write_text(json.dumps(content))
    assert detect_format(path) == "alicevision"
    reading = aerotri.read(path, pixel_um=4.0)
    check(reading, kind)
    assert reading.block.cameras[0].projection == ("fisheye" if kind == "equidistant" else "perspective")


def test_control_points_of_alicevision(tmp_path):
    path = tmp_path / "x.sfm"
    path.write_text(json.dumps(alicevision(control=4) | {"surveyPoints": [{"X": ["1"]}]}))
    reading = read_alicevision(path)
    np.testing.assert_allclose(reading.block.control.xyz, POINTS[:4])
    assert "not used: surveyPoints" in reading.messages


@pytest.mark.parametrize("program", ["openmvg", "alicevision"])
def test_photographs_without_camera_and_positions(tmp_path, program):
    """A photograph without camera is left out, and does not stop the others."""
    content = openmvg() if program == "openmvg" else alicevision()
    if program == "openmvg":
        views = [view["value"]["ptr_wrapper"]["data"] for view in content["views"]]
        views[2]["id_intrinsic"] = 4294967295
        views[1] |= {"use_pose_center_prior": True, "center_weight": [1.0] * 3, "center": [1.0, 2.0, 3.0]}
    else:
        del content["views"][2]["intrinsicId"]
    path = tmp_path / "x.json"
    path.write_text(json.dumps(content))
    reading = aerotri.read(path)
    assert reading.block.images.names.tolist() == [f"DJI_{k}.JPG" for k in range(6) if k != 2]
    assert "left out: 1 photograph without a camera" in reading.messages
    said = any(text.startswith("not used: 1 position of photographs") for text in reading.messages)
    assert said == (program == "openmvg")


def test_views_without_pose_and_rigs(tmp_path):
    content = alicevision()
    content["views"][0]["rigId"] = "5"
    del content["poses"][1]
    content["structure"][0]["observations"][0]["observationId"] = "999"
    path = tmp_path / "x.sfm"
    path.write_text(json.dumps(content))
    reading = read_alicevision(path)
    assert np.isnan(reading.block.images.centre).any(axis=1).tolist() == [True, True, False, False, False, False]
    assert any("not used: rigs; 1 photograph" in text for text in reading.messages)
    assert any("left out: 1 image point" in text for text in reading.messages)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            lambda c: c["intrinsics"][0]["value"]["ptr_wrapper"].update(data={"width": 1, "height": 1}),
            "is it spherical",
        ),
        (lambda c: c["intrinsics"][0]["value"]["ptr_wrapper"]["data"].update(disto_x=[1]), "disto_x cannot"),
        (lambda c: c["views"][0]["value"]["ptr_wrapper"]["data"].update(id_intrinsic=3), "not described"),
        (lambda c: c["extrinsics"][0]["value"].update(rotation=[[1, 0, 0], [0, 2, 0], [0, 0, 1]]), "rotation is none"),
        (lambda c: c["extrinsics"][0]["value"].update(center=[1, 2]), "no list of 3"),
        (lambda c: c["structure"][0]["value"]["observations"][0]["value"].update(x=["a", 1]), "is not a number"),
        (lambda c: c["structure"].append(c["structure"][0]), "called '4'"),
        (lambda c: c.update(views=[]), "holds no photographs"),
    ],
)
def test_what_openmvg_is_refused(tmp_path, change, says):
    content = openmvg()
    change(content)
    path = tmp_path / "sfm_data.json"
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=says) as caught:
        read_openmvg(path)
    assert caught.value.file == path
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"distortionType": "3deanamorphic4"}, "type 3deanamorphic4"),
        ({"distortionParams": ["1", "2"]}, "cannot be expressed"),
        ({"sensorWidth": "-1"}, "no size of the sensor"),
        ({"focalLength": "1e300"}, "is not possible"),
        ({"width": "4000.5"}, "no format"),
        ({"type": "equirectangular"}, "type equirectangular"),
        ({"type": "equidistant"}, "equidistant camera with distortion"),
        ({"undistortionType": "radialk3", "undistortionParams": ["0.1", "0", "0"]}, "undistortion of type radialk3"),
    ],
)
def test_what_alicevision_is_refused(tmp_path, change, says):
    content = alicevision()
    content["intrinsics"][0] |= change
    path = tmp_path / "x.sfm"
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=says):
        read_alicevision(path)
