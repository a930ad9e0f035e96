"""A block cut into parts whose image points are read piece by piece: what `dividing` makes of it, never held whole.

Image points come in any order, mostly photograph by photograph. They are first sorted into files by the name of their
point, so that all rays of a point are in one file. The files say which photographs share points, which is all that the
cut needs; then they are sorted anew, into a file for each part.
"""

# pyright: reportUnknownParameterType=false
# (pyarrow has no types: what is annotated as its Table or Array is unknown to pyright)

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.block.in_pieces import PieceOfRays
from aerotri.formats.text.arrow_compute import arrow_compute
from aerotri.observations import Block
from aerotri.partition.dividing import (
    Division,
    PointRays,
    control_of,
    cut_photographs,
    homes_of,
    part_with,
    positions_of,
)
from aerotri.partition.ray_files import MOST_OPEN, NamedRays, RayFiles

if TYPE_CHECKING:
    import pyarrow as pa

Say = Callable[[str, float | None], None]


class InPieces(Protocol):
    """A block whose image points are read piece by piece, as `formats.block.in_pieces.BlockInPieces`."""

    @property
    def block(self) -> Block:
        """No image points; `points` are the names of control and check points alone."""
        ...

    def pieces(self) -> Iterator[PieceOfRays]:
        """All image points, some at a time."""
        ...

    def twice(self, rows: tuple[int, int]) -> InputError:
        """The error of a point that is there twice in a photograph, in two rows from 0."""
        ...


def divided(source: InPieces, parts: int, room: Path, say: Say) -> Iterator[Block]:
    """The parts of a block one after the other, as `dividing.part_of` gives them.

    Parameters
    ----------
    parts : at most so many. room : an empty folder for twice the image points. say : told what is done, and the share.

    Raises
    ------
    InputError
        For anything the block format does not allow; when photographs have no position, or nothing can be cut.
    """
    position = positions_of(source.block)
    count = min(parts, MOST_OPEN)
    say("reading image points", None)
    with RayFiles(room, "points") as by_point:
        for piece in source.pieces():
            file = _file_of(piece.names, count)[piece.rays.point]
            rows = piece.first_row + np.arange(len(piece.rays))
            by_point.append(file, NamedRays(rows, piece.rays, piece.names))
    say("dividing", None)
    division = _divided(source, by_point, count, parts, position)
    with RayFiles(room, "part") as by_part:
        of_control = _sorted_by_part(source.block, by_point, count, division, by_part)
    division = replace(division, of_point=of_control)
    for number in range(division.count):
        say("writing parts", number / division.count)
        yield _part(source.block, division, number, by_part.read(number))
        by_part.drop(number)


def _file_of(names: pa.StringArray, count: int) -> np.ndarray:
    """(P,) file of every point: by its name alone, about as many in each."""
    return np.array([zlib.crc32(name.encode()) % count for name in names.to_pylist()], dtype=np.int64)


def _divided(source: InPieces, by_point: RayFiles, count: int, parts: int, position: np.ndarray) -> Division:
    """Which part photographs belong to; nothing is said of points."""
    n = len(position)
    edges = np.zeros((0, 2), np.int64)
    for number in range(count):
        found = by_point.read(number)
        _refuse_twice(source, found)
        edges = np.unique(np.concatenate([edges, _groups(found).pairs(n)]) @ [n, 1])
        edges = np.column_stack([edges // n, edges % n])
    of_image, there = cut_photographs(position, edges, parts)
    votes = [_groups(by_point.read(number)).homes(of_image, there) for number in range(count)]
    codes, rays = (np.concatenate([vote[k] for vote in votes]) for k in (0, 1))
    return Division(there, of_image, homes_of(of_image, there, codes, rays), np.zeros(0, np.int64))


def _sorted_by_part(block: Block, by_point: RayFiles, count: int, division: Division, by_part: RayFiles) -> np.ndarray:
    """All image points sorted into the files of the parts; (N,) part of the points that the block names."""
    import pyarrow as pa

    named = pa.array(block.points.tolist(), pa.string())
    of_control = np.zeros(len(named), np.int64)
    for number in range(count):
        found = by_point.read(number)
        part = _groups(found).parts(division.of_image, division.home)
        by_part.append(part[found.rays.point], found)
        place = arrow_compute().index_in(named, value_set=found.names).fill_null(-1).to_numpy().astype(np.int64)
        of_control[place >= 0] = part[place[place >= 0]]
        by_point.drop(number)
    return of_control


def _part(block: Block, division: Division, number: int, found: NamedRays) -> Block:
    """A part with its image points; control points that nobody measured come last among its points."""
    control = control_of(block, division, number)
    measured = found.names.to_pylist()
    row = {name: k for k, name in enumerate(measured)}
    given = block.points[control.point].tolist()
    others = [name for name in given if name not in row]
    row |= {name: len(measured) + k for k, name in enumerate(others)}
    points = np.array([*measured, *others], dtype=str)
    control = replace(control, point=np.array([row[name] for name in given], dtype=np.int64))
    return part_with(block, division, number, found.rays, points, control)


def _groups(found: NamedRays) -> PointRays:
    return PointRays.of(found.rays.image, found.rays.point, len(found.names))


def _refuse_twice(source: InPieces, found: NamedRays) -> None:
    """A point that is there twice in a photograph, in pieces that were read apart."""
    rays = found.rays
    order = np.lexsort((found.row, rays.point, rays.image))
    same = (np.diff(rays.image[order]) == 0) & (np.diff(rays.point[order]) == 0)
    if same.any():
        second = order[1:][same]
        k = int(np.flatnonzero(same)[np.argmin(found.row[second])])
        raise source.twice((int(found.row[order[k]]), int(found.row[order[k + 1]])))
