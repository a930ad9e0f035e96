"""The millions of records of a COLMAP model, binary or text, read into arrays: image points and object points.

Everything else of a model is pycolmap's to read, from a copy without them. The layout is COLMAP's own [L: COLMAP,
Output format].
"""

from __future__ import annotations

import mmap
import shutil
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.foreign._colmap_kernels import FIXED, find_points
from aerotri.formats.foreign.colmap_binary import REMEDY, mapped

FILES = ("cameras", "images", "points3D")
SMALL_FILES = ("cameras", "rigs", "frames")
POINT_2D = np.dtype([("xy", "<f8", 2), ("point", "<u8")])
IMAGE_HEAD = 4 + 7 * 8 + 4
"""Bytes of an image before its name: number, pose and camera."""
NO_POINT = np.uint64(2**64 - 1)
ONE_COLUMN = bytes.maketrans(b" \t\r", b"\n\n\n")
EXACT = 2.0**53
"""Numbers of object points that are read exactly as floating point."""


@dataclass(frozen=True, eq=False)
class ModelArrays:
    """Image points that belong to an object point, and the object points.

    Parameters
    ----------
    images : by the number of the image, positions (k, 2) px and numbers (k,) uint64 of the object points.
    heads : what the file of the images holds beside image points, in the format of the model.
    ids : (N,) uint64 numbers, xyz : (N, 3) coordinates of the object points.
    """

    images: dict[int, tuple[np.ndarray, np.ndarray]]
    heads: bytes
    ids: np.ndarray
    xyz: np.ndarray


def is_binary(folder: Path) -> bool:
    """Whether a model is read from its binary files: as pycolmap does, where all three are there."""
    return all((folder / f"{name}.bin").is_file() for name in FILES)


def read_arrays(folder: Path) -> ModelArrays | None:
    """The records of a model; None where a text file is not written as COLMAP does. Binary: `check_binary_model` first.

    Raises
    ------
    InputError
        When a binary file announces more than it holds, or two images have the same number.
    """
    if is_binary(folder):
        return _binary(folder)
    try:
        return _text(folder)
    except ValueError:
        return None
    except OSError as error:
        raise InputError(f"cannot be read: {error}", "check the files and their permissions", folder) from error


def write_bare(heads: bytes, folder: Path, place: Path) -> None:
    """A copy of a model without image points and object points, for pycolmap.

    Parameters
    ----------
    heads : see `ModelArrays`. folder : of the model. place : the folder of the copy.
    """
    end = "bin" if is_binary(folder) else "txt"
    for name in SMALL_FILES:
        if (folder / f"{name}.{end}").is_file():
            shutil.copyfile(folder / f"{name}.{end}", place / f"{name}.{end}")
    (place / f"images.{end}").write_bytes(heads)
    (place / f"points3D.{end}").write_bytes(struct.pack("<Q", 0) if end == "bin" else b"")


def _binary(folder: Path) -> ModelArrays:
    raw = mapped(folder / "images.bin")
    images: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    heads = [raw[:8]]
    for number, head, points in _binary_images(raw):
        used = points[points["point"] != NO_POINT]
        _add(images, number, used["xy"], used["point"], folder)
        heads += [head, bytes(8)]
    ids, xyz = read_points(folder / "points3D.bin")
    return ModelArrays(images, b"".join(heads), ids, xyz)


def _binary_images(raw: mmap.mmap | bytes) -> Iterator[tuple[int, bytes, np.ndarray]]:
    """Number, bytes before the count of image points, and the image points of every image."""
    (count,) = struct.unpack_from("<Q", raw, 0)
    at = 8
    for _ in range(count):
        (number,) = struct.unpack_from("<I", raw, at)
        end = raw.find(b"\0", at + IMAGE_HEAD) + 1
        (size,) = struct.unpack_from("<Q", raw, end)
        yield number, raw[at:end], np.frombuffer(raw, POINT_2D, size, end + 8)
        at = end + 8 + POINT_2D.itemsize * size


def _add(
    images: dict[int, tuple[np.ndarray, np.ndarray]], number: int, px: np.ndarray, point: np.ndarray, folder: Path
) -> None:
    if number in images:
        raise InputError(f"two images have the number {number}", "export the model anew", folder)
    images[number] = px, point


def read_points(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(N,) numbers and (N, 3) coordinates of the object points of a binary file.

    Raises
    ------
    InputError
        When the file announces more than it holds.
    """
    raw = np.frombuffer(mapped(path), np.uint8)
    count = int(raw[:8].view("<u8")[0]) if len(raw) >= 8 else -1
    offsets = np.zeros(max(count, 0) if count <= len(raw) // FIXED else 0, np.int64)
    if count != len(offsets) or not find_points(raw, offsets):
        raise InputError("announces more than it holds", REMEDY, path)
    heads = raw[offsets[:, None] + np.arange(32)]
    return heads[:, :8].copy().view("<u8")[:, 0], heads[:, 8:].copy().view("<f8")


def _text(folder: Path) -> ModelArrays:
    images: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    heads = []
    with (folder / "images.txt").open("rb") as file:
        for line in file:
            head = line.strip()
            if not head or head.startswith(b"#"):
                continue
            _add(images, int(head.split(None, 1)[0]), *text_points(next(file, b"")), folder)
            heads.append(head + b"\n\n")
    with (folder / "points3D.txt").open("rb") as file:
        rows = [line.split(None, 4)[:4] for line in file if line.strip() and not line.lstrip().startswith(b"#")]
    if any(len(row) < 4 for row in rows):
        raise ValueError("an object point has no coordinates")
    table = numbers_of_text(b" ".join([b" ".join(row) for row in rows]), 4)
    return ModelArrays(images, b"".join(heads), ids_of_text(table[:, 0]), table[:, 1:])


def text_points(line: bytes) -> tuple[np.ndarray, np.ndarray]:
    """(k, 2) px and (k,) object points of a line of image points, of those that belong to one.

    Raises
    ------
    ValueError
        When it is not written as COLMAP does.
    """
    points = numbers_of_text(line, 3)
    if (points[:, 2] < -1.0).any():
        raise ValueError("a number of an object point is negative")
    used = points[points[:, 2] >= 0.0]
    return used[:, :2], ids_of_text(used[:, 2])


def numbers_of_text(text: bytes, columns: int) -> np.ndarray:
    """(n, columns) of a text, by pyarrow as one column.

    Raises
    ------
    ValueError
        When something is not a number.
    """
    import pyarrow as pa
    from pyarrow import csv

    if not text.strip():
        return np.zeros((0, columns))
    table: Any = csv.read_csv(
        pa.BufferReader(text.translate(ONE_COLUMN)),
        csv.ReadOptions(column_names=["value"], use_threads=False, block_size=1 << 24),
        csv.ParseOptions(quote_char=False),
        csv.ConvertOptions(column_types={"value": pa.float64()}, null_values=[]),
    )
    return table["value"].to_numpy().reshape(-1, columns)


def ids_of_text(values: np.ndarray) -> np.ndarray:
    """(k,) numbers of object points that were read as floating point.

    Raises
    ------
    ValueError
        When one is no such number.
    """
    if not ((values >= 0.0) & (values < EXACT) & (values == np.floor(values))).all():
        raise ValueError("is not the number of an object point")
    return values.astype(np.uint64)
