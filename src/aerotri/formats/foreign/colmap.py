"""COLMAP models, text and binary, by way of pycolmap.

COLMAP's camera frame is x right, y down, z forwards: this program's turned by diag(1, −1, −1). Its pixels begin at the
corner of the upper left one, as here. Its cameras are those of `colmap_cameras`.

COLMAP knows no pixel size. It is 1 µm unless stated, so that a principal distance of 3000 pixels reads 3 mm; choose the
camera's own where it is known.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import FilePath, InputError, counted, px_from_mm, whole_number
from aerotri.formats.assembly.losses import lost_names, lost_pixels
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.assembly.parts import no_sigma
from aerotri.formats.files.atomic import atomic_folder
from aerotri.formats.foreign._colmap_kernels import mark_repeated, number_by_appearance
from aerotri.formats.foreign.colmap_arrays import FILES, ModelArrays, read_arrays
from aerotri.formats.foreign.colmap_binary import check_binary_model
from aerotri.formats.foreign.colmap_cameras import colmap_camera, expressible, value
from aerotri.formats.foreign.colmap_model import (
    bare_model,
    block_without_rays,
    image_point_mm,
    open_model,
    refuse_far,
    refuse_no_colmap,
    refuse_unknown,
    warn_of_no_points,
    warn_of_repeated,
)
from aerotri.formats.foreign.colmap_rigs import (
    add_frames,
    add_rigs,
)
from aerotri.observations import Block, Camera, ImagePoints, Images, Prior

OWN_ENTRIES = tuple(f"{name}.{end}" for name in (*FILES, "rigs", "frames") for end in ("txt", "bin"))
PIXEL_UM = 1.0
"""Size of a pixel where it is not stated."""
SPARSE = 8
"""Largest number of an object point, per ray, up to which a table of all numbers is made [C]."""


def read_colmap(folder: FilePath, pixel_um: float = PIXEL_UM) -> tuple[Block, np.ndarray]:
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
        held, or fitted to a model of other formulas. When no point is measured: photographs and cameras are read.
    """
    folder = Path(folder)
    model, arrays = _opened(folder)
    ids = sorted(model.images)
    bare = block_without_rays(model, ids, pixel_um, folder)
    if not any(len(point) for _, point in arrays.images.values()):
        warn_of_no_points()
        return bare, no_sigma(0)
    image, point_id, xy = _rays_of(arrays, ids, bare.images, bare.cameras, folder)
    numbers, point = _by_appearance(point_id)
    keep = _once_each(image, point, len(numbers))
    rays = ImagePoints(image[keep], point[keep], xy[keep], np.full_like(xy[keep], pixel_um * 1e-3))
    return replace(bare, points=numbers.astype(str), image_points=rays), _points_of(arrays, numbers, folder)


def _points_of(arrays: ModelArrays, numbers: np.ndarray, folder: Path) -> np.ndarray:
    """(N, 3) the object points of these numbers."""
    order = np.argsort(arrays.ids, kind="stable")
    ids, known = arrays.ids[order], arrays.xyz[order]
    place = np.minimum(np.searchsorted(ids, numbers), max(len(ids) - 1, 0))
    refuse_unknown(ids, numbers, folder)
    xyz = known[place]
    refuse_far(xyz, folder)
    return xyz


def _rays_of(
    arrays: ModelArrays, ids: list[int], images: Images, cameras: tuple[Camera, ...], folder: Path
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image (m,), number of the object point (m,) and position (m, 2) mm of every ray, image by image."""
    parts = [arrays.images[number] for number in ids]
    ends = np.cumsum([0, *(len(point) for _, point in parts)])
    point, xy = np.empty(ends[-1], np.uint64), np.empty((ends[-1], 2))
    for row, (px, numbers) in enumerate(parts):
        point[ends[row] : ends[row + 1]] = numbers
        xy[ends[row] : ends[row + 1]] = image_point_mm(px, cameras[images.camera[row]], folder)
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
    refuse_no_colmap(folder)
    check_binary_model(folder)
    arrays = read_arrays(folder)
    if arrays is None:
        model = open_model(folder)
        return model, _arrays_of(model)
    return bare_model(arrays.heads, folder), arrays


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


def _once_each(image: np.ndarray, point: np.ndarray, count: int) -> np.ndarray | slice:
    """Rays to keep: COLMAP's tracks may hold two image points of one image; a block's may not."""
    again = np.zeros(len(image), bool)
    repeated = int(mark_repeated(image, point, np.full(count, -1), again))
    if not repeated:
        return slice(None)
    warn_of_repeated(repeated)
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
    lost += [*lost_names(block.points, point_numbers(block.points), "point"), *lost_pixels(block, PIXEL_UM)]
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
    from aerotri.colmap_library import pycolmap

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
    plain = [(number := whole_number(name, digits=18)) is not None and str(number) == name for name in names.tolist()]
    if all(plain):
        return names.astype(np.uint64)
    return np.arange(1, len(names) + 1, dtype=np.uint64)
