"""OPF projects: the specification's formulas by hand, systems and orders of axes, and what is refused."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import aerotri
from aerotri.conventions import InputError
from aerotri.formats.convert import detect_format
from aerotri.formats.foreign.opf import read_opf
from aerotri.functional_model.rotation import rotation_from_angles
from formats.foreign.opf_sample import OpfProject


def fit_px(messages) -> list[float]:
    return [float(found[1]) for text in messages if (found := re.search(r"fit the given \w+ to (\S+) px", text))]


@pytest.mark.parametrize(
    ("crs", "projected"), [("EPSG:25832", True), ("EPSG:25832", False), ("EPSG:3044", True), ("EPSG:3044", False)]
)
def test_a_project(tmp_path, crs, projected):
    """East or north first, places in degrees or as Pix4D projected them: one block on the ground."""
    sample = OpfProject(crs, projected)
    path = sample.write(tmp_path)
    assert detect_format(path) == detect_format(tmp_path) == "opf"
    reading = aerotri.read(path)
    block = reading.block
    assert block.crs == crs
    np.testing.assert_allclose(block.images.centre, sample.utm(sample.centre), rtol=0, atol=1e-6)
    np.testing.assert_allclose(rotation_from_angles(block.images.angles), sample.rotation, atol=1e-12)
    np.testing.assert_allclose(block.control.xyz, sample.utm(sample.points[55:]), rtol=0, atol=1e-4)
    # of the degrees north comes first, of what is projected the east
    np.testing.assert_allclose(block.control.sigma, np.tile([0.02, 0.01, 0.04], (5, 1)))
    assert block.control.is_check.tolist() == [False] * 4 + [True]
    assert block.gnss_ins is not None
    np.testing.assert_allclose(block.gnss_ins.xyz, sample.utm(sample.centre + 0.01), rtol=0, atol=1e-4)
    assert len(block.image_points) == int(sample.seen.sum())
    assert block.cameras[0].name == "DJI_FC6310"
    assert reading.points is not None
    order = [int(name[1:]) - 1 for name in block.points.tolist() if name[0] == "t"]
    np.testing.assert_allclose(reading.points[5:], sample.utm(sample.points[order]), rtol=0, atol=1e-3)
    # Pix4D takes the plane of the projection for straight: its scale of 0.9996 moves ground points half a pixel
    ties, control = fit_px(reading.messages)
    assert ties < 0.05
    assert control < 0.6
    assert any("6 orientations before the calibration" in text for text in reading.messages)


def test_it_adjusts(tmp_path):
    result = aerotri.adjust(aerotri.read(OpfProject().write(tmp_path)).block)
    assert result.status == "converged"


def test_a_fisheye(tmp_path):
    """Pix4D's polynomial has even powers of the angle: the nearest lens is taken, and the difference is said."""
    reading = aerotri.read(OpfProject(kind="fisheye").write(tmp_path))
    (camera,) = reading.block.cameras
    assert camera.projection == "fisheye"
    said = next(text for text in reading.messages if "nearest lens" in text)
    assert float(re.search(r"RMS (\S+) px", said)[1]) < 1.0
    assert max(fit_px(reading.messages)) < 1.0


def changed(files: dict[str, bytes], name: str, change) -> dict[str, bytes]:
    content = json.loads(files[name])
    change(content)
    return files | {name: json.dumps(content).encode()}


def write(folder, files: dict[str, bytes]) -> None:
    for name, raw in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(raw)


def set_in(*keys, value):
    def change(content):
        for key in keys[:-1]:
            content = content[key]
        content[keys[-1]] = value

    return change


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        ("calibrated-cameras.json", set_in("cameras", value=[]), "no calibrated photographs"),
        ("calibrated-cameras.json", set_in("cameras", 0, "sensor_id", value=3), "sensor 3 is not described"),
        ("calibrated-cameras.json", set_in("sensors", 0, "internals", "type", value="spherical"), "spherical camera"),
        ("calibrated-cameras.json", set_in("sensors", 0, "internals", "focal_length_px", value=-1), "no camera has"),
        ("calibrated-cameras.json", set_in("cameras", 0, "position", value=[1, 2]), "no list of 3 numbers"),
        ("calibrated-cameras.json", set_in("cameras", 0, "id", value=1.5), "is no whole number"),
        ("input-cameras.json", set_in("sensors", 0, "image_size_px", value=[4000]), "no list of 2 numbers"),
        ("input-cameras.json", set_in("sensors", 0, "image_size_px", value=[4000.5, 3000]), "no format"),
        ("input-cameras.json", set_in("captures", 0, "id", value=[1]), "is no identifier"),
        ("projected-input-cameras.json", set_in("captures", 0, "id", value=[1]), "is no identifier"),
        ("scene-reference-frame.json", set_in("base_to_canonical", "swap_xy", value=True), "counts east and north"),
        ("scene-reference-frame.json", set_in("crs", "definition", value="EPSG:5513"), "counts south and west"),
        ("camera-list.json", set_in("cameras", value=[]), "holds no photograph"),
        ("input-cameras.json", set_in("sensors", 0, "pixel_size_um", value=0), "size of a pixel"),
        ("scene-reference-frame.json", set_in("base_to_canonical", "scale", value=[1, 1, 2]), "to one unit"),
        ("scene-reference-frame.json", set_in("crs", "definition", value="EPSG:4326"), "counts in degrees"),
        ("scene-reference-frame.json", set_in("crs", "definition", value="nowhere"), "is not known"),
        ("input-control-points.json", set_in("gcps", 1, "id", value="gcp 0"), "called 'gcp 0'"),
        ("projected-control-points.json", set_in("projected_gcps", 0, "sigmas", value=[0, 1, 1]), "standard deviation"),
        ("tracks/tracks.gltf", set_in("accessors", 0, "count", value=99999), "is shorter than"),
        ("tracks/tracks.gltf", set_in("accessors", 2, "count", value=3), "ranges lead beyond"),
        ("tracks/tracks.gltf", set_in("buffers", 0, "uri", value="../../x.bin"), "below the folder"),
        ("tracks/tracks.gltf", set_in("buffers", 0, "uri", value="missing.bin"), "no such file"),
        ("project.opf", set_in("items", 0, "resources", 0, "uri", value="/etc/passwd"), "below the folder"),
        ("project.opf", set_in("items", value=[]), "names no files of"),
    ],
)
def test_what_is_refused(tmp_path, name, change, says):
    write(tmp_path, changed(OpfProject().files(), name, change))
    with pytest.raises(InputError, match=says) as caught:
        read_opf(tmp_path / "project.opf")
    assert caught.value.file is not None
    assert caught.value.remedy


def test_a_constant_geoid_height(tmp_path):
    """[L] heights above a constant geoid are ellipsoidal after its height is added."""
    files = changed(OpfProject().files(), "scene-reference-frame.json", set_in("crs", "geoid_height", value=48.0))
    write(tmp_path, files)
    block = read_opf(tmp_path).block
    sample = OpfProject()
    np.testing.assert_allclose(block.images.centre, sample.utm(sample.centre) + [0, 0, 48.0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(block.control.xyz, sample.utm(sample.points[55:]) + [0, 0, 48.0], rtol=0, atol=1e-6)


def test_a_system_of_two_dimensions_in_feet(tmp_path):
    """[L] the heights of EPSG:6434 count in feet, as X and Y do; sizes may be written as numbers with a point."""
    foot = 1200.0 / 3937.0
    files = changed(OpfProject().files(), "input-cameras.json", set_in("sensors", 0, "image_size_px", value=[4e3, 3e3]))
    files = changed(files, "scene-reference-frame.json", set_in("crs", "definition", value="EPSG:6434"))
    write(tmp_path, files)
    block, sample = read_opf(tmp_path).block, OpfProject()
    assert block.crs == "EPSG:6433"
    np.testing.assert_allclose(block.images.centre, sample.utm(sample.centre) * foot, rtol=0, atol=1e-6)
    np.testing.assert_allclose(block.control.xyz, sample.utm(sample.points[55:]) * foot, rtol=0, atol=1e-6)


LOCAL = (
    'ENGINEERINGCRS["site",ENGINEERINGDATUM["corner"],CS[Cartesian,3],AXIS["x",east,ORDER[1]],AXIS["y",north,ORDER[2]],'
    'AXIS["z",up,ORDER[3]],LENGTHUNIT["metre",1.0]]'
)


@pytest.mark.parametrize("known", [True, False])
def test_a_local_frame_with_positions_on_the_earth(tmp_path, known):
    """Positions of photographs that lead nowhere do not stop the rest; a frame may have no file at all."""
    files = changed(OpfProject(projected=False).files(), "input-control-points.json", set_in("gcps", value=[]))
    files = changed(files, "scene-reference-frame.json", set_in("crs", "definition", value=LOCAL))
    if not known:
        items = json.loads(files["project.opf"])["items"]
        k = [item["type"] for item in items].index("scene_reference_frame")
        files = changed(files, "project.opf", set_in("items", k, "resources", value=[]))
    write(tmp_path, files)
    reading = read_opf(tmp_path)
    assert reading.block.crs == "local"
    assert reading.block.gnss_ins is None or not len(reading.block.gnss_ins)
    assert any(text.startswith("not used: 6 positions of photographs") for text in reading.messages)
