"""Rigs of OpenSfM: the pose of every rig camera, rig → camera, and of every rig instance, world → rig.

OpenSfM gives every photograph a rig instance, which is one of several cameras only where it has several photographs. A
rig here is made of cameras, so that rig cameras which share a camera of OpenSfM become two of ours.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA
from aerotri.formats.foreign.opensfm_json import Node
from aerotri.functional_model.rotation import angles_from_rotation, exponential
from aerotri.observations import Block, Mounting, Prior, Rig


@dataclass(frozen=True, eq=False)
class RigShots:
    """Which rig camera and which exposure a photograph belongs to.

    Parameters
    ----------
    camera : rig camera by photograph, of rigs of several cameras.
    instance : exposure by photograph, of the same.
    groups : rig cameras that belong to one rig, the reference first.
    """

    camera: dict[str, str] = field(default_factory=dict)
    instance: dict[str, str] = field(default_factory=dict)
    groups: tuple[tuple[str, ...], ...] = ()


def rig_shots(chosen: Node) -> RigShots:
    """What the rig instances of a reconstruction say.

    Raises
    ------
    InputError
        When an instance has a rig camera twice, or one that there is not.
    """
    if not chosen.has("rig_instances"):
        return RigShots()
    shots, known = chosen.get("shots").value, chosen.get("rig_cameras").items() if chosen.has("rig_cameras") else {}
    members = {}
    for key, node in chosen.get("rig_instances").items().items():
        cameras = {shot: name.text() for shot, name in node.get("rig_camera_ids").items().items() if shot in shots}
        if len(set(cameras.values())) < len(cameras):
            raise node.error("a rig camera took two of its photographs")
        if not set(cameras.values()) <= set(known):
            raise node.error("a rig camera is not described in rig_cameras")
        members[key] = cameras
    several = [sorted(cameras.values()) for cameras in members.values() if len(cameras) > 1]
    count = Counter(name for cameras in members.values() for name in cameras.values())
    # the sort is stable: of several with as many photographs the first one leads
    groups = _connected(several, sorted(known, key=lambda name: -count[name]))
    mounted = {name for group in groups for name in group}
    own = [(key, shot, name) for key, cameras in members.items() for shot, name in cameras.items() if name in mounted]
    return RigShots({shot: name for _, shot, name in own}, {shot: key for key, shot, _ in own}, groups)


def _connected(several: list[list[str]], order: list[str]) -> tuple[tuple[str, ...], ...]:
    """Rig cameras that photographed together, in groups, each in this order."""
    group_of: dict[str, set[str]] = {}
    for names in several:
        joined = set(names).union(*(group_of.get(name, set()) for name in names))
        for name in joined:
            group_of[name] = joined
    distinct = {id(group): group for group in group_of.values()}
    return tuple(sorted(tuple(name for name in order if name in group) for group in distinct.values()))


def rigs_of(chosen: Node, shots: RigShots, camera_of: dict[str, str]) -> tuple[Rig, ...]:
    """The rigs.

    Parameters
    ----------
    camera_of : the block's camera of every rig camera.
    """
    out = []
    for number, (lead, *others) in enumerate(shots.groups, 1):
        poses = {name: pose_of(chosen.get("rig_cameras").get(name)) for name in (lead, *others)}
        mountings = {camera_of[name]: _mounting(poses[lead], poses[name]) for name in others}
        out.append(Rig(f"rig{number}", camera_of[lead], mountings))
    return tuple(out)


def stations_of(shots: RigShots, names: list[str]) -> np.ndarray:
    """(n,) the exposure of every photograph; '' outside of rigs, and where the reference camera took none."""
    leads = {group[0] for group in shots.groups}
    led = {shots.instance[shot] for shot, name in shots.camera.items() if name in leads}
    found = [shots.instance.get(name, "") for name in names]
    return np.array([instance if instance in led else "" for instance in found], dtype=object)


def pose_of(node: Node) -> np.ndarray:
    """(3, 4) rotation and translation of a pose.

    Raises
    ------
    InputError
    """
    rotation = exponential(np.array(node.get("rotation").numbers(3)))
    return np.column_stack([rotation, node.get("translation").numbers(3)])


def inverse(pose: np.ndarray) -> np.ndarray:
    """(3, 4) the pose the other way round."""
    return np.column_stack([pose[:, :3].T, -pose[:, :3].T @ pose[:, 3]])


def compose(outer: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """(3, 4) first the inner pose, then the outer one."""
    return np.column_stack([outer[:, :3] @ inner[:, :3], outer[:, :3] @ inner[:, 3] + outer[:, 3]])


def _mounting(lead: np.ndarray, pose: np.ndarray) -> Mounting:
    """Position and rotation in the frame of the reference camera."""
    lead_from_camera = compose(lead, inverse(pose))
    rotation = COLMAP_FROM_CAMERA @ lead_from_camera[:, :3] @ COLMAP_FROM_CAMERA
    x, y, z = (Prior(float(value)) for value in COLMAP_FROM_CAMERA @ lead_from_camera[:, 3])
    a, b, c = (Prior(float(value)) for value in angles_from_rotation(rotation, Block.rotation))
    return Mounting((x, y, z), (a, b, c))


def split_cameras(chosen: Node, shots: RigShots) -> dict[tuple[str, str], str]:
    """Names of our cameras by camera and rig camera ('' outside of rigs); the camera's own where it is one.

    Raises
    ------
    InputError
        When a rig camera has photographs of two cameras.
    """
    used: dict[tuple[str, str], None] = {}
    for shot, node in chosen.get("shots").items().items():
        used[node.get("camera").text(), shots.camera.get(shot, "")] = None
    rig_cameras = [name for _, name in used if name]
    twice = [name for name, times in Counter(rig_cameras).items() if times > 1]
    if twice:
        message = f"rig camera '{twice[0][:60]}' has photographs of two cameras"
        raise chosen.error(message, "give each camera a rig camera of its own")
    parts = Counter(camera for camera, _ in used)
    return {(camera, rig): f"{camera} {rig}".strip() if parts[camera] > 1 else camera for camera, rig in used}
