"""Rigs told by the names of photographs: lists of Metashape and Pix4D there and back, and patterns that do not suit."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.formats.assembly.camera_spec import CameraSpec
from aerotri.formats.assembly.parts import Reading
from aerotri.formats.assembly.project import Request, read_project
from aerotri.formats.assembly.rigs_by_name import names_told, with_rig
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.convert import write_any
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations.rigs import station_places
from aerotri.pipeline import adjust
from rig_blocks import EXACT, MOUNTINGS, rig_block

TWO = ("left", "fore")
SPEC = CameraSpec(name="cam", size_px=(6000, 4000), pixel_um=4.0, focal_length_mm=35.0)


@pytest.fixture(scope="module")
def flown():
    """A block with its true orientations; every name says station and camera."""
    block, truth = rig_block(3, cameras=TWO, mounting=EXACT)
    names = [block.cameras[c].name for c in block.images.camera]
    station = block.images.columns["station"]
    named = np.array([f"IMG_{s}_{c}.tif" for s, c in zip(station, names, strict=True)])
    return replace(block, images=replace(block.images, names=named, centre=truth.centre, angles=truth.angles)), truth


def listed(block, folder, format="metashape"):
    path = folder / "cameras.txt"
    return path, write_any(block, path, format)


def read(path, **more):
    return read_project(Request(str(path), "", camera=SPEC, station_pattern="IMG_{station}_{camera}.tif", **more))


@pytest.mark.parametrize("format", ["metashape", "pix4d-eo"])
def test_lists_there_and_back(flown, tmp_path, format):
    """Every photograph of the rig is listed; names give the rig back, its mountings from the orientations."""
    block, truth = flown
    path, lost = listed(block, tmp_path, format)
    assert [text for text in lost if "1 rig; photographs are written one by one" in text]
    found = read(path)
    (rig,) = found.block.rigs
    assert (rig.reference, set(rig.cameras)) == ("cam_nadir", {"cam_left", "cam_fore"})
    assert len(found.block.images) == len(block.images)
    np.testing.assert_array_equal(
        station_places(found.block).lead, station_places(block).lead
    )  # fmt: skip
    for name in TWO:
        elements = np.array([prior.value for prior in rig.cameras[f"cam_{name}"].elements])
        np.testing.assert_allclose(elements[:3], truth.mountings[name][:3], atol=1e-5)
        turned = rotation_from_angles(elements[3:]).T @ rotation_from_angles(truth.mountings[name][3:])
        np.testing.assert_allclose(turned, np.eye(3), atol=1e-9)
    assert any("they agree to" in text for text in found.messages)


def test_the_block_that_comes_of_it_is_adjusted(flown, tmp_path):
    """Cameras of the block stay; what is written is read, and adjusted to the true mountings."""
    block, truth = flown
    bare = replace(block, rigs=(), images=replace(block.images, columns={}))
    found = with_rig(Reading(bare), "IMG_{station}_{camera}")
    assert [camera.name for camera in found.block.cameras] == ["nadir", *TWO]
    write_block(found.block, tmp_path / "block")
    result = adjust(read_block(tmp_path / "block"))
    assert result.outcome.status == "converged"
    for one in result.rigs:
        error = np.concatenate([one.position, one.angles]) - truth.mountings[one.camera]
        assert (np.abs(error) < 4.5 * one.sigma).all()


def test_a_wrong_orientation_does_not_pull_the_mean(flown):
    block, _ = flown
    bare = replace(block, rigs=(), images=replace(block.images, columns={}))
    angles = bare.images.angles.copy()
    angles[np.flatnonzero(bare.images.camera == 1)[:2]] += 0.7
    found = with_rig(Reading(replace(bare, images=replace(bare.images, angles=angles))), "IMG_{station}_{camera}")
    turned = [prior.value for prior in found.block.rigs[0].cameras["left"].rotation]
    np.testing.assert_allclose(np.degrees(turned), MOUNTINGS["left"]["rotation_deg"], atol=1e-6)


def test_without_orientations_the_angles_are_asked_for(flown):
    block, _ = flown
    nothing = np.full_like(block.images.centre, np.nan)
    bare = replace(block, rigs=(), images=replace(block.images, columns={}, centre=nothing, angles=nothing))
    found = with_rig(Reading(bare), "IMG_{station}_{camera}", "fore")
    assert found.block.rigs[0].reference == "fore"
    assert not any(one.known for one in found.block.rigs[0].cameras.values())
    assert "give rotation_deg in block.toml" in " ".join(found.messages)


def test_stations_without_the_reference_camera_stand_alone(flown):
    block, _ = flown
    names = block.images.names.copy()
    names[0] = "calibration.tif"
    bare = replace(block, rigs=(), images=replace(block.images, columns={}, names=names))
    found = with_rig(Reading(bare), "IMG_{station}_{camera}", "nadir")
    assert found.block.images.columns["station"][:3].tolist() == ["", "", ""]
    said = " ".join(found.messages)
    assert "2 photographs stand alone" in said
    assert "1 photograph has names that are not like" in said


@pytest.mark.parametrize(("pattern", "name", "station", "camera"), [
    ("IMG_{station}_{camera}.tif", "000/IMG_0001_6.tif", "0001", "6"),
    ("{camera}06{station}", "A0619", "19", "A"),
    ("{station}_{camera}", "1_002_left.jpg", "1_002", "left"),
    ("{station}/IMG_{camera}", "flight 1\\0001\\IMG_2.TIF", "flight 1/0001", "2"),
    ("*_{station}_{camera}", "x_17_3", "17", "3"),
    ("({station})[{camera}].+", "(7)[b].+", "7", "b"),
])  # fmt: skip
def test_patterns(pattern, name, station, camera):
    found = names_told(np.array([name, "another"]), pattern)
    assert (found[0].tolist(), found[1].tolist()) == ([station, ""], [camera, ""])


@pytest.mark.parametrize(("pattern", "says"), [
    ("IMG_{station}", "does not say where station and camera stand"),
    ("{station}{station}{camera}", "does not say where station and camera stand"),
    ("{station}_{head}_{camera}", "does not say where station and camera stand"),
    ("*{station}*{camera}", "does not say where station and camera stand"),
    ("{station}_{camera}" + 300 * "a", "does not say where station and camera stand"),
    ("DSC{station}_{camera}", "no name of a photograph is like it, for example 'IMG_1_001_nadir.tif'"),
    ("IMG_{station}_{camera}ir.tif", "all photographs are of one camera"),
    ("IMG_{station}_*_{camera}", "two photographs of camera"),
])  # fmt: skip
def test_patterns_that_do_not_suit_are_refused(flown, pattern, says):
    block, _ = flown
    bare = replace(block, rigs=(), images=replace(block.images, columns={}))
    with pytest.raises(InputError, match=says) as caught:
        with_rig(Reading(bare), pattern)
    assert caught.value.remedy


def test_cameras_that_names_and_block_tell_differently_are_refused(flown):
    block, _ = flown
    bare = replace(block, rigs=(), images=replace(block.images, columns={}, camera=np.roll(block.images.camera, 1)))
    mixed = replace(bare, images=replace(bare.images, camera=np.arange(len(bare.images)) % 2))
    with pytest.raises(InputError, match="by their names, are of the cameras"):
        with_rig(Reading(mixed), "IMG_{station}_{camera}")
    with pytest.raises(InputError, match="has rigs already"):
        with_rig(Reading(block), "IMG_{station}_{camera}")
    with pytest.raises(InputError, match="no camera 'zenith' on the rig"):
        with_rig(Reading(replace(block, rigs=())), "IMG_{station}_{camera}", "zenith")


def test_a_photograph_listed_twice_is_refused(flown, tmp_path):
    """As multi-camera systems are exported whose photographs have the same names in several folders."""
    path, _ = listed(flown[0], tmp_path)
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([*lines, lines[-1]]), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read(path)
    assert caught.value.line == len(lines) + 1


def test_long_names_take_no_time():
    names = np.array(["_" * 100_000, "a" * 199, "1_2"])
    begun = time.process_time()
    station, _ = names_told(names, "*{station}_{camera}")
    assert time.process_time() - begun < 5.0
    assert station.tolist() == ["", "", "1"]


def test_cameras_of_a_file_are_told_by_names(flown, tmp_path):
    """Several cameras are described, the list names none."""
    block, _ = flown
    path, _ = listed(block, tmp_path)
    text = "\n".join(
        f"[camera.{c.name}]\nsize_px = [6000, 4000]\npixel_um = 4.0\nfocal_length_mm = {c.focal_length_mm}\n"
        for c in block.cameras
    )
    (tmp_path / "cameras.toml").write_text(text, encoding="utf-8")
    found = read_project(
        Request(
            str(path), "", camera=CameraSpec(file=tmp_path / "cameras.toml"), station_pattern="IMG_{station}_{camera}"
        )
    )
    assert found.block.rigs[0].reference == "nadir"
    used = [found.block.cameras[c].name for c in found.block.images.camera]
    assert used == [block.cameras[c].name for c in block.images.camera]
