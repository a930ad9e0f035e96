"""COLMAP models, text and binary, by way of pycolmap, which is known to this module only.

COLMAP's camera frame is x right, y down, z forwards: this program's turned by diag(1, −1, −1). Its pixels begin at the
corner of the upper left one, as here. Its cameras are those of `colmap_cameras`.

COLMAP knows no pixel size. It is 1 µm unless stated, so that a principal distance of 3000 pixels reads 3 mm; choose the
camera's own where it is known.
"""

from __future__ import annotations

import re
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import FilePath, InputError, counted, mm_from_px, px_from_mm
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.files.atomic import atomic_folder
from aerotri.formats.foreign._colmap_kernels import mark_repeated, number_by_appearance
from aerotri.formats.foreign.colmap_arrays import FILES, ModelArrays, read_arrays, write_bare
from aerotri.formats.foreign.colmap_binary import check_binary_model
from aerotri.formats.foreign.colmap_cameras import MOST_PIXELS, colmap_camera, expressible, read_camera, value
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

OWN_ENTRIES = tuple(f"{name}.{end}" for name in (*FILES, "rigs", "frames") for end in ("txt", "bin"))
SPARSE = 8
"""Largest number of an object point, per ray, up to which a table of all numbers is made [C]."""


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
        When an object point is measured more than once in one image; the first measurement is kept. When a lens is
        held, or fitted to a model of other formulas.
    """
    folder = Path(folder)
    model, arrays = _opened(folder)
    cameras, camera_place = _cameras_of(model, pixel_um, folder)
    ids = sorted(model.images)
    images = _images_of(model, ids, camera_place, folder)
    names = {number: cameras[place].name for number, place in camera_place.items()}
    rigs = rigs_of_model(model, names, Block.rotation)
    if rigs:
        images = replace(images, columns={STATION: stations_of_model(model, ids, names, rigs)})
    _check_images(images, folder)
    image, point_id, xy = _rays_of(arrays, ids, images, cameras, folder)
    numbers, point = _by_appearance(point_id)
    keep = _once_each(image, point, len(numbers))
    block = Block(
        name=folder.resolve().name,
        cameras=cameras,
        images=images,
        points=numbers.astype(str),
        image_points=ImagePoints(image[keep], point[keep], xy[keep], np.full_like(xy[keep], pixel_um * 1e-3)),
        settings=Settings(
            adjustment=AdjustmentSettings(additional_parameters=_free_parameters(cameras), datum="minimal"),
            image_sigma_um=pixel_um,
        ),
        rigs=rigs,
    )
    return block, _points_of(arrays, numbers, folder)


def _points_of(arrays: ModelArrays, numbers: np.ndarray, folder: Path) -> np.ndarray:
    """(N, 3) the object points of these numbers."""
    order = np.argsort(arrays.ids, kind="stable")
    ids, known = arrays.ids[order], arrays.xyz[order]
    place = np.minimum(np.searchsorted(ids, numbers), max(len(ids) - 1, 0))
    missing = np.flatnonzero(ids[place] != numbers) if len(ids) else np.arange(len(numbers))
    if len(missing):
        message = f"image points belong to object point {numbers[missing[0]]}, which there is not"
        raise InputError(message, "export the model with its points", folder)
    xyz = known[place]
    if not (np.abs(xyz) <= LARGEST_NUMBER).all():
        raise InputError("an object point lies at no possible place", "export the model anew", folder)
    return xyz


def _rays_of(
    arrays: ModelArrays, ids: list[int], images: Images, cameras: tuple[Camera, ...], folder: Path
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image (m,), number of the object point (m,) and position (m, 2) mm of every ray, image by image."""
    parts = [arrays.images[number] for number in ids]
    ends = np.cumsum([0, *(len(point) for _, point in parts)])
    if not ends[-1]:
        raise InputError("the model has no points that were measured", "export it with its points", folder)
    point, xy = np.empty(ends[-1], np.uint64), np.empty((ends[-1], 2))
    for row, (px, numbers) in enumerate(parts):
        camera = cameras[images.camera[row]]
        if not (np.abs(px) <= MOST_PIXELS).all():
            raise InputError("an image point lies outside of any image", "export the model anew", folder)
        point[ends[row] : ends[row + 1]] = numbers
        xy[ends[row] : ends[row + 1]] = mm_from_px(px, camera.size_px, camera.pixel_mm)
    return np.repeat(np.arange(len(ids)), np.diff(ends)), point, xy


def _by_appearance(point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (N,) of the object points in the order in which they appear, and the place (m,) of each ray's there."""
    known = None
    if point.max() > SPARSE * len(point):
        known, point = np.unique(point, return_inverse=True)
    place, index = np.full(int(point.max()) + 1, -1), np.empty(len(point), np.int64)
    numbers = np.zeros(number_by_appearance(point.astype(np.int64), place, index), np.uint64)
    seen = np.flatnonzero(place >= 0)
    numbers[place[seen]] = seen if known is None else known[seen]
    return numbers, index


def _opened(folder: Path) -> tuple[Any, ModelArrays]:
    """pycolmap's reconstruction of a folder, without its image points and object points, and these in arrays."""
    _check(folder)
    arrays = read_arrays(folder)
    if arrays is None:
        model = _reconstruction(folder, folder)
        return model, _arrays_of(model)
    with tempfile.TemporaryDirectory(prefix="aerotri_colmap_") as place:
        write_bare(arrays, folder, Path(place))
        return _reconstruction(Path(place), folder), arrays


def _arrays_of(model: Any) -> ModelArrays:
    """The records of a model that pycolmap has read."""
    images = {}
    for number, image in model.images.items():
        used = [measured for measured in image.points2D if measured.has_point3D()]
        px = np.array([measured.xy for measured in used], float).reshape(-1, 2)
        images[number] = px, np.array([measured.point3D_id for measured in used], np.uint64)
    ids = list(model.point3D_ids())
    xyz = np.array([model.points3D[number].xyz for number in ids], float).reshape(-1, 3)
    return ModelArrays(images, b"", np.array(ids, np.uint64), xyz)


def open_model(folder: Path) -> Any:
    """pycolmap's reconstruction of a folder.

    Raises
    ------
    InputError
        When it cannot be read.
    """
    _check(folder)
    return _reconstruction(folder, folder)


def _check(folder: Path) -> None:
    if not is_colmap(folder):
        raise InputError("holds no COLMAP model", "give a folder with cameras, images and points3D", folder)
    check_binary_model(folder)


def _reconstruction(place: Path, folder: Path) -> Any:
    """What pycolmap reads at a place; errors name the folder of the model."""
    import pycolmap

    try:
        return pycolmap.Reconstruction(place)
    except (RuntimeError, ValueError, IndexError, MemoryError, OSError) as error:
        short = str(error).strip().splitlines()[-1] if str(error).strip() else type(error).__name__
        short = short.replace(str(place), str(folder))
        raise InputError(f"is no readable COLMAP model: {short}", "export the model anew", folder) from error


def _cameras_of(model: Any, pixel_um: float, folder: Path) -> tuple[tuple[Camera, ...], dict[int, int]]:
    """The cameras, and their places by COLMAP's numbers."""
    ids = sorted(model.cameras)
    read = [read_camera(model.cameras[number], pixel_um, folder) for number in ids]
    for sentence in dict.fromkeys(sentence for _, said in read for sentence in said):
        warnings.warn(sentence, stacklevel=3)
    found = [camera for camera, _ in read]
    used = [name for name in LENS_NAMES if any(name in camera.lens for camera in found)]
    complete = []
    for camera in found:
        # a parameter that other cameras estimate is held at zero where this one does not have it
        lens = {name: camera.lens.get(name, Prior(0.0, fixed=True)) for name in used}
        complete.append(replace(camera, lens=lens))
    return tuple(complete), {number: place for place, number in enumerate(ids)}


def _free_parameters(cameras: tuple[Camera, ...]) -> tuple[tuple[str, tuple[str, ...]], ...]:
    lens = tuple(name for name in LENS_NAMES if any(is_free(camera.lens.get(name)) for camera in cameras))
    affinity = ("b1",) if any(camera.brown for camera in cameras) else ()
    return tuple((family, items) for family, items in (("lens", lens), ("brown", affinity)) if items)


def is_free(prior: Prior | None) -> bool:
    """Whether there is a parameter to be estimated."""
    return prior is not None and not prior.fixed


def _name(image: Any, folder: Path) -> str:
    try:
        return image.name
    except UnicodeDecodeError as error:
        raise InputError("the name of an image is not UTF-8", "export the model anew", folder) from error


def _pose(image: Any, folder: Path) -> np.ndarray:
    """(3, 4) camera from world."""
    try:
        return image.cam_from_world().matrix()
    except RuntimeError as error:
        message = f"the pose of image '{_name(image, folder)}' on its rig is missing"
        raise InputError(message, "export the model anew", folder) from error


def _images_of(model: Any, ids: list[int], camera_place: dict[int, int], folder: Path) -> Images:
    centre, angles = np.full((len(ids), 3), np.nan), np.full((len(ids), 3), np.nan)
    for row, number in enumerate(ids):
        image = model.images[number]
        if image.has_pose:
            colmap_from_world = _pose(image, folder)
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


def _once_each(image: np.ndarray, point: np.ndarray, count: int) -> np.ndarray | slice:
    """Rays to keep: COLMAP's tracks may hold two image points of one image; a block's may not."""
    again = np.zeros(len(image), bool)
    repeated = int(mark_repeated(image, point, np.full(count, -1), again))
    if not repeated:
        return slice(None)
    warnings.warn(f"left out: {counted(repeated, 'repeated measurement')} of a point in the same image", stacklevel=3)
    return ~again


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
    written = [expressible(camera) for camera in cameras]
    cameras = [camera for camera, _ in written]
    model, lost_rigs = _model(oriented, cameras, freed, keep)
    with atomic_folder(folder, own=OWN_ENTRIES) as place:
        (model.write_binary if binary else model.write_text)(place)
    lost = [*oriented.losses(with_rigs=True), *lost_rigs, *(sentence for _, said in written for sentence in said)]
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
    if oriented.errors is None and not any(other) and not any(value(camera, "b2") for camera in cameras):
        return oriented.block.image_points.xy, cameras
    return without_shear(oriented), [replace(camera, brown={}, lens=_lens_without_shear(camera)) for camera in cameras]


def without_shear(oriented: OrientedBlock) -> np.ndarray:
    """(m, 2) mm, the rays free of Brown's and the linear errors, and of the lens' shear b2: x − b2·(y − y0)."""
    block, rays = oriented.block, oriented.block.image_points
    xy = oriented.corrected_xy()
    b2, y0 = np.array([(value(camera, "b2"), camera.principal_point_mm[1]) for camera in block.cameras]).T
    of_ray = block.images.camera[rays.image]
    return xy - np.column_stack([b2[of_ray] * (xy[:, 1] - y0[of_ray]), np.zeros(len(xy))]) if b2.any() else xy


def _lens_without_shear(camera: Camera) -> dict[str, Prior]:
    return {name: prior for name, prior in camera.lens.items() if name != "b2"}


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


def point_numbers(names: np.ndarray) -> np.ndarray:
    """(N,) uint64 numbers of points: their names where all are numbers, 1, 2, 3 … otherwise."""
    plain = [name.isascii() and name.isdigit() and str(int(name)) == name and len(name) < 19 for name in names.tolist()]
    if all(plain):
        return names.astype(np.uint64)
    return np.arange(1, len(names) + 1, dtype=np.uint64)
