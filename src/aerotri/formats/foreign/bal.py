"""Bundle Adjustment in the Large: one text file with observations, cameras and points.

P = R·X + t, p = −P/P.z, p' = f·(1 + k1|p|² + k2|p|⁴)·p in pixels from the image centre, x right, y up, the camera
looking along −z [L: Agarwal et al., Bundle Adjustment in the Large, 2010]. This is the camera frame of `conventions`:
its rotation is Rᵀ, its projection centre −Rᵀt, and k1, k2 are the forward lens of `additional_parameters.lens`.

The format knows no pixel size and no format: a pixel counts as 1 mm (pixel_um = 1000), so pixels and millimetres are
the same numbers, and the format of every camera is the smallest of whole, even numbers of pixels that holds its points.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.formats.assembly.losses import lost_names, lost_pixels
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.files.atomic import atomic_file
from aerotri.formats.text.csv_text import read_bytes
from aerotri.formats.text.notes import left_behind
from aerotri.formats.text.tables import LARGEST_NUMBER
from aerotri.formats.text.text_lines import line_of_word
from aerotri.functional_model.rotation import angles_from_rotation, exponential, logarithm
from aerotri.observations import AdjustmentSettings, Block, Camera, ImagePoints, Images, Prior, Settings

PIXEL_UM = 1000.0
"""Size of a pixel, µm: files have pixels only, and with 1 mm a pixel both are the same numbers."""
CAMERA_VALUES = 9
"""Numbers of a camera: rotation vector, translation, f, k1, k2 [L: Agarwal et al. 2010]."""
FARTHEST_PX = 1e6
"""No photograph reaches farther from its centre."""
SMALLEST_FOCAL_PX = 1e-3
"""Focal length, pixels, below which it counts as 0; chosen [C]: no camera sees half a sphere on a pixel."""
WRITTEN_LENS = ("k1", "k2")


def read_bal(path: FilePath) -> tuple[Block, np.ndarray]:
    """A block and its object points from a BAL file.

    Focal length, k1 and k2 are free for every image, the datum is minimal, the standard deviation one pixel.

    Parameters
    ----------
    path : the file.

    Returns
    -------
    block : with start values for all images; cameras, images and points are named by their number.
    points : (N, 3) start values of the object points.

    Raises
    ------
    InputError
        With the line, for what is not such a file.
    """
    path = Path(path)
    n_images, n_points, observations, cameras, points = _parse(path)
    image, point = observations[:, 0].astype(np.int64), observations[:, 1].astype(np.int64)
    xy = observations[:, 2:]
    cam_from_world = exponential(cameras[:, :3])
    rotation = np.swapaxes(cam_from_world, 1, 2)
    centre = -np.einsum("nij,nj->ni", rotation, cameras[:, 3:6])
    numbers = np.arange(max(n_images, n_points)).astype(str)
    images = Images(
        names=numbers[:n_images],
        camera=np.arange(n_images),
        strip=np.full(n_images, ""),
        centre=centre,
        angles=angles_from_rotation(rotation),
    )
    block = Block(
        name=path.stem,
        cameras=_cameras(cameras[:, 6:], image, xy),
        images=images,
        points=numbers[:n_points],
        image_points=ImagePoints(image, point, xy, np.full_like(xy, PIXEL_UM * 1e-3)),
        settings=Settings(
            adjustment=AdjustmentSettings(additional_parameters=(("lens", WRITTEN_LENS),), datum="minimal"),
            image_sigma_um=PIXEL_UM,
        ),
    )
    return block, points


def is_bal(path: Path) -> bool:
    """Whether a file begins as a BAL file does: a line of three counts, then a line of four numbers."""
    try:
        with path.open("rb") as file:
            first, second = file.readline(200).split(), file.readline(200).split()
        return len(first) == 3 and len(second) == 4 and all(word.isdigit() for word in [*first, *second[:2]])
    except OSError:
        return False


def _cameras(values: np.ndarray, image: np.ndarray, xy: np.ndarray) -> tuple[Camera, ...]:
    """A camera for every row (f, k1, k2)."""
    reach = np.zeros((len(values), 2))
    np.maximum.at(reach, image, np.abs(xy))
    size = 2 * np.maximum(np.ceil(reach), 1.0).astype(np.int64)
    return tuple(
        Camera(
            name=str(i),
            model="frame",
            size_px=(int(size[i, 0]), int(size[i, 1])),
            pixel_um=PIXEL_UM,
            interior={
                "focal_length_mm": Prior(float(f)),
                "x0_mm": Prior(0.0, fixed=True),
                "y0_mm": Prior(0.0, fixed=True),
            },
            lens={"k1": Prior(float(k1)), "k2": Prior(float(k2))},
        )
        for i, (f, k1, k2) in enumerate(values)
    )


def _parse(path: Path) -> tuple[int, int, np.ndarray, np.ndarray, np.ndarray]:
    """Counts of images and points, and the arrays (m, 4), (n, 9), (N, 3), checked."""
    raw = read_bytes(path)
    words = raw.split()
    n_images, n_points, m = _counts(words[:3], path)
    wanted = 3 + 4 * m + CAMERA_VALUES * n_images + 3 * n_points
    if len(words) != wanted:
        raise InputError(
            f"holds {len(words)} numbers, its first line announces {wanted}",
            "give a whole BAL file; is this one cut off?",
            path,
        )
    try:
        values = np.array(words[3:], dtype=float)
    except ValueError:
        values = np.array([_number(word) for word in words[3:]])
    bad = np.flatnonzero(~(np.abs(values) <= LARGEST_NUMBER))
    if len(bad):
        place = int(bad[0]) + 3
        word = words[place][:60].decode("utf-8", "replace")
        what = "is not possible" if np.isfinite(values[bad[0]]) else "is not a finite number"
        raise InputError(
            f"'{word}' {what}",
            "write plain numbers, or take the file from its source again",
            path,
            line_of_word(raw, place),
        )
    observations = values[: 4 * m].reshape(m, 4)
    cameras = values[4 * m : 4 * m + CAMERA_VALUES * n_images].reshape(n_images, CAMERA_VALUES)
    _check_observations(observations, (n_images, n_points), raw, path)
    short = np.flatnonzero(cameras[:, 6] < SMALLEST_FOCAL_PX)
    if len(short):
        place = 3 + 4 * m + CAMERA_VALUES * int(short[0]) + 6
        raise InputError(
            "a focal length is not greater than 0",
            "give it in pixels: the seventh of the nine values of a camera",
            path,
            line_of_word(raw, place),
        )
    return n_images, n_points, observations, cameras, values[4 * m + CAMERA_VALUES * n_images :].reshape(n_points, 3)


def _counts(words: list[bytes], path: Path) -> tuple[int, int, int]:
    if len(words) == 3 and all(word.isdigit() and len(word) < 12 for word in words):
        n_images, n_points, m = (int(word) for word in words)
        if min(n_images, n_points, m) > 0:
            return n_images, n_points, m
    raise InputError("does not begin with the counts of cameras, points and observations", "give a BAL file", path, 1)


def _check_observations(observations: np.ndarray, counts: tuple[int, int], raw: bytes, path: Path) -> None:
    index = observations[:, :2]
    bad = np.flatnonzero(((index < 0) | (index >= np.array(counts)) | (index != np.floor(index))).any(axis=1))
    if len(bad):
        line = line_of_word(raw, 3 + 4 * int(bad[0]))
        raise InputError(
            "an observation names a camera or point that the file does not have",
            "numbers count from 0 and stay below those of the first line",
            path,
            line,
        )
    far = np.flatnonzero((np.abs(observations[:, 2:]) > FARTHEST_PX).any(axis=1))
    if len(far):
        line = line_of_word(raw, 3 + 4 * int(far[0]))
        raise InputError(
            "an image point lies outside of any image", "give coordinates in pixels from the image centre", path, line
        )
    key = index[:, 0] * counts[1] + index[:, 1]
    _, first = np.unique(key, return_index=True)
    if len(first) < len(key):
        repeated = np.setdiff1d(np.arange(len(key)), first)
        line = line_of_word(raw, 3 + 4 * int(repeated[0]))
        raise InputError("a point is observed twice in one image", "keep one of the lines", path, line)


def _number(word: bytes) -> float:
    try:
        return float(word)
    except ValueError:
        return np.nan


def write_bal(oriented: OrientedBlock, path: FilePath) -> tuple[str, ...]:
    """Write a BAL file: one camera an image, image points free of every error but k1 and k2.

    Images without orientation and points without coordinates are left out.

    Parameters
    ----------
    oriented : block, orientation and points.
    path : the file.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When a camera is a fisheye or its lens has more than k1 and k2, or nothing is oriented.
    """
    for camera in oriented.block.cameras:
        if camera.is_fisheye:
            message = f"camera '{camera.name}' is a fisheye, which BAL has no words for"
            raise InputError(message, "write COLMAP or OpenSfM")
        more = [name for name, prior in camera.lens.items() if prior.value and name not in WRITTEN_LENS]
        if more:
            raise InputError(f"camera '{camera.name}' has lens parameter {more[0]}, BAL has k1 and k2", "write COLMAP")
    rays, block = oriented.block.image_points, oriented.block
    keep = np.flatnonzero(oriented.complete)
    if not len(keep):
        raise InputError(f"block '{block.name}' has no oriented image points", "adjust it first")
    images, image = np.unique(rays.image[keep], return_inverse=True)
    points, point = np.unique(rays.point[keep], return_inverse=True)
    cameras = [block.cameras[number] for number in block.images.camera[images]]
    pixel = np.array([camera.pixel_mm for camera in cameras])
    principal = np.array([camera.principal_point_mm for camera in cameras])
    xy = (oriented.corrected_xy()[keep] - principal[image]) / pixel[image, None]
    cam_from_world = np.swapaxes(oriented.rotation[images], 1, 2)
    translation = -np.einsum("nij,nj->ni", cam_from_world, oriented.centre[images])
    inner = [
        [camera.focal_length_mm / camera.pixel_mm, *(_value(camera, name) for name in WRITTEN_LENS)]
        for camera in cameras
    ]
    values = np.hstack([logarithm(cam_from_world), translation, np.array(inner)])
    order = np.lexsort((image, point))
    with atomic_file(path) as place, place.open("w", encoding="ascii") as file:
        file.write(f"{len(images)} {len(points)} {len(keep)}\n")
        for k in order.tolist():
            file.write(f"{image[k]} {point[k]} {float(xy[k, 0])!r} {float(xy[k, 1])!r}\n")
        for value in np.concatenate([values.ravel(), oriented.points[points].ravel()]).tolist():
            file.write(f"{value!r}\n")
    lost = [*lost_names(block.images.names[images], np.arange(len(images)), "photograph")]
    lost += lost_names(block.points[points], np.arange(len(points)), "point")
    if len(np.unique(block.images.camera[images])) < len(images):
        lost.append(left_behind("could not be carried over: which photographs share a camera"))
    return (*oriented.losses(), *lost, *lost_pixels(block, PIXEL_UM))


def _value(camera: Camera, name: str) -> float:
    return camera.lens[name].value if name in camera.lens else 0.0
