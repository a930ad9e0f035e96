"""The millions of records of a binary COLMAP model, read into arrays: image points and object points.

Everything else of a model is pycolmap's to read. The layout is COLMAP's own [L: COLMAP, Output format].
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.foreign._colmap_kernels import FIXED, find_points
from aerotri.formats.foreign.colmap_binary import REMEDY, mapped

POINT_2D = np.dtype([("xy", "<f8", 2), ("point", "<u8")])
IMAGE_HEAD = 4 + 7 * 8 + 4
"""Bytes of an image before its name: number, pose and camera."""
NO_POINT = np.uint64(2**64 - 1)


@dataclass(frozen=True, eq=False)
class ModelArrays:
    """Image points that belong to an object point, and the object points.

    Parameters
    ----------
    image : (m,) number of the image, in the order of the file. point : (m,) number of the object point. px : (m, 2).
    ids : (N,) numbers, xyz : (N, 3) coordinates of the object points.
    """

    image: np.ndarray
    point: np.ndarray
    px: np.ndarray
    ids: np.ndarray
    xyz: np.ndarray


def read_arrays(folder: Path) -> ModelArrays | None:
    """The records of a model; None where it is not binary. To be checked before (`check_binary_model`).

    Raises
    ------
    InputError
    """
    if not all((folder / f"{name}.bin").is_file() for name in ("images", "points3D")):
        return None
    raw = mapped(folder / "images.bin")
    (count,) = struct.unpack_from("<Q", raw, 0)
    at, image, parts = 8, [], []
    for _ in range(count):
        (number,) = struct.unpack_from("<I", raw, at)
        at = raw.find(b"\0", at + IMAGE_HEAD) + 1
        (size,) = struct.unpack_from("<Q", raw, at)
        found = np.frombuffer(raw, POINT_2D, size, at + 8)
        found = found[found["point"] != NO_POINT]
        image.append(np.full(len(found), number, np.int64))
        parts.append(found)
        at += 8 + POINT_2D.itemsize * size
    records = np.concatenate(parts) if parts else np.zeros(0, POINT_2D)
    numbers = np.concatenate(image) if image else np.zeros(0, np.int64)
    ids, xyz = read_points(folder / "points3D.bin")
    return ModelArrays(numbers, records["point"].copy(), records["xy"].copy(), ids, xyz)


def read_points(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(N,) numbers and (N, 3) coordinates of the object points.

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
