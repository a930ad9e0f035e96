"""COLMAP models, text and binary, by way of pycolmap, which is known to this module only.

COLMAP's camera frame is x right, y down, z forwards: this program's turned by diag(1, −1, −1). Its pixels begin at the
corner of the upper left one, as here. Its lens is the forward lens of `additional_parameters.lens` in a frame whose y
points down, so p1 changes sign. Two focal lengths are c = fy with the affinity b1 = fy/fx − 1 of Brown's family, which
is exact, since b1 acts on the measured x alone.

COLMAP knows no pixel size. It is 1 µm unless stated, so that a principal distance of 3000 pixels reads 3 mm; choose the
camera's own where it is known.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import FilePath, InputError, counted, mm_from_px, px_from_mm
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.files.atomic import atomic_folder
from aerotri.formats.foreign.colmap_binary import check_binary_model
from aerotri.formats.foreign.colmap_rigs import (
    COLMAP_FROM_CAMERA,
    add_frames,
    add_rigs,
    rigs_of_model,
    stations_of_model,
)
from aerotri.formats.text.tables import CONTROL_CHARACTERS, LARGEST_NUMBER, LONGEST_NAME
from aerotri.functional_model.rotation import angles_from_rotation
from aerotri.observations import AdjustmentSettings, Block, Camera, ImagePoints, Images, Prior, Settings
from aerotri.observations.block import LENS_NAMES
from aerotri.observations.rigs import STATION

LENS_OF_MODEL: Mapping[str, tuple[str, ...]] = {
    "SIMPLE_PINHOLE": (),
    "PINHOLE": (),
    "SIMPLE_RADIAL": ("k1",),
    "RADIAL": ("k1", "k2"),
    "OPENCV": ("k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("k1", "k2", "p1", "p2", "k3"),
}
"""Models that can be expressed, and their lens parameters in COLMAP's order."""
TWO_FOCAL_LENGTHS = ("PINHOLE", "OPENCV", "FULL_OPENCV")
SIGN = {"p1": -1.0}
"""Parameters that change their sign with y: p1 is the tangential distortion along it."""
SMALLEST_FOCAL_PX, MOST_PIXELS, LARGEST_RATIO = 1e-3, 10_000_000, 100.0
"""Least focal length, largest format, both pixels, and largest ratio of two focal lengths; chosen [C]: beyond any
camera, so that only damaged files are refused."""
FILES = ("cameras", "images", "points3D")
OWN_ENTRIES = tuple(f"{name}.{end}" for name in (*FILES, "rigs", "frames") for end in ("txt", "bin"))


def is_colmap(path: Path) -> bool:
    """Whether a folder holds a COLMAP model."""
    return any(all((path / f"{name}.{ending}").is_file() for name in FILES) for ending in ("bin", "txt"))


def read_colmap(folder: FilePath, pixel_um: float = 1.0) -> tuple[Block, np.ndarray]:
    """A block and its object points from a COLMAP model.

    Rays are the image points that belong to an object point. Focal lengths and lens parameters are free, principal
    points held, the datum is minimal, the standard deviation one pixel. Points are named by their number, cameras by
    theirs, images by their name.

    Parameters
    ----------
    folder : with cameras, images and points3D, .bin or .txt.
    pixel_um : size of a pixel.

    Returns
    -------
    block : with start values for the images that have a pose.
    points : (N, 3) the object points.

    Raises
    ------
    InputError
        When the model cannot be read or has a camera model that cannot be expressed.

    Warns
    -----
    UserWarning
        When an object point is measured more than once in one image; the first measurement is kept.
    """
    folder = Path(folder)
    model = _read_model(folder)
    cameras, camera_place = _cameras_of(model, pixel_um, folder)
    ids = sorted(model.images)
    images = _images_of(model, ids, camera_place, folder)
    names = {number: cameras[place].name for number, place in camera_place.items()}
    rigs = rigs_of_model(model, names, Block.rotation)
    if rigs:
        images = replace(images, columns={STATION: stations_of_model(model, ids, names, rigs)})
    _check_images(images, folder)
    image, point_id, px = _observations(model, ids)
    image, point_id, px = _once_each(image, point_id, px)
    if not len(image):
        raise InputError("the model has no points that were measured", "export it with its points", folder)
    if not (np.abs(px) <= MOST_PIXELS).all():
        raise InputError("an image point lies outside of any image", "export the model anew", folder)
    numbers, first, point = np.unique(point_id, return_index=True, return_inverse=True)
    appearance = np.argsort(first)
    place = np.empty_like(appearance)
    place[appearance] = np.arange(len(appearance))
    numbers, point = numbers[appearance], place[point]
    xy = np.empty_like(px)
    for number, camera in enumerate(cameras):
        own = images.camera[image] == number
        xy[own] = mm_from_px(px[own], camera.size_px, camera.pixel_mm)
    block = Block(
        name=folder.resolve().name,
        cameras=cameras,
        images=images,
        points=numbers.astype(str),
        image_points=ImagePoints(image, point, xy, np.full_like(xy, pixel_um * 1e-3)),
        settings=Settings(
            adjustment=AdjustmentSettings(additional_parameters=_free_parameters(cameras), datum="minimal"),
            image_sigma_um=pixel_um,
        ),
        rigs=rigs,
    )
    return block, _points_of(model, numbers, folder)


def _points_of(model: Any, numbers: np.ndarray, folder: Path) -> np.ndarray:
    """(N, 3) the object points of these numbers."""
    missing = [number for number in numbers.tolist() if number not in model.points3D]
    if missing:
        message = f"image points belong to object point {missing[0]}, which there is not"
        raise InputError(message, "export the model with its points", folder)
    xyz = np.array([model.points3D[number].xyz for number in numbers.tolist()])
    if not (np.abs(xyz) <= LARGEST_NUMBER).all():
        raise InputError("an object point lies at no possible place", "export the model anew", folder)
    return xyz


def _read_model(folder: Path) -> Any:
    import pycolmap

    if not is_colmap(folder):
        raise InputError("holds no COLMAP model", "give a folder with cameras, images and points3D", folder)
    check_binary_model(folder)
    try:
        return pycolmap.Reconstruction(folder)
    except (RuntimeError, ValueError, IndexError, MemoryError, OSError) as error:
        short = str(error).strip().splitlines()[-1] if str(error).strip() else type(error).__name__
        raise InputError(f"is no readable COLMAP model: {short}", "export the model anew", folder) from error


def _cameras_of(model: Any, pixel_um: float, folder: Path) -> tuple[tuple[Camera, ...], dict[int, int]]:
    """The cameras, and their places by COLMAP's numbers."""
    ids = sorted(model.cameras)
    found = [_camera_of(model.cameras[number], pixel_um, folder) for number in ids]
    used = [name for name in LENS_NAMES if any(name in camera.lens for camera in found)]
    complete = []
    for camera in found:
        # a parameter that other cameras estimate is held at zero where this one does not have it
        lens = {name: camera.lens.get(name, Prior(0.0, fixed=True)) for name in used}
        complete.append(replace(camera, lens=lens))
    return tuple(complete), {number: place for place, number in enumerate(ids)}


def _camera_of(camera: Any, pixel_um: float, folder: Path) -> Camera:
    name, values = camera.model.name, list(camera.params)
    if name not in LENS_OF_MODEL:
        known = ", ".join(LENS_OF_MODEL)
        raise InputError(f"camera {camera.camera_id} is of model {name}", f"known are {known}", folder)
    focal = values[:2] if name in TWO_FOCAL_LENGTHS else [values[0], values[0]]
    after = 2 if name in TWO_FOCAL_LENGTHS else 1
    cx, cy, *rest = values[after:]
    names = LENS_OF_MODEL[name]
    if any(rest[len(names) :]):
        raise InputError(
            f"camera {camera.camera_id} has lens parameters k4 to k6",
            "estimate it as OPENCV or with k4 to k6 held at 0",
            folder,
        )
    possible = bool((np.abs(values) <= LARGEST_NUMBER).all())
    possible = possible and min(focal) >= SMALLEST_FOCAL_PX and max(focal) < LARGEST_RATIO * min(focal)
    if not possible or not 0 < min(camera.width, camera.height) <= max(camera.width, camera.height) <= MOST_PIXELS:
        raise InputError(f"camera {camera.camera_id} has no valid parameters", "calibrate it first", folder)
    size = (int(camera.width), int(camera.height))
    x0, y0 = mm_from_px(np.array([[cx, cy]]), size, pixel_um * 1e-3)[0]
    return Camera(
        name=str(camera.camera_id),
        model="frame",
        size_px=size,
        pixel_um=pixel_um,
        interior={
            "focal_length_mm": Prior(float(focal[1] * pixel_um * 1e-3)),
            "x0_mm": Prior(float(x0), fixed=True),
            "y0_mm": Prior(float(y0), fixed=True),
        },
        brown={} if focal[0] == focal[1] else {"b1": Prior(float(focal[1] / focal[0] - 1.0))},
        lens={key: Prior(SIGN.get(key, 1.0) * float(value)) for key, value in zip(names, rest, strict=False)},
    )


def _free_parameters(cameras: tuple[Camera, ...]) -> tuple[tuple[str, tuple[str, ...]], ...]:
    lens = tuple(name for name in LENS_NAMES if any(name in camera.lens for camera in cameras))
    affinity = ("b1",) if any(camera.brown for camera in cameras) else ()
    return tuple((family, items) for family, items in (("lens", lens), ("brown", affinity)) if items)


def _name(image: Any, folder: Path) -> str:
    try:
        return image.name
    except UnicodeDecodeError as error:
        raise InputError("the name of an image is not UTF-8", "export the model anew", folder) from error


def _images_of(model: Any, ids: list[int], camera_place: dict[int, int], folder: Path) -> Images:
    centre, angles = np.full((len(ids), 3), np.nan), np.full((len(ids), 3), np.nan)
    for row, number in enumerate(ids):
        image = model.images[number]
        if image.has_pose:
            colmap_from_world = image.cam_from_world().matrix()
            if not (np.abs(colmap_from_world) <= LARGEST_NUMBER).all():
                continue
            rotation = colmap_from_world[:, :3].T @ COLMAP_FROM_CAMERA
            centre[row] = -colmap_from_world[:, :3].T @ colmap_from_world[:, 3]
            angles[row] = angles_from_rotation(rotation)
    return Images(
        names=np.array([_name(model.images[number], folder) for number in ids], dtype=str),
        camera=np.array([camera_place[model.images[number].camera_id] for number in ids], dtype=np.int64),
        strip=np.full(len(ids), ""),
        centre=centre,
        angles=angles,
    )


def _check_images(images: Images, folder: Path) -> None:
    """Refuse names that occur twice or that no table could hold, and photographs at no possible place."""
    names = images.names.tolist()
    odd = [name for name in names if not name or len(name) > LONGEST_NAME or re.search(CONTROL_CHARACTERS, name)]
    if odd or len(set(names)) < len(names):
        what = f"{odd[0][:60]!r} is no name of an image" if odd else "two images have the same name"
        raise InputError(what, "export the model anew", folder)
    if (np.abs(images.centre) > LARGEST_NUMBER).any() or (np.isnan(images.centre) != np.isnan(images.angles)).any():
        raise InputError("an image lies at no possible place", "export the model anew", folder)


def _observations(model: Any, ids: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image (m,), number of the object point (m,) and pixel position (m, 2) of every ray, image by image."""
    image, point, px = [], [], []
    for row, number in enumerate(ids):
        for measured in model.images[number].points2D:
            if measured.has_point3D():
                image.append(row)
                point.append(measured.point3D_id)
                px.append(measured.xy)
    return np.array(image, np.int64), np.array(point, np.uint64), np.array(px, float).reshape(-1, 2)


def _once_each(image: np.ndarray, point: np.ndarray, px: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """COLMAP's tracks may hold two image points of one image; a block's may not."""
    pairs = np.stack([image.astype(np.uint64), point], axis=1)
    _, first = np.unique(pairs, axis=0, return_index=True)
    if len(first) < len(image):
        count = len(image) - len(first)
        warnings.warn(f"left out: {counted(count, 'repeated measurement')} of a point in the same image", stacklevel=3)
        keep = np.sort(first)
        return image[keep], point[keep], px[keep]
    return image, point, px


def write_colmap(oriented: OrientedBlock, folder: FilePath, binary: bool = True) -> tuple[str, ...]:
    """Write a COLMAP model.

    A camera whose errors COLMAP has words for (lens, affinity) keeps them; image points are freed of all others. Images
    without orientation, points without coordinates and points with fewer than two rays are left out. Points keep their
    names as numbers when all of them are numbers, and are numbered from 1 otherwise.

    Parameters
    ----------
    oriented : block, orientation and points.
    folder : its place; an older model there is replaced.
    binary : .bin files, else .txt.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When nothing is oriented.
    """
    block = oriented.block
    keep = np.flatnonzero(oriented.complete)
    rays = np.bincount(block.image_points.point[keep], minlength=len(block.points))
    keep = keep[rays[block.image_points.point[keep]] > 1]
    if not len(keep):
        raise InputError(f"block '{block.name}' has no oriented image points", "adjust it first")
    freed, cameras = _freed(oriented)
    model, lost_rigs = _model(oriented, cameras, freed, keep)
    with atomic_folder(folder, own=OWN_ENTRIES) as place:
        (model.write_binary if binary else model.write_text)(place)
    lost = [*oriented.losses(), *lost_rigs]
    single = int(np.sum(rays == 1))
    if single:
        lost.append(f"could not be carried over: {counted(single, 'point')} with one ray")
    if freed is not block.image_points.xy:
        lost.append("image points are written free of the additional parameters, which COLMAP has no words for")
    return tuple(lost)


def _freed(oriented: OrientedBlock) -> tuple[np.ndarray, list[Camera]]:
    """(m, 2) mm, and the cameras that belong to it: as measured, when lens and affinity are all there is."""
    cameras = list(oriented.block.cameras)
    other = [camera.brown[name].value for camera in cameras for name in camera.brown if name != "b1"]
    if oriented.errors is None and not any(other):
        return oriented.block.image_points.xy, cameras
    return oriented.corrected_xy(), [replace(camera, brown={}) for camera in cameras]


def _model(
    oriented: OrientedBlock, cameras: list[Camera], xy: np.ndarray, keep: np.ndarray
) -> tuple[Any, tuple[str, ...]]:
    """The model, and what of its rigs could not be carried over, in words."""
    import pycolmap

    block, rays = oriented.block, oriented.block.image_points
    model = pycolmap.Reconstruction()
    for number, camera in enumerate(cameras, 1):
        name, values = colmap_camera(camera)
        width, height = camera.size_px
        model.add_camera(pycolmap.Camera(camera_id=number, model=name, width=width, height=height, params=values))
    written = add_rigs(model, oriented)
    add_frames(model, written, oriented)
    keep = keep[np.argsort(rays.image[keep], kind="stable")]
    bounds = np.searchsorted(rays.image[keep], np.arange(len(block.images) + 1))
    number_of_point = point_numbers(block.points)
    tracks: dict[int, Any] = {}
    for row in np.flatnonzero(oriented.oriented).tolist():
        own = keep[bounds[row] : bounds[row + 1]]
        camera = cameras[block.images.camera[row]]
        measured = [pycolmap.Point2D(position) for position in px_from_mm(xy[own], camera.size_px, camera.pixel_mm)]
        image = pycolmap.Image(
            name=str(block.images.names[row]),
            points2D=measured,
            camera_id=int(block.images.camera[row]) + 1,
            image_id=row + 1,
        )
        image.frame_id = int(written.frame[row])
        model.add_image(image)
        for place, point in enumerate(rays.point[own].tolist()):
            tracks.setdefault(point, pycolmap.Track()).add_element(row + 1, place)
    for point, track in tracks.items():
        model.add_point3D_with_id(
            int(number_of_point[point]), pycolmap.Point3D(xyz=oriented.points[point], track=track)
        )
    for number in written.from_world:
        model.register_frame(number)
    return model, written.lost


def colmap_camera(camera: Camera) -> tuple[str, list[float]]:
    """COLMAP's model and parameters (pixels) of a camera; of Brown's family only b1 counts.

    Returns
    -------
    model : the smallest that has all lens parameters the camera names.
    values : in COLMAP's order.
    """
    fy = camera.focal_length_mm / camera.pixel_mm
    fx = fy / (1.0 + (camera.brown["b1"].value if "b1" in camera.brown else 0.0))
    cx, cy = px_from_mm(np.array([camera.principal_point_mm]), camera.size_px, camera.pixel_mm)[0].tolist()
    wanted = [model for model, names in LENS_OF_MODEL.items() if set(camera.lens) <= set(names)]
    model = next(model for model in wanted if model in TWO_FOCAL_LENGTHS or fx == fy)
    lens = [
        SIGN.get(name, 1.0) * camera.lens[name].value if name in camera.lens else 0.0 for name in LENS_OF_MODEL[model]
    ]
    if model == "FULL_OPENCV":
        lens += [0.0, 0.0, 0.0]
    return model, [*([fx, fy] if model in TWO_FOCAL_LENGTHS else [fy]), cx, cy, *lens]


def point_numbers(names: np.ndarray) -> np.ndarray:
    """(N,) uint64 numbers of points: their names where all are numbers, 1, 2, 3 … otherwise."""
    plain = [name.isascii() and name.isdigit() and str(int(name)) == name and len(name) < 19 for name in names.tolist()]
    if all(plain):
        return names.astype(np.uint64)
    return np.arange(1, len(names) + 1, dtype=np.uint64)
