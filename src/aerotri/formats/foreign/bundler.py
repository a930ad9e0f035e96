"""Bundler v0.3: bundle.out with cameras, points and rays, and list.txt with the names of the photographs.

P = R·X + t, p = −P/P.z, p' = f·(1 + k1|p|² + k2|p|⁴)·p in pixels from the image centre, x right, y up: the camera frame
of `conventions`, and the lens of BAL. As there, the format of a camera is not told: it is the smallest of whole, even
numbers of pixels that holds the points, unless stated; a pixel counts as 1 µm unless stated.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError, counted, real_path
from aerotri.formats.assembly.losses import lost_names, lost_pixels
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.assembly.parts import Reading, texts
from aerotri.formats.files.atomic import atomic_folder
from aerotri.formats.foreign.bal import FARTHEST_PX, SMALLEST_FOCAL_PX, WRITTEN_LENS
from aerotri.formats.text.csv_text import read_bytes
from aerotri.formats.text.notes import assumed, left_behind
from aerotri.formats.text.tables import LARGEST_NUMBER
from aerotri.formats.text.text_lines import TextFile, check_words, first_lines, is_number, line_of_word
from aerotri.functional_model.rotation import angles_from_rotation
from aerotri.observations import AdjustmentSettings, Block, Camera, ImagePoints, Images, Prior, Settings

HEADER = "# Bundle file v0.3"
CAMERA_VALUES = 15
"""Numbers of a camera: f, k1, k2, the rotation matrix, the translation [L: manual of Bundler v0.3]."""
BUNDLE, LIST = "bundle.out", "list.txt"
PIXEL_UM = 1.0
"""Size of a pixel where it is not stated."""
SKEW = 1e-4
"""Largest deviation of RᵀR from the unit matrix."""


def is_bundler(path: Path) -> bool:
    """Whether a file, or bundle.out in a folder, is of this format."""
    file = path / BUNDLE if path.is_dir() else path
    return first_lines(file, 1, comments=False)[:1] == [HEADER]


@dataclass(frozen=True, eq=False)
class _Content:
    """bundle.out: cameras (n, 15), points (N, 3), and of every ray camera, point and position (m, 2) px."""

    cameras: np.ndarray
    points: np.ndarray
    image: np.ndarray
    point: np.ndarray
    px: np.ndarray


class _Numbers:
    """The numbers of the file in their order, with errors that know the line of each."""

    def __init__(self, path: Path):
        self.path = path
        self.raw = read_bytes(path)
        if not self.raw.startswith(HEADER.encode()):
            raise InputError("is no Bundler file of version 0.3", f"its first line is {HEADER}", path, 1)
        self.words = self.raw.split()[len(HEADER.split()) :]
        try:
            self.values = np.array(self.words, dtype=float)
        except ValueError:
            good = [is_number(word.decode("utf-8", "replace")) for word in self.words]
            raise self.error(good.index(False) if False in good else 0, "is not a number") from None
        bad = np.flatnonzero(~(np.abs(self.values) <= LARGEST_NUMBER))
        if len(bad):
            finite = np.isfinite(self.values[bad[0]])
            raise self.error(int(bad[0]), "is not possible" if finite else "is not a finite number")

    def error(self, place: int, message: str) -> InputError:
        word = self.words[place].decode("utf-8", "replace")[:60] if place < len(self.words) else "the end"
        line = line_of_word(self.raw, min(place, len(self.words) - 1) + len(HEADER.split()))
        return InputError(f"'{word}' {message}", "export the reconstruction again", self.path, line)

    def cut_off(self) -> InputError:
        return self.error(len(self.words), "comes too early, the file is cut off")

    def count(self, place: int, limit: float = 1e9) -> int:
        """A whole number that is not negative."""
        if place >= len(self.values):
            raise self.cut_off()
        value = self.values[place]
        if value != np.floor(value) or not 0 <= value < limit:
            raise self.error(place, "is no count")
        return int(value)


def _content(path: Path) -> _Content:
    numbers = _Numbers(path)
    n_images, n_points = numbers.count(0), numbers.count(1)
    begin = 2 + CAMERA_VALUES * n_images
    if begin + 7 * n_points > len(numbers.values):
        raise numbers.cut_off()
    cameras = numbers.values[2:begin].reshape(n_images, CAMERA_VALUES)
    place, starts, counts = begin, np.empty(n_points, np.int64), np.empty(n_points, np.int64)
    for k in range(n_points):
        starts[k] = place
        counts[k] = numbers.count(place + 6)
        place += 7 + 4 * int(counts[k])
        if place > len(numbers.values):
            raise numbers.cut_off()
    if place < len(numbers.values):
        raise numbers.error(place, "comes after the last point that the file announces")
    point = np.repeat(np.arange(n_points), counts)
    within = np.arange(len(point)) - np.repeat(np.cumsum(counts) - counts, counts)
    at = starts[point] + 7 + 4 * within
    image = numbers.values[at]
    bad = np.flatnonzero((image != np.floor(image)) | (image < 0) | (image >= n_images))
    if len(bad):
        raise numbers.error(int(at[bad[0]]), "is not the number of a camera of the file")
    px = np.column_stack([numbers.values[at + 2], numbers.values[at + 3]]).reshape(-1, 2)
    far = np.flatnonzero((np.abs(px) > FARTHEST_PX).any(axis=1))
    if len(far):
        raise numbers.error(int(at[far[0]]) + 2, "is an image coordinate outside of any image")
    _check_cameras(numbers, cameras)
    xyz = numbers.values[starts[:, None] + np.arange(3)].reshape(-1, 3)
    return _Content(cameras, xyz, image.astype(np.int64), point, px)


def _check_cameras(numbers: _Numbers, cameras: np.ndarray) -> None:
    rotation = cameras[:, 3:12].reshape(-1, 3, 3)
    with np.errstate(over="ignore", invalid="ignore"):
        skew = np.abs(rotation @ np.swapaxes(rotation, 1, 2) - np.eye(3)).max(axis=(1, 2), initial=0.0)
        odd = ~(skew < SKEW) | ~(np.linalg.det(rotation) > 0.0)
    bad = np.flatnonzero((cameras[:, 0] > 0.0) & odd)
    if len(bad):
        raise numbers.error(2 + CAMERA_VALUES * int(bad[0]) + 3, "begins a matrix that is not a rotation")
    negative = np.flatnonzero((cameras[:, 0] < SMALLEST_FOCAL_PX) & (cameras[:, 0] != 0.0))
    if len(negative):
        raise numbers.error(2 + CAMERA_VALUES * int(negative[0]), "is not a possible principal distance")


def read_bundler(path: FilePath, pixel_um: float = PIXEL_UM, size_px: tuple[int, int] | None = None) -> Reading:
    """A block and its object points; names of photographs from list.txt beside the file or in the folder above.

    Photographs with the same f, k1, k2 share a camera. Focal length, k1 and k2 are free, the datum is minimal, the
    standard deviation one pixel. Photographs that Bundler did not orient (f = 0) are left out.

    Parameters
    ----------
    path : bundle.out, or the folder with it.
    pixel_um : size of a pixel; size_px : columns and rows.

    Raises
    ------
    InputError
        With the line.
    """
    path = Path(path) / BUNDLE if Path(path).is_dir() else Path(path)
    content = _content(path)
    names, messages = _names(path, len(content.cameras))
    oriented = content.cameras[:, 0] > 0.0
    if not oriented.all():
        about = f"left out: {counted(int((~oriented).sum()), 'photograph')} that Bundler did not orient"
        messages.append(left_behind(about))
    keep, repeated = _once_each(content, oriented)
    if repeated:
        about = f"left out: {counted(repeated, 'repeated measurement')} of a point in the same photograph"
        messages.append(left_behind(about))
    if not len(keep):
        raise InputError("holds no image points of oriented photographs", "give a reconstruction with points", path)
    number = np.cumsum(oriented) - 1
    image, point, px = number[content.image[keep]], content.point[keep], content.px[keep]
    used, point = np.unique(point, return_inverse=True)
    values = content.cameras[oriented]
    inner, camera = np.unique(values[:, :3], axis=0, return_inverse=True)
    cam_from_world = values[:, 3:12].reshape(-1, 3, 3)
    images = Images(
        names=texts(names)[oriented],
        camera=camera.astype(np.int64).ravel(),
        strip=np.full(len(values), ""),
        centre=-np.einsum("nji,nj->ni", cam_from_world, values[:, 12:]),
        angles=angles_from_rotation(np.swapaxes(cam_from_world, 1, 2)),
    )
    xy = px * pixel_um * 1e-3
    sizes = _sizes(images.camera[image], px, len(inner), size_px)
    cameras = tuple(_camera(i, row, sizes[i], pixel_um) for i, row in enumerate(inner.tolist()))
    adjustment = AdjustmentSettings(additional_parameters=(("lens", WRITTEN_LENS),), datum="minimal")
    block = Block(
        name=real_path(path).parent.name,
        cameras=cameras,
        images=images,
        points=used.astype(str),
        image_points=ImagePoints(image, point.ravel(), xy, np.full_like(xy, pixel_um * 1e-3)),
        settings=Settings(adjustment=adjustment, image_sigma_um=pixel_um),
    )
    return Reading(block, content.points[used], tuple(messages))


def _names(path: Path, count: int) -> tuple[list[str], list[str]]:
    """Names of the photographs: of list.txt, else numbers from 0 as the file itself counts; and messages."""
    place = next((folder / LIST for folder in (path.parent, path.parent.parent) if (folder / LIST).is_file()), None)
    if place is None:
        about = f"there is no {LIST}: photographs are called by their numbers from 0"
        return [str(i) for i in range(count)], [assumed(about)]
    file = TextFile(place)
    if len(file) != count:
        message = f"names {len(file)} photographs, {path.name} has {count}"
        raise InputError(message, "give the list.txt that belongs to the reconstruction", place)
    # a name may be followed by "0 focal-length"
    names = [line[0] if len(line) == 3 and is_number(line[2]) else " ".join(line) for line in file.words()]
    names = [name.replace("\\", "/").rsplit("/", 1)[-1] for name in names]
    rows = list(range(count))
    file.check_names(names, rows, "photograph")
    file.refuse_repeated(names, rows, "photograph")
    return names, []


def _once_each(content: _Content, oriented: np.ndarray) -> tuple[np.ndarray, int]:
    """Rays of oriented photographs, in order, the first one of each point in a photograph; and how many others."""
    rows = np.flatnonzero(oriented[content.image])
    key = content.image[rows] * np.int64(len(content.points)) + content.point[rows]
    _, first = np.unique(key, return_index=True)
    return rows[np.sort(first)], len(rows) - len(first)


def _sizes(camera: np.ndarray, px: np.ndarray, count: int, size_px: tuple[int, int] | None) -> list[tuple[int, int]]:
    if size_px is not None:
        return [size_px] * count
    reach = np.zeros((count, 2))
    np.maximum.at(reach, camera, np.abs(px))
    size = 2 * np.maximum(np.ceil(reach), 1.0).astype(np.int64)
    return [(int(columns), int(rows)) for columns, rows in size]


def _camera(number: int, inner: list[float], size: tuple[int, int], pixel_um: float) -> Camera:
    f, k1, k2 = inner
    centre = {"x0_mm": Prior(0.0, fixed=True), "y0_mm": Prior(0.0, fixed=True)}
    interior = {"focal_length_mm": Prior(f * pixel_um * 1e-3)} | centre
    return Camera(str(number + 1), "frame", size, pixel_um, interior, lens={"k1": Prior(k1), "k2": Prior(k2)})


def write_bundler(oriented: OrientedBlock, folder: FilePath) -> tuple[str, ...]:
    """Write bundle.out and list.txt; image points are free of every error but k1 and k2.

    Photographs without orientation and points without coordinates are left out. Points are white.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When a camera is a fisheye or its lens has more than k1 and k2, a name a blank, or nothing is oriented.
    """
    block, rays = oriented.block, oriented.block.image_points
    for camera in block.cameras:
        if camera.is_fisheye:
            message = f"camera '{camera.name}' is a fisheye, which Bundler has no words for"
            raise InputError(message, "write COLMAP or OpenSfM")
        more = [name for name, prior in camera.lens.items() if prior.value and name not in WRITTEN_LENS]
        if more:
            message = f"camera '{camera.name}' has lens parameter {more[0]}, Bundler has k1 and k2"
            raise InputError(message, "write COLMAP or OpenSfM")
    keep = np.flatnonzero(oriented.complete)
    if not len(keep):
        raise InputError(f"block '{block.name}' has no oriented image points", "adjust it first")
    check_words(block.images.names, "photograph", LIST)
    images, image = np.unique(rays.image[keep], return_inverse=True)
    points, point = np.unique(rays.point[keep], return_inverse=True)
    cameras = [block.cameras[number] for number in block.images.camera[images]]
    pixel = np.array([camera.pixel_mm for camera in cameras])
    principal = np.array([camera.principal_point_mm for camera in cameras])
    px = (oriented.corrected_xy()[keep] - principal[image]) / pixel[image, None]
    lines = [HEADER, f"{len(images)} {len(points)}"]
    for row, camera in zip(images.tolist(), cameras, strict=True):
        lines += _camera_lines(oriented, row, camera)
    order = np.lexsort((image, point))
    bounds = np.searchsorted(point[order], np.arange(len(points) + 1))
    for k, xyz in enumerate(oriented.points[points].tolist()):
        own = order[bounds[k] : bounds[k + 1]].tolist()
        views = " ".join(f"{image[i]} {k} {float(px[i, 0])!r} {float(px[i, 1])!r}" for i in own)
        lines += [_text(xyz), "255 255 255", f"{len(own)} {views}"]
    with atomic_folder(folder, own=(BUNDLE, LIST)) as place:
        (place / BUNDLE).write_text("\n".join(lines) + "\n", encoding="ascii", newline="\n")
        names = "\n".join(block.images.names[images].tolist())
        (place / LIST).write_text(names + "\n", encoding="utf-8", newline="\n")
    lost = lost_names(block.points[points], np.arange(len(points)), "point")
    return (*oriented.losses(), *lost, *lost_pixels(block, PIXEL_UM))


def _camera_lines(oriented: OrientedBlock, row: int, camera: Camera) -> list[str]:
    cam_from_world = oriented.rotation[row].T
    k1, k2 = (camera.lens[name].value if name in camera.lens else 0.0 for name in WRITTEN_LENS)
    translation = -cam_from_world @ oriented.centre[row]
    inner = [camera.focal_length_mm / camera.pixel_mm, k1, k2]
    return [_text(values) for values in (inner, *cam_from_world.tolist(), translation.tolist())]


def _text(values: list[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
