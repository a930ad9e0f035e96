"""OpenSfM's ground_control_points.json beside a reconstruction, by the formulas of its documentation."""

from __future__ import annotations

import json

import numpy as np
import pytest
from oriented_sample import CAMERA, oriented_sample

import aerotri
from aerotri.conventions import InputError, px_from_mm
from aerotri.formats.assembly.kinds import CONTROL, kind_of
from aerotri.formats.foreign.opensfm import write_opensfm
from aerotri.formats.foreign.opensfm_gcp import read_opensfm_gcp
from formats.foreign.metashape_sample import LAT, LON, earth_centred

GCP = {
    "points": [
        {
            "id": "gcp_01",
            "position": {"latitude": 48.7, "longitude": 9.2, "altitude": 350.5},
            "observations": [
                {"shot_id": "p0.jpg", "projection": [0.01, -0.2]}, {"shot_id": "p1.jpg", "projection": [0, 0.1]},
            ],
        },
        {
            "id": "gcp_02", "position": {"latitude": 48.701, "longitude": 9.201}, "observations": [],
            "role": "METRICS_ONLY",
        },
        {"id": 3, "observations": [{"shot_id": "p0.jpg", "projection": [0.1, 0.1]}]},
    ]
}  # fmt: skip


@pytest.fixture
def write(tmp_path):
    def one(content=GCP):
        path = tmp_path / "ground_control_points.json"
        path.write_text(content if isinstance(content, str) else json.dumps(content))
        return path

    return one


def test_a_list(write):
    path = write()
    assert kind_of(path, CONTROL) == "opensfm-gcp"
    found = read_opensfm_gcp(path)
    assert (found.points.tolist(), found.is_check.tolist()) == (["gcp_01", "gcp_02"], [False, True])
    np.testing.assert_array_equal(found.xyz, [[9.2, 48.7, 350.5], [9.201, 48.701, np.nan]])
    assert (found.crs, found.heights) == ("EPSG:4326", "ellipsoidal")
    assert found.messages == ("ground_control_points.json: 1 point without position: not control points",)
    rays = found.rays
    assert rays is not None
    assert rays.images[rays.image].tolist() == ["p0.jpg", "p1.jpg", "p0.jpg"]
    assert rays.points[rays.point].tolist() == ["gcp_01", "gcp_01", "3"]


def test_positions_in_metres(write):
    points = [{"id": "a", "position": {"x": 2.6e6, "y": 1.2e6, "z": 400.0}, "observations": []}]
    found = read_opensfm_gcp(write({"crs": "EPSG:2056", "points": points}))
    assert found.crs == "EPSG:2056"
    np.testing.assert_array_equal(found.xyz, [[2.6e6, 1.2e6, 400.0]])


def test_beside_a_reconstruction(tmp_path):
    """The image points of control points fit a reconstruction whose axes are at a place on the earth."""
    oriented = oriented_sample()
    shift = np.array([1100.0, 2050.0, 0.0])
    write_opensfm(oriented, tmp_path / "x")
    content = json.loads((tmp_path / "x" / "reconstruction.json").read_text())
    content[0]["reference_lla"] = {"latitude": LAT, "longitude": LON, "altitude": 350.0}
    for shot in content[0]["shots"].values():
        turn = rotation(np.array(shot["rotation"]))
        shot["translation"] = (np.array(shot["translation"]) + turn @ shift).tolist()
    for point in content[0]["points"].values():
        point["coordinates"] = (np.array(point["coordinates"]) - shift).tolist()
    (tmp_path / "x" / "reconstruction.json").write_text(json.dumps(content))
    points = []
    block, rays = oriented.block, oriented.block.image_points
    for place, name in zip(oriented.points[:5] - shift, ["a", "b", "c", "d", "e"], strict=True):
        lon, lat, height = geographic(earth_centred(place))
        row = int(np.flatnonzero((oriented.points - shift == place).all(axis=1))[0])
        observed = []
        for k in np.flatnonzero(rays.point == row).tolist():
            column_row = px_from_mm(rays.xy[k], CAMERA.size_px, CAMERA.pixel_mm)
            projection = (column_row - np.array(CAMERA.size_px) / 2) / max(CAMERA.size_px)
            observed.append({"shot_id": str(block.images.names[rays.image[k]]), "projection": projection.tolist()})
        position = {"latitude": lat, "longitude": lon, "altitude": height}
        points.append({"id": name, "position": position, "observations": observed})
    path = tmp_path / "x" / "ground_control_points.json"
    path.write_text(json.dumps({"points": points}))
    alone = aerotri.read(tmp_path / "x", pixel_um=5.0)
    assert any(text.startswith("ground_control_points.json beside it is not read") for text in alone.messages)
    reading = aerotri.read(tmp_path / "x", pixel_um=5.0, control=str(path), control_sigma_m=(0.02, 0.02, 0.03))
    assert reading.block.crs == "EPSG:32632"
    assert len(reading.block.control) == 5
    fit = [text for text in reading.messages if "image points of control points fit" in text]
    assert float(fit[0].split(" to ")[1].split()[0]) < 1e-2
    assert not any("is not read" in text for text in reading.messages)


def rotation(vector: np.ndarray) -> np.ndarray:
    """Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def geographic(xyz: np.ndarray) -> tuple[float, float, float]:
    """Longitude, latitude, height on WGS 84 by iteration."""
    a, f = 6378137.0, 1.0 / 298.257223563
    e2, p = f * (2 - f), np.hypot(xyz[0], xyz[1])
    lat = np.arctan2(xyz[2], p * (1 - e2))
    for _ in range(10):
        n = a / np.sqrt(1 - e2 * np.sin(lat) ** 2)
        height = p / np.cos(lat) - n
        lat = np.arctan2(xyz[2], p * (1 - e2 * n / (n + height)))
    return float(np.degrees(np.arctan2(xyz[1], xyz[0]))), float(np.degrees(lat)), float(height)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"role": "spare"}, "the role 'spare' is not known"),
        ({"position": {"latitude": 4870.0, "longitude": 9.2}}, "no longitude and latitude"),
        ({"position": {"latitude": 48.7}}, "has no longitude"),
        ({"position": {"latitude": "48.7", "longitude": 9.2}}, "is not a number"),
        ({"observations": {}}, "is no list"),
        ({"observations": [{"shot_id": "a", "projection": [0.1]}]}, "is no list of 2 numbers"),
        ({"observations": [{"shot_id": "a"}, {"shot_id": "a"}]}, "twice in photograph 'a'"),
        ({"id": "gcp_02"}, "called 'gcp_02'"),
        ({"id": " "}, "cannot be the name"),
        ({"observations": [{"projection": [0.1, 0.1]}]}, "has no shot_id"),
    ],
)
def test_errors(write, change, says):
    content = json.loads(json.dumps(GCP))
    content["points"][0] |= change
    path = write(content)
    with pytest.raises(InputError, match=says) as caught:
        read_opensfm_gcp(path)
    assert caught.value.file == path
    assert caught.value.remedy
    assert "reconstruction" not in caught.value.remedy


def test_a_position_that_is_empty_is_none(write):
    content = json.loads(json.dumps(GCP))
    content["points"][0]["position"] = {}
    assert read_opensfm_gcp(write(content)).points.tolist() == ["gcp_02"]
