"""sfm_data of AliceVision (Meshroom), in JSON, as a block.

[L] AliceVision's sources. As `openmvg`, but rotations are written column by column, and numbers as texts. Principal
points count from the image centre since version 1.2.1, focal lengths in millimetres since 1.2.2; pixelRatio is the
focal length along y by that along x since 1.2.5. The projection (type) and the distortion of a camera are stated apart
in newer versions; an equidistant image point lies radius·2θ/φ from the principal point, φ = shorter side of the sensor
/ focal length, radius that of the image circle in pixels.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, counted
from aerotri.foreign_json import json_head
from aerotri.formats.assembly.parts import Reading
from aerotri.formats.foreign.openmvg import (
    ENDINGS,
    UNDEFINED,
    Scene,
    checked,
    key_of,
    not_used,
    number_of,
    numbers_of,
    pose_of,
    reading_of,
    root_of,
    section_of,
    size_of,
)
from aerotri.formats.foreign.opensfm_json import Node
from aerotri.formats.foreign.reconstruction import PixelCamera
from aerotri.formats.text.notes import left_behind

LENS: dict[str, tuple[str, ...]] = {
    "none": (), "pinhole": (), "radial1": ("k1",), "radialk1": ("k1",), "radial3": ("k1", "k2", "k3"),
    "radialk3": ("k1", "k2", "k3"), "brown": ("k1", "k2", "k3", "p1", "p2"), "fisheye4": ("k1", "k2", "k3", "k4"),
}  # fmt: skip
"""Parameters by the distortion."""
EQUIDISTANT = "equidistant"
SECTIONS = (
    "version", "featuresFolders", "matchesFolders", "views", "intrinsics", "poses", "rigs", "structure",
    "controlPoints",
)  # fmt: skip
"""What is used of a file or named elsewhere, or is of no use for an adjustment."""
FROM_CENTRE_SINCE, RATIO_SINCE = (1, 2, 1), (1, 2, 5)
"""Versions since which principal points count from the image centre, and pixelRatio is what its name says."""


def is_alicevision(path: Path) -> bool:
    """Whether a JSON file is an sfm_data of AliceVision."""
    head = json_head(path, ENDINGS)
    return '"viewId"' in head and '"intrinsicId"' in head and '"nodesVersions"' not in head


def read_alicevision(path: FilePath, pixel_um: float = 1.0) -> Reading:
    """The scene of an sfm_data of AliceVision; see `read_openmvg`."""
    path = Path(path)
    return reading_of(_scene(root_of(path)), path, pixel_um)


def _scene(root: Node) -> Scene:
    version = tuple(int(number_of(node)) for node in section_of(root, "version"))
    poses = {}
    for entry in section_of(root, "poses"):
        transform = entry.get("pose").get("transform")
        columns = np.array(numbers_of(transform.get("rotation"), 9))
        poses[key_of(entry.get("poseId"))] = pose_of(entry, columns.reshape(3, 3).T.ravel(), transform.get("center"))
    views, rigs = {}, 0
    for view in section_of(root, "views"):
        pose = poses.get(key_of(view.get("poseId"))) if view.has("poseId") else None
        if view.has("rigId") and key_of(view.get("rigId")) not in UNDEFINED:
            rigs, pose = rigs + 1, None
        camera = key_of(view.get("intrinsicId")) if view.has("intrinsicId") else ""
        views[key_of(view.get("viewId"))] = view.get("path").text(), camera, pose
    cameras = {key_of(one.get("intrinsicId")): _camera(one, version) for one in section_of(root, "intrinsics")}
    said = not_used(root, SECTIONS)
    if rigs:
        words = f"not used: rigs; {counted(rigs, 'photograph')} of them without start orientation"
        said.append(left_behind(words))
    points, control = ([_point(one) for one in section_of(root, key)] for key in ("structure", "controlPoints"))
    return Scene(views, cameras, points, control, tuple(said))


def _point(entry: Node) -> tuple[str, list[float], list[tuple[str, float, float]]]:
    seen = []
    for one in section_of(entry, "observations"):
        x, y = numbers_of(one.get("x"), 2)
        seen.append((key_of(one.get("observationId")), x, y))
    return key_of(entry.get("landmarkId")), numbers_of(entry.get("X"), 3), seen


def _camera(node: Node, version: tuple[int, ...]) -> PixelCamera:
    width, height = size_of(node)
    equidistant, lens, kind = _lens(node)
    x, y = numbers_of(node.get("principalPoint"), 2)
    if version >= FROM_CENTRE_SINCE or (not version and node.has("focalLength")):
        x, y = width / 2.0 + x, height / 2.0 + y
    focal = _focal_px(node, version, width)
    if equidistant:
        focal = _equidistant_px(node, focal[0], (width, height))
    return checked(node, (width, height), focal, (x, y), lens, equidistant or kind == "fisheye4")


def _lens(node: Node) -> tuple[bool, dict[str, float], str]:
    """Whether a camera is equidistant, the parameters of its lens, and their kind."""
    stated = node.get("type").text().lower()
    equidistant = stated == EQUIDISTANT
    apart = node.has("distortionType") and bool(node.get("distortionType").value)
    # older versions have one word for both
    distortion = node.get("distortionType").text().lower() if apart else "none" if equidistant else stated
    values = numbers_of(node.get("distortionParams")) if node.has("distortionParams") else []
    kind = stated if stated not in (*LENS, EQUIDISTANT) else distortion
    if kind not in LENS or (len(values) != len(LENS[distortion]) and any(values)):
        raise node.error(f"a camera of type {kind[:40]} cannot be expressed", f"known are {', '.join(LENS)}")
    if equidistant and any(values):
        raise node.error(
            "an equidistant camera with distortion cannot be expressed", "adjust it as pinhole with fisheye4"
        )
    _refuse_undistortion(node)
    return equidistant, dict(zip(LENS[distortion], values, strict=False)), distortion


def _refuse_undistortion(node: Node) -> None:
    kind = str(node.get("undistortionType").value).lower() if node.has("undistortionType") else "none"
    keys = ("undistortionParams", "undistortionOffset")
    values = [value for key in keys if node.has(key) for value in numbers_of(node.get(key))]
    if kind not in ("", "none") and any(values):
        raise node.error(f"an undistortion of type {kind[:40]} cannot be expressed", "export undistorted photographs")


def _focal_px(node: Node, version: tuple[int, ...], width: int) -> tuple[float, float]:
    """Focal lengths along x and y."""
    if not node.has("focalLength"):
        stated = node.get("pxFocalLength")
        both = numbers_of(stated, 2) if isinstance(stated.value, list) else [number_of(stated)] * 2
        return both[0], both[1]
    fx = number_of(node.get("focalLength")) * width / _sensor(node, "sensorWidth")
    ratio = number_of(node.get("pixelRatio")) if node.has("pixelRatio") else 1.0
    if ratio != 1.0 and version < RATIO_SINCE:
        raise node.error("has a pixelRatio of an older version", "export the scene with a newer version")
    return fx, fx * ratio


def _sensor(node: Node, side: str) -> float:
    size = number_of(node.get(side))
    if size <= 0.0:
        raise node.error("has a focal length in mm and no size of the sensor", "state the size of the sensor")
    return size


def _equidistant_px(node: Node, focal: float, size: tuple[int, int]) -> tuple[float, float]:
    """Pixels of a radian: where the image circle fits the format and the sensor, this is the focal length."""
    width, height = (_sensor(node, side) for side in ("sensorWidth", "sensorHeight"))
    radius = number_of(node.get("fisheyeCircleRadius")) if node.has("fisheyeCircleRadius") else min(size) / 2.0
    found = radius * 2.0 * focal * width / max(size) / min(width, height)
    return found, found
