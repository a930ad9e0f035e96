"""A COLMAP model brought to an adjusted orientation in place, by way of pycolmap.

Cameras, poses and object points are those of the adjustment; numbers, names, image points, tracks and colours stay.
What was not adjusted is moved by the similarity between the two. Image points stay as measured, since the photographs
do: what COLMAP's cameras have no words for is fitted.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.coordinates.similarity import Similarity
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.foreign.colmap import OWN_ENTRIES
from aerotri.formats.foreign.colmap_cameras import colmap_camera, whole_camera
from aerotri.formats.foreign.colmap_model import open_model
from aerotri.formats.foreign.colmap_rigs import colmap_pose
from aerotri.formats.foreign.in_place import about_others, mean_pose, move_between, poses_differ, replaced_files


def update_colmap(oriented: OrientedBlock, folder: FilePath) -> tuple[str, ...]:
    """Bring the model that a block was read from to the block's orientation.

    Photographs are matched by their names, object points by their numbers.

    Parameters
    ----------
    oriented : block, orientation and points.
    folder : of the model, binary or text. Older files go into its folder before_aerotri.

    Returns
    -------
    What moved along unadjusted or could not be carried over, in words.

    Raises
    ------
    InputError
        When the model is not that of the block, cameras differ between groups of photographs, or move on a rigid rig.
    """
    folder = Path(folder)
    model = open_model(folder)
    row_of = {name: row for row, name in enumerate(oriented.block.images.names.tolist())}
    there = oriented.oriented
    rows = {
        number: row_of[image.name]
        for number, image in model.images.items()
        if image.name in row_of and there[row_of[image.name]]
    }
    if not rows:
        raise InputError("has no photograph of the result", "give the model that the block was read from", folder)
    points = _points(oriented, model)
    move = _move(oriented, model, rows, points, folder)
    _transform(model, move)
    said = _set_cameras(oriented, model, rows, folder)
    _set_poses(oriented, model, rows, folder)
    for number, place in points.items():
        model.points3D[number].xyz = oriented.points[place]
    model.update_point_3d_errors()
    with replaced_files(folder, OWN_ENTRIES) as new:
        (model.write_binary if (folder / "cameras.bin").is_file() else model.write_text)(new)
    images = sum(number not in rows for number in model.reg_image_ids())
    missing = int(oriented.oriented.sum()) - len(rows)
    return (*said, *about_others(images, len(model.points3D) - len(points), missing, "model"))


def _points(oriented: OrientedBlock, model: Any) -> dict[int, int]:
    """Places in the block of the model's object points, by number, where they were adjusted."""
    known = np.flatnonzero(np.isfinite(oriented.points).all(axis=1))
    names = oriented.block.points[known].tolist()
    # names of control points are no numbers
    numbers = ((int(name), place) for name, place in zip(names, known.tolist(), strict=True) if _is_number(name))
    here = set(model.point3D_ids())
    return {number: place for number, place in numbers if number in here}


def _is_number(name: str) -> bool:
    return name.isascii() and name.isdigit() and len(name) < 20 and str(int(name)) == name


def _move(
    oriented: OrientedBlock, model: Any, rows: Mapping[int, int], points: Mapping[int, int], folder: Path
) -> Similarity:
    """From photographs with an old pose, and from points."""
    posed = [number for number in rows if model.images[number].has_pose]
    old = [model.images[number].projection_center() for number in posed]
    old += [model.points3D[number].xyz for number in points]
    new = [oriented.centre[[rows[number] for number in posed]], oriented.points[list(points.values())]]
    return move_between(np.array(old, dtype=float).reshape(-1, 3), np.vstack(new), folder)


def _transform(model: Any, move: Similarity) -> None:
    from aerotri.colmap_library import pycolmap

    model.transform(pycolmap.Sim3d(move.scale, pycolmap.Rotation3d(move.rotation), move.translation))


def _set_cameras(oriented: OrientedBlock, model: Any, rows: Mapping[int, int], folder: Path) -> tuple[str, ...]:
    """The cameras of adjusted photographs, and what was fitted, in words."""
    from aerotri.colmap_library import pycolmap

    used: dict[int, set[int]] = {}
    for number, row in rows.items():
        used.setdefault(model.images[number].camera_id, set()).add(int(oriented.block.images.camera[row]))
    said = []
    for number, places in used.items():
        camera = model.cameras[number]
        if len(places) > 1:
            raise InputError(
                f"camera {number} has other parameters in every group of photographs, the model has it once",
                'adjust with parameter_groups = "camera", or write a new model without --in-place',
                folder,
            )
        (place,) = places
        own = oriented.block.cameras[place]
        if own.size_px != (camera.width, camera.height):
            raise InputError(f"camera {number} has another format than in the result", "give its own model", folder)
        whole, words = whole_camera(own, oriented.format_errors[place] if oriented.format_errors else None)
        said += words
        name, values = colmap_camera(whole, camera.model.name)
        camera.model = getattr(pycolmap.CameraModelId, name)
        camera.params = values
    return tuple(said)


def _set_poses(oriented: OrientedBlock, model: Any, rows: Mapping[int, int], folder: Path) -> None:
    """Rigs and frames, so that every photograph has its pose.

    Raises
    ------
    InputError
        When the photographs of a rig deviate from rigidity.
    """
    from aerotri.colmap_library import pycolmap

    wanted = {number: colmap_pose(oriented, row) for number, row in rows.items()}
    for rig in model.rigs.values():
        for sensor, pose in _sensors(model, rig, wanted).items():
            rig.set_sensor_from_rig(sensor, pycolmap.Rigid3d(pose))
    registered = set(model.reg_frame_ids())
    for frame in model.frames.values():
        own = [d.id for d in frame.image_ids if d.id in wanted]
        if own:
            number = next((number for number in own if model.images[number].is_ref_in_frame()), own[0])
            frame.set_cam_from_world(model.images[number].camera_id, pycolmap.Rigid3d(wanted[number]))
            if frame.frame_id not in registered:
                model.register_frame(frame.frame_id)
    _check_poses(model, wanted, folder)


def _sensors(model: Any, rig: Any, wanted: Mapping[int, np.ndarray]) -> dict[Any, np.ndarray]:
    """(3, 4) sensor from rig of the cameras that are not the reference, where a frame has both photographs."""
    found: dict[int, list[np.ndarray]] = {}
    sensors = {sensor.id: sensor for sensor in rig.non_ref_sensors}
    for frame in model.frames.values():
        if frame.rig_id != rig.rig_id or not sensors:
            continue
        own = {model.images[d.id].camera_id: wanted[d.id] for d in frame.image_ids if d.id in wanted}
        lead = own.get(rig.ref_sensor_id.id)
        if lead is None:
            continue
        for camera, pose in own.items():
            if camera in sensors:
                turn = pose[:, :3] @ lead[:, :3].T
                found.setdefault(camera, []).append(np.column_stack([turn, pose[:, 3] - turn @ lead[:, 3]]))
    return {sensors[camera]: mean_pose(poses) for camera, poses in found.items()}


def _check_poses(model: Any, wanted: Mapping[int, np.ndarray], folder: Path) -> None:
    for number, pose in wanted.items():
        if poses_differ(model.images[number].cam_from_world().matrix(), pose):
            raise InputError(
                f"photograph '{model.images[number].name}' moves on its rig, which is rigid in the model",
                'adjust with constraint = "rigid", or write a new model without --in-place',
                folder,
            )
