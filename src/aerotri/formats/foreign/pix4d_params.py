"""Cameras and orientations of Pix4Dmapper's folder params.

``…_calibrated_camera_parameters.txt``, [L] its own header: a row ``fileName imageWidth imageHeight``, the camera matrix
K (3 rows), radial and tangential distortion, position t, rotation R (3 rows), for every photograph; m = K·R·(X − t), so
R leads from the world to x right, y down, z forwards. [L] Pix4D's knowledge base: the distortion is OpenCV's, R1 to R3
are k1 to k3, T1 and T2 are p1 and p2; pixels begin at the corner of the upper left one. Positions are local:
``…_offset.xyz`` is added. ``…_calibrated_internal_camera_parameters.cam`` holds one camera in millimetres, the
principal point from the upper left corner.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError, counted, whole_number
from aerotri.formats.assembly.parts import Reading
from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA
from aerotri.formats.foreign.pix4d import read_pix4d_offset
from aerotri.formats.foreign.reconstruction import PixelCamera, Reconstruction, check_names, rotation_matrix
from aerotri.formats.text.notes import assumed, taken
from aerotri.formats.text.tables import LARGEST_NUMBER, SMALLEST_POSITIVE
from aerotri.formats.text.text_lines import TextFile, all_numbers, first_lines, is_number
from aerotri.observations import Camera, Prior

HEADER = "fileName imageWidth imageHeight"
PARAMS, OFFSET, CALIBRATION = (
    "_calibrated_camera_parameters.txt", "_offset.xyz", "_calibrated_internal_camera_parameters.cam",
)  # fmt: skip
"""Ends of the names of files in params."""
ROWS = (3, 3, 3, 3, 2, 3, 3, 3, 3)
"""Numbers in the rows of a photograph: name and format aside, K, distortions, t, R."""
LENS: tuple[str, ...] = ("k1", "k2", "k3", "p1", "p2")
"""R1, R2, R3, T1, T2."""
CAM_TITLE = "Pix4D camera calibration file"
CAM_KEYS = ("F", "Px", "Py", "K1", "K2", "K3", "T1", "T2")
SENSOR = re.compile(r"sensor width of\s*([0-9.eE+-]+)\s*x\s*([0-9.eE+-]+)\s*mm")
REMEDY = "let Pix4D write the folder params again"


def is_pix4d_params(path: Path) -> bool:
    """Whether a file begins with the header of calibrated cameras."""
    lines = first_lines(path, 1)
    return bool(lines) and " ".join(lines[0].split()) == HEADER


def read_pix4d_params(path: FilePath, pixel_um: float | None = None, offset: np.ndarray | None = None) -> Reading:
    """The photographs of …_calibrated_camera_parameters.txt with cameras and orientations, without image points.

    Focal lengths, principal points and lens are unknown.

    Parameters
    ----------
    pixel_um : size of a pixel; None: from the .cam file beside it, else 1 µm.
    offset : (3,) m, added to positions; None: that of the _offset.xyz beside it, else nothing.

    Raises
    ------
    InputError
        With the line: a row that is not of the form, values that no camera has.
    """
    file = TextFile(Path(path))
    begin = _first_row(file)
    names, sizes, values = _photographs(file, begin)
    check_names(names, "photograph", file.path, REMEDY)
    offset, said = _offset(file.path, offset)
    kinds: dict[tuple[float, ...], int] = {}
    of_image = [
        kinds.setdefault((*size, *row[:14].tolist()), len(kinds)) for size, row in zip(sizes, values, strict=True)
    ]
    cameras, about = _cameras(file, kinds, pixel_um)
    centre = values[:, 14:17] + offset
    rotation = np.array(
        [
            rotation_matrix(row[17:], InputError(f"R of '{name[:60]}' is no rotation", REMEDY, file.path)).T
            for name, row in zip(names, values, strict=True)
        ]
    )
    nothing = np.zeros(0, np.int64)
    reading = Reconstruction(
        cameras, names, np.array(of_image, np.int64), centre, rotation @ COLMAP_FROM_CAMERA, [], np.zeros((0, 3)),
        nothing, nothing, np.zeros((0, 2)),
    ).reading(file.path.name.removesuffix(PARAMS).removesuffix(".txt"))  # fmt: skip
    return replace(
        reading, points=None, messages=(*said, *about, "holds no image points: add them with --image-points")
    )


def _first_row(file: TextFile) -> int:
    """Row of the first photograph: behind the title, of which no row is three words with two whole numbers."""
    if not len(file) or " ".join(file.lines[0].split()) != HEADER:
        raise file.error(0, f"does not begin with {HEADER}", "give …_calibrated_camera_parameters.txt of Pix4D")
    for row, line in enumerate(file.lines):
        words = line.split()
        if len(words) >= 3 and all(whole_number(word) is not None for word in words[-2:]):
            return row
    raise file.error(0, "holds no photographs", REMEDY)


def _photographs(file: TextFile, begin: int) -> tuple[list[str], list[tuple[int, int]], np.ndarray]:
    """Names, formats and (n, 26) numbers: K, R1 R2 R3, T1 T2, t, R."""
    step = 1 + len(ROWS)
    names, sizes, values = [], [], []
    for row in range(begin, len(file), step):
        words = file.lines[row].split()
        if len(words) < 3 or not all(whole_number(word) for word in words[-2:]):
            raise file.error(row, "is no row of name, width and height", REMEDY)
        if row + step > len(file):
            raise file.error(row, f"photograph '{words[0][:60]}' is cut off", REMEDY)
        numbers: list[str] = []
        for k, count in enumerate(ROWS, 1):
            cells = file.lines[row + k].split()
            if len(cells) != count or not all_numbers(cells):
                raise file.error(row + k, f"is no row of {count} numbers", REMEDY)
            numbers += cells
        names.append(" ".join(words[:-2]))
        sizes.append((int(words[-2]), int(words[-1])))
        values.append([float(word) for word in numbers])
    found = np.array(values, float).reshape(len(names), sum(ROWS))
    if not (np.abs(found) <= LARGEST_NUMBER).all():
        raise InputError("holds a number that is not possible", REMEDY, file.path)
    return names, sizes, found


def _cameras(
    file: TextFile, kinds: dict[tuple[float, ...], int], pixel_um: float | None
) -> tuple[tuple[Camera, ...], list[str]]:
    """A camera for every set of values, and what to say of the size of a pixel."""
    widths = {kind[0] for kind in kinds}
    told = None if pixel_um is not None or len(widths) > 1 else _pixel_um_beside(file.path, widths.pop())
    size_um = pixel_um or told or 1.0
    found = []
    for number, (width, height, *k) in enumerate(kinds, 1):
        name = "camera" if len(kinds) == 1 else f"camera {number}"
        lens: dict[str, float] = dict(zip(LENS, k[9:14], strict=True))
        camera = PixelCamera((int(width), int(height)), (k[0], k[4]), (k[2], k[5]), lens, centre_known=True)
        wrong = InputError(f"{name} has values that no camera has", REMEDY, file.path)
        if k[1] or k[3] or (k[6], k[7], k[8]) != (0.0, 0.0, 1.0):
            raise InputError(f"K of {name} has a skew or is no camera matrix", REMEDY, file.path)
        camera.refuse_impossible(wrong)
        found.append(camera.camera(name, size_um))
    if told is not None:
        return tuple(found), [taken(f"a pixel counts as {told:.5g} µm, from the .cam file beside it")]
    said = assumed(f"a pixel counts as {size_um:g} µm: state it with --pixel-um")
    return tuple(found), [said] if pixel_um is None else []


def _beside(path: Path, end: str) -> Path | None:
    """A file of the same project."""
    if not path.name.endswith(PARAMS):
        return None
    found = path.with_name(path.name.removesuffix(PARAMS) + end)
    return found if found.is_file() else None


def _pixel_um_beside(path: Path, width_px: float) -> float | None:
    found = _beside(path, CALIBRATION)
    return None if found is None else 1e3 * _sensor_mm(TextFile(found, comments=False))[0] / width_px


def _offset(path: Path, offset: np.ndarray | None) -> tuple[np.ndarray, list[str]]:
    if offset is not None:
        return offset, []
    found = _beside(path, OFFSET)
    if found is None:
        words = f"positions are taken as they are: there is no {OFFSET} beside it; give it with --offset"
        return np.zeros(3), [assumed(words)]
    return read_pix4d_offset(found), [taken(f"positions have the offset of {found.name} added")]


def is_pix4d_camera(path: Path) -> bool:
    """Whether a file is a .cam of Pix4D."""
    return any(line.startswith(CAM_TITLE) for line in first_lines(path, 2))


def read_pix4d_camera(path: FilePath, pixel_um: float) -> Camera:
    """The camera of a .cam file, everything held; it is called as the file.

    Parameters
    ----------
    pixel_um : size of a pixel, which with the size of the sensor gives the format.

    Raises
    ------
    InputError
        When something is missing or not known, or the file holds several cameras.
    """
    file = TextFile(Path(path), comments=False)
    titles = sum(line.startswith(CAM_TITLE) for line in file.lines)
    if titles != 1:
        raise InputError(f"holds {counted(titles, 'camera')}", "give a file with one camera", file.path)
    sensor = _sensor_mm(file)
    values: dict[str, float] = {}
    for row, line in enumerate(file.lines):
        words = line.split()
        if line.startswith(("#", CAM_TITLE)) or not words:
            continue
        if len(words) != 2 or words[0] not in CAM_KEYS or not is_number(words[1]) or words[0] in values:
            remedy = "give the calibration of a perspective camera, whose keys are " + ", ".join(CAM_KEYS)
            raise file.error(row, f"'{line[:40]}' is not understood", remedy)
        values[words[0]] = float(words[1])
    missing = [key for key in CAM_KEYS if key not in values]
    if missing:
        raise InputError(f"holds no {missing[0]}", REMEDY, file.path)
    size = (round(sensor[0] / (pixel_um * 1e-3)), round(sensor[1] / (pixel_um * 1e-3)))
    lens = {"k1": values["K1"], "k2": values["K2"], "k3": values["K3"], "p1": values["T1"], "p2": values["T2"]}
    pixel_mm = sensor[0] / size[0] if size[0] else 1.0
    focal, centre = values["F"] / pixel_mm, (values["Px"] / pixel_mm, values["Py"] / pixel_mm)
    found = PixelCamera(size, (focal, focal), centre, lens)
    found.refuse_impossible(InputError("has values that no camera has", REMEDY, file.path))
    camera = found.camera(file.path.stem, pixel_um)
    return replace(
        camera,
        interior={name: Prior(prior.value, fixed=True) for name, prior in camera.interior.items()},
        lens={name: Prior(prior.value, fixed=True) for name, prior in camera.lens.items()},
    )


def _sensor_mm(file: TextFile) -> tuple[float, float]:
    """Width and height of the sensor, which a comment states."""
    for line in file.lines:
        found = SENSOR.search(line)
        if found is not None and all(is_number(word) and float(word) >= SMALLEST_POSITIVE for word in found.groups()):
            return float(found[1]), float(found[2])
    raise InputError("does not tell the size of the sensor", REMEDY, file.path)
