"""sfm_data of OpenMVG, in JSON, as a block; what it has in common with that of AliceVision.

[L] OpenMVG's sources. Rotations lead from the world to x right, y down, z forwards and are written row by row; centre
is the projection centre. Lenses are OpenCV's: disto_k1, disto_k3, disto_t2 (k1, k2, k3, p1, p2) and fisheye (k1 to k4).
Coordinates are local.
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
UNDEFINED = ("", "4294967295", "-1")
"""Identifiers of nothing: no camera, no rig."""
SECTIONS = (
    "sfm_data_version", "root_path", "views", "intrinsics", "extrinsics", "structure", "control_points",
)  # fmt: skip
"""What is used of a file, or is of no use for an adjustment."""


@dataclass(frozen=True, eq=False)
class Scene:
    """What both programs hold.

    Parameters
    ----------
    views : file, key of the camera ('' for none) and pose by the key of a view; the pose is rotation and centre, None
        where unknown.
    cameras : by key. points : name, coordinates and observations (view, x, y). control : the same, of control points.
    messages : what the user should know.
    """

    views: dict[str, tuple[str, str, tuple[np.ndarray, np.ndarray] | None]]
    cameras: dict[str, PixelCamera]
    points: list[tuple[str, list[float], list[tuple[str, float, float]]]]
    control: list[tuple[str, list[float], list[tuple[str, float, float]]]]
    messages: tuple[str, ...] = ()


def is_openmvg(path: Path) -> bool:
    """Whether a JSON file is an sfm_data of OpenMVG."""
    return '"sfm_data_version"' in json_head(path, ENDINGS)


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
    return reading_of(_openmvg_scene(root_of(path)), path, pixel_um)


def root_of(path: Path) -> Node:
    return Node(read_foreign_json(path, REMEDY), "the file", path, REMEDY)


def list_of(node: Node) -> list[Node]:
    if node.value == "":
        # an empty list of boost
        return []
    if not isinstance(node.value, list):
        raise node.error("is no list", REMEDY)
    return [node.at(value, f"{node.where}[{k}]"[:120]) for k, value in enumerate(node.value)]


def number_of(node: Node) -> float:
    """A number, written as one or as a text."""
    if isinstance(node.value, str) and is_number(node.value):
        value = float(node.value)
        if not (math.isfinite(value) and abs(value) <= LARGEST):
            raise node.error(f"{node.value[:40]} is not possible", REMEDY)
        return value
    return node.number()


def numbers_of(node: Node, count: int | None = None) -> list[float]:
    values = [number_of(entry) for entry in list_of(node)]
    if count is not None and len(values) != count:
        raise node.error(f"is no list of {count} numbers", REMEDY)
    return values


def key_of(node: Node) -> str:
    """An identifier, written as a number or as a text."""
    if isinstance(node.value, bool) or not isinstance(node.value, int | str):
        raise node.error("is no identifier", REMEDY)
    return str(node.value)


def section_of(table: Node, section: str) -> list[Node]:
    return list_of(table.get(section)) if table.has(section) else []


def _openmvg_scene(root: Node) -> Scene:
    poses = {}
    for entry in section_of(root, "extrinsics"):
        value = entry.get("value")
        rows = [number for row in list_of(value.get("rotation")) for number in numbers_of(row, 3)]
        poses[key_of(entry.get("key"))] = pose_of(value, np.array(rows), value.get("center"))
    views = {}
    positions = 0
    for entry in section_of(root, "views"):
        data = entry.get("value").get("ptr_wrapper").get("data")
        data = data.get("value0") if data.has("value0") else data
        name = "/".join(data.get(key).value for key in ("local_path", "filename") if _is_text(data, key))
        pose = poses.get(key_of(data.get("id_pose")))
        positions += data.has("center")
        views[key_of(entry.get("key"))] = name, key_of(data.get("id_intrinsic")), pose
    cameras = {key_of(one.get("key")): _openmvg_camera(one.get("value")) for one in section_of(root, "intrinsics")}
    structure = [_openmvg_point(one) for one in section_of(root, "structure")]
    said = not_used(root, SECTIONS)
    if positions:
        words = f"{counted(positions, 'position')} of photographs, observed before the adjustment"
        said.append(left_behind(f"not used: {words}; give them with --positions"))
    control = [_openmvg_point(one) for one in section_of(root, "control_points")]
    return Scene(views, cameras, structure, control, tuple(said))


def not_used(root: Node, sections: tuple[str, ...]) -> list[str]:
    """On sections of a file that hold something and are not used."""
    unused = [key[:40] for key, value in root.items().items() if key not in sections and value.value]
    return [left_behind(f"not used: {', '.join(unused)[:120]}")] if unused else []


def _is_text(table: Node, key: str) -> bool:
    return table.has(key) and isinstance(table.get(key).value, str) and bool(table.get(key).value)


def pose_of(node: Node, matrix: np.ndarray, centre: Node) -> tuple[np.ndarray, np.ndarray]:
    """Rotation from x right, y down, z forwards to the world, and projection centre."""
    if len(matrix) != 9:
        raise node.error("its rotation does not have 9 numbers", REMEDY)
    return rotation_matrix(matrix, node.error("its rotation is none", REMEDY)).T, np.array(numbers_of(centre, 3))


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
            lens = dict(zip(names, numbers_of(data.get(key), len(names)), strict=True))
    focal = number_of(own.get("focal_length"))
    x, y = numbers_of(own.get("principal_point"), 2)
    return checked(value, size_of(own), (focal, focal), (x, y), lens, data.has("fisheye"))


def size_of(node: Node) -> tuple[int, int]:
    width, height = number_of(node.get("width")), number_of(node.get("height"))
    if width % 1.0 or height % 1.0:
        raise node.error("width and height are no format", REMEDY)
    return int(width), int(height)


def checked(
    node: Node, size: tuple[int, int], focal: tuple[float, float], centre: tuple[float, float], lens: dict[str, float],
    fisheye: bool,
) -> PixelCamera:  # fmt: skip
    camera = PixelCamera(size, focal, centre, lens, fisheye, centre_known=True)
    camera.refuse_impossible(node.error("has values that no camera has", REMEDY))
    return camera


def _openmvg_point(entry: Node) -> tuple[str, list[float], list[tuple[str, float, float]]]:
    value, seen = entry.get("value"), []
    for one in section_of(value, "observations"):
        x, y = numbers_of(one.get("value").get("x"), 2)
        seen.append((key_of(one.get("key")), x, y))
    return key_of(entry.get("key")), numbers_of(value.get("X"), 3), seen


def reading_of(scene: Scene, path: Path, pixel_um: float) -> Reading:
    scene, said = _with_cameras(scene, path)
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
    if left:
        words = f"left out: {counted(left, 'image point')} of photographs that are not there, or twice in one"
        said.append(left_behind(words))
    messages: list[str] = [*scene.messages, *said, "coordinates are local"]
    if scene.control:
        messages.append(assumed(f"control points have a standard deviation of {CONTROL_SIGMA_M:g} m"))
    return replace(_with_control(reading, scene), messages=tuple(messages))


def _with_cameras(scene: Scene, path: Path) -> tuple[Scene, list[str]]:
    """The scene without photographs that have no camera, as programs leave those they could not use; what to say.

    Raises
    ------
    InputError
        When none remains.
    """
    if not scene.views:
        raise InputError("holds no photographs", REMEDY, path)
    views = {key: view for key, view in scene.views.items() if view[1] not in UNDEFINED}
    if not views:
        raise InputError("none of its photographs has a camera", "export the scene after its reconstruction", path)
    count = len(scene.views) - len(views)
    said: list[str] = [left_behind(f"left out: {counted(count, 'photograph')} without a camera")] if count else []
    return replace(scene, views=views), said


def _points(
    scene: Scene,
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
"""Standard deviation of control points, which these programs do not know; chosen [C]."""


def _with_control(reading: Reading, scene: Scene) -> Reading:
    """Control points as such."""
    if not scene.control or reading.points is None:
        return reading
    count = len(scene.control)
    sigma = np.full((count, 3), CONTROL_SIGMA_M)
    control = Control(np.arange(count), reading.points[:count].copy(), sigma, np.zeros(count, bool))
    block = reading.block
    adjustment = replace(block.settings.adjustment, datum="control")
    settings = replace(block.settings, adjustment=adjustment)
    return replace(reading, block=replace(block, control=control, settings=settings))
