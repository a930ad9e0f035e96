"""Rigs in a block folder: what is read, that writing loses nothing, and what is wrong is said with line and remedy."""

from __future__ import annotations

import numpy as np
import pytest
from format_samples import BLOCK_TOML, assert_same_block

from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.observations import Prior
from aerotri.observations.rigs import station_places

CAMERA = "\n[camera.{}]\nsize_px = [10000, 8000]\npixel_um = 10.0\nfocal_length_mm = 100.0\n"
RIG = """
[rig.two]
reference = "cam"
[rig.two.camera.side]
position_m = { value = [0.1, -0.2, 0.3], sigma = [0.01, 0.02, 0.03] }
rotation_deg = { value = [0.0, 45.0, 90.0], fixed = [true, false, false] }
"""
TOML = BLOCK_TOML + CAMERA.format("side") + CAMERA.format("other") + RIG
IMAGES = """\
image,camera,station
a,cam,1
b,side,1
c,cam,2
d,side,
e,other,
"""
POINTS = "image,point,x,y\n" + "".join(f"{name},p{k},{k},1\n" for name in "abcde" for k in range(2))


@pytest.fixture
def rig_folder(small_block):
    def made(toml: str = TOML, images: str = IMAGES):
        return small_block({"block.toml": toml, "images.csv": images, "image_points.csv": POINTS, "gnss_ins.csv": None})

    return made


def test_a_rig_is_read(rig_folder):
    (rig,) = read_block(rig_folder()).rigs
    assert (rig.name, rig.reference, rig.constraint) == ("two", "cam", "rigid")
    mounting = rig.cameras["side"]
    assert mounting.position == (Prior(0.1, 0.01), Prior(-0.2, 0.02), Prior(0.3, 0.03))
    assert [prior.kind for prior in mounting.rotation] == ["fixed", "free", "free"]
    np.testing.assert_allclose([p.value for p in mounting.rotation], np.radians([0.0, 45.0, 90.0]))
    assert mounting.known


def test_photographs_of_a_station_follow_the_reference_camera(rig_folder):
    places = station_places(read_block(rig_folder()))
    assert places.lead.tolist() == [0, 0, 2, 3, 4]
    assert places.mounting.tolist() == [-1, 0, -1, -1, -1]
    assert [camera for _, camera in places.mountings] == ["side"]


def test_a_rig_that_is_off_has_no_stations(rig_folder):
    block = read_block(rig_folder(TOML.replace('reference = "cam"', 'reference = "cam"\nconstraint = "off"')))
    assert not station_places(block)


def test_without_values_the_rotation_is_to_be_computed(rig_folder):
    toml = TOML.replace("rotation_deg = { value = [0.0, 45.0, 90.0], fixed = [true, false, false] }\n", "")
    block = read_block(rig_folder(toml))
    assert not block.rigs[0].cameras["side"].known


@pytest.mark.parametrize("tables", ["csv", "parquet"])
def test_written_and_read_again(rig_folder, tmp_path, tables):
    block = read_block(rig_folder(TOML.replace("[rig.two.camera.side]", 'constraint = "off"\n[rig.two.camera.side]')))
    write_block(block, tmp_path / "again", tables)
    again = read_block(tmp_path / "again")
    assert_same_block(again, block)
    (a,), (b,) = again.rigs, block.rigs
    assert (a.name, a.reference, a.constraint) == (b.name, b.reference, "off")
    assert (a.cameras["side"].movement_m, a.cameras["side"].movement_rad) == (0.0, None)
    for one, other in zip(a.cameras["side"].elements, b.cameras["side"].elements, strict=True):
        assert (one.value, one.fixed) == (pytest.approx(other.value, rel=1e-14), other.fixed)
        assert one.sigma == (None if other.sigma is None else pytest.approx(other.sigma, rel=1e-14))


MOVES = """constraint = "weighted"
[rig.two.camera.side]
movement_m = {}
movement_deg = {}
"""


@pytest.mark.parametrize(("position", "rotation"), [("0.01", "0.002"), ('"estimated"', '"estimated"'), ("0.0", "0.0")])
def test_movements_are_written_and_read_again(rig_folder, tmp_path, position, rotation):
    block = read_block(rig_folder(TOML.replace("[rig.two.camera.side]", MOVES.format(position, rotation))))
    write_block(block, tmp_path / "again")
    for one in (block, read_block(tmp_path / "again")):
        side = one.rigs[0].cameras["side"]
        assert one.rigs[0].constraint == "weighted"
        assert side.movement_m == (None if "est" in position else float(position))
        assert side.movement_rad == (None if "est" in rotation else pytest.approx(np.radians(float(rotation))))


WRONG_TOML = {
    "there is no camera 'nadir'": ('reference = "cam"', 'reference = "nadir"', 'reference = "nadir"'),
    "there is no camera 'left'": ("[rig.two.camera.side]", "[rig.two.camera.left]", "[rig.two.camera.left]"),
    "has a mounting of its own": ("[rig.two.camera.side]", "[rig.two.camera.cam]", "[rig.two.camera.cam]"),
    "belongs to the rigs 'two' and 'more'": ("", '[rig.more]\nreference = "side"\n', 'reference = "side"'),
    "rig.two.constraint = 'stiff'": ('"cam"\n[rig', '"cam"\nconstraint = "stiff"\n[rig', 'constraint = "stiff"'),
    "unknown key 'rig.two.camera.side.angles_deg'": ("rotation_deg", "angles_deg", "angles_deg"),
    "exclude each other": ("0.03] }", "0.03], fixed = true }", "position_m"),
    "key 'rig.two.reference' is missing": ('reference = "cam"\n', "", "[rig.two]"),
}


@pytest.mark.parametrize("says", WRONG_TOML)
def test_what_is_wrong_in_block_toml_is_said_with_its_line(rig_folder, says):
    old, new, at = WRONG_TOML[says]
    toml = TOML.replace(old, new, 1) if old else TOML + new
    with pytest.raises(InputError, match=says.replace("(", r"\(")) as error:
        read_block(rig_folder(toml))
    line = next(k for k, text in enumerate(toml.splitlines(), 1) if at in text)
    assert error.value.line == line
    assert error.value.file.name == "block.toml"
    assert error.value.remedy


WRONG_STATIONS = {
    "two photographs of camera 'side': 'b' and 'd'": ("d,side,", "d,side,1", 5),
    "station '3' has no photograph of the reference camera 'cam'": ("d,side,", "d,side,3", 5),
    "rig 'two' needs the stations": ("image,camera,station", "image,camera,stations", 1),
}


@pytest.mark.parametrize("says", WRONG_STATIONS)
def test_wrong_stations_are_said_with_their_line(rig_folder, says):
    old, new, line = WRONG_STATIONS[says]
    with pytest.raises(InputError, match=says) as error:
        read_block(rig_folder(images=IMAGES.replace(old, new)))
    assert (error.value.file.name, error.value.line) == ("images.csv", line)
    assert error.value.remedy
