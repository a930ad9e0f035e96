"""BlocksExchange XML: the format's formulas by hand in all its axes and systems, there and back, what is refused."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from oriented_sample import oriented_sample

import aerotri
from aerotri.conventions import InputError
from aerotri.formats.convert import detect_format, write_oriented
from aerotri.formats.foreign.blocks_exchange import read_blocks_exchange
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Camera, Prior
from formats.foreign.blocks_exchange_sample import LENS, ORIENTATIONS, PIXEL_MM, PRINCIPAL, SIZE, BlocksExchange


def read(tmp_path, text: str, **options):
    path = tmp_path / "site.xml"
    path.write_text(text, encoding="utf-8")
    assert detect_format(path) == "blocks-exchange"
    return aerotri.read(path, **options)


def fit_px(messages) -> list[float]:
    """What the program says of how image points fit the orientations, of all points and of control points."""
    return [float(found[1]) for text in messages if (found := re.search(r"fit the given \w+ to (\S+) px", text))]


@pytest.mark.parametrize("system", ["utm", "degrees", "earth", "enu"])
def test_systems(tmp_path, system):
    """Orientations and control points in each of them lead to the same block on the earth."""
    sample = BlocksExchange(system)
    reading = read(tmp_path, sample.text())
    block, utm = reading.block, BlocksExchange("utm")
    assert block.crs == ("EPSG:32632" if system in ("earth", "enu") else "EPSG:25832")
    np.testing.assert_allclose(block.images.centre, utm.coordinates(sample.centre), rtol=0, atol=2e-3)
    np.testing.assert_allclose(block.control.xyz, utm.coordinates(sample.points)[55:], rtol=0, atol=2e-3)
    assert block.gnss_ins is not None
    np.testing.assert_allclose(block.gnss_ins.xyz, utm.coordinates(sample.centre + 0.01), rtol=0, atol=2e-3)
    np.testing.assert_allclose(block.gnss_ins.sigma, np.tile([0.02, 0.02, 0.03], (6, 1)))
    np.testing.assert_allclose(block.control.sigma, np.tile([0.02, 0.02, 0.04], (5, 1)))
    assert block.control.is_check.tolist() == [False] * 4 + [True]
    assert max(fit_px(reading.messages)) < 1e-3
    assert len(fit_px(reading.messages)) == 2


@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_axes_of_the_camera(tmp_path, orientation):
    """Angles and millimetres count along the axes that CameraOrientation names."""
    sample = BlocksExchange("local", orientation, "angles", "mm")
    reading = read(tmp_path, sample.text())
    block = reading.block
    down = rotation_from_angles(block.images.angles) @ np.diag([1.0, -1.0, -1.0])
    np.testing.assert_allclose(down, sample.rotation, atol=1e-9)
    assert max(fit_px(reading.messages)) < 1e-3
    (camera,) = block.cameras
    assert (camera.size_px, camera.pixel_um) == (SIZE, pytest.approx(1e3 * PIXEL_MM))
    x0, y0 = (np.array(PRINCIPAL) - (np.array(SIZE) - 1) / 2) * [PIXEL_MM, -PIXEL_MM]
    assert camera.principal_point_mm == (pytest.approx(x0), pytest.approx(y0))
    lens = {name: prior.value for name, prior in camera.lens.items()}
    expected = {"k1": LENS["K1"], "k2": LENS["K2"], "k3": LENS["K3"], "p1": -LENS["P2"], "p2": LENS["P1"]}
    assert lens == {name: pytest.approx(value) for name, value in expected.items()}


def test_an_aspect_ratio(tmp_path):
    reading = read(tmp_path, BlocksExchange("local", aspect=1.002).text())
    assert max(fit_px(reading.messages)) < 1e-3
    assert any("AspectRatio" in text for text in reading.messages)


def test_the_documented_example():
    """[L] omega, phi, kappa and the matrix of one photograph in Bentley's annotated example are one rotation."""
    omega, phi, kappa = np.radians([179.6523471469934, 0.04985630236313049, 179.9065465708369])
    matrix = [
        [-0.9999982912233401, -0.001636319085375301, -0.0008602425863163225],
        [-0.001631068695467463, 0.9999802528616577, -0.00606906089589293],
        [0.0008701565192966738, -0.006067647409696231, -0.9999812130648239],
    ]
    np.testing.assert_allclose(rotation_from_angles(np.array([[omega, phi, kappa]]))[0].T, matrix, atol=1e-12)


def test_it_adjusts_and_goes_back(tmp_path):
    """Read, adjusted with everything free, written and read again."""
    block = read(tmp_path, BlocksExchange("utm").text()).block
    result = aerotri.adjust(block)
    assert result.status == "converged"
    said = aerotri.convert(result, tmp_path / "out.xml", "blocks-exchange")
    assert said == ()
    again = aerotri.read(tmp_path / "out.xml")
    adjusted = result.adjusted
    np.testing.assert_allclose(again.block.images.centre, adjusted.images.centre, rtol=0, atol=1e-8)
    found, expected = (rotation_from_angles(one.angles) for one in (again.block.images, adjusted.images))
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert again.block.control.is_check.tolist() == block.control.is_check.tolist()
    np.testing.assert_allclose(again.block.control.xyz, block.control.xyz, rtol=0, atol=1e-9)
    np.testing.assert_allclose(again.block.control.sigma, block.control.sigma)
    assert again.block.gnss_ins is not None
    assert block.gnss_ins is not None
    np.testing.assert_allclose(again.block.gnss_ins.xyz, block.gnss_ins.xyz, rtol=0, atol=1e-9)
    order = [again.block.points.tolist().index(name) for name in block.points.tolist()]
    rays, same = again.block.image_points, block.image_points
    key = np.argsort(rays.image * 1000 + rays.point)
    wanted = np.argsort(same.image * 1000 + np.array(order)[same.point])
    np.testing.assert_allclose(rays.xy[key], same.xy[wanted], rtol=0, atol=1e-9)
    # positions in the file are 14 mm off
    assert max(fit_px(again.messages)) < 0.1


def test_what_the_format_cannot_hold_is_named(tmp_path):
    lens = {"k1": Prior(-0.02, fixed=True), "k4": Prior(1e-4, fixed=True), "b2": Prior(1e-4, fixed=True)}
    camera = Camera(
        "cam", "frame", (8000, 6000), 5.0,
        {key: Prior(value, fixed=True) for key, value in (("focal_length_mm", 40.0), ("x0_mm", 0.1), ("y0_mm", 0.0))},
        lens=lens,
    )  # fmt: skip
    said = write_oriented(oriented_sample(camera), tmp_path / "x.xml", "blocks-exchange")
    assert any("nearest lens" in text for text in said)
    with pytest.raises(InputError, match="fisheye"):
        write_oriented(oriented_sample(replace(camera, projection="fisheye")), tmp_path / "x.xml", "blocks-exchange")


def test_pieces_that_are_not_used_are_said(tmp_path):
    """Yaw, pitch, roll, a rig, a position alone, points without accuracy, of a category, of another photograph."""
    sample = BlocksExchange("utm")
    text = sample.text(extra="<Rig>1</Rig>")
    text = re.sub(
        r"<Rotation>.*?</Rotation>", "<Rotation><Yaw>1</Yaw><Pitch>2</Pitch><Roll>3</Roll></Rotation>", text, count=1
    )
    text = re.sub(
        r"(?s)(<Id>1</Id>.*?<Pose>)<Rotation>.*?</Rotation>(.*?)<Metadata>.*?</Metadata>", r"\1\2", text, count=1
    )
    before = "<Rotation><Yaw>1</Yaw><Pitch>2</Pitch><Roll>3</Roll></Rotation><Odd>1</Odd>"
    text = re.sub(r"(?s)(<Id>2</Id>.*?<Metadata>)", rf"\1{before}", text, count=1)
    text = text.replace("<HorizontalAccuracy>0.02</HorizontalAccuracy><VerticalAccuracy>0.04</VerticalAccuracy>", "", 1)
    text = re.sub(r"(<Name>gcp 1</Name>)", r"\1<Category>Horizontal</Category>", text)
    text = text.replace("<Measurement><PhotoId>0</PhotoId>", "<Measurement><PhotoId>77</PhotoId>", 1)
    reading = read(tmp_path, text)
    said = "\n".join(reading.messages)
    assert "not used: Rig (1), Odd (1)" in said
    assert "not used: the rotation before the adjustment, of 1 photograph" in said
    assert "not used: yaw, pitch and roll" in said
    assert "1 control point without accuracy: 0.01 m is taken" in said
    assert "1 position without accuracy: 10 m is taken" in said
    assert "left out: 1 image point of photographs that are not there" in said
    assert np.isnan(reading.block.images.angles).any(axis=1).tolist() == [True, True, False, False, False, False]
    assert np.isnan(reading.block.control.xyz).tolist()[1] == [False, False, True]


def test_positions_beside_yaw_pitch_and_roll(tmp_path):
    """Without a rotation that can be used a centre is a position, as one without any rotation."""
    sample = BlocksExchange("utm")
    angles = "<Rotation><Yaw>1</Yaw><Pitch>2</Pitch><Roll>3</Roll></Rotation>"
    text = re.sub(r"<Rotation>.*?</Rotation>", angles, sample.text())
    reading = read(tmp_path, re.sub(r"<Metadata>.*?</Metadata>", "", text))
    assert reading.block.gnss_ins is not None
    np.testing.assert_allclose(reading.block.gnss_ins.xyz, sample.coordinates(sample.centre), rtol=0, atol=1e-6)


def test_a_control_point_without_all_coordinates_on_the_earth(tmp_path):
    """Of earth-centred coordinates three are needed; one point that lacks some leaves the others what they are."""
    text = BlocksExchange("earth").text()
    text = re.sub(r"(<Name>gcp 1</Name>)", r"\1<Category>Horizontal</Category>", text)
    reading, utm = read(tmp_path, text), BlocksExchange("utm")
    assert any(message.startswith("left out: 1 control point without all three") for message in reading.messages)
    np.testing.assert_allclose(
        reading.block.control.xyz, utm.coordinates(utm.points)[[55, 57, 58, 59]], rtol=0, atol=2e-3
    )


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("Perspective<", "Fisheye<", "type Fisheye"),
        ("<Skew>0", "<Skew>0.1", "skew"),
        ("<CameraOrientation>XRightYDown", "<CameraOrientation>XRightYLeft", "CameraOrientation 'XRightYLeft'"),
        (f"<SensorSize>{SIZE[0] * PIXEL_MM}</SensorSize>", "", "neither SensorSize nor PixelSize"),
        ("EPSG:25832", "EPSG:999999", "not known"),
        ("<SRSId>7", "<SRSId>8", "no SRS with the id 8"),
        ("<M_00>", "<M_00>9", "is no rotation"),
        ("<Id>1</Id>", "<Id>0</Id>", "two photographs have the id 0"),
        ("<Width>4000", "<Width>4000.5", "no format"),
        ("<K3>", "<K4>0.1</K4><K3>", "<K4> is not known"),
        ("gcp 1", "gcp 2", "called 'gcp 2'"),
        ("<HorizontalAccuracy>0.02", "<HorizontalAccuracy>0", "accuracy is not greater than 0"),
        ("<x>", "<x>n", "is not a number"),
    ],
)
def test_what_is_not_understood_is_refused(tmp_path, old, new, says):
    path = tmp_path / "site.xml"
    text = BlocksExchange("utm").text()
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        read_blocks_exchange(path)
    assert caught.value.file == path
    assert caught.value.remedy


def test_photographs_in_local_axes_and_control_on_the_earth(tmp_path):
    """Orientations that lead nowhere are not used as start values, and that is said."""
    local, earth = BlocksExchange("local"), BlocksExchange("utm")
    text = local.text(control=earth.points_text())
    text = re.sub(r"<Metadata>.*?</Metadata>", "", text)
    system = "<SRS><Id>2</Id><Definition>EPSG:25832</Definition></SRS>"
    text = text.replace("<SpatialReferenceSystems>", f"<SpatialReferenceSystems>{system}")
    text = text.replace("<ControlPoints>", "<ControlPoints><SRSId>2</SRSId>")
    reading = read(tmp_path, text)
    assert reading.block.crs == "EPSG:25832"
    assert np.isnan(reading.block.images.centre).all()
    assert any("no start orientations" in message for message in reading.messages)


@pytest.mark.parametrize("system", ["utm", "earth", "local"])
def test_the_order_of_opencv(tmp_path, system):
    """Some programs write OpenCV's p1 and p2: the image points tell, and that is said."""
    text = BlocksExchange(system).text()
    text = re.sub(r"<P1>(.*?)</P1><P2>(.*?)</P2>", r"<P1>\2</P1><P2>\1</P2>", text)
    reading = read(tmp_path, text)
    assert max(fit_px(reading.messages)) < 1e-3
    assert any("P1 and P2 are taken in OpenCV's order" in message for message in reading.messages)
    (camera,) = reading.block.cameras
    assert (camera.lens["p1"].value, camera.lens["p2"].value) == (-LENS["P2"], LENS["P1"])
