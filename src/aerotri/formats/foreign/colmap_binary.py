"""The counts of a binary COLMAP model held against the size of its files, before pycolmap allocates what they announce.

The layout is COLMAP's own [L: COLMAP, Output format]: every file begins with a count of records, and records of
variable length with the count of their parts.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable
from pathlib import Path

from aerotri.conventions import InputError

PARAMETERS = (3, 4, 4, 5, 8, 8, 12, 5, 4, 5, 12, 16, 3, 4, 3, 4, 16, 5, 5)
"""Of the camera models, by their number."""
LONGEST_NAME = 1000
"""Bytes of a name at most, about that of tables: without an end the search would run through the whole file."""
REMEDY = "export the model anew; is the file cut off?"


def mapped(path: Path) -> mmap.mmap | bytes:
    """The bytes of a file without holding them in memory.

    Raises
    ------
    InputError
    """
    try:
        with path.open("rb") as file:
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if path.stat().st_size else b""
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read: {error}", "check the file and its permissions", path) from error


class _Cursor:
    """A place in the bytes of a file; reading beyond the end is an error that names it."""

    def __init__(self, path: Path):
        self.path = path
        self.raw = mapped(path)
        self.at = 0

    def take(self, form: str) -> tuple[int, ...]:
        size = struct.calcsize("<" + form)
        self.skip(size)
        return struct.unpack_from("<" + form, self.raw, self.at - size)

    def skip(self, size: int) -> None:
        self.at += size
        if self.at > len(self.raw):
            raise InputError("announces more than it holds", REMEDY, self.path)

    def name(self) -> None:
        end = self.raw.find(b"\0", self.at, self.at + LONGEST_NAME + 1)
        if end < 0:
            raise InputError("has a name without an end", REMEDY, self.path)
        self.at = end + 1


def check_binary_model(folder: Path) -> None:
    """Refuse a model whose files announce more than they hold.

    Raises
    ------
    InputError
        Naming the file.
    """
    from aerotri.formats.foreign.colmap_arrays import read_points

    if (folder / "points3D.bin").is_file():
        read_points(folder / "points3D.bin")
    check_small_files(folder, tuple(RECORDS))


def check_small_files(folder: Path, names: tuple[str, ...] = ("cameras", "rigs", "frames")) -> None:
    """Refuse a model of which some files announce more than they hold.

    Raises
    ------
    InputError
        Naming the file.
    """
    for name in names:
        record = RECORDS[name]
        path = folder / f"{name}.bin"
        if path.is_file():
            cursor = _Cursor(path)
            (count,) = cursor.take("Q")
            # every record advances by some bytes: a count too large ends at the end of the file
            for _ in range(count):
                record(cursor)


def _camera(cursor: _Cursor) -> None:
    _, model, _, _ = cursor.take("IiQQ")
    if not 0 <= model < len(PARAMETERS):
        raise InputError(f"has a camera of the unknown model {model}", REMEDY, cursor.path)
    cursor.skip(8 * PARAMETERS[model])


def _image(cursor: _Cursor) -> None:
    cursor.skip(4 + 7 * 8 + 4)
    cursor.name()
    (points,) = cursor.take("Q")
    cursor.skip(24 * points)


def _rig(cursor: _Cursor) -> None:
    _, sensors = cursor.take("II")
    if not sensors:
        return
    cursor.skip(8)
    for _ in range(sensors - 1):
        _, _, has_pose = cursor.take("iIB")
        cursor.skip(56 if has_pose else 0)


def _frame(cursor: _Cursor) -> None:
    cursor.skip(8 + 56)
    (sensors,) = cursor.take("I")
    cursor.skip(16 * sensors)


RECORDS: dict[str, Callable[[_Cursor], None]] = {
    "cameras": _camera, "images": _image, "rigs": _rig, "frames": _frame,
}  # fmt: skip
