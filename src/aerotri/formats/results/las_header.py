"""The header of a LAS or LAZ file held against the size of the file, before anything allocates what it announces.

Layout after the LAS specification 1.4 [L: ASPRS] and the LASzip container, whose table of chunks stands where the
first eight bytes of the point data say [L: Isenburg, LASzip, 2013].
"""

from __future__ import annotations

import mmap
import struct
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from aerotri.conventions import InputError, regular_file
from aerotri.formats.foreign.colmap_binary import mapped

HEADER_BYTES = {0: 227, 1: 227, 2: 227, 3: 235, 4: 375}
"""Least size of the header, by the minor version."""
RECORD_BYTES = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)
"""Least size of a point, by its format."""
COMPRESSED = 0x80
"""Bit of the point format that LASzip sets [L: LASzip]."""
VLR_BYTES, EVLR_BYTES = 54, 60
"""Head of a record before the points, and of one after them [L: ASPRS LAS 1.4]."""
LASZIP_USER, LASZIP_RECORD = b"laszip encoded", 22204
"""Owner and number of the record that tells how points are compressed [L: LASzip]."""
POINTS_PER_BYTE = 100
"""A compressed point takes a few bytes; a hundredth of one is no measured surface."""
LAYERED, LAYERED_BYTES = 3, 14
"""Number of the compressor that keeps parts of points apart, and of the item of extra bytes [L: LASzip]."""
LAYERS_OF_ITEM = {10: 9, 11: 1, 12: 2, 13: 1}
"""Layers of points, colours, colours with infrared and wave packets of formats from 6 on; extra bytes have one each."""
VARIABLE_CHUNKS = 0xFFFFFFFF
"""Size of a chunk that says that every chunk has its own [L: LASzip]."""
Bytes = bytes | mmap.mmap
REMEDY = "give a whole LAS or LAZ file"


@dataclass(frozen=True)
class _Header:
    """What the header announces."""

    size: int
    offset: int
    vlrs: int
    format: int
    record: int
    count: int
    compressed: bool


def check_las(path: Path) -> None:
    """Refuse a file that announces more than it holds.

    Raises
    ------
    InputError
    """
    raw = mapped(regular_file(path))
    try:
        header = _header(raw, path)
        laszip = _laszip_of(raw, header, path)
        if header.compressed:
            _check_compressed(raw, header, laszip, path)
        elif header.offset + header.count * header.record > len(raw):
            raise _error(f"announces {header.count} points of {header.record} bytes", path)
    except struct.error as error:
        raise InputError("is cut off", REMEDY, path) from error


def _error(message: str, path: Path) -> InputError:
    return InputError(f"{message}, and holds fewer", REMEDY, path)


def _header(raw: Bytes, path: Path) -> _Header:
    if raw[:4] != b"LASF":
        raise InputError("is no LAS or LAZ file", REMEDY, path)
    major, minor = struct.unpack_from("<BB", raw, 24)
    size, offset, vlrs, code, record, count = struct.unpack_from("<HIIBHI", raw, 94)
    if major != 1 or minor not in HEADER_BYTES:
        raise InputError(f"is of version {major}.{minor}", "give LAS 1.0 to 1.4", path)
    if minor == 4:
        evlr_at, evlrs, count = struct.unpack_from("<QIQ", raw, 235)
        _check_evlrs(raw, evlr_at, evlrs, path)
    kind = code & 0x3F
    if kind >= len(RECORD_BYTES) or record < RECORD_BYTES[kind]:
        raise InputError(f"has points of format {kind} with {record} bytes", REMEDY, path)
    if size < HEADER_BYTES[minor] or not size <= offset <= len(raw):
        raise InputError("has points that begin outside of the file", REMEDY, path)
    return _Header(size, offset, vlrs, kind, record, count, bool(code & COMPRESSED))


def _check_evlrs(raw: Bytes, at: int, count: int, path: Path) -> None:
    for _ in range(count):
        if at + EVLR_BYTES > len(raw):
            raise _error(f"announces {count} extended records", path)
        (length,) = struct.unpack_from("<Q", raw, at + 20)
        at += EVLR_BYTES + length
        if at > len(raw):
            raise _error("announces longer extended records", path)


def _laszip_of(raw: Bytes, header: _Header, path: Path) -> bytes:
    """The record of LASzip; all records in front of the points are walked."""
    at, found = header.size, b""
    for _ in range(header.vlrs):
        if at + VLR_BYTES > header.offset:
            raise _error(f"announces {header.vlrs} records in front of its points", path)
        user, number, length = struct.unpack_from("<16sHH", raw, at + 2)
        at += VLR_BYTES + length
        if at > header.offset:
            raise _error("announces longer records in front of its points", path)
        if user.rstrip(b"\0") == LASZIP_USER and number == LASZIP_RECORD:
            found = raw[at - length : at]
    return found


def _check_compressed(raw: Bytes, header: _Header, laszip: bytes, path: Path) -> None:
    (chunk,) = struct.unpack_from("<I", laszip, 12)
    (items,) = struct.unpack_from("<H", laszip, 32)
    sizes = [struct.unpack_from("<HHH", laszip, 34 + 6 * k)[1] for k in range(items)]
    if sum(sizes) != header.record:
        raise InputError(f"has points of {header.record} bytes, LASzip of {sum(sizes)}", REMEDY, path)
    if header.count > POINTS_PER_BYTE * len(raw):
        raise _error(f"announces {header.count} points", path)
    (table,) = struct.unpack_from("<q", raw, header.offset)
    if table == -1:
        (table,) = struct.unpack_from("<q", raw, len(raw) - 8)
    if not header.offset + 8 <= table <= len(raw) - 8:
        raise InputError("has its table of chunks outside of the file", REMEDY, path)
    version, chunks = struct.unpack_from("<II", raw, table)
    fits = chunks <= max(table - header.offset - 8, 0)
    if chunk != VARIABLE_CHUNKS:
        fits = fits and chunk > 0 and chunks == -(-header.count // chunk)
    if version != 0 or not fits:
        raise InputError(f"has a table of {chunks} chunks, which its points do not fill", REMEDY, path)
    _check_chunks(raw, header, laszip, table, path)


def _check_chunks(raw: Bytes, header: _Header, laszip: bytes, table: int, path: Path) -> None:
    """Every chunk within the point data, and its layers within the chunk."""
    # the package has no stubs and is compiled
    lazrs: Any = import_module("lazrs")
    try:
        with path.open("rb") as file:
            file.seek(header.offset)
            chunks = lazrs.read_chunk_table(file, lazrs.LazVlr(laszip))
    except (lazrs.LazrsError, OSError, ValueError, OverflowError, MemoryError) as error:
        raise InputError(f"has a table of chunks that cannot be read: {error}", REMEDY, path) from error
    at, left = header.offset + 8, header.count
    if at + sum(size for _, size in chunks) != table:
        raise InputError("has chunks that are not as long as its table says", REMEDY, path)
    layers = _layers(laszip)
    for points, size in chunks:
        points = min(points, left)
        if layers and points:
            count, *sizes = struct.unpack_from(f"<{1 + layers}I", raw, at + header.record)
            if count != points or header.record + 4 * (1 + layers) + sum(sizes) != size:
                raise InputError("has a chunk whose layers do not fill it", REMEDY, path)
        at, left = at + size, left - points


def _layers(laszip: bytes) -> int:
    """Layers of a chunk that is compressed layer by layer, 0 where it is not."""
    (compressor,) = struct.unpack_from("<H", laszip, 0)
    (items,) = struct.unpack_from("<H", laszip, 32)
    if compressor != LAYERED:
        return 0
    found = 0
    for k in range(items):
        kind, size, _ = struct.unpack_from("<HHH", laszip, 34 + 6 * k)
        found += size if kind == LAYERED_BYTES else LAYERS_OF_ITEM.get(kind, 0)
    return found
