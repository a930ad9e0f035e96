"""OpenSfM: reconstruction.json with cameras, photographs and points, and tracks.csv with the image points.

Lengths in an image are parts of its longer side, from its centre, x right, y down. Rotations (angle-axis) and
translations are world → camera, with x right, y down, z forward: this program's camera frame turned by diag(1, −1, −1).
Lens parameters are those of `additional_parameters.lens`, p1 with the other sign, since y points down; two focal
lengths are c and the affinity b1, as for COLMAP. fisheye and fisheye_opencv are fisheyes with k1, k2 and k1 to k4;
fisheye62 is read where its k5, k6, p1 and p2 are 0. Coordinates are local, east, north, up around reference_lla.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import FilePath, InputError, counted, mm_from_px, px_from_mm
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.assembly.parts import Reading, no_sigma, texts
from aerotri.formats.files.atomic import atomic_folder
from aerotri.formats.foreign.colmap import is_free, without_shear
from aerotri.formats.foreign.colmap_cameras import SIGN, value, with_nearest
from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA
from aerotri.formats.results.json_text import json_text
from aerotri.formats.text.csv_text import UTF8_REMEDY, read_bytes
from aerotri.formats.text.tables import LARGEST_FORMAT_PX, SMALLEST_POSITIVE
from aerotri.formats.text.text_lines import TextFile
from aerotri.functional_model.rotation import angles_from_rotation, exponential, logarithm
from aerotri.observations import (
    AdjustmentSettings,
    Block,
    Camera,
    GnssIns,
    ImagePoints,
    Images,
    Prior,
    Settings,
)
from aerotri.observations.block import LENS_NAMES

RECONSTRUCTION, TRACKS = "reconstruction.json", "tracks.csv"
TRACKS_HEADER = "OPENSFM_TRACKS_VERSION"
LENS_OF_TYPE: dict[str, tuple[str, ...]] = {
    "perspective": ("k1", "k2"),
    "simple_radial": ("k1",),
    "radial": ("k1", "k2"),
    "brown": ("k1", "k2", "p1", "p2", "k3"),
    "fisheye": ("k1", "k2"),
    "fisheye_opencv": ("k1", "k2", "k3", "k4"),
    "fisheye62": ("k1", "k2", "k3", "k4"),
}
"""Projections that can be expressed, and their lens parameters."""
NOT_EXPRESSED = {"fisheye62": ("k5", "k6", "p1", "p2")}
"""Lens parameters of other formulas."""
TWO_FOCAL_LENGTHS = ("radial", "simple_radial", "brown", "fisheye_opencv", "fisheye62")
LARGEST = 1e9
"""Largest number of a reconstruction; chosen [C]: beyond every coordinate in metres and every pixel; squares of it keep
their digits."""


def is_opensfm(path: Path) -> bool:
    """Whether a path is a reconstruction.json, or a folder with one."""
    file = path / RECONSTRUCTION if path.is_dir() else path
    return file.suffix == ".json" and file.is_file()


class _Node:
    """A piece of the JSON text with the words to name it in an error."""

    def __init__(self, value: Any, where: str, path: Path):
        self.value, self.where, self.path = value, where, path

    def error(self, message: str, remedy: str = "export the reconstruction anew") -> InputError:
        return InputError(f"{self.where}: {message}", remedy, self.path)

    def items(self) -> dict[str, _Node]:
        if not isinstance(self.value, dict):
            raise self.error("is no table")
        return {key: _Node(value, f"{self.where}.{key}"[:120], self.path) for key, value in self.value.items()}

    def get(self, key: str) -> _Node:
        found = self.items().get(key)
        if found is None:
            raise self.error(f"has no {key}")
        return found

    def has(self, key: str) -> bool:
        return isinstance(self.value, dict) and self.value.get(key) is not None

    def number(self) -> float:
        if isinstance(self.value, bool) or not isinstance(self.value, int | float):
            raise self.error("is no number")
        try:
            value = float(self.value)
        except OverflowError:
            value = math.inf
        if not abs(value) <= LARGEST:
            raise self.error(f"{value:g} is not possible")
        return value

    def numbers(self, count: int) -> list[float]:
        if not isinstance(self.value, list) or len(self.value) != count:
            raise self.error(f"is no list of {count} numbers")
        return [_Node(value, f"{self.where}[{i}]", self.path).number() for i, value in enumerate(self.value)]

    def text(self) -> str:
        if not isinstance(self.value, str) or not self.value:
            raise self.error("is no text")
        return self.value


def read_opensfm(path: FilePath, pixel_um: float = 1.0) -> Reading:
    """A block and its object points from reconstruction.json and, beside it, tracks.csv.

    Focal lengths and lens parameters are free, the standard deviation is one pixel. GNSS positions are observations
    with gps_dop as their standard deviation. Of several reconstructions the one with most photographs is taken.

    Parameters
    ----------
    path : reconstruction.json, or the folder with it.
    pixel_um : size of a pixel, which the files do not tell.

    Raises
    ------
    InputError
        When the files are damaged, or a camera is of a projection that cannot be expressed, such as spherical.
    """
    path = Path(path) / RECONSTRUCTION if Path(path).is_dir() else Path(path)
    chosen, messages = _largest(path)
    keys = list(chosen.get("cameras").items())
    cameras = _cameras(chosen.get("cameras"), pixel_um)
    shots = chosen.get("shots").items()
    if not shots:
        raise chosen.error("has no shots")
    images = _images(shots, keys)
    points = {key: node.get("coordinates").numbers(3) for key, node in chosen.get("points").items().items()}
    tracks = path.with_name(TRACKS)
    if tracks.is_file():
        image, track, position, left = _tracks(tracks, list(shots), list(points))
        if left:
            messages.append(f"left out: {counted(left, 'image point')} of other photographs, or without object point")
    else:
        image, track, position = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2))
        messages.append(f"there is no {TRACKS} beside {path.name}: no image points")
    used, point = np.unique(track, return_inverse=True)
    xy = np.empty_like(position)
    for number, camera in enumerate(cameras):
        own = images.camera[image] == number
        px = position[own] * max(camera.size_px) + np.array(camera.size_px) / 2.0
        xy[own] = mm_from_px(px, camera.size_px, camera.pixel_mm)
    observed = _positions(shots)
    if observed is not None:
        messages.append(
            f"{counted(len(observed), 'GNSS position')} used as observations, with gps_dop as standard deviation"
        )
    if chosen.has("reference_lla"):
        lla = [chosen.get("reference_lla").get(key).number() for key in ("latitude", "longitude", "altitude")]
        messages.append("coordinates are local, around latitude {:.9g}, longitude {:.9g}, height {:.6g} m".format(*lla))
    free = tuple(name for name in LENS_NAMES if any(is_free(camera.lens.get(name)) for camera in cameras))
    affinity = ("b1",) if any(camera.brown for camera in cameras) else ()
    parameters = tuple((family, items) for family, items in (("lens", free), ("brown", affinity)) if items)
    datum = "minimal" if observed is None else "control"
    block = Block(
        name=path.resolve().parent.name,
        cameras=cameras,
        images=images,
        points=texts(list(points))[used],
        image_points=ImagePoints(image, point.ravel(), xy, np.full_like(xy, pixel_um * 1e-3)),
        gnss_ins=observed,
        settings=Settings(
            AdjustmentSettings(additional_parameters=parameters, datum=datum),
            image_sigma_um=pixel_um,
        ),
    )
    xyz = np.array(list(points.values()), dtype=float).reshape(-1, 3)
    return Reading(block, xyz[used], tuple(messages))


def _largest(path: Path) -> tuple[_Node, list[str]]:
    """The reconstruction with most photographs, and a message on the others."""
    try:
        content = json.loads(read_bytes(path).decode("utf-8"))
    except UnicodeDecodeError as error:
        raise InputError("is not UTF-8", UTF8_REMEDY, path) from error
    except json.JSONDecodeError as error:
        raise InputError(f"is not JSON: {error.msg}", "is it cut off?", path, error.lineno) from error
    except (RecursionError, ValueError) as error:
        raise InputError("is not JSON that can be read", "export the reconstruction anew", path) from error
    if not isinstance(content, list) or not content:
        raise InputError("holds no reconstruction", "it is a list of reconstructions", path)
    nodes = [_Node(value, f"reconstruction {i}", path) for i, value in enumerate(content)]
    sizes = [len(node.get("shots").items()) for node in nodes]
    best = sizes.index(max(sizes))
    smaller = counted(len(nodes) - 1, "smaller reconstruction")
    others = f"left out: {smaller} with {counted(sum(sizes) - sizes[best], 'photograph')}"
    return nodes[best], [others] if len(nodes) > 1 else []


def _cameras(section: _Node, pixel_um: float) -> tuple[Camera, ...]:
    found = [_camera(name, node, pixel_um) for name, node in section.items().items()]
    if not found:
        raise section.error("is empty")
    used = [name for name in LENS_NAMES if any(name in camera.lens for camera in found)]
    # a parameter that other cameras estimate is held at zero where this one does not have it
    held = Prior(0.0, fixed=True)
    return tuple(replace(camera, lens={name: camera.lens.get(name, held) for name in used}) for camera in found)


def _camera(name: str, node: _Node, pixel_um: float) -> Camera:
    kind = node.get("projection_type").text()
    if kind not in LENS_OF_TYPE:
        raise node.error(f"projection {kind[:40]} cannot be expressed", f"known are {', '.join(LENS_OF_TYPE)}")
    width, height = node.get("width").number(), node.get("height").number()
    if min(width, height) < 1.0 or max(width, height) > LARGEST_FORMAT_PX or width % 1.0 or height % 1.0:
        raise node.error("width and height are no format")
    size, longer = (int(width), int(height)), max(width, height)
    for key in NOT_EXPRESSED.get(kind, ()):
        if node.has(key) and node.get(key).number():
            raise node.error(f"projection {kind} with {key} cannot be expressed", "estimate it as fisheye_opencv")
    two = node.has("focal_x") or kind in TWO_FOCAL_LENGTHS
    fx, fy = (node.get(key).number() * longer for key in (("focal_x", "focal_y") if two else ("focal", "focal")))
    if min(fx, fy) < SMALLEST_POSITIVE:
        raise node.error("a focal length is not greater than 0")
    cx, cy = (node.get(key).number() * longer if node.has(key) else 0.0 for key in ("c_x", "c_y"))
    scale = pixel_um * 1e-3
    lens = {key: SIGN.get(key, 1.0) * (node.get(key).number() if node.has(key) else 0.0) for key in LENS_OF_TYPE[kind]}
    return Camera(
        name=name.strip() or "camera",
        model="frame",
        size_px=size,
        pixel_um=pixel_um,
        interior={
            "focal_length_mm": Prior(fy * scale),
            "x0_mm": Prior(cx * scale, fixed=True),
            "y0_mm": Prior(-cy * scale, fixed=True),
        },
        brown={} if fx == fy else {"b1": Prior(fy / fx - 1.0)},
        lens={key: Prior(value) for key, value in lens.items()},
        projection="fisheye" if kind.startswith("fisheye") else "perspective",
    )


def _images(shots: dict[str, _Node], cameras: list[str]) -> Images:
    place = {name: i for i, name in enumerate(cameras)}
    number, centre, rotation = [], [], []
    for node in shots.values():
        camera = node.get("camera").text()
        if camera not in place:
            raise node.error(f"there is no camera '{camera[:60]}'")
        number.append(place[camera])
        world_to_camera = exponential(np.array(node.get("rotation").numbers(3)))
        rotation.append(world_to_camera.T @ COLMAP_FROM_CAMERA)
        centre.append(-world_to_camera.T @ np.array(node.get("translation").numbers(3)))
    names = texts(list(shots))
    angles = angles_from_rotation(np.array(rotation))
    return Images(names, np.array(number, np.int64), np.full(len(names), ""), np.array(centre), angles)


def _positions(shots: dict[str, _Node]) -> GnssIns | None:
    rows, xyz, sigma = [], [], []
    for row, node in enumerate(shots.values()):
        if node.has("gps_position") and node.has("gps_dop"):
            dop = node.get("gps_dop").number()
            if dop < SMALLEST_POSITIVE:
                raise node.error("gps_dop is not greater than 0")
            rows.append(row)
            xyz.append(node.get("gps_position").numbers(3))
            sigma.append([dop] * 3)
    if not rows:
        return None
    unknown = no_sigma(len(rows))
    return GnssIns(np.array(rows, np.int64), np.array(xyz), np.array(sigma), unknown, unknown, unknown[:, 0])


def _tracks(path: Path, images: list[str], points: list[str]) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Image (m,), point (m,), position (m, 2) of the rays of known photographs and points, and how many others."""
    file = TextFile(path, comments=False)
    begin = 1 if len(file) and file.lines[0].startswith(TRACKS_HEADER) else 0
    words = file.words("\t")
    rows = range(begin, len(words))
    short = next((row for row in rows if len(words[row]) < 5), None)
    if short is not None:
        remedy = "rows are: image, track, feature, x, y, …, separated by tabs"
        raise file.error(short, f"the row has {len(words[short])} cells", remedy)
    image_place = {name: i for i, name in enumerate(images)}
    point_place = {name: i for i, name in enumerate(points)}
    known = [row for row in rows if words[row][0] in image_place and words[row][1] in point_place]
    names = [f"{words[row][1]}' in photograph '{words[row][0]}" for row in known]
    file.refuse_repeated(names, known, "track")
    position = file.table([words[row][3:5] for row in known], known, "position").reshape(-1, 2)
    outside = np.flatnonzero((np.abs(position) > 1.0).any(axis=1))
    if len(outside):
        remedy = "positions are parts of the longer side, from the image centre"
        raise file.error(known[int(outside[0])], "an image point lies outside of its image", remedy)
    image = np.array([image_place[words[row][0]] for row in known], dtype=np.int64)
    point = np.array([point_place[words[row][1]] for row in known], dtype=np.int64)
    return image, point, position, len(rows) - len(known)


def write_opensfm(oriented: OrientedBlock, folder: FilePath) -> tuple[str, ...]:
    """Write reconstruction.json and tracks.csv.

    Lens parameters and affinity are kept; image points are freed of all other errors. Photographs without orientation
    and points without coordinates are left out. Points are white.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When nothing is oriented.
    """
    block, rays = oriented.block, oriented.block.image_points
    rows = oriented.rows_with_orientation("a reconstruction")
    other = any(prior.value for camera in block.cameras for name, prior in camera.brown.items() if name != "b1")
    freed = other or oriented.errors is not None or any(value(camera, "b2") for camera in block.cameras)
    xy = without_shear(oriented) if freed else rays.xy
    written = [_expressible(camera, not freed) for camera in block.cameras]
    cameras = {camera.name: _camera_json(camera) for camera, _ in written}
    shots = {str(block.images.names[row]): _shot_json(oriented, row) for row in rows.tolist()}
    known = np.flatnonzero(np.isfinite(oriented.points).all(axis=1))
    points = {
        str(block.points[p]): {"color": [255.0] * 3, "coordinates": oriented.points[p].tolist()} for p in known.tolist()
    }
    lines = [f"{TRACKS_HEADER}_v2"]
    for k in np.flatnonzero(oriented.complete).tolist():
        camera = block.cameras[block.images.camera[rays.image[k]]]
        column_row = px_from_mm(xy[k], camera.size_px, camera.pixel_mm)
        x, y = ((column_row - np.array(camera.size_px) / 2.0) / max(camera.size_px)).tolist()
        image, point = block.images.names[rays.image[k]], block.points[rays.point[k]]
        lines.append(f"{image}\t{point}\t{k}\t{x!r}\t{y!r}\t0.004\t255\t255\t255\t-1\t-1")
    content = [{"cameras": cameras, "shots": shots, "points": points}]
    with atomic_folder(folder, own=(RECONSTRUCTION, TRACKS)) as place:
        text = json_text(content, 1)
        (place / RECONSTRUCTION).write_text(text, encoding="utf-8", newline="\n")
        (place / TRACKS).write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    said = ("image points are written free of the additional parameters, which OpenSfM has no words for",)
    return (*oriented.losses(), *(said if freed else ()), *(sentence for _, fitted in written for sentence in fitted))


def _expressible(camera: Camera, with_affinity: bool) -> tuple[Camera, tuple[str, ...]]:
    """The camera with a lens that OpenSfM has words for, and in words what was fitted."""
    if not with_affinity:
        camera = replace(camera, brown={})
    names = LENS_OF_TYPE["fisheye_opencv" if camera.is_fisheye else "brown"]
    if all(name in (*names, "b1", "b2") for name, prior in camera.lens.items() if prior.value):
        return camera, ()
    return with_nearest(camera, names, "OpenSfM")


def _camera_json(camera: Camera) -> dict[str, Any]:
    longer = max(camera.size_px)
    fy = camera.focal_length_mm / camera.pixel_mm
    fx = fy * (1.0 + value(camera, "b1")) / (1.0 + (camera.brown["b1"].value if "b1" in camera.brown else 0.0))
    small, large = ("fisheye", "fisheye_opencv") if camera.is_fisheye else ("perspective", "brown")
    lens = {key: SIGN.get(key, 1.0) * value(camera, key) for key in LENS_OF_TYPE[large]}
    size: dict[str, Any] = {"width": camera.size_px[0], "height": camera.size_px[1]}
    x0, y0 = camera.principal_point_mm
    if fx == fy and not (x0 or y0 or any(number for key, number in lens.items() if key not in LENS_OF_TYPE[small])):
        return {
            "projection_type": small, **size, "focal": fx / longer, "k1": lens["k1"], "k2": lens["k2"],
        }  # fmt: skip
    centre = {"c_x": x0 / camera.pixel_mm / longer, "c_y": -y0 / camera.pixel_mm / longer}
    return {"projection_type": large, **size, "focal_x": fx / longer, "focal_y": fy / longer, **centre, **lens}


def _shot_json(oriented: OrientedBlock, row: int) -> dict[str, Any]:
    world_to_camera = COLMAP_FROM_CAMERA @ oriented.rotation[row].T
    return {
        "camera": oriented.block.cameras[oriented.block.images.camera[row]].name,
        "rotation": logarithm(world_to_camera).tolist(),
        "translation": (-world_to_camera @ oriented.centre[row]).tolist(),
    }
