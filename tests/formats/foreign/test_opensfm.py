"""OpenSfM: conventions on a reconstruction computed by hand, there and back, damaged files."""

from __future__ import annotations

import copy
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from oriented_sample import CAMERA, oriented_sample, prediction

import aerotri
from aerotri.conventions import InputError
from aerotri.formats.foreign.opensfm import is_opensfm, read_opensfm, write_opensfm
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Prior

# cameras look down from 10 over the origin and over (1, 0): half a turn about x brings world axes to theirs
CONTENT = [
    {
        "cameras": {
            "one": {"projection_type": "perspective", "width": 200, "height": 100, "focal": 0.5, "k1": 0.1, "k2": 0.0},
            "two": {
                "projection_type": "brown", "width": 200, "height": 100, "focal_x": 0.5, "focal_y": 0.51, "c_x": 0.01,
                "c_y": -0.02, "k1": 0.1, "k2": 0.0, "p1": 1e-3, "p2": 2e-3, "k3": 0.0,
            },
        },
        "shots": {
            "a.jpg": {
                "camera": "one", "rotation": [math.pi, 0, 0], "translation": [0, 0, 10], "gps_position": [0, 0, 10.1],
                "gps_dop": 0.5,
            },
            "b.jpg": {"camera": "two", "rotation": [math.pi, 0, 0], "translation": [-1, 0, 10]},
        },
        "points": {"7": {"coordinates": [1, 2, 0], "color": [1, 2, 3]}, "9": {"coordinates": [0.5, 0, 1]}},
        "reference_lla": {"latitude": 14.5, "longitude": 101.0, "altitude": 0.0},
    },
    {"cameras": {}, "shots": {"z.jpg": {}}, "points": {}},
]  # fmt: skip
# p = (0.1, −0.2) in a frame with y down, 1 + 0.1·0.05 = 1.005
TRACKS = """\
OPENSFM_TRACKS_VERSION_v2
a.jpg\t7\t0\t0.05025\t-0.1005\t0.004\t1\t2\t3\t-1\t-1
b.jpg\t7\t1\t0.0\t0.0\t0.004\t1\t2\t3\t-1\t-1
a.jpg\t9\t2\t0.02\t0.0\t0.004\t1\t2\t3\t-1\t-1
z.jpg\t7\t3\t0.02\t0.0\t0.004\t1\t2\t3\t-1\t-1
"""  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    def write(content=CONTENT, tracks=TRACKS):
        text = content if isinstance(content, str) else json.dumps(content)
        (tmp_path / "reconstruction.json").write_text(text)
        if tracks is not None:
            (tmp_path / "tracks.csv").write_text(tracks)
        return tmp_path

    return write


def test_conventions(folder):
    reading = read_opensfm(folder(), pixel_um=5.0)
    block = reading.block
    assert block.images.names.tolist() == ["a.jpg", "b.jpg"]
    np.testing.assert_allclose(block.images.centre, [[0, 0, 10], [1, 0, 10]], atol=1e-12)
    np.testing.assert_allclose(rotation_from_angles(block.images.angles), np.tile(np.eye(3), (2, 1, 1)), atol=1e-12)
    one, two = block.cameras
    assert one.focal_length_mm == pytest.approx(0.5 * 200 * 0.005)
    held = {name: Prior(0.0, fixed=True) for name in ("p1", "p2", "k3")}
    assert one.lens == {"k1": Prior(0.1), "k2": Prior(0.0)} | held
    np.testing.assert_allclose(two.principal_point_mm, [0.01 * 200 * 0.005, 0.02 * 200 * 0.005])
    assert two.brown["b1"].value == pytest.approx(0.51 / 0.5 - 1)
    assert (two.lens["p1"].value, two.lens["p2"].value) == (-1e-3, 2e-3)
    # parts of 200 pixels, y down
    np.testing.assert_allclose(block.image_points.xy[0], [0.05025, 0.1005])
    np.testing.assert_allclose(prediction(block, reading.points)[0], [0.05025, 0.1005], rtol=1e-12)
    assert block.points[block.image_points.point].tolist() == ["7", "7", "9"]
    assert block.gnss_ins is not None
    np.testing.assert_array_equal(block.gnss_ins.xyz, [[0, 0, 10.1]])
    np.testing.assert_array_equal(block.gnss_ins.sigma, [[0.5] * 3])
    assert reading.messages == (
        "left out: 1 smaller reconstruction with 1 photograph",
        "left out: 1 image point of other photographs, or without object point",
        "1 GNSS position used as observations, with gps_dop as standard deviation",
        "coordinates are local, around latitude 14.5, longitude 101, height 0 m",
    )
    assert is_opensfm(folder())


def test_cameras_that_opensfm_held_are_unknowns(folder):
    """And with --free-interior the principal point, too."""
    place = folder()
    (place / "config.yaml").write_text("processes: 4\noptimize_camera_parameters: no\n")
    reading = aerotri.read(place)
    assert "OpenSfM held focal lengths and lens (optimize_camera_parameters: no); here they are unknowns" in (
        reading.messages
    )
    assert [camera.interior["x0_mm"].fixed for camera in reading.block.cameras] == [True, True]
    free = aerotri.read(place, free_interior=True).block
    assert not any(prior.fixed for camera in free.cameras for prior in camera.interior.values())
    with pytest.raises(InputError, match="has cameras of its own"):
        aerotri.read(place, focal_length_mm=3.0)


def test_tracks_of_other_versions_and_none(folder):
    rows = "\n".join("\t".join(line.split("\t")[:5]) for line in TRACKS.splitlines()[1:])
    assert len(read_opensfm(folder(tracks=rows)).block.image_points) == 3
    (folder(tracks=None) / "tracks.csv").unlink()
    reading = read_opensfm(folder(tracks=None))
    assert len(reading.block.image_points) == 0
    assert "there is no tracks.csv beside reconstruction.json: no image points" in reading.messages


@pytest.mark.parametrize("lens", [{}, {"k1": -0.05, "k2": 0.01}, {"k1": -0.05, "p1": 1e-3, "p2": -2e-3, "k3": 0.01}])
@pytest.mark.parametrize("more", [False, True])
def test_there_and_back(tmp_path, lens, more):
    camera = replace(CAMERA, lens={name: Prior(value) for name, value in lens.items()})
    if more:
        interior = CAMERA.interior | {"x0_mm": Prior(0.3, fixed=True), "y0_mm": Prior(-0.2, fixed=True)}
        camera = replace(camera, interior=interior, brown={"b1": Prior(2e-3)})
    oriented = oriented_sample(camera)
    xy = prediction(oriented.block, oriented.points)
    oriented = replace(
        oriented, block=replace(oriented.block, image_points=replace(oriented.block.image_points, xy=xy))
    )
    write_opensfm(oriented, tmp_path / "model")
    kind = json.loads((tmp_path / "model" / "reconstruction.json").read_text())[0]["cameras"]["cam"]["projection_type"]
    assert kind == ("brown" if more or "p1" in lens else "perspective")
    reading = read_opensfm(tmp_path / "model", 5.0)
    again = reading.block
    assert reading.points is not None
    assert again.images.names.tolist() == oriented.block.images.names.tolist()
    np.testing.assert_allclose(again.images.centre, oriented.centre, rtol=0, atol=1e-9)
    np.testing.assert_allclose(rotation_from_angles(again.images.angles), oriented.rotation, rtol=0, atol=1e-13)
    np.testing.assert_allclose(again.image_points.xy, xy, rtol=0, atol=1e-12)
    np.testing.assert_allclose(again.image_points.xy, prediction(again, reading.points), rtol=0, atol=1e-9)
    assert again.cameras[0].size_px == (8000, 6000)


def test_brown_is_taken_off_the_image_points(tmp_path):
    oriented = oriented_sample(replace(CAMERA, brown={"K1": Prior(1e-7)}))
    said = write_opensfm(oriented, tmp_path / "model")
    assert said[-1] == "image points are written free of the additional parameters, which OpenSfM has no words for"
    again = read_opensfm(tmp_path / "model", 5.0).block
    x, y = oriented.block.image_points.xy[0]
    np.testing.assert_allclose(again.image_points.xy[0], np.array([x, y]) * (1 + 1e-7 * (x * x + y * y)), rtol=1e-12)


def changed(*path, to):
    """The reconstruction with one value changed, or removed where `to` is None."""
    content = copy.deepcopy(CONTENT)
    place = content[0]
    for key in path[:-1]:
        place = place[key]
    if to is None:
        del place[path[-1]]
    else:
        place[path[-1]] = to
    return content


WRONG = {
    "not json": (json.dumps(CONTENT)[:-20], "is not JSON"),
    "nan": (json.dumps(CONTENT).replace("0.51", "NaN"), "cameras.two.focal_y: nan is not possible"),
    "infinite": (json.dumps(CONTENT).replace("0.51", "1e999"), "cameras.two.focal_y: inf is not possible"),
    "digits": (json.dumps(CONTENT).replace("0.51", "1" * 5000), "focal_y: inf is not possible"),
    "deep": ("[" * 100000, "is not JSON that can be read"),
    "no list": ("{}", "holds no reconstruction"),
    "empty": ("[]", "holds no reconstruction"),
    "no table": ("[1]", "reconstruction 0: is no table"),
    "no shots": (changed("shots", to={}), "reconstruction 1.cameras: is empty"),
    "spherical": (changed("cameras", "one", "projection_type", to="spherical"), "spherical cannot be expressed"),
    "type": (changed("cameras", "one", "projection_type", to=3), "projection_type: is no text"),
    "width": (changed("cameras", "one", "width", to=0.5), "width and height are no format"),
    "focal": (changed("cameras", "one", "focal", to=-1), "a focal length is not greater than 0"),
    "no focal": (changed("cameras", "one", "focal", to=None), "reconstruction 0.cameras.one: has no focal"),
    "camera": (changed("shots", "a.jpg", "camera", to="three"), "there is no camera 'three'"),
    "rotation": (changed("shots", "a.jpg", "rotation", to=[1, 2]), "rotation: is no list of 3 numbers"),
    "translation": (changed("shots", "a.jpg", "translation", to=[1, 2, "x"]), "translation[2]: is not a number"),
    "boolean": (changed("shots", "a.jpg", "translation", to=[1, 2, True]), "translation[2]: is not a number"),
    "dop": (changed("shots", "a.jpg", "gps_dop", to=0), "gps_dop is not greater than 0"),
    "points": (changed("points", to=[1]), "points: is no table"),
    "coordinates": (changed("points", "7", "coordinates", to=None), "points.7: has no coordinates"),
}


@pytest.mark.parametrize(("content", "says"), WRONG.values(), ids=WRONG)
def test_errors(folder, content, says):
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        read_opensfm(folder(content))
    assert caught.value.remedy


def test_line_of_damaged_json(folder):
    with pytest.raises(InputError, match="is not JSON") as caught:
        read_opensfm(folder(json.dumps(CONTENT, indent=1).replace('"a.jpg": {', '"a.jpg" {')))
    assert caught.value.line == 28


WRONG_TRACKS = {
    "cells": (TRACKS.replace("a.jpg\t9\t2\t0.02\t", "a.jpg\t9 2 0.02 "), 4, "cells"),
    "number": (TRACKS.replace("-0.1005", "0,1"), 2, "'0,1' is not a number"),
    "outside": (TRACKS.replace("-0.1005", "-10.05"), 2, "outside of its image"),
    "twice": (TRACKS.replace("a.jpg\t9", "a.jpg\t7"), 4, "track '7' in photograph 'a.jpg' is there twice"),
}


@pytest.mark.parametrize(("tracks", "line", "says"), WRONG_TRACKS.values(), ids=WRONG_TRACKS)
def test_errors_of_tracks(folder, tracks, line, says):
    if says == "cells":
        tracks = "\n".join(line[:12] if n == 3 else line for n, line in enumerate(TRACKS.splitlines()))
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        read_opensfm(folder(tracks=tracks))
    assert caught.value.line == line


@pytest.mark.parametrize("change", ["empty", "missing"])
def test_orientations_without_object_points(tmp_path, change):
    """The tracks are points all the same; the adjustment places them."""
    oriented = oriented_sample()
    write_opensfm(oriented, tmp_path / "x")
    content = json.loads((tmp_path / "x" / "reconstruction.json").read_text())
    content[0] |= {"points": {}}
    if change == "missing":
        del content[0]["points"]
    (tmp_path / "x" / "reconstruction.json").write_text(json.dumps(content))
    reading = read_opensfm(tmp_path / "x", 5.0)
    assert len(reading.block.image_points) == len(oriented.block.image_points)
    assert reading.points is not None
    assert np.isnan(reading.points).all()
    assert "holds no object points: those of tracks.csv are placed anew" in reading.messages
