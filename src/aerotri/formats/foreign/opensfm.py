"""OpenSfM: reconstruction.json with cameras, photographs and points, and tracks.csv with the image points.

Lengths in an image are parts of its longer side, from its centre, x right, y down. Rotations (angle-axis) and
translations are world → camera, with x right, y down, z forward: this program's camera frame turned by diag(1, −1, −1).
Coordinates are local, east, north, up around reference_lla. OpenDroneMap replaces reconstruction.json by one in a
projected system and keeps this one as reconstruction.topocentric.json, which is then read.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import FilePath, counted, mm_from_px, px_from_mm, real_path
from aerotri.formats.assembly.losses import lost_pixels
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.assembly.parts import Reading, no_sigma, texts
from aerotri.formats.files.atomic import atomic_folder
from aerotri.formats.foreign.colmap import without_shear
from aerotri.formats.foreign.colmap_cameras import value
from aerotri.formats.foreign.colmap_model import is_free
from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA
from aerotri.formats.foreign.opensfm_cameras import camera_json, expressible, read_cameras
from aerotri.formats.foreign.opensfm_json import Node, largest, points_of, read_reconstructions
from aerotri.formats.foreign.opensfm_rigs import RigShots, rig_shots, rigs_of, split_cameras, stations_of
from aerotri.formats.foreign.opensfm_tracks import HEADER, TRACKS, Tracks, read_tracks, track_line, track_names
from aerotri.formats.results.json_text import json_text
from aerotri.formats.text.notes import assumed, left_behind, taken
from aerotri.formats.text.sigmas import impossible_sigmas, why_impossible
from aerotri.functional_model.rotation import angles_from_rotation, exponential, logarithm
from aerotri.observations import (
    AdjustmentSettings,
    Block,
    Camera,
    GnssIns,
    ImagePoints,
    Images,
    Rig,
    Settings,
)
from aerotri.observations.block import LENS_NAMES
from aerotri.observations.rigs import STATION

PIXEL_UM = 1.0
"""Size of a pixel where it is not stated."""
RECONSTRUCTION, TOPOCENTRIC = "reconstruction.json", "reconstruction.topocentric.json"
CONFIG = "config.yaml"
FROZEN = re.compile(rb"^\s*optimize_camera_parameters\s*:\s*(no|false|off)\b", re.IGNORECASE | re.MULTILINE)
"""What OpenSfM's settings say where it held focal lengths and lens."""
SETTINGS_BYTES = 1 << 16
"""Of the settings that are looked at [C]."""


def is_opensfm(path: Path) -> bool:
    """Whether a path is a reconstruction.json, or a folder with one."""
    file = path / RECONSTRUCTION if path.is_dir() else path
    return file.suffix == ".json" and file.is_file()


NO_POSITION = 999999.0
"""gps_dop that OpenSfM writes for a photograph without a position, whose coordinates are 0 then [L: opensfm's exif]."""


def file_of(path: Path) -> Path:
    """The file in local coordinates of a folder, or the file itself."""
    if not path.is_dir():
        return path
    return path / (TOPOCENTRIC if (path / TOPOCENTRIC).is_file() else RECONSTRUCTION)


def read_opensfm(path: FilePath, pixel_um: float = PIXEL_UM) -> Reading:
    """A block and its object points from reconstruction.json and, beside it, tracks.csv.

    Focal lengths and lens parameters are free, the standard deviation is one pixel. GNSS positions are observations
    with gps_dop as their standard deviation. Rig instances of several photographs are a rigid rig. Of several
    reconstructions the one with most photographs is taken.

    Parameters
    ----------
    path : reconstruction.json, or the folder with it.
    pixel_um : size of a pixel, which the files do not tell.

    Returns
    -------
    Reading
        With reference_lla as its origin.

    Raises
    ------
    InputError
        When the files are damaged, or a camera is of a projection that cannot be expressed, such as spherical.
    """
    path = file_of(Path(path))
    chosen, messages = largest(read_reconstructions(path))
    known = read_cameras(chosen.get("cameras"), pixel_um)
    shots = chosen.get("shots").items()
    if not shots:
        raise chosen.error("has no shots")
    on_rigs = rig_shots(chosen)
    cameras, images, rigs = _images(chosen, shots, known, on_rigs)
    names, xyz, said = _points(chosen, path.with_name(TRACKS))
    messages += said
    tracks, said = _tracks(path.with_name(TRACKS), list(shots), names)
    messages += said
    present = np.zeros(len(names), bool)
    present[tracks.point] = True
    used, point = np.flatnonzero(present), (np.cumsum(present) - 1)[tracks.point]
    observed, said = _observed(chosen, shots)
    messages += said
    free = tuple(name for name in LENS_NAMES if any(is_free(camera.lens.get(name)) for camera in cameras))
    affinity = ("b1",) if any(camera.brown for camera in cameras) else ()
    parameters = tuple((family, items) for family, items in (("lens", free), ("brown", affinity)) if items)
    datum = "minimal" if observed is None else "control"
    measured = _image_points(tracks, cameras, images.camera)
    block = Block(
        name=real_path(path).parent.name,
        cameras=cameras,
        images=images,
        points=texts(names)[used],
        image_points=ImagePoints(tracks.image, point, measured, np.full_like(measured, pixel_um * 1e-3)),
        gnss_ins=observed,
        settings=Settings(
            AdjustmentSettings(additional_parameters=parameters, datum=datum),
            image_sigma_um=pixel_um,
        ),
        rigs=rigs,
    )
    origin = _origin(chosen, observed is not None)
    if origin is not None:
        lon, lat, height = origin
        words = f"latitude {lat:.9g}, longitude {lon:.9g}, height {height:.6g} m"
        messages.append(taken(f"coordinates are local, around {words}"))
    if _is_frozen(path.with_name(CONFIG)):
        about = "OpenSfM held focal lengths and lens (optimize_camera_parameters: no); here they are unknowns"
        messages.append(assumed(about))
    return Reading(block, xyz[used], tuple(messages), origin)


def _is_frozen(config: Path) -> bool:
    try:
        with config.open("rb") as file:
            return FROZEN.search(file.read(SETTINGS_BYTES)) is not None
    except OSError:
        return False


def _origin(chosen: Node, has_positions: bool) -> tuple[float, float, float] | None:
    """Longitude, latitude and height of the origin; None where it is the one that OpenSfM writes for want of one."""
    if not chosen.has("reference_lla"):
        return None
    node = chosen.get("reference_lla")
    lon, lat, height = (node.get(key).number() for key in ("longitude", "latitude", "altitude"))
    if abs(lon) > 360.0 or abs(lat) > 90.0:
        raise node.error("is no place on the earth")
    return None if (lon, lat) == (0.0, 0.0) and not has_positions else (lon, lat, height)


def _images(
    chosen: Node, shots: dict[str, Node], known: tuple[Camera, ...], on_rigs: RigShots
) -> tuple[tuple[Camera, ...], Images, tuple[Rig, ...]]:
    """The cameras in the order of their own, the photographs and the rigs."""
    by_name = dict(zip(chosen.get("cameras").items(), known, strict=True))
    number, centre, rotation = [], [], []
    parts = split_cameras(chosen, on_rigs)
    for (camera, _), _name in parts.items():
        if camera not in by_name:
            raise chosen.error(f"there is no camera '{camera[:60]}'")
    unused = [key for key in by_name if all(camera != key for camera, _ in parts)]
    ordered = sorted(parts, key=lambda part: (list(by_name).index(part[0]), part[1]))
    place = {part: i for i, part in enumerate(ordered)}
    cameras = tuple(
        by_name[camera] if parts[camera, rig] == camera else replace(by_name[camera], name=parts[camera, rig])
        for camera, rig in ordered
    )
    for shot, node in shots.items():
        number.append(place[node.get("camera").text(), on_rigs.camera.get(shot, "")])
        world_to_camera = exponential(np.array(node.get("rotation").numbers(3)))
        rotation.append(world_to_camera.T @ COLMAP_FROM_CAMERA)
        centre.append(-world_to_camera.T @ np.array(node.get("translation").numbers(3)))
    names = list(shots)
    columns = {STATION: stations_of(on_rigs, names)} if on_rigs.groups else {}
    angles = angles_from_rotation(np.array(rotation))
    cameras_of_rigs = {rig: cameras[place[camera, rig]].name for camera, rig in ordered if rig}
    images = Images(
        texts(names), np.array(number, np.int64), np.full(len(names), ""), np.array(centre), angles, columns=columns
    )
    return (*cameras, *(by_name[key] for key in unused)), images, rigs_of(chosen, on_rigs, cameras_of_rigs)


def _points(chosen: Node, tracks: Path) -> tuple[list[str], np.ndarray, list[str]]:
    """Names and (N, 3) coordinates of the object points; without any, the tracks themselves are points to be placed."""
    names, xyz = points_of(chosen.get("points")) if chosen.has("points") else ([], no_sigma(0))
    if names or not tracks.is_file():
        return names, xyz, []
    names = track_names(tracks)
    return names, no_sigma(len(names)), [taken(f"holds no object points: those of {TRACKS} are placed anew")]


def _tracks(path: Path, images: list[str], points: list[str]) -> tuple[Tracks, list[str]]:
    if not path.is_file():
        nothing = Tracks(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2)), 0)
        return nothing, [f"there is no {TRACKS} beside {RECONSTRUCTION}: no image points"]
    found = read_tracks(path, images, points)
    others = f"left out: {counted(found.left, 'image point')} of other photographs, or without object point"
    return found, [left_behind(others)] if found.left else []


def _image_points(tracks: Tracks, cameras: tuple[Camera, ...], camera_of_image: np.ndarray) -> np.ndarray:
    """(m, 2) mm."""
    xy, of_ray = np.empty_like(tracks.position), camera_of_image[tracks.image]
    for number, camera in enumerate(cameras):
        own = of_ray == number if len(cameras) > 1 else slice(None)
        px = tracks.position[own] * max(camera.size_px) + np.array(camera.size_px) / 2.0
        xy[own] = mm_from_px(px, camera.size_px, camera.pixel_mm)
    return xy


def _observed(chosen: Node, shots: dict[str, Node]) -> tuple[GnssIns | None, list[str]]:
    """GNSS positions, and what to say of them."""
    rows, xyz, sigma, unknown_places = [], [], [], 0
    for row, node in enumerate(shots.values()):
        if node.has("gps_position") and node.has("gps_dop"):
            dop = node.get("gps_dop").number()
            if dop >= NO_POSITION:
                unknown_places += 1
                continue
            if impossible_sigmas(np.array(dop)):
                raise node.error(f"gps_dop {why_impossible(dop)}")
            rows.append(row)
            xyz.append(node.get("gps_position").numbers(3))
            sigma.append([dop] * 3)
    said = []
    if unknown_places:
        many = counted(unknown_places, "photograph")
        said = [left_behind(f"{many} without GNSS position (gps_dop is OpenSfM's {NO_POSITION:.0f})")]
    if not rows:
        return None, [
            *said,
            "the block has no place and no scale: add control points, or positions with --positions",
        ] if said else []
    unknown = no_sigma(len(rows))
    observed = GnssIns(np.array(rows, np.int64), np.array(xyz), np.array(sigma), unknown, unknown, unknown[:, 0])
    return observed, [
        *said,
        taken(f"{counted(len(rows), 'GNSS position')} used as observations, with gps_dop as standard deviation"),
    ]


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
    written = [expressible(camera, not freed) for camera in block.cameras]
    cameras = {camera.name: camera_json(camera) for camera, _ in written}
    shots = {str(block.images.names[row]): _shot_json(oriented, row) for row in rows.tolist()}
    known = np.flatnonzero(np.isfinite(oriented.points).all(axis=1))
    points = {
        str(block.points[p]): {"color": [255.0] * 3, "coordinates": oriented.points[p].tolist()} for p in known.tolist()
    }
    lines = [f"{HEADER}_v2"]
    for k in np.flatnonzero(oriented.complete).tolist():
        camera = block.cameras[block.images.camera[rays.image[k]]]
        column_row = px_from_mm(xy[k], camera.size_px, camera.pixel_mm)
        x, y = ((column_row - np.array(camera.size_px) / 2.0) / max(camera.size_px)).tolist()
        image, point = block.images.names[rays.image[k]], block.points[rays.point[k]]
        lines.append(track_line(str(image), str(point), k, x, y))
    content = [{"cameras": cameras, "shots": shots, "points": points}]
    with atomic_folder(folder, own=(RECONSTRUCTION, TRACKS)) as place:
        text = json_text(content, 1)
        (place / RECONSTRUCTION).write_text(text, encoding="utf-8", newline="\n")
        (place / TRACKS).write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    said = ("image points are written free of the additional parameters, which OpenSfM has no words for",)
    lost = (*oriented.losses(), *lost_pixels(block, PIXEL_UM))
    return (*lost, *(said if freed else ()), *(sentence for _, fitted in written for sentence in fitted))


def _shot_json(oriented: OrientedBlock, row: int) -> dict[str, Any]:
    world_to_camera = COLMAP_FROM_CAMERA @ oriented.rotation[row].T
    return {
        "camera": oriented.block.cameras[oriented.block.images.camera[row]].name,
        "rotation": logarithm(world_to_camera).tolist(),
        "translation": (-world_to_camera @ oriented.centre[row]).tolist(),
    }
