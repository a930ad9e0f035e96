"""An OpenSfM or OpenDroneMap project brought to an adjusted orientation in place.

Cameras, shots, rigs and points of reconstruction.json are those of the adjustment; everything else of the file, and
tracks.csv, stay. Image points stay as measured, since the photographs do: what OpenSfM's cameras have no words for is
fitted. OpenDroneMap's reconstruction.json in a projected system is the local one times an affine transformation, which
its points tell; it is made again from the new one.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import FilePath, InputError, counted
from aerotri.coordinates.similarity import Similarity
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.foreign.colmap_rigs import colmap_pose
from aerotri.formats.foreign.in_place import (
    about_others,
    centre_of,
    mean_pose,
    move_between,
    poses_differ,
    replaced_files,
)
from aerotri.formats.foreign.opensfm import RECONSTRUCTION, TOPOCENTRIC, file_of
from aerotri.formats.foreign.opensfm_cameras import camera_json, whole_camera
from aerotri.formats.foreign.opensfm_json import Node, points_of, read_reconstructions
from aerotri.formats.foreign.opensfm_rigs import RigShots, compose, inverse, pose_of, rig_shots
from aerotri.functional_model.rotation import logarithm

MOVED = 1e-2
"""Scale and rotation by which a project turns or grows before its user is told [C]: reference_lla is then no longer
that of its coordinates."""
UNDISTORTED = "undistorted"
AFFINE = 1e-6
"""Smallest singular value, of the largest, of the points that tell the affine transformation [C]."""


def origin_of(folder: FilePath) -> np.ndarray | None:
    """(3,) longitude, latitude and height of the axes of a project; None where it has none.

    Raises
    ------
    InputError
    """
    found = None
    for node in read_reconstructions(file_of(Path(folder))):
        if found is None and node.has("reference_lla"):
            lla = node.get("reference_lla")
            found = np.array([lla.get(key).number() for key in ("longitude", "latitude", "altitude")])
    return found


def update_opensfm(oriented: OrientedBlock, folder: FilePath) -> tuple[str, ...]:
    """Bring the project that a block was read from to the block's orientation.

    Photographs and object points are matched by their names; of several reconstructions the one with most of them is
    changed.

    Parameters
    ----------
    oriented : block, orientation and points, in the axes of the project.
    folder : with reconstruction.json, or that file. Older files go into the folder before_aerotri.

    Returns
    -------
    What moved along unadjusted, could not be carried over, or is to be made anew, in words.

    Raises
    ------
    InputError
        When the project is not that of the block, or its files are damaged.
    """
    path = file_of(Path(folder))
    nodes = read_reconstructions(path)
    rows = {
        name: row
        for row, (name, there) in enumerate(zip(oriented.block.images.names.tolist(), oriented.oriented, strict=True))
        if there
    }
    counts = [sum(name in rows for name in node.get("shots").items()) for node in nodes]
    chosen = nodes[counts.index(max(counts))]
    if not max(counts):
        raise InputError("has no photograph of the result", "give the project that the block was read from", path)
    rows = {name: row for name, row in rows.items() if name in chosen.get("shots").value}
    names, old = points_of(chosen.get("points"))
    move, new, adjusted = _points(oriented, chosen, rows, names, old, path)
    said = [*_set_cameras(oriented, chosen, rows), *_set_poses(oriented, chosen, rows, move)]
    for point, xyz in zip(chosen.get("points").value.values(), new.tolist(), strict=True):
        point["coordinates"] = xyz
    said += _about(oriented, chosen, rows, len(names) - adjusted, move, path.parent)
    files = {path.name: [node.value for node in nodes]}
    if path.name == TOPOCENTRIC:
        files[RECONSTRUCTION] = _projected(path.with_name(RECONSTRUCTION), chosen, names, old)
    with replaced_files(path.parent, tuple(files)) as place:
        for name, content in files.items():
            (place / name).write_text(json.dumps(content), encoding="utf-8")
    return tuple(said)


def _points(
    oriented: OrientedBlock, chosen: Node, rows: dict[str, int], names: list[str], old: np.ndarray, path: Path
) -> tuple[Similarity, np.ndarray, int]:
    """How the project moves, (N, 3) its points as they are to be, and how many of them were adjusted."""
    place = {name: k for k, name in enumerate(oriented.block.points.tolist())}
    where = np.array([place.get(name, -1) for name in names], dtype=np.int64)
    known = where >= 0
    known[known] = np.isfinite(oriented.points[where[known]]).all(axis=1)
    shots = chosen.get("shots").items()
    centres = np.array([centre_of(pose_of(shots[name])) for name in rows])
    common = np.vstack([centres, old[known]])
    move = move_between(common, np.vstack([oriented.centre[list(rows.values())], oriented.points[where[known]]]), path)
    new = move(old)
    new[known] = oriented.points[where[known]]
    return move, new, int(known.sum())


def _set_cameras(oriented: OrientedBlock, chosen: Node, rows: dict[str, int]) -> list[str]:
    """Cameras as adjusted; where photographs of one camera have different ones now, cameras are added."""
    block, cameras, shots = oriented.block, chosen.value["cameras"], chosen.value["shots"]
    places: dict[str, set[int]] = {}
    for name, row in rows.items():
        places.setdefault(shots[name]["camera"], set()).add(int(block.images.camera[row]))
    said, key_of = [], {}
    for key, several in places.items():
        before = dict(cameras[key])
        for place in sorted(several):
            errors = oriented.format_errors[place] if oriented.format_errors else None
            whole, words = whole_camera(block.cameras[place], errors)
            said += words
            key_of[key, place] = key if len(several) == 1 else _free_key(cameras, block.cameras[place].name)
            cameras[key_of[key, place]] = before | camera_json(whole, str(before.get("projection_type")))
    for name, row in rows.items():
        shots[name]["camera"] = key_of[shots[name]["camera"], int(block.images.camera[row])]
    return said


def _free_key(cameras: dict[str, Any], name: str) -> str:
    key, number = name, 2
    while key in cameras:
        key, number = f"{name} {number}", number + 1
    return key


def _set_poses(oriented: OrientedBlock, chosen: Node, rows: dict[str, int], move: Similarity) -> list[str]:
    """Shots, rig cameras and rig instances, and what to say of them."""
    wanted = {name: colmap_pose(oriented, row) for name, row in rows.items()}
    shots = chosen.get("shots").items()
    poses = {name: wanted.get(name, _moved(pose_of(node), move)) for name, node in shots.items()}
    on_rigs = rig_shots(chosen)
    mounted = _mounted(chosen, on_rigs, wanted, move)
    alone: dict[str, str] = {}
    if chosen.has("rig_instances"):
        for node in chosen.get("rig_instances").items().values():
            members = {shot: node.get("rig_camera_ids").get(shot).text() for shot in node.value["rig_camera_ids"]}
            here = sorted((shot for shot in members if shot in poses), key=lambda shot: shot not in wanted)
            if not here:
                _write(node.value, _moved(pose_of(node), move))
                continue
            instance = compose(inverse(mounted[members[here[0]]]), poses[here[0]])
            _write(node.value, instance)
            for shot in here:
                again = compose(mounted[members[shot]], instance)
                if shot not in wanted:
                    poses[shot] = again
                elif poses_differ(again, wanted[shot]):
                    alone[shot] = members[shot]
                    del node.value["rig_camera_ids"][shot]
        for shot, name in alone.items():
            own = chosen.value["rig_instances"].setdefault(_free_key(chosen.value["rig_instances"], shot), {})
            _write(own, compose(inverse(mounted[name]), poses[shot]))
            own["rig_camera_ids"] = {shot: name}
        for name, node in chosen.get("rig_cameras").items().items():
            _write(node.value, mounted[name])
    for name, node in shots.items():
        _write(node.value, poses[name])
    what = counted(len(alone), "photograph has", "photographs have")
    return [f"{what} a rig instance of its own now, since it moves on the rig"] if alone else []


def _mounted(chosen: Node, on_rigs: RigShots, wanted: dict[str, np.ndarray], move: Similarity) -> dict[str, np.ndarray]:
    """(3, 4) camera from rig of every rig camera; the reference of a rig stays where it is in its rig."""
    if not chosen.has("rig_cameras"):
        return {}
    out = {}
    for name, node in chosen.get("rig_cameras").items().items():
        pose = pose_of(node)
        out[name] = np.column_stack([pose[:, :3], move.scale * pose[:, 3]])
    shot_of = {(on_rigs.instance[shot], rig): shot for shot, rig in on_rigs.camera.items() if shot in wanted}
    for lead, *others in on_rigs.groups:
        leads = {instance: wanted[shot] for (instance, rig), shot in shot_of.items() if rig == lead}
        for name in others:
            turns = [
                compose(wanted[shot_of[key, name]], inverse(pose))
                for key, pose in leads.items()
                if (key, name) in shot_of
            ]
            if turns:
                out[name] = compose(mean_pose(turns), out[lead])
    return out


def _moved(pose: np.ndarray, move: Similarity) -> np.ndarray:
    """A pose in the coordinates of the adjustment."""
    rotation = pose[:, :3] @ move.rotation.T
    return np.column_stack([rotation, -rotation @ move(centre_of(pose)[None])[0]])


def _write(value: dict[str, Any], pose: np.ndarray) -> None:
    value["rotation"], value["translation"] = logarithm(pose[:, :3]).tolist(), pose[:, 3].tolist()


def _projected(path: Path, chosen: Node, names: list[str], old: np.ndarray) -> list[Any]:
    """OpenDroneMap's reconstruction.json, made again from the local one.

    Raises
    ------
    InputError
        When the two have too few points in common to tell the transformation between them.
    """
    nodes = read_reconstructions(path)
    place = {name: k for k, name in enumerate(names)}
    for node in nodes:
        theirs, projected = points_of(node.get("points"))
        pairs = [(place[name], k) for k, name in enumerate(theirs) if name in place]
        if not pairs or not set(node.get("shots").value) & set(chosen.get("shots").value):
            continue
        here, there = (np.array(side) for side in zip(*pairs, strict=True))
        middle, aim = old[here].mean(axis=0), projected[there].mean(axis=0)
        rows = old[here] - middle
        if len(rows) < 4 or np.linalg.svd(rows, compute_uv=False)[-1] <= AFFINE * np.linalg.norm(rows):
            raise InputError(f"has too few points of {TOPOCENTRIC}", "run OpenDroneMap again", path)
        linear = np.linalg.lstsq(rows, projected[there] - aim, rcond=None)[0].T
        _set_projected(node, chosen, linear, aim - linear @ middle)
    return [node.value for node in nodes]


def _set_projected(node: Node, chosen: Node, linear: np.ndarray, shift: np.ndarray) -> None:
    for name, point in node.value["points"].items():
        if name in chosen.value["points"]:
            point["coordinates"] = (linear @ chosen.value["points"][name]["coordinates"] + shift).tolist()
    u, _, vt = np.linalg.svd(np.linalg.inv(linear))
    turn = u @ vt
    for section in ("shots", "rig_instances"):
        for name, value in node.value.get(section, {}).items():
            source = chosen.value.get(section, {}).get(name)
            if source is not None:
                pose = pose_of(Node(source, name, chosen.path))
                rotation = pose[:, :3] @ turn
                _write(value, np.column_stack([rotation, -rotation @ (linear @ centre_of(pose) + shift)]))
                if "camera" in source:
                    value["camera"] = source["camera"]
    for section in ("cameras", "rig_cameras"):
        if section in chosen.value:
            node.value[section] = node.value.get(section, {}) | chosen.value[section]


def _about(
    oriented: OrientedBlock, chosen: Node, rows: dict[str, int], others: int, move: Similarity, folder: Path
) -> list[str]:
    """What is to be said."""
    missing = int(oriented.oriented.sum()) - len(rows)
    said = about_others(len(chosen.value["shots"]) - len(rows), others, missing, "project")
    turned = float(np.abs(logarithm(move.rotation)).max())
    if chosen.has("reference_lla") and (abs(move.scale - 1.0) > MOVED or turned > MOVED):
        said.append("the project turned or grew: its coordinates are no longer east, north and up at reference_lla")
    if (folder / UNDISTORTED).is_dir():
        said.append(f"photographs in {UNDISTORTED} have the old cameras: remove the folder, and run what follows again")
    return said
