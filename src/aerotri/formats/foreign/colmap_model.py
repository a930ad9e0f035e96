"""What a COLMAP model holds beside its millions of records, by way of pycolmap: cameras, photographs, rigs, as a block.

See `colmap` for the conventions.
"""

from __future__ import annotations

import re
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import InputError, counted, mm_from_px, real_path
from aerotri.formats.foreign.colmap_arrays import FILES, write_bare
from aerotri.formats.foreign.colmap_binary import check_binary_model
from aerotri.formats.foreign.colmap_cameras import MOST_PIXELS, read_camera
from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA, rigs_of_model, stations_of_model
from aerotri.formats.text.notes import assumed, left_behind
from aerotri.formats.text.tables import CONTROL_CHARACTERS, LARGEST_NUMBER, LONGEST_NAME
from aerotri.functional_model.rotation import angles_from_rotation
from aerotri.observations import AdjustmentSettings, Block, Camera, ImagePoints, Images, Prior, Settings
from aerotri.observations.block import LENS_NAMES
from aerotri.observations.rigs import STATION


def is_colmap(path: Path) -> bool:
    """Whether a folder holds a COLMAP model."""
    return any(all((path / f"{name}.{ending}").is_file() for name in FILES) for ending in ("bin", "txt"))


def refuse_no_colmap(folder: Path) -> None:
    """Refuse a folder without a model.

    Raises
    ------
    InputError
    """
    if not is_colmap(folder):
        raise InputError("holds no COLMAP model", "give a folder with cameras, images and points3D", folder)


def open_model(folder: Path) -> Any:
    """pycolmap's reconstruction of a folder.

    Raises
    ------
    InputError
        When it cannot be read.
    """
    refuse_no_colmap(folder)
    check_binary_model(folder)
    return _reconstruction(folder, folder)


def bare_model(heads: bytes, folder: Path) -> Any:
    """pycolmap's reconstruction of a folder without image points and object points.

    Parameters
    ----------
    heads : what the file of the images holds beside image points, in the format of the model.

    Raises
    ------
    InputError
        When it cannot be read.
    """
    with tempfile.TemporaryDirectory(prefix="aerotri_colmap_") as place:
        write_bare(heads, folder, Path(place))
        return _reconstruction(Path(place), folder)


def _reconstruction(place: Path, folder: Path) -> Any:
    """What pycolmap reads at a place; errors name the folder of the model."""
    from aerotri.colmap_library import pycolmap

    try:
        return pycolmap.Reconstruction(place)
    except (RuntimeError, ValueError, IndexError, MemoryError, OSError) as error:
        short = str(error).strip().splitlines()[-1] if str(error).strip() else type(error).__name__
        short = short.replace(str(place), str(folder))
        raise InputError(f"is no readable COLMAP model: {short}", "export the model anew", folder) from error


def block_without_rays(model: Any, ids: list[int], pixel_um: float, folder: Path) -> Block:
    """The block of pycolmap's reconstruction, without image points.

    Parameters
    ----------
    ids : numbers of the photographs, in order. folder : of the model.

    Raises
    ------
    InputError
        When it has a camera model that cannot be expressed, or names or poses are not possible.
    """
    cameras, camera_place = _cameras_of(model, pixel_um, folder)
    images = _images_of(model, ids, camera_place, folder)
    names = {number: cameras[place].name for number, place in camera_place.items()}
    rigs = rigs_of_model(model, names, Block.rotation)
    if rigs:
        images = replace(images, columns={STATION: stations_of_model(model, ids, names, rigs)})
    _check_images(images, folder)
    nothing = np.zeros(0, np.int64)
    return Block(
        name=real_path(folder).name,
        cameras=cameras,
        images=images,
        points=np.zeros(0, "<U1"),
        image_points=ImagePoints(nothing, nothing, np.zeros((0, 2)), np.zeros((0, 2))),
        settings=Settings(
            adjustment=AdjustmentSettings(additional_parameters=_free_parameters(cameras), datum="minimal"),
            image_sigma_um=pixel_um,
        ),
        rigs=rigs,
    )


def _cameras_of(model: Any, pixel_um: float, folder: Path) -> tuple[tuple[Camera, ...], dict[int, int]]:
    """The cameras, and their places by COLMAP's numbers."""
    ids = sorted(model.cameras)
    read = [read_camera(model.cameras[number], pixel_um, folder) for number in ids]
    for sentence in dict.fromkeys(sentence for _, said in read for sentence in said):
        warnings.warn(UserWarning(assumed(sentence)), stacklevel=3)
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


def no_measured_points(folder: Path) -> InputError:
    """The error of a model without image points."""
    return InputError("the model has no points that were measured", "export it with its points", folder)


def warn_of_no_points() -> None:
    """Say that a model has photographs and cameras alone."""
    about = "the model has no points that were measured: photographs, orientations and cameras are read"
    warnings.warn(UserWarning(left_behind(f"{about}; add image points with --image-points")), stacklevel=4)


def image_point_mm(px: np.ndarray, camera: Camera, folder: Path) -> np.ndarray:
    """(k, 2) mm of image points (k, 2) px.

    Raises
    ------
    InputError
        When one is outside of any image.
    """
    if not (np.abs(px) <= MOST_PIXELS).all():
        raise InputError("an image point lies outside of any image", "export the model anew", folder)
    return mm_from_px(px, camera.size_px, camera.pixel_mm)


def refuse_unknown(ids: np.ndarray, numbers: np.ndarray, folder: Path) -> None:
    """Refuse image points of object points that there are not.

    Parameters
    ----------
    ids : (N,) uint64, of the object points, rising. numbers : (k,) uint64, of those that are measured.

    Raises
    ------
    InputError
    """
    place = np.minimum(np.searchsorted(ids, numbers), max(len(ids) - 1, 0))
    missing = np.flatnonzero(ids[place] != numbers) if len(ids) else np.arange(len(numbers))
    if len(missing):
        message = f"image points belong to object point {numbers[missing[0]]}, which there is not"
        raise InputError(message, "export the model with its points", folder)


def refuse_far(xyz: np.ndarray, folder: Path) -> None:
    """Refuse object points (N, 3) at no possible place.

    Raises
    ------
    InputError
    """
    if not (np.abs(xyz) <= LARGEST_NUMBER).all():
        raise InputError("an object point lies at no possible place", "export the model anew", folder)


def warn_of_repeated(count: int) -> None:
    """Warn of measurements that are left out."""
    about = left_behind(f"left out: {counted(count, 'repeated measurement')} of a point in the same image")
    warnings.warn(UserWarning(about), stacklevel=4)
