"""Plain lists ``photo X Y Z omega phi kappa`` without a header, in degrees; and cameras of simple-ortho and orthority.

South Africa's mapping agency NGI delivers its photographs so. The camera stands in a YAML file of two levels: under
``camera:`` (simple-ortho), or under the camera's name (orthority), ``im_size`` in pixels, ``focal_len`` and
``sensor_size`` in millimetres, principal point ``cx``, ``cy`` as parts of the width, x right, y down.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.formats.assembly.parts import OrientationList, texts
from aerotri.formats.foreign.list_header import is_named
from aerotri.formats.foreign.list_systems import refuse_unknown_heights, system_above
from aerotri.formats.text.tables import LARGEST_FORMAT_PX, SMALLEST_POSITIVE
from aerotri.formats.text.text_lines import TextFile, all_numbers, first_lines
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Camera, Prior

SQUARE = 1e-3
"""Relative difference of width and height of a pixel that is still square."""


def is_orientation_list(path: Path) -> bool:
    """Whether rows are a name and six numbers."""
    lines = [line.split() for line in first_lines(path, 3)]
    return bool(lines) and all(len(line) == 7 and all_numbers(line[1:]) for line in lines) and not is_named(path)


def read_orientation_list(path: FilePath) -> OrientationList:
    """Orientations, R = Rx(ω)·Ry(φ)·Rz(κ).

    Raises
    ------
    InputError
        With the line.
    """
    file = TextFile(Path(path))
    words = file.words()
    if not words:
        raise file.error(0, "holds no photographs", "rows are: photo X Y Z omega phi kappa")
    rows = list(range(len(words)))
    for row, line in enumerate(words):
        if len(line) != 7:
            message = f"the row has {len(line)} entries"
            raise file.error(row, message, "rows are: photo X Y Z omega phi kappa; is the file cut off?")
    names = [line[0] for line in words]
    file.check_names(names, rows, "photograph")
    file.refuse_repeated(names, rows, "photograph")
    values = file.table([line[1:] for line in words], rows, "value")
    system, said = system_above(file.path)
    refuse_unknown_heights(file, system, values[:, 2])
    centre, rotation = values[:, :3] * system.to_metre, rotation_from_angles(np.radians(values[:, 3:]))
    return OrientationList(
        file.path, texts(names), np.full(len(names), ""), centre, rotation, messages=said, crs=system.crs
    )


def is_ortho_camera(path: Path) -> bool:
    """Whether a YAML file describes a camera of simple-ortho or orthority."""
    if path.suffix.lower() not in (".yaml", ".yml"):
        return False
    keys = {line.partition(":")[0].strip() for line in first_lines(path, 40)}
    return {"im_size", "focal_len", "sensor_size"} <= keys


def read_ortho_camera(path: FilePath) -> Camera:
    """The one camera of such a file, without lens parameters.

    Raises
    ------
    InputError
        When it is not a pinhole camera with square pixels, or something is missing.
    """
    file = TextFile(Path(path))
    name, entries = _camera_section(file)
    kind = entries.get("type", (0, "pinhole"))
    if kind[1] != "pinhole":
        raise file.error(kind[0], f"the camera is of type '{kind[1][:60]}'", "only pinhole can be read")
    for key in ("im_size", "focal_len", "sensor_size"):
        if key not in entries:
            raise InputError(f"camera '{name}' has no {key}", f"add {key}: …", file.path)
    width, height = _numbers(file, entries["im_size"], 2)
    (focal,) = _numbers(file, entries["focal_len"], 1)
    width_mm, height_mm = _numbers(file, entries["sensor_size"], 2)
    cx, cy = (_numbers(file, entries[key], 1)[0] if key in entries else 0.0 for key in ("cx", "cy"))
    row = entries["im_size"][0]
    if min(width, height, focal, width_mm, height_mm) < SMALLEST_POSITIVE or max(width, height) > LARGEST_FORMAT_PX:
        raise file.error(row, "a size is not possible", "sizes are greater than 0")
    if width != int(width) or height != int(height):
        raise file.error(row, "the image has no whole number of pixels", "give columns and rows")
    pixel_mm = width_mm / width
    if abs(height_mm / height / pixel_mm - 1.0) > SQUARE:
        raise file.error(row, "the pixels are not square", "correct im_size or sensor_size")
    file.check_names([name], [row], "camera")
    held = {"focal_length_mm": focal, "x0_mm": cx * width_mm, "y0_mm": -cy * width_mm}
    interior = {element: Prior(value, fixed=True) for element, value in held.items()}
    return Camera(name, "frame", (int(width), int(height)), pixel_mm * 1e3, interior)


def _camera_section(file: TextFile) -> tuple[str, dict[str, tuple[int, str]]]:
    """Name and entries (row, text) of the section with im_size: what YAML has of two levels, and no more of it."""
    sections: list[tuple[str, dict[str, tuple[int, str]]]] = []
    for row, line in enumerate(file.lines):
        key, colon, value = line.partition(":")
        value = value.split(" #")[0].strip().strip("'\"")
        if not colon:
            raise file.error(row, f"'{line[:60]}' is no entry", "entries are key: value")
        if not file.is_indented[row]:
            sections.append((key.strip(), {}))
        elif sections:
            sections[-1][1][key.strip()] = (row, value)
    for name, entries in sections:
        if "im_size" in entries:
            return entries.get("name", (0, name))[1] or name, entries
    raise InputError("describes no camera", "it needs im_size, focal_len and sensor_size", file.path)


def _numbers(file: TextFile, entry: tuple[int, str], count: int) -> list[float]:
    row, text = entry
    words = text.strip("[]").replace(",", " ").split()
    if len(words) != count:
        wanted = "a number" if count == 1 else f"{count} numbers"
        raise file.error(row, f"'{text[:60]}' is not {wanted}", "write numbers, several as [a, b]")
    return file.values(words, [row] * count, "value").tolist()
