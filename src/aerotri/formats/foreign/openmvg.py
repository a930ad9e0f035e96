"""sfm_data of OpenMVG and of AliceVision (Meshroom), in JSON, as a block.

[L] OpenMVG's and AliceVision's sources. Rotations lead from the world to x right, y down, z forwards; centre is the
projection centre. OpenMVG writes rotations row by row, AliceVision column by column, and its numbers as texts. Lenses
are OpenCV's: disto_k1, disto_k3, disto_t2 (k1, k2, k3, p1, p2) and fisheye (k1 to k4). Since AliceVision writes focal
lengths in millimetres (focalLength, sensorWidth), principal points count from the image centre; pixelRatio is then the
focal length along y by that along x, since version 1.2.5. Coordinates are local.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError, counted
from aerotri.foreign_json import json_head, read_foreign_json
from aerotri.formats.assembly.parts import Reading
from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA
from aerotri.formats.foreign.opensfm_json import LARGEST, Node
from aerotri.formats.foreign.reconstruction import (
    PixelCamera,
    Reconstruction,
    check_names,
    names_of_paths,
    rotation_matrix,
)
from aerotri.formats.text.notes import assumed, left_behind
from aerotri.formats.text.text_lines import is_number
from aerotri.observations import Control

ENDINGS = (".json", ".sfm")
REMEDY = "export the scene again, as JSON"
OPENMVG_LENS: dict[str, tuple[str, ...]] = {
    "disto_k1": ("k1",), "disto_k3": ("k1", "k2", "k3"), "disto_t2": ("k1", "k2", "k3", "p1", "p2"),
    "fisheye": ("k1", "k2", "k3", "k4"),
}  # fmt: skip
"""Parameters by the key that holds them."""
ALICEVISION_LENS: dict[str, tuple[str, ...]] = {
    "none": (), "pinhole": (), "radial1": ("k1",), "radialk1": ("k1",), "radial3": ("k1", "k2", "k3"),
    "radialk3": ("k1", "k2", "k3"), "brown": ("k1", "k2", "k3", "p1", "p2"), "fisheye4": ("k1", "k2", "k3", "k4"),
}  # fmt: skip
NO_RIG = ("", "4294967295", "-1")
RATIO_SINCE = (1, 2, 5)
"""Version since which pixelRatio is what its name says."""


@dataclass(frozen=True, eq=False)
class _Scene:
    """What both programs hold.

    Parameters
    ----------
    views : file, key of the camera and pose by the key of a view; the pose is rotation and centre, None where unknown.
    cameras : by key. points : name, coordinates and observations (view, x, y). control : the same, of control points.
    """

    views: dict[str, tuple[str, str, tuple[np.ndarray, np.ndarray] | None]]
    cameras: dict[str, PixelCamera]
    points: list[tuple[str, list[float], list[tuple[str, float, float]]]]
    control: list[tuple[str, list[float], list[tuple[str, float, float]]]]
    messages: tuple[str, ...] = ()


def is_openmvg(path: Path) -> bool:
    """Whether a JSON file is an sfm_data of OpenMVG."""
    return '"sfm_data_version"' in json_head(path, ENDINGS)


def is_alicevision(path: Path) -> bool:
    """Whether a JSON file is an sfm_data of AliceVision."""
    head = json_head(path, ENDINGS)
    return '"viewId"' in head and '"intrinsicId"' in head and '"nodesVersions"' not in head


def read_openmvg(path: FilePath, pixel_um: float = 1.0) -> Reading:
    """The scene of an sfm_data.json of OpenMVG; control points have a σ of the user's choice.

    Parameters
    ----------
    pixel_um : size of a pixel, which the file does not tell.

    Raises
    ------
    InputError
        When it is damaged, or a camera cannot be expressed.
    """
    path = Path(path)
    return _reading(_openmvg_scene(_root(path)), path, pixel_um)


def read_alicevision(path: FilePath, pixel_um: float = 1.0) -> Reading:
    """The scene of an sfm_data of AliceVision; see `read_openmvg`."""
    path = Path(path)
    return _reading(_alicevision_scene(_root(path)), path, pixel_um)


def _root(path: Path) -> Node:
    return Node(read_foreign_json(path, REMEDY), "the file", path)


def _list(node: Node) -> list[Node]:
    if node.value == "":
        # an empty list of boost
        return []
    if not isinstance(node.value, list):
        raise node.error("is no list", REMEDY)
    return [Node(value, f"{node.where}[{k}]"[:120], node.path) for k, value in enumerate(node.value)]


def _number(node: Node) -> float:
    """A number, written as one or as a text."""
    if isinstance(node.value, str) and is_number(node.value):
        value = float(node.value)
        if not (math.isfinite(value) and abs(value) <= LARGEST):
            raise node.error(f"{node.value[:40]} is not possible", REMEDY)
        return value
    return node.number()


def _numbers(node: Node, count: int | None = None) -> list[float]:
    values = [_number(entry) for entry in _list(node)]
    if count is not None and len(values) != count:
        raise node.error(f"is no list of {count} numbers", REMEDY)
    return values


def _key(node: Node) -> str:
    """An identifier, written as a number or as a text."""
    if isinstance(node.value, bool) or not isinstance(node.value, int | str):
        raise node.error("is no identifier", REMEDY)
    return str(node.value)


def _of(table: Node, section: str) -> list[Node]:
    return _list(table.get(section)) if table.has(section) else []


def _openmvg_scene(root: Node) -> _Scene:
    poses = {}
    for entry in _of(root, "extrinsics"):
        value = entry.get("value")
        rows = [number for row in _list(value.get("rotation")) for number in _numbers(row, 3)]
        poses[_key(entry.get("key"))] = _pose(value, np.array(rows), value.get("center"))
    views = {}
    for entry in _of(root, "views"):
        data = entry.get("value").get("ptr_wrapper").get("data")
        data = data.get("value0") if data.has("value0") else data
        name = "/".join(data.get(key).value for key in ("local_path", "filename") if _is_text(data, key))
        pose = poses.get(_key(data.get("id_pose")))
        views[_key(entry.get("key"))] = name, _key(data.get("id_intrinsic")), pose
    cameras = {_key(one.get("key")): _openmvg_camera(one.get("value")) for one in _of(root, "intrinsics")}
    structure = [_openmvg_point(one) for one in _of(root, "structure")]
    return _Scene(views, cameras, structure, [_openmvg_point(one) for one in _of(root, "control_points")])


def _is_text(table: Node, key: str) -> bool:
    return table.has(key) and isinstance(table.get(key).value, str) and bool(table.get(key).value)


def _pose(node: Node, matrix: np.ndarray, centre: Node) -> tuple[np.ndarray, np.ndarray]:
    """Rotation from x right, y down, z forwards to the world, and projection centre."""
    if len(matrix) != 9:
        raise node.error("its rotation does not have 9 numbers", REMEDY)
    return rotation_matrix(matrix, node.error("its rotation is none", REMEDY)).T, np.array(_numbers(centre, 3))


def _openmvg_camera(value: Node) -> PixelCamera:
    data = value.get("ptr_wrapper").get("data")
    own = data.get("value0") if data.has("value0") else data
    if not own.has("focal_length"):
        raise value.error("the camera has no focal length; is it spherical?", "export perspective photographs")
    unknown = [key for key in data.items() if key.startswith(("disto", "fish", "affine")) and key not in OPENMVG_LENS]
    if unknown:
        raise value.error(
            f"a camera with {unknown[0][:40]} cannot be expressed", f"known are {', '.join(OPENMVG_LENS)}"
        )
    lens: dict[str, float] = {}
    for key, names in OPENMVG_LENS.items():
        if data.has(key):
            lens = dict(zip(names, _numbers(data.get(key), len(names)), strict=True))
    focal = _number(own.get("focal_length"))
    x, y = _numbers(own.get("principal_point"), 2)
    return _checked(value, _size(own), (focal, focal), (x, y), lens, data.has("fisheye"))


def _size(node: Node) -> tuple[int, int]:
    width, height = _number(node.get("width")), _number(node.get("height"))
    if width % 1.0 or height % 1.0:
        raise node.error("width and height are no format", REMEDY)
    return int(width), int(height)


def _checked(
    node: Node, size: tuple[int, int], focal: tuple[float, float], centre: tuple[float, float], lens: dict[str, float],
    fisheye: bool,
) -> PixelCamera:  # fmt: skip
    camera = PixelCamera(size, focal, centre, lens, fisheye, centre_known=True)
    camera.refuse_impossible(node.error("has values that no camera has", REMEDY))
    return camera


def _openmvg_point(entry: Node) -> tuple[str, list[float], list[tuple[str, float, float]]]:
    value, seen = entry.get("value"), []
    for one in _of(value, "observations"):
        x, y = _numbers(one.get("value").get("x"), 2)
        seen.append((_key(one.get("key")), x, y))
    return _key(entry.get("key")), _numbers(value.get("X"), 3), seen


def _alicevision_scene(root: Node) -> _Scene:
    version = tuple(int(_number(node)) for node in _of(root, "version"))
    poses = {}
    for entry in _of(root, "poses"):
        transform = entry.get("pose").get("transform")
        columns = np.array(_numbers(transform.get("rotation"), 9))
        poses[_key(entry.get("poseId"))] = _pose(entry, columns.reshape(3, 3).T.ravel(), transform.get("center"))
    views, rigs = {}, 0
    for view in _of(root, "views"):
        pose = poses.get(_key(view.get("poseId"))) if view.has("poseId") else None
        if view.has("rigId") and _key(view.get("rigId")) not in NO_RIG:
            rigs, pose = rigs + 1, None
        views[_key(view.get("viewId"))] = view.get("path").text(), _key(view.get("intrinsicId")), pose
    cameras = {_key(one.get("intrinsicId")): _alicevision_camera(one, version) for one in _of(root, "intrinsics")}
    points = []
    for entry in _of(root, "structure"):
        seen = []
        for one in _of(entry, "observations"):
            x, y = _numbers(one.get("x"), 2)
            seen.append((_key(one.get("observationId")), x, y))
        points.append((_key(entry.get("landmarkId")), _numbers(entry.get("X"), 3), seen))
    said = left_behind(f"not used: rigs; {counted(rigs, 'photograph')} of them without start orientation")
    return _Scene(views, cameras, points, [], (said,) if rigs else ())


def _alicevision_camera(node: Node, version: tuple[int, ...]) -> PixelCamera:
    kind, (width, height) = node.get("type").text(), _size(node)
    if node.has("distortionType") and node.get("distortionType").value:
        kind = node.get("distortionType").text()
    values = _numbers(node.get("distortionParams")) if node.has("distortionParams") else []
    if kind not in ALICEVISION_LENS or (len(values) != len(ALICEVISION_LENS[kind]) and any(values)):
        known = ", ".join(ALICEVISION_LENS)
        raise node.error(f"a camera of type {kind[:40]} cannot be expressed", f"known are {known}")
    lens = dict(zip(ALICEVISION_LENS[kind], values, strict=False))
    x, y = _numbers(node.get("principalPoint"), 2)
    if node.has("focalLength"):
        sensor = _number(node.get("sensorWidth"))
        if sensor <= 0.0:
            raise node.error("has a focal length in mm and no size of the sensor", "state the size of the sensor")
        fx = _number(node.get("focalLength")) * width / sensor
        ratio = _number(node.get("pixelRatio")) if node.has("pixelRatio") else 1.0
        if ratio != 1.0 and version < RATIO_SINCE:
            raise node.error("has a pixelRatio of an older version", "export the scene with a newer version")
        focal, centre = (fx, fx * ratio), (width / 2.0 + x, height / 2.0 + y)
    else:
        stated = node.get("pxFocalLength")
        both = _numbers(stated, 2) if isinstance(stated.value, list) else [_number(stated)] * 2
        focal, centre = (both[0], both[1]), (x, y)
    return _checked(node, (width, height), focal, centre, lens, kind == "fisheye4")


def _reading(scene: _Scene, path: Path, pixel_um: float) -> Reading:
    if not scene.views:
        raise InputError("holds no photographs", REMEDY, path)
    used = list(dict.fromkeys(camera for _, camera, _ in scene.views.values()))
    missing = [key for key in used if key not in scene.cameras]
    if missing:
        raise InputError(f"has photographs of a camera '{missing[0][:40]}' that is not described", REMEDY, path)
    names = names_of_paths([file or f"view {key}" for key, (file, _, _) in scene.views.items()])
    check_names(names, "photograph", path, REMEDY)
    place, unknown = {key: k for k, key in enumerate(used)}, (np.full((3, 3), np.nan), np.full(3, np.nan))
    poses = [pose or unknown for _, _, pose in scene.views.values()]
    points, left = _points(scene)
    control = len(scene.control)
    check_names(points[0], "point", path, "give every point a name of its own")
    reading = Reconstruction(
        tuple(scene.cameras[key].camera(f"camera {key}" if len(used) > 1 else "camera", pixel_um) for key in used),
        names,
        np.array([place[camera] for _, camera, _ in scene.views.values()], np.int64),
        np.array([centre for _, centre in poses]),
        np.array([rotation for rotation, _ in poses]) @ COLMAP_FROM_CAMERA,
        *points,
        kept=control,
    ).reading(path.stem)
    said = [left_behind(f"left out: {counted(left, 'image point')} of photographs that are not there, or twice in one")]
    messages: list[str] = [*scene.messages, *(said if left else ()), "coordinates are local"]
    if scene.control:
        messages.append(assumed(f"control points have a standard deviation of {CONTROL_SIGMA_M:g} m"))
    return replace(_with_control(reading, scene), messages=tuple(messages))


def _points(
    scene: _Scene,
) -> tuple[tuple[list[str], np.ndarray, np.ndarray, np.ndarray, np.ndarray], int]:
    """Names, coordinates, and image, point and pixels of the rays; and how many were left out."""
    row = {key: k for k, key in enumerate(scene.views)}
    names, xyz, image, point, px, left = [], [], [], [], [], 0
    for prefix, entries in (("control ", scene.control), ("", scene.points)):
        for key, place, observations in entries:
            seen: set[int] = set()
            for view, x, y in observations:
                photograph = row.get(view, -1)
                if photograph < 0 or photograph in seen:
                    left += 1
                    continue
                seen.add(photograph)
                image.append(photograph)
                point.append(len(names))
                px.append((x, y))
            names.append(f"{prefix}{key}")
            xyz.append(place)
    places = np.array(xyz, float).reshape(-1, 3)
    rays = np.array(image, np.int64), np.array(point, np.int64), np.array(px, float).reshape(-1, 2)
    return (names, places, *rays), left


CONTROL_SIGMA_M = 0.01
"""Standard deviation of control points, which OpenMVG does not know; chosen [C]."""


def _with_control(reading: Reading, scene: _Scene) -> Reading:
    """Control points of OpenMVG as such."""
    if not scene.control or reading.points is None:
        return reading
    count = len(scene.control)
    sigma = np.full((count, 3), CONTROL_SIGMA_M)
    control = Control(np.arange(count), reading.points[:count].copy(), sigma, np.zeros(count, bool))
    block = reading.block
    adjustment = replace(block.settings.adjustment, datum="control")
    settings = replace(block.settings, adjustment=adjustment)
    return replace(reading, block=replace(block, control=control, settings=settings))
