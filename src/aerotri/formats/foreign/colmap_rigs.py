"""Rigs and frames of COLMAP models.

A rig of COLMAP is a reference sensor and, of every other sensor, the pose in its frame; a frame is an exposure of a
rig. COLMAP's poses lead from the rig to the sensor, here they lead from the camera to the reference camera; its cameras
are turned by diag(1, −1, −1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from aerotri.adjustment.rigging import robust_mean
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.text.tables import LARGEST_NUMBER
from aerotri.functional_model.rotation import angles_from_rotation, logarithm, rotation_from_angles
from aerotri.observations import Mounting, Prior, Rig
from aerotri.observations.rigs import station_places

COLMAP_FROM_CAMERA = np.diag([1.0, -1.0, -1.0])
SAME_M, SAME_RAD = 1e-6, 1e-9
"""Deviations of photographs from one mounting below which the rig is rigid [C]: rounding of large coordinates."""


def rigs_of_model(model: Any, names: Mapping[int, str], order: str) -> tuple[Rig, ...]:
    """The rigs of more than one camera.

    Parameters
    ----------
    names : of the cameras, by COLMAP's numbers. order : of the angles.
    """
    out = []
    for number in sorted(model.rigs):
        rig = model.rigs[number]
        others = {
            sensor.id: pose
            for sensor, pose in rig.non_ref_sensors.items()
            if sensor.type.name == "CAMERA" and sensor.id in names
        }
        if others and rig.ref_sensor_id.type.name == "CAMERA" and rig.ref_sensor_id.id in names:
            cameras = {names[key]: _mounting(others[key], order) for key in sorted(others)}
            out.append(Rig(f"rig{number}", names[rig.ref_sensor_id.id], cameras))
    return tuple(out)


def stations_of_model(model: Any, ids: list[int], names: Mapping[int, str], rigs: tuple[Rig, ...]) -> np.ndarray:
    """(n,) the frame of every image; '' outside of rigs and where the reference camera took none.

    Parameters
    ----------
    ids : COLMAP's numbers of the images.
    """
    led = {camera: rig.reference for rig in rigs for camera in (rig.reference, *rig.cameras)}
    camera = [names[model.images[number].camera_id] for number in ids]
    frame = [model.images[number].frame_id for number in ids]
    leads = {(f, c) for f, c in zip(frame, camera, strict=True) if led.get(c) == c}
    return np.array(
        [str(f) if (f, led.get(c, "")) in leads else "" for f, c in zip(frame, camera, strict=True)], dtype=object
    )  # fmt: skip


def _mounting(pose: Any, order: str) -> Mounting:
    """Position and rotation from the pose of a sensor; what is not known is to be computed."""
    if pose is None:
        return Mounting(known=False)
    matrix = np.asarray(pose.matrix())
    if not (np.abs(matrix) <= LARGEST_NUMBER).all():
        return Mounting(known=False)
    rotation = COLMAP_FROM_CAMERA @ matrix[:, :3].T @ COLMAP_FROM_CAMERA
    position = -COLMAP_FROM_CAMERA @ matrix[:, :3].T @ matrix[:, 3]
    x, y, z = (Prior(float(value)) for value in position)
    a, b, c = (Prior(float(value)) for value in angles_from_rotation(rotation, order))
    return Mounting((x, y, z), (a, b, c))


@dataclass(frozen=True, eq=False)
class WrittenRigs:
    """Which rig and frame every image belongs to in a model to be written.

    Parameters
    ----------
    rig_of_camera : by place of the camera. frame : (n,) number of the frame. from_world : by frame, 3 × 4.
    lost : what could not be carried over, in words.
    """

    rig_of_camera: Mapping[int, int]
    frame: np.ndarray
    from_world: Mapping[int, np.ndarray]
    lost: tuple[str, ...]


def add_rigs(model: Any, oriented: OrientedBlock) -> WrittenRigs:
    """Add the rigs to a model that has its cameras, numbered from 1: rigid ones, and one for every other camera."""
    from aerotri.colmap_library import pycolmap

    block, places = oriented.block, station_places(oriented.block)
    number = {camera.name: place for place, camera in enumerate(block.cameras)}
    sensor_from_rig = {place: np.eye(3, 4) for place in range(len(block.cameras))}
    rig_of = {place: place for place in range(len(block.cameras))}
    lost = []
    for rig in block.rigs if places else ():
        own = {camera: _relative(oriented, places, k) for k, (r, camera) in enumerate(places.mountings) if r is rig}
        if any(pose is None for pose in own.values()):
            lost.append(f"the cameras of the rig {rig.name} are written as independent ones: they move on it")
            continue
        for camera, pose in own.items():
            if pose is not None:
                sensor_from_rig[number[camera]], rig_of[number[camera]] = pose, number[rig.reference]
    for place in sorted(set(rig_of.values())):
        rig = pycolmap.Rig(rig_id=place + 1)
        rig.add_ref_sensor(_sensor(place))
        for camera, of in rig_of.items():
            if of == place and camera != place:
                rig.add_sensor(_sensor(camera), pycolmap.Rigid3d(sensor_from_rig[camera]))
        model.add_rig(rig)
    frame, from_world = _frames(oriented, places.lead, rig_of, sensor_from_rig)
    return WrittenRigs(rig_of, frame, from_world, tuple(lost))


def add_frames(model: Any, written: WrittenRigs, oriented: OrientedBlock) -> None:
    """Add the frames of the oriented images to a model that has its rigs; the images come after them."""
    from aerotri.colmap_library import pycolmap

    camera = oriented.block.images.camera
    rows = np.flatnonzero(oriented.oriented)
    for number in np.unique(written.frame[rows]).tolist():
        own = rows[written.frame[rows] == number]
        frame = pycolmap.Frame()
        frame.frame_id, frame.rig_id = number, written.rig_of_camera[int(camera[own[0]])] + 1
        for row in own.tolist():
            frame.add_data_id(pycolmap.data_t(_sensor(int(camera[row])), row + 1))
        frame.rig_from_world = pycolmap.Rigid3d(written.from_world[number])
        model.add_frame(frame)


def _sensor(place: int) -> Any:
    from aerotri.colmap_library import pycolmap

    return pycolmap.sensor_t(pycolmap.SensorType.CAMERA, place + 1)


def colmap_pose(oriented: OrientedBlock, row: int) -> np.ndarray:
    """(3, 4) COLMAP's camera from world."""
    rotation = COLMAP_FROM_CAMERA @ oriented.rotation[row].T
    return np.column_stack([rotation, -rotation @ oriented.centre[row]])


def _relative(oriented: OrientedBlock, places: Any, k: int) -> np.ndarray | None:
    """(3, 4) sensor from rig of a mounting, of the photographs; None where they deviate from one another.

    As stated where no station has both photographs.
    """
    rows = np.flatnonzero((places.mounting == k) & oriented.oriented & oriented.oriented[places.lead])
    if not len(rows):
        rig, camera = places.mountings[k]
        return _sensor_pose(rig.cameras[camera], oriented.block.rotation)
    leads = oriented.rotation[places.lead[rows]]
    turns = np.swapaxes(leads, 1, 2) @ oriented.rotation[rows]
    arms = np.einsum("nji,nj->ni", leads, oriented.centre[rows] - oriented.centre[places.lead[rows]])
    mean, arm = robust_mean(turns), np.median(arms, axis=0)
    apart = np.abs(logarithm(turns @ mean.T)).max(), np.abs(arms - arm).max()
    if apart[0] > SAME_RAD or apart[1] > SAME_M:
        return None
    rotation = COLMAP_FROM_CAMERA @ mean.T @ COLMAP_FROM_CAMERA
    return np.column_stack([rotation, -COLMAP_FROM_CAMERA @ mean.T @ arm])


def _sensor_pose(mounting: Mounting, order: str) -> np.ndarray:
    """(3, 4) sensor from rig of a stated mounting."""
    values = np.array([prior.value for prior in mounting.elements])
    turn = rotation_from_angles(values[3:], order)
    rotation = COLMAP_FROM_CAMERA @ turn.T @ COLMAP_FROM_CAMERA
    return np.column_stack([rotation, -COLMAP_FROM_CAMERA @ turn.T @ values[:3]])


def _frames(
    oriented: OrientedBlock, lead: np.ndarray, rig_of: Mapping[int, int], sensor_from_rig: Mapping[int, np.ndarray]
) -> tuple[np.ndarray, dict[int, np.ndarray]]:
    """(n,) frame of every image, numbered as its first image is, and rig from world of every frame."""
    camera = oriented.block.images.camera
    # what is no rigid rig has frames of one image
    follows = np.array([rig_of[int(c)] != int(c) for c in camera.tolist()], dtype=bool)
    frame = np.where(follows & oriented.oriented[lead], lead, np.arange(len(camera))) + 1
    from_world: dict[int, np.ndarray] = {}
    for row in np.flatnonzero(oriented.oriented).tolist():
        pose = colmap_pose(oriented, row)
        if frame[row] == row + 1:
            sensor = sensor_from_rig[int(camera[row])]
            rotation = sensor[:, :3].T @ pose[:, :3]
            from_world[row + 1] = np.column_stack([rotation, sensor[:, :3].T @ (pose[:, 3] - sensor[:, 3])])
    return frame, from_world
