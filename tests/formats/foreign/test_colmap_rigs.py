"""Rigs and frames of COLMAP models: pycolmap composes the poses that were adjusted, and a round trip loses nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.formats.assembly.oriented import oriented_block
from aerotri.formats.foreign.colmap import read_colmap, write_colmap
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations.rigs import station_places
from rig_blocks import MOUNTINGS, rig_block

pycolmap = pytest.importorskip("pycolmap")

TWO = ("left", "fore")


@pytest.fixture(scope="module")
def flown():
    """A block with its true orientations and points."""
    block, truth = rig_block(3, cameras=TWO)
    images = replace(block.images, centre=truth.centre, angles=truth.angles)
    return replace(block, images=images), truth


def written(block, points, folder, binary=True):
    lost = write_colmap(oriented_block(block, points), folder, binary)
    return pycolmap.Reconstruction(folder), lost


@pytest.mark.parametrize("binary", [True, False])
def test_frames_hold_the_poses(flown, tmp_path, binary):
    block, truth = flown
    model, lost = written(block, truth.points, tmp_path / "model", binary)
    assert not [text for text in lost if "rig" in text]
    assert [rig.num_sensors() for rig in model.rigs.values()] == [3]
    stations = len(set(block.images.columns["station"].tolist()))
    assert len(model.frames) == stations
    for number, image in model.images.items():
        matrix = image.cam_from_world().matrix()
        np.testing.assert_allclose(-matrix[:, :3].T @ matrix[:, 3], truth.centre[number - 1], atol=1e-6)
    # what was measured is where pycolmap projects
    errors = [
        np.linalg.norm(image.project_point(model.points3D[p.point3D_id].xyz) - p.xy)
        for image in list(model.images.values())[:5]
        for p in image.points2D
        if p.has_point3D()
    ]
    assert np.median(errors) < 1.0


@pytest.mark.parametrize("binary", [True, False])
def test_round_trip(flown, tmp_path, binary):
    block, truth = flown
    written(block, truth.points, tmp_path / "model", binary)
    again, points = read_colmap(tmp_path / "model", pixel_um=4.0)
    (rig,) = again.rigs
    names = {camera.name: name for camera, name in zip(again.cameras, ("nadir", *TWO), strict=True)}
    assert names[rig.reference] == "nadir"
    assert {names[camera] for camera in rig.cameras} == set(TWO)
    assert rig.constraint == "rigid"
    for camera, mounting in rig.cameras.items():
        values = np.array([prior.value for prior in mounting.elements])
        true = MOUNTINGS[names[camera]]
        np.testing.assert_allclose(values[:3], true["position_m"], atol=1e-6)
        turn = rotation_from_angles(values[3:]) @ rotation_from_angles(np.radians(true["rotation_deg"])).T
        np.testing.assert_allclose(turn, np.eye(3), atol=1e-9)
    row = {name: k for k, name in enumerate(block.images.names.tolist())}
    order = [row[name] for name in again.images.names.tolist()]
    np.testing.assert_allclose(again.images.centre, truth.centre[order], atol=1e-6)
    here, there = station_places(again), station_places(block)
    assert [order[k] for k in here.lead] == there.lead[order].tolist()
    assert len(points) == len(again.points)
    # and back: the same model
    model, _ = written(again, points, tmp_path / "again", binary)
    assert [rig.num_sensors() for rig in model.rigs.values()] == [3]


def test_a_photograph_without_its_reference(flown, tmp_path):
    """It has a frame of its own, and comes back without a station."""
    block, truth = flown
    lead = block.images.names.tolist().index("1_003")
    centre = block.images.centre.copy()
    centre[lead] = np.nan
    partly = replace(block, images=replace(block.images, centre=centre))
    model, _ = written(partly, truth.points, tmp_path / "model")
    assert "1_003" not in {image.name for image in model.images.values()}
    again, _ = read_colmap(tmp_path / "model")
    names = again.images.names.tolist()
    for name in ("1_003_left", "1_003_fore"):
        if name in names:
            k = names.index(name)
            assert again.images.columns["station"][k] == ""
            np.testing.assert_allclose(
                again.images.centre[k], truth.centre[block.images.names.tolist().index(name)], atol=1e-6
            )


def test_cameras_that_move_are_written_as_independent_ones(tmp_path):
    block, truth = rig_block(3, cameras=TWO, rig={"play_rotation_deg": 0.01})
    block = replace(block, images=replace(block.images, centre=truth.centre, angles=truth.angles))
    model, lost = written(block, truth.points, tmp_path / "model")
    assert [rig.num_sensors() for rig in model.rigs.values()] == [1, 1, 1]
    assert any("rig frame" in text and "independent" in text for text in lost)
    again, _ = read_colmap(tmp_path / "model")
    assert again.rigs == ()


def test_a_model_of_single_cameras_has_no_rigs(flown, tmp_path):
    block, truth = flown
    model, _ = written(replace(block, rigs=()), truth.points, tmp_path / "model")
    assert len(model.rigs) == 3
    again, _ = read_colmap(tmp_path / "model")
    assert again.rigs == ()
    assert "station" not in again.images.columns


def test_a_pose_on_the_rig_that_is_missing_or_no_number(flown, tmp_path):
    """Frames hold poses of their reference camera alone: without the other's pose on the rig it is refused by name."""
    block, truth = flown
    model, _ = written(block, truth.points, tmp_path / "model")
    (rig,) = model.rigs.values()
    sensor = next(iter(rig.non_ref_sensors))
    matrix = rig.sensor_from_rig(sensor).matrix().copy()
    matrix[0, 3] = np.nan
    rig.set_sensor_from_rig(sensor, pycolmap.Rigid3d(matrix))
    (tmp_path / "nan").mkdir()
    model.write_binary(tmp_path / "nan")
    again, _ = read_colmap(tmp_path / "nan", pixel_um=4.0)
    assert sorted(mounting.known for mounting in again.rigs[0].cameras.values()) == [False, True]
    written(block, truth.points, tmp_path / "none")
    rigs = tmp_path / "none" / "rigs.bin"
    raw = rigs.read_bytes()
    # number of rigs, number, sensors, reference; then type and number of the first sensor, whether it has a pose, pose
    flag = 8 + 4 + 4 + 8 + 8
    assert raw[flag] == 1
    rigs.write_bytes(raw[:flag] + b"\0" + raw[flag + 1 + 56 :])
    with pytest.raises(InputError, match=r"the pose of image '.*' on its rig is missing"):
        read_colmap(tmp_path / "none", pixel_um=4.0)
