"""A COLMAP model whose image points are read photograph by photograph, some at a time; see `colmap`.

What is held are the heads of the photographs, where the image points of each begin, and the numbers of the object
points.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.assembly.bulk import Bulk, Sample
from aerotri.formats.assembly.parts import RayList
from aerotri.formats.foreign._colmap_kernels import FIXED, find_points_in
from aerotri.formats.foreign.colmap_arrays import (
    IMAGE_HEAD,
    NO_POINT,
    POINT_2D,
    ids_of_text,
    is_binary,
    numbers_of_text,
    text_points,
)
from aerotri.formats.foreign.colmap_binary import LONGEST_NAME, REMEDY, check_small_files
from aerotri.formats.foreign.colmap_model import (
    bare_model,
    block_without_rays,
    image_point_mm,
    no_measured_points,
    refuse_far,
    refuse_no_colmap,
    refuse_unknown,
    warn_of_repeated,
)
from aerotri.observations import Block

PIECE_RAYS = 80_000
"""Image points that are read at a time [C], at least those of one photograph."""
PIECE_BYTES = 1 << 24
"""Of the file of object points."""


@dataclass(frozen=True, eq=False)
class _Index:
    """Where the image points of the photographs are.

    Parameters
    ----------
    heads : see `ModelArrays`. at : by the number of the photograph, the place in the file, and how many there are
        (binary) or bytes of their line (text).
    rays : how many there are, about.
    """

    heads: bytes
    at: dict[int, tuple[int, int]]
    rays: int


def open_colmap(folder: Path, pixel_um: float, always: frozenset[str]) -> tuple[Block, Bulk]:
    """The block of a COLMAP model without its image points, and the way to them.

    Parameters
    ----------
    folder : with cameras, images and points3D, .bin or .txt. pixel_um : size of a pixel.
    always : names of points that belong to the sample.

    Raises
    ------
    InputError
        As `read_colmap`; when a text file is not written as COLMAP does.

    Warns
    -----
    UserWarning
        As `read_colmap`.
    """
    refuse_no_colmap(folder)
    binary = is_binary(folder)
    if binary:
        check_small_files(folder)
    path = folder / f"images.{'bin' if binary else 'txt'}"
    index = (_binary_index if binary else _text_index)(path)
    model = bare_model(index.heads, folder)
    numbers = sorted(model.images)
    block = block_without_rays(model, numbers, pixel_um, folder)
    points = _object_points(folder, binary)
    images = block.images
    names = np.array([camera.name for camera in block.cameras], dtype=str)[images.camera]
    nothing = np.zeros(0, np.int64)
    bare = RayList(
        path, images.names, names, np.zeros(0, "<U1"), nothing, nothing, np.zeros((0, 2)), "mm",
        np.full(len(images), np.nan),
    )  # fmt: skip
    repeated = [0]

    def pieces() -> Iterator[RayList]:
        repeated[0] = 0
        with path.open("rb") as file:
            for rows in _groups([index.at[number][1] for number in numbers], 1 if binary else 40):
                found = [_points_of(file, index.at[numbers[row]], binary, path) for row in rows]
                first = [_first_each(point) for _, point in found]
                repeated[0] += sum(len(point) for _, point in found) - sum(len(own) for own in first)
                point = np.concatenate([point[own] for (_, point), own in zip(found, first, strict=True)])
                xy = [
                    image_point_mm(px[own], block.cameras[images.camera[row]], folder)
                    for row, (px, _), own in zip(rows, found, first, strict=True)
                ]
                there, place = np.unique(point, return_inverse=True)
                refuse_unknown(points, there, folder)
                yield RayList(
                    path, images.names, names, there.astype(str), np.repeat(rows, [len(own) for own in first]),
                    place.ravel().astype(np.int64), np.concatenate(xy), "mm", bare.focal_length_mm,
                )  # fmt: skip

    sample = Sample(index.rays, always)
    for piece in pieces():
        sample.add(piece)
    if not sample.rays:
        raise no_measured_points(folder)
    if repeated[0]:
        warn_of_repeated(repeated[0])
    return block, Bulk(sample.of(bare), pieces)


def _first_each(point: np.ndarray) -> np.ndarray:
    """Rows of the first image point of every object point, rising."""
    _, first = np.unique(point, return_index=True)
    return np.sort(first)


def _groups(sizes: list[int], per_ray: int) -> Iterator[np.ndarray]:
    """Rows of photographs that are read together."""
    rows: list[int] = []
    size = 0
    for row, one in enumerate(sizes):
        rows.append(row)
        size += one
        if size >= PIECE_RAYS * per_ray:
            yield np.array(rows)
            rows, size = [], 0
    if rows:
        yield np.array(rows)


def _points_of(file: BinaryIO, at: tuple[int, int], binary: bool, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(k, 2) px and (k,) object points of the image points of a photograph that belong to one."""
    file.seek(at[0])
    if binary:
        points = np.frombuffer(file.read(at[1] * POINT_2D.itemsize), POINT_2D)
        used = points[points["point"] != NO_POINT]
        return used["xy"], used["point"]
    try:
        return text_points(file.read(at[1]))
    except ValueError as error:
        raise _odd_text(path) from error


def _odd_text(path: Path) -> InputError:
    return InputError(
        "is not written as COLMAP does, and cannot be read in pieces",
        "convert it whole, then divide: aerotri convert MODEL --out BLOCK; aerotri divide BLOCK", path,
    )  # fmt: skip


def _binary_index(path: Path) -> _Index:
    size, at = path.stat().st_size, dict[int, tuple[int, int]]()
    wrong = InputError("announces more than it holds", REMEDY, path)
    with path.open("rb") as file:
        heads, rays = [file.read(8)], 0
        if len(heads[0]) < 8:
            raise wrong
        (count,) = struct.unpack("<Q", heads[0])
        for _ in range(count):
            begin = file.tell()
            raw = file.read(IMAGE_HEAD + LONGEST_NAME + 1 + 8)
            end = raw.find(b"\0", IMAGE_HEAD) + 1
            if end < 1 and len(raw) > IMAGE_HEAD + LONGEST_NAME:
                raise InputError("has a name without an end", REMEDY, path)
            if end < 1 or len(raw) < end + 8:
                raise wrong
            (number,), (points,) = struct.unpack_from("<I", raw), struct.unpack_from("<Q", raw, end)
            _refuse_again(at, number, path)
            at[number] = begin + end + 8, points
            rays += points
            if begin + end + 8 + POINT_2D.itemsize * points > size:
                raise wrong
            heads += [raw[:end], bytes(8)]
            file.seek(begin + end + 8 + POINT_2D.itemsize * points)
    return _Index(b"".join(heads), at, rays)


def _text_index(path: Path) -> _Index:
    heads, at, place = list[bytes](), dict[int, tuple[int, int]](), 0
    with path.open("rb") as file:
        for line in file:
            place += len(line)
            head = line.strip()
            if not head or head.startswith(b"#"):
                continue
            points = next(file, b"")
            try:
                number = int(head.split(None, 1)[0])
            except ValueError as error:
                raise _odd_text(path) from error
            _refuse_again(at, number, path)
            at[number] = place, len(points)
            place += len(points)
            heads.append(head + b"\n\n")
    return _Index(b"".join(heads), at, place // 40)


def _refuse_again(at: dict[int, tuple[int, int]], number: int, path: Path) -> None:
    if number in at:
        raise InputError(f"two images have the number {number}", "export the model anew", path.parent)


def _object_points(folder: Path, binary: bool) -> np.ndarray:
    """(N,) numbers of the object points, rising; their coordinates are looked at and not kept."""
    found = [np.zeros(0, np.uint64)]
    path = folder / f"points3D.{'bin' if binary else 'txt'}"
    for ids, xyz in (_binary_points if binary else _text_points)(path):
        refuse_far(xyz, folder)
        found.append(ids)
    return np.sort(np.concatenate(found))


def _binary_points(path: Path) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    wrong = InputError("announces more than it holds", REMEDY, path)
    with path.open("rb") as file:
        left, rest = int.from_bytes(file.read(8), "little"), b""
        while left:
            more = file.read(PIECE_BYTES)
            raw = np.frombuffer(rest + more, np.uint8)
            offsets = np.zeros(min(left, len(raw) // FIXED), np.int64)
            count, end = find_points_in(raw, offsets)
            if not more and count < left:
                raise wrong
            heads = raw[offsets[:count, None] + np.arange(32)]
            yield heads[:, :8].copy().view("<u8")[:, 0], heads[:, 8:].copy().view("<f8")
            left, rest = left - count, raw[end:].tobytes()


def _text_points(path: Path) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    with path.open("rb") as file:
        while lines := file.readlines(PIECE_BYTES):
            rows = [line.split(None, 4)[:4] for line in lines if line.strip() and not line.lstrip().startswith(b"#")]
            try:
                if any(len(row) < 4 for row in rows):
                    raise ValueError("an object point has no coordinates")
                table = numbers_of_text(b" ".join([b" ".join(row) for row in rows]), 4)
                yield ids_of_text(table[:, 0]), table[:, 1:]
            except ValueError as error:
                raise _odd_text(path) from error
