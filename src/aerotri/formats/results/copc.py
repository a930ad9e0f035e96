"""Point clouds in an octree, COPC 1.0: a LAZ 1.4 file whose chunks are the nodes of the tree [L: copc.io].

A viewer reads of it what it shows: few points from afar, all of them near by. Points are given part by part and lie on
the cells of a raster. [C] A cell belongs to the coarsest level whose spacing its row and column are multiples of, so
that every level is an even sample of the surface and the file does not depend on the order of the parts. The parts are
kept in a file beside the target until all nodes are known: memory holds one part and some nodes.
"""

from __future__ import annotations

import struct
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

if TYPE_CHECKING:
    from laspy import LasHeader

Key = tuple[int, int, int, int]
"""Level, and number of the node along X, Y and Z."""
SPACINGS = 256
"""Points along a side of a node; chosen [C]: up to 65 000 points a node, as many as readers like to take at once."""
INFO_BYTES, INFO_RECORD, HIERARCHY_RECORD, OWNER = 160, 1, 1000, b"copc"
ENTRY = struct.Struct("<4i Q 2i")
"""Of the hierarchy: level, X, Y, Z, place in the file, bytes, points."""
NODES_AT_ONCE = 32
"""Nodes that are compressed together, in threads."""


@dataclass(frozen=True)
class Octree:
    """The cube that nodes divide.

    Parameters
    ----------
    low : (3,) m, its lowest corner; in plan half a cell before the first cell. side : m. deepest : level of all cells.
    cell : m, of the raster.
    """

    low: tuple[float, float, float]
    side: float
    deepest: int
    cell: float

    @property
    def spacing(self) -> float:
        """m, between the points of the root."""
        return self.side / SPACINGS

    def keys(self, xyz: np.ndarray) -> np.ndarray:
        """(n, 4) level and node of points (n, 3) m."""
        low = np.array(self.low)
        index = np.rint((xyz[:, :2] - low[:2]) / self.cell - 0.5).astype(np.int64)
        level = np.zeros(len(xyz), np.int64)
        for finer in range(1, self.deepest + 1):
            step = 1 << (self.deepest - finer + 1)
            level[(index % step != 0).any(axis=1)] = finer
        width = self.side / 2.0**level
        node = np.floor((xyz - low) / width[:, None]).astype(np.int64)
        most = (1 << level) - 1
        return np.column_stack([level, np.clip(node, 0, most[:, None])])


def octree_over(low: np.ndarray, high: np.ndarray, cell: float) -> Octree:
    """The smallest that holds a box.

    Parameters
    ----------
    low, high : (3,) m, outer edges of the raster, lowest and highest height. cell : m.
    """
    extent = float(np.max(high - low))
    deepest = max(int(np.ceil(np.log2(max(extent / (SPACINGS * cell), 1.0)) - 1e-9)), 0)
    corner = (float(low[0]), float(low[1]), float(low[2]))
    return Octree(corner, SPACINGS * cell * 2.0**deepest, deepest, cell)


def write_copc(path: Path, header: LasHeader, parts: Iterable[np.ndarray], tree: Octree) -> int:
    """Write records of points as COPC; how many.

    Parameters
    ----------
    header : of LAS 1.4, point format 6, 7 or 8, with its extra bytes and CRS; its count and bounds follow from the
        points. parts : structured arrays of packed points, as laspy has them, part by part.
    """
    from laspy import VLR, PackedPointRecord

    lazrs: Any = import_module("lazrs")
    header.partial_reset()
    with tempfile.TemporaryFile(dir=path.parent) as spool:
        kept = _Spool(spool, header.point_format.dtype())
        for records in parts:
            header.grow(PackedPointRecord(records, header.point_format))
            kept.add(records, tree.keys(_places(records, header)))
        own = lazrs.LazVlr.new_for_compression(header.point_format.id, header.point_format.num_extra_bytes, True)
        header.vlrs.insert(0, VLR("copc", INFO_RECORD, "COPC", bytes(INFO_BYTES)))
        header.vlrs.append(VLR("laszip encoded", 22204, "LASzip", own.record_data()))
        header.are_points_compressed = True
        header.global_encoding.wkt = True
        with path.open("w+b") as file:
            header.write_to(file)
            order = sorted(kept.pieces)
            _compress(lazrs, file, own, kept, order)
            _finish(lazrs, file, header, own, tree, [(key, kept.count(key)) for key in order])
    return int(header.point_count)


@dataclass(frozen=True, eq=False)
class _Spool:
    """Records of points in a file, those of a node in pieces."""

    file: BinaryIO
    dtype: np.dtype
    pieces: dict[Key, list[tuple[int, int]]] = field(default_factory=dict)

    def add(self, records: np.ndarray, keys: np.ndarray) -> None:
        """Records (n,) and the nodes (n, 4) they belong to."""
        order = np.lexsort(keys.T[::-1])
        keys, records = keys[order], records[order]
        first = np.flatnonzero(np.r_[True, (np.diff(keys, axis=0) != 0).any(axis=1)]) if len(keys) else np.zeros(0, int)
        for start, end in zip(first.tolist(), [*first[1:].tolist(), len(keys)], strict=True):
            level, x, y, z = keys[start].tolist()
            at = self.file.tell()
            self.file.write(records[start:end].tobytes())
            self.pieces.setdefault((level, x, y, z), []).append((at, end - start))

    def count(self, key: Key) -> int:
        """Points of a node."""
        return sum(count for _, count in self.pieces[key])

    def records(self, key: Key) -> np.ndarray:
        """(n,) uint8, all points of a node, in the order of the raster."""
        found = []
        for at, count in self.pieces[key]:
            self.file.seek(at)
            found.append(np.frombuffer(self.file.read(count * self.dtype.itemsize), self.dtype))
        points = np.concatenate(found)
        # the order of parts is no matter
        return points[np.lexsort((points["Z"], points["X"], points["Y"]))].view(np.uint8).reshape(-1)


def _places(records: np.ndarray, header: LasHeader) -> np.ndarray:
    """(n, 3) m, as the file has them."""
    return np.column_stack([records[axis] for axis in "XYZ"]) * header.scales + header.offsets


def _compress(lazrs: Any, file: BinaryIO, own: Any, kept: _Spool, order: list[Key]) -> None:
    """A chunk for every node."""
    compressor = lazrs.ParLasZipCompressor(file, own)
    for first in range(0, len(order), NODES_AT_ONCE):
        compressor.compress_chunks([kept.records(key) for key in order[first : first + NODES_AT_ONCE]])
    compressor.done()


def _finish(
    lazrs: Any, file: BinaryIO, header: LasHeader, own: Any, tree: Octree, nodes: list[tuple[Key, int]]
) -> None:
    """The hierarchy behind the points, and the header with all that is known now."""
    from laspy import VLR

    file.seek(header.offset_to_point_data)
    sizes = [int(size) for _, size in lazrs.read_chunk_table(file, own)]
    entries = hierarchy(nodes, sizes, header.offset_to_point_data + 8)
    file.seek(0, 2)
    at = file.tell()
    file.write(struct.pack("<H16sHQ32s", 0, OWNER, HIERARCHY_RECORD, len(entries), b"COPC hierarchy"))
    file.write(entries)
    header.start_of_first_evlr, header.number_of_evlrs = at, 1
    head = at + 60
    info = struct.pack("<5d2Q2d", *_middle(tree), tree.side / 2.0, tree.spacing, head, len(entries), 0.0, 0.0)
    header.vlrs[0] = VLR("copc", INFO_RECORD, "COPC", info.ljust(INFO_BYTES, b"\0"))
    file.seek(0)
    header.write_to(file, ensure_same_size=True)


def _middle(tree: Octree) -> Iterator[float]:
    return (value + tree.side / 2.0 for value in tree.low)


def hierarchy(nodes: list[tuple[Key, int]], sizes: list[int], at: int) -> bytes:
    """The page of the hierarchy: nodes with points, and empty ones above them.

    Parameters
    ----------
    nodes : with their numbers of points, as they stand in the file. sizes : bytes of their chunks. at : the first.
    """
    entries: dict[Key, tuple[int, int, int]] = {}
    for (key, count), size in zip(nodes, sizes, strict=True):
        entries[key] = (at, size, count)
        at += size
    for key, _ in nodes:
        above = _parent(key)
        while above is not None and above not in entries:
            entries[above] = (0, 0, 0)
            above = _parent(above)
    return b"".join(ENTRY.pack(*key, *entries[key]) for key in sorted(entries))


def _parent(key: Key) -> Key | None:
    level, x, y, z = key
    return None if level == 0 else (level - 1, x >> 1, y >> 1, z >> 1)
