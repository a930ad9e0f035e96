"""VisualSFM's NVM_V3: cameras, object points and image points.

[L] VisualSFM's documentation and the writers of COLMAP and Theia. A camera is ``name f qw qx qy qz cx cy cz r 0``; the
quaternion leads from the world to x right, y down, z forwards, c is the projection centre. A point is ``X Y Z R G B n``
and n times ``camera feature x y``; x, y count from the principal point, which is the image centre, or that of
``FixedK fx cx fy cy`` in the first line. VisualSFM's r makes a measured position ideal: u = d·(1 + r·|d|²) for f = 1;
other programs write OpenCV's k1 there. The image points tell which; coordinates are local.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError, counted
from aerotri.formats.assembly.parts import Reading
from aerotri.formats.assembly.reprojection import CLEAR, FEWEST, residuals_at_start, sample_of_points
from aerotri.formats.foreign.bal import FARTHEST_PX
from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA
from aerotri.formats.foreign.lens_fit import fitted_lens
from aerotri.formats.foreign.reconstruction import PixelCamera, Reconstruction, check_names, names_of_paths
from aerotri.formats.text.notes import assumed, left_behind, taken
from aerotri.formats.text.tables import LARGEST_NUMBER, SMALLEST_POSITIVE
from aerotri.formats.text.text_lines import TextFile, all_numbers, first_lines
from aerotri.observations import Block, Camera

HEADER = "NVM_V3"
REMEDY = "export the reconstruction again"
CAMERA_VALUES, POINT_VALUES, RAY_VALUES = 10, 7, 4
LENS = ("k1", "k2", "k3")
RADII, DIRECTIONS = 60, 12
"""Places at which VisualSFM's lens is compared with the nearest one, along a radius and around [C]."""


@dataclass(frozen=True, eq=False)
class _Model:
    """One model of a file.

    Parameters
    ----------
    names : of the photographs. cameras : (n, 9) f, quaternion, centre, r. points : (N, 3).
    image, point : (m,). xy : (m, 2) from the principal point.
    """

    names: list[str]
    cameras: np.ndarray
    points: np.ndarray
    image: np.ndarray
    point: np.ndarray
    xy: np.ndarray
    left: int


def is_nvm(path: Path) -> bool:
    """Whether a file begins as one of VisualSFM."""
    lines = first_lines(path, 1)
    return bool(lines) and lines[0].split()[:1] == [HEADER]


def read_nvm(path: FilePath, pixel_um: float = 1.0, size_px: tuple[int, int] | None = None) -> Reading:
    """The first model of a file; photographs with the same f and r share a camera.

    Parameters
    ----------
    pixel_um : size of a pixel. size_px : columns and rows, which the file does not tell; None: as small as the image
        points allow.

    Raises
    ------
    InputError
        With the line.
    """
    file = TextFile(Path(path), comments=False)
    fixed = _fixed(file)
    model, said = _model(file)
    lenses = [PixelLens(*row) for row in np.unique(model.cameras[:, [0, 8]], axis=0).tolist()]
    place = {lens: k for k, lens in enumerate(lenses)}
    of_image = np.array([place[PixelLens(*row)] for row in model.cameras[:, [0, 8]].tolist()], np.int64)
    if len(model.names) > 1:
        words = (
            f"the photographs have {counted(len(lenses), 'camera')}: those of one f and one radial distortion share it"
        )
        said.append(assumed(words))
    if size_px is None and fixed is None:
        said.append(assumed("the format is as small as the image points allow: state it with --camera-size"))
    sizes = _sizes(model, of_image, fixed, size_px)
    readings = {
        name: _block(file, model, of_image, [lens.camera(size, fixed, forward) for lens, size in
                                             zip(lenses, sizes, strict=True)], pixel_um)
        for name, forward in (("VisualSFM's", False), ("OpenCV's k1", True))
    }  # fmt: skip
    chosen, about = _settled(readings, any(lens.r for lens in lenses))
    return replace(readings[chosen], messages=(*said, *about, "coordinates are local"))


@dataclass(frozen=True)
class PixelLens:
    """focal_px : f. r : radial distortion."""

    focal_px: float
    r: float

    def camera(
        self, size: tuple[int, int], fixed: tuple[float, float, float, float] | None, forward: bool
    ) -> PixelCamera:
        """The camera, r read as OpenCV's k1 (forward) or as VisualSFM has it."""
        fx, cx, fy, cy = fixed or (self.focal_px, size[0] / 2.0, self.focal_px, size[1] / 2.0)
        lens = {"k1": self.r} if forward or not self.r else self._nearest(size)
        return PixelCamera(size, (fx, fy), (cx, cy), lens, centre_known=fixed is not None)

    def _nearest(self, size: tuple[int, int]) -> dict[str, float]:
        """The forward lens nearest to u = d·(1 + r·d²) over the format."""
        farthest = float(np.hypot(*size)) / 2.0 / self.focal_px
        if self.r < 0.0:
            # beyond, it folds
            farthest = min(farthest, 0.9 / np.sqrt(-3.0 * self.r))
        d = np.linspace(0.0, farthest, RADII + 1)[1:]
        around = np.linspace(0.0, 2.0 * np.pi, DIRECTIONS, endpoint=False)
        axes = np.column_stack([np.cos(around), np.sin(around)])
        bent = np.vstack([d[:, None] * axis for axis in axes])
        ideal = bent * (1.0 + self.r * np.sum(bent**2, axis=1))[:, None]
        return fitted_lens(ideal, bent, LENS, False, self.focal_px).values(LENS)


def _fixed(file: TextFile) -> tuple[float, float, float, float] | None:
    """fx, cx, fy, cy of a calibration in the first line; None where there is none."""
    if not len(file) or file.lines[0].split()[:1] != [HEADER]:
        raise file.error(0, f"does not begin with {HEADER}", "give the .nvm file of VisualSFM")
    words = file.lines[0].split()[1:]
    if not words:
        return None
    if words[0] != "FixedK" or len(words) < 5 or not all_numbers(words[1:]):
        raise file.error(0, f"'{' '.join(words)[:40]}' is not understood", "write FixedK fx cx fy cy, or nothing")
    if any(float(word) for word in words[5:]):
        raise file.error(
            0, "has a distortion beside FixedK, which is not understood", "leave it out: write FixedK fx cx fy cy"
        )
    fx, cx, fy, cy = (float(word) for word in words[1:5])
    if not min(fx, fy) >= SMALLEST_POSITIVE or not max(fx, cx, fy, cy) <= FARTHEST_PX:
        raise file.error(0, "the calibration is none", REMEDY)
    return fx, cx, fy, cy


def _model(file: TextFile) -> tuple[_Model, list[str]]:
    """The first model, and what to say of others."""
    row, count = 1, _count(file, 1)
    names, values = [], []
    for k in range(row + 1, row + 1 + count):
        words = _words(file, k)
        if len(words) <= CAMERA_VALUES or not all_numbers(words[-CAMERA_VALUES:]):
            raise file.error(min(k, len(file) - 1), "is no camera of name and 10 numbers", REMEDY)
        # VisualSFM writes a blank of a name as a quotation mark
        names.append(" ".join(words[:-CAMERA_VALUES]).strip('"').replace('"', " "))
        values.append([float(word) for word in words[-CAMERA_VALUES:-1]])
    if not count:
        raise file.error(row, "holds no photographs", REMEDY)
    row += 1 + count
    cameras = np.array(values, float)
    bad = ~(np.abs(cameras) <= LARGEST_NUMBER).all(axis=1) | ~(cameras[:, 0] >= SMALLEST_POSITIVE)
    bad |= ~(np.linalg.norm(cameras[:, 1:5], axis=1) > 0.5)
    if bad.any():
        raise file.error(2 + int(np.flatnonzero(bad)[0]), "has values that no camera has", REMEDY)
    number = _count(file, row)
    points, rays = _points(file, row + 1, number, count)
    short = names_of_paths(names)
    check_names(short, "photograph", file.path, REMEDY)
    image, point, xy, left = _once(rays)
    said: list[str] = []
    if left:
        said.append(left_behind(f"left out: {counted(left, 'repeated measurement')} of a point in the same photograph"))
    after = row + 1 + number
    if after < len(file) and file.lines[after].split()[0].isdigit() and int(file.lines[after].split()[0]) > 0:
        said.append(left_behind("of several models the first is read"))
    return _Model(short, cameras, points, image, point, xy, left), said


def _words(file: TextFile, row: int) -> list[str]:
    if row >= len(file):
        raise file.error(len(file), "comes too early, the file is cut off", REMEDY)
    return file.lines[row].split()


def _count(file: TextFile, row: int) -> int:
    words = _words(file, row)
    if len(words) != 1 or not words[0].isdigit() or len(words[0]) > 9:
        raise file.error(row, "is no count", REMEDY)
    if int(words[0]) > len(file):
        raise file.error(row, f"announces {words[0]} rows, more than the file has", REMEDY)
    return int(words[0])


def _points(file: TextFile, begin: int, count: int, photographs: int) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) points and (m, 4) rays: photograph, point, x, y."""
    points, rays = [], []
    for k in range(count):
        words = _words(file, begin + k)
        if not all_numbers(words) or len(words) < POINT_VALUES:
            raise file.error(begin + k, "is no point of numbers", REMEDY)
        values = np.array(words, dtype=float)
        number = (len(words) - POINT_VALUES) // RAY_VALUES
        own = (
            values[POINT_VALUES:].reshape(-1, RAY_VALUES) if len(words) == POINT_VALUES + RAY_VALUES * number else None
        )
        if own is None or values[6] != number:
            raise file.error(begin + k, "has other than the measurements that it announces", REMEDY)
        whole = (own[:, 0] == np.floor(own[:, 0])) & (own[:, 0] >= 0) & (own[:, 0] < photographs)
        near = (np.abs(own[:, 2:]) <= FARTHEST_PX).all(axis=1)
        if not whole.all() or not near.all() or not (np.abs(values[:3]) <= LARGEST_NUMBER).all():
            raise file.error(begin + k, "names a photograph or a place that is not possible", REMEDY)
        points.append(values[:3])
        rays.append(np.column_stack([own[:, 0], np.full(number, k), own[:, 2:]]))
    empty = np.zeros((0, 4))
    return np.array(points, float).reshape(-1, 3), np.vstack(rays) if rays else empty


def _once(rays: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Image, point and position of the rays, a point once in a photograph; and how many were left out."""
    image, point = rays[:, 0].astype(np.int64), rays[:, 1].astype(np.int64)
    _, first = np.unique(image * (int(point.max(initial=0)) + 1) + point, return_index=True)
    keep = np.sort(first)
    return image[keep], point[keep], rays[keep, 2:], len(rays) - len(keep)


def _sizes(
    model: _Model,
    of_image: np.ndarray,
    fixed: tuple[float, float, float, float] | None,
    size_px: tuple[int, int] | None,
) -> list[tuple[int, int]]:
    count = int(of_image.max()) + 1
    if size_px is not None:
        return [size_px] * count
    if fixed is not None:
        # the principal point is near the middle of a format
        return [(max(1, round(2.0 * fixed[1])), max(1, round(2.0 * fixed[3])))] * count
    reach = np.zeros((count, 2))
    np.maximum.at(reach, of_image[model.image], np.abs(model.xy))
    return [(int(columns), int(rows)) for columns, rows in 2 * np.maximum(np.ceil(reach), 1.0)]


def _block(
    file: TextFile, model: _Model, of_image: np.ndarray, cameras: list[PixelCamera], pixel_um: float
) -> Reading:  # fmt: skip
    for camera in cameras:
        camera.refuse_impossible(InputError("has values that no camera has", REMEDY, file.path))
    centre_px = np.array([camera.centre_px for camera in cameras])[of_image[model.image]]
    ours: list[Camera] = [camera.camera(f"camera {k}", pixel_um) for k, camera in enumerate(cameras, 1)]
    return Reconstruction(
        tuple(ours),
        model.names,
        of_image,
        model.cameras[:, 5:8],
        np.swapaxes(_rotations(model.cameras[:, 1:5]), 1, 2) @ COLMAP_FROM_CAMERA,
        [f"{k + 1}" for k in range(len(model.points))],
        model.points,
        model.image,
        model.point,
        model.xy + centre_px,
    ).reading(file.path.stem)


def _rotations(quaternions: np.ndarray) -> np.ndarray:
    """(n, 3, 3) of (n, 4) w, x, y, z."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=1)


def _settled(readings: dict[str, Reading], distorted: bool) -> tuple[str, list[str]]:
    """The reading of r that the image points confirm, the first where they do not tell; and what to say."""
    first, second = readings
    if not distorted:
        return first, []
    own, other = (residuals_at_start(_sample(readings[name].block)) for name in (first, second))
    if min(own.count, other.count) < FEWEST:
        return first, [assumed(f"the distortion is taken as {first}: the image points do not tell")]
    told = f"{first} {own.median_px:.3g} px, {second} {other.median_px:.3g} px"
    chosen = second if other.median_px < CLEAR * own.median_px else first
    return chosen, [taken(f"the distortion is {chosen}, by the median residual of the image points: {told}")]


def _sample(block: Block) -> Block:
    rows, rays = sample_of_points(block), block.image_points
    some = replace(rays, image=rays.image[rows], point=rays.point[rows], xy=rays.xy[rows], sigma=rays.sigma[rows])
    return replace(block, image_points=some)
