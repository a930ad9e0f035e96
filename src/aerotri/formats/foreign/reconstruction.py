"""What programs of structure from motion hold, made a block: cameras in pixels, poses, object points and rays.

Their camera frame is x right, y down, z forwards: ours turned by diag(1, −1, −1). Lens parameters are those of
`additional_parameters.lens`, where p1 and b2 change their sign with y.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

import numpy as np

from aerotri.conventions import InputError, mm_from_px
from aerotri.formats.assembly.parts import Reading, texts
from aerotri.formats.foreign.colmap_cameras import SIGN
from aerotri.formats.foreign.colmap_model import is_free
from aerotri.formats.text.tables import (
    CONTROL_CHARACTERS,
    LARGEST_FORMAT_PX,
    LARGEST_NUMBER,
    LONGEST_NAME,
    SMALLEST_POSITIVE,
)
from aerotri.functional_model.rotation import angles_from_rotation
from aerotri.observations import AdjustmentSettings, Block, Camera, ImagePoints, Images, Prior, Settings
from aerotri.observations.block import LENS_NAMES

OFF_ROTATION = 1e-3
"""Deviation from a rotation that is taken for rounding [C]."""


@dataclass(frozen=True)
class PixelCamera:
    """A camera in pixels.

    Parameters
    ----------
    size_px : columns, rows. focal_px : along x and y; the image grows to the right and down.
    centre_px : principal point, (0, 0) the upper left corner of the upper left pixel.
    lens : by the names of OpenCV's formula (`lens.ITEMS`); what is 0 or missing is held there.
    fisheye : whether positions before the lens are equidistant.
    centre_known : whether the principal point is a value of its own, which is then unknown; else it is held.
    """

    size_px: tuple[int, int]
    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    lens: Mapping[str, float]
    fisheye: bool = False
    centre_known: bool = False

    def camera(self, name: str, pixel_um: float) -> Camera:
        """In our terms: c is the focal length along y, the affinity b1 makes that along x."""
        pixel_mm = pixel_um * 1e-3
        x0, y0 = mm_from_px(np.array([self.centre_px]), self.size_px, pixel_mm)[0].tolist()
        items = {key: SIGN.get(key, 1.0) * value for key, value in self.lens.items()}
        items["b1"] = self.focal_px[0] / self.focal_px[1] - 1.0
        return Camera(
            name=name,
            model="frame",
            size_px=self.size_px,
            pixel_um=pixel_um,
            interior={
                "focal_length_mm": Prior(self.focal_px[1] * pixel_mm),
                "x0_mm": Prior(x0, fixed=not self.centre_known),
                "y0_mm": Prior(y0, fixed=not self.centre_known),
            },
            lens={key: Prior(value) for key, value in items.items() if value},
            projection="fisheye" if self.fisheye else "perspective",
        )

    def refuse_impossible(self, error: InputError) -> None:
        """Raise an error where no camera has such values."""
        width, height = self.size_px
        values = (*self.focal_px, *self.centre_px, *self.lens.values())
        possible = 1 <= min(width, height) <= max(width, height) <= LARGEST_FORMAT_PX
        possible = possible and all(abs(value) <= LARGEST_NUMBER for value in values)
        if not possible or not SMALLEST_POSITIVE <= min(self.focal_px) <= max(self.focal_px) <= LARGEST_FORMAT_PX:
            raise error


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """Photographs, object points and rays.

    Parameters
    ----------
    cameras : in our terms. images : names; camera : (n,) of each.
    centre : (n, 3); rotation : (n, 3, 3), our camera frame → object. NaN where unknown.
    points : names, of which the first `kept` stay without rays as well; xyz : (N, 3), NaN where unknown.
    image, point : (m,) index. px : (m, 2) column and row from the corner. sigma_px : of all image points.
    """

    cameras: tuple[Camera, ...]
    images: Sequence[str]
    camera: np.ndarray
    centre: np.ndarray
    rotation: np.ndarray
    points: Sequence[str]
    xyz: np.ndarray
    image: np.ndarray
    point: np.ndarray
    px: np.ndarray
    kept: int = 0
    sigma_px: float = 1.0

    def reading(self, name: str) -> Reading:
        """A local block of it, whose lens parameters and focal lengths are unknown, and the object points."""
        cameras = with_same_lens(self.cameras)
        needed = np.arange(len(self.points)) < self.kept
        needed[self.point] = True
        of_ray = self.camera[self.image]
        pixel = np.array([camera.pixel_mm for camera in cameras])[of_ray]
        xy = np.empty_like(self.px)
        for number, camera in enumerate(cameras):
            own = of_ray == number
            xy[own] = mm_from_px(self.px[own], camera.size_px, camera.pixel_mm)
        block = Block(
            name=name,
            cameras=cameras,
            images=Images(
                texts(list(self.images)),
                self.camera,
                np.full(len(self.images), ""),
                self.centre,
                angles_from_rotation(self.rotation),
            ),
            points=texts(list(self.points))[needed],
            image_points=ImagePoints(
                self.image,
                (np.cumsum(needed) - 1)[self.point],
                xy,
                np.repeat(self.sigma_px * pixel[:, None], 2, axis=1),
            ),
            settings=Settings(
                AdjustmentSettings(additional_parameters=unknown_lens(cameras), datum="minimal"),
                image_sigma_um=self.sigma_px * cameras[0].pixel_um,
            ),
        )
        return Reading(block, self.xyz[needed])


def with_same_lens(cameras: tuple[Camera, ...]) -> tuple[Camera, ...]:
    """A parameter that other cameras estimate is held at zero where a camera does not have it."""
    used = [name for name in LENS_NAMES if any(name in camera.lens for camera in cameras)]
    held = Prior(0.0, fixed=True)
    return tuple(replace(camera, lens={name: camera.lens.get(name, held) for name in used}) for camera in cameras)


def unknown_lens(cameras: tuple[Camera, ...]) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """The additional parameters of cameras whose lens is not held."""
    items = tuple(name for name in LENS_NAMES if any(is_free(camera.lens.get(name)) for camera in cameras))
    return (("lens", items),) if items else ()


def rotation_matrix(values: np.ndarray, error: InputError) -> np.ndarray:
    """(3, 3) the rotation nearest to nine numbers, row by row.

    Raises
    ------
    InputError
        The one given, where they are none.
    """
    matrix = values.reshape(3, 3)
    if not (np.abs(matrix) <= 2.0).all():
        raise error
    u, size, vt = np.linalg.svd(matrix)
    rotation = u @ vt
    if np.abs(size - 1.0).max() > OFF_ROTATION or np.linalg.det(rotation) < 0.0:
        raise error
    return rotation


def names_of_paths(paths: Sequence[str]) -> list[str]:
    """Short names of photographs: the file, with as many folders before it as make the names differ."""
    parts = [PurePosixPath(path.replace("\\", "/")).parts or ("",) for path in paths]
    names = [own[-1] for own in parts]
    for length in range(2, max((len(own) for own in parts), default=1) + 1):
        counts = Counter(names)
        if len(counts) == len(names):
            break
        names = ["/".join(own[-length:]) if counts[name] > 1 else name for own, name in zip(parts, names, strict=True)]
    return names


def check_names(names: Sequence[str], what: str, path: Path, remedy: str) -> None:
    """Refuse names that no table holds, and a name that is there twice.

    Raises
    ------
    InputError
    """
    for name in names:
        if not name.strip() or len(name) > LONGEST_NAME or re.search(CONTROL_CHARACTERS, name):
            raise InputError(f"{name[:60]!r} cannot be the name of a {what}", f"rename the {what}", path)
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise InputError(f"two {what}s are called '{twice[0][:60]}'", remedy, path)
