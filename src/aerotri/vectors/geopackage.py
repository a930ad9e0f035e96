"""Polygons and lines of GeoPackages: attributes, kind of geometry and coordinates, checked byte by byte."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import InputError, real_path
from aerotri.crs_text import is_known_system
from aerotri.vectors.geojson import LARGEST_M

ENVELOPE_BYTES = (0, 32, 48, 48, 64)
"""Of a GeoPackage geometry, by the kind of envelope its header has [L: OGC 12-128]."""
KINDS = {2: "LineString", 3: "Polygon", 5: "MultiLineString", 6: "MultiPolygon"}
"""Names of the kinds of geometry that have lines, by their code [L: OGC 06-103]."""
COLLECTION = 7
"""Code of a collection of shapes of any kind [L: OGC 06-103]."""
PARTS = {5: 2, 6: 3}
"""What a geometry of several parts is made of [L: OGC 06-103]."""
EXTRA_DIMENSIONS = {0: 0, 1: 1, 2: 1, 3: 2}
"""Coordinates beyond X and Y, by the thousands of the code: none, Z, M, both [L: OGC 06-103]."""
STEPS, MOST_STEPS = 10_000, 100_000
"""Instructions of the database between two counts, and counts until it is given up: a view may never end."""
REMEDY = "write the GeoPackage anew"


@dataclass(frozen=True)
class GeoPackageFeature:
    """A row: attributes by lower-case name, kind of its geometry ('' for none or another), lists of positions.

    Parameters
    ----------
    parts : for each part its lines or rings, (k, 2) or (k, 3) m each.
    """

    properties: Mapping[str, Any]
    kind: str
    parts: list[list[np.ndarray]]


def read_geopackage(path: Path) -> Iterator[tuple[str, str | None, Iterator[GeoPackageFeature]]]:
    """Name, CRS as PROJ reads it (None where not known) and rows of every layer with geometries.

    Raises
    ------
    InputError
    """
    if not path.is_file():
        raise InputError("there is no such file", "give a GeoPackage", path)
    try:
        with closing(sqlite3.connect(f"{real_path(path).as_uri()}?mode=ro", uri=True)) as database:
            _limit(database)
            for table, column, srs in _layers(database, path):
                yield table, srs, _rows(database, table, column, path)
    except (sqlite3.Error, OverflowError, UnicodeError, MemoryError) as error:
        raise InputError(f"is no GeoPackage that can be read: {error}", REMEDY, path) from error


def _limit(database: sqlite3.Connection) -> None:
    counted = 0

    def count() -> bool:
        nonlocal counted
        counted += 1
        return counted > MOST_STEPS

    database.set_progress_handler(count, STEPS)
    database.execute("PRAGMA trusted_schema = OFF")


def _layers(database: sqlite3.Connection, path: Path) -> list[tuple[str, str, str | None]]:
    found = []
    query = "SELECT table_name, column_name, srs_id FROM gpkg_geometry_columns"
    for table, column, srs in database.execute(query).fetchall():
        if not isinstance(table, str) or not isinstance(column, str) or not isinstance(srs, int):
            raise InputError("its list of layers is damaged", REMEDY, path)
        found.append((table, column, _system(database, srs, path) if srs > 0 else None))
    return found


def _system(database: sqlite3.Connection, srs: int, path: Path) -> str:
    """The CRS of a number of the file's own list: by organisation and code, else by its definition.

    A file without such a list is no whole GeoPackage; its numbers are taken for EPSG codes.
    """
    lists = "SELECT count(*) FROM sqlite_master WHERE name = 'gpkg_spatial_ref_sys'"
    if not database.execute(lists).fetchone()[0]:
        return f"EPSG:{srs}"
    query = "SELECT organization, organization_coordsys_id, definition FROM gpkg_spatial_ref_sys WHERE srs_id = ?"
    row = database.execute(query, (srs,)).fetchone()
    if row is None:
        raise InputError(f"its list of coordinate systems has no number {srs}", REMEDY, path)
    code, definition = f"{row[0]}:{row[1]}".upper(), str(row[2])
    for text in (code, definition):
        if is_known_system(text):
            return text
    raise InputError(f"its CRS {code} is not known, and has no definition that can be read", REMEDY, path)


def _rows(database: sqlite3.Connection, table: str, column: str, path: Path) -> Iterator[GeoPackageFeature]:
    try:
        cursor = database.execute("SELECT * FROM " + '"' + table.replace('"', '""') + '"')
        names = [entry[0] for entry in cursor.description]
        if column not in names:
            raise InputError(f"layer '{table}' has no column '{column}'", REMEDY, path)
        at = names.index(column)
        for number, row in enumerate(cursor, start=1):
            properties = {names[k].lower(): value for k, value in enumerate(row) if k != at}
            try:
                kind, parts = _geometry(row[at])
            except (ValueError, struct.error) as error:
                raise InputError(f"the geometry of row {number} is damaged: {error}", REMEDY, path) from error
            yield GeoPackageFeature(properties, kind, parts)
    except (sqlite3.Error, OverflowError, UnicodeError, MemoryError) as error:
        raise InputError(f"layer '{table}' cannot be read: {error}", REMEDY, path) from error


def _geometry(blob: Any) -> tuple[str, list[list[np.ndarray]]]:
    """Kind and parts of a geometry: a header, then WKB.

    Raises
    ------
    ValueError, struct.error
    """
    if blob is None:
        return "", []
    if not isinstance(blob, bytes) or blob[:2] != b"GP" or len(blob) < 8:
        raise ValueError("it is not in the form of GeoPackage")
    envelope = (blob[3] >> 1) & 7
    if envelope >= len(ENVELOPE_BYTES):
        raise ValueError("its header is unknown")
    at = 8 + ENVELOPE_BYTES[envelope]
    _, kind, _, count = _head(blob, at)
    if kind == COLLECTION:
        return _collected(blob, at + 9, count)
    if kind not in KINDS:
        return "other", []
    if kind not in PARTS:
        return KINDS[kind], [_part(blob, at)[0]]
    parts, at = [], at + 9
    for _ in range(count):
        part, at = _part(blob, at, PARTS[kind])
        parts.append(part)
    return KINDS[kind], parts


def _collected(blob: bytes, at: int, count: int) -> tuple[str, list[list[np.ndarray]]]:
    """A collection of polygons as one of several parts; other collections are of no use here."""
    parts: list[list[np.ndarray]] = []
    for _ in range(count):
        _, kind, _, members = _head(blob, at)
        if KINDS.get(kind) not in ("Polygon", "MultiPolygon"):
            return "other", []
        several = KINDS[kind] == "MultiPolygon"
        at += 9 if several else 0
        for _ in range(members if several else 1):
            part, at = _part(blob, at)
            parts.append(part)
    return "MultiPolygon", parts


def _head(blob: bytes, at: int) -> tuple[str, int, int, int]:
    """Byte order, kind, number of coordinates of a position, and the count behind them."""
    if at >= len(blob):
        raise ValueError("it is cut off")
    order = "<" if blob[at] == 1 else ">"
    code, count = struct.unpack_from(order + "II", blob, at + 1)
    kind, dimensions = code & 0x0FFFFFFF, 2 + bool(code & 0x80000000) + bool(code & 0x40000000)
    if kind >= 1000:
        dimensions = 2 + EXTRA_DIMENSIONS.get(kind // 1000, 0)
        kind = kind % 1000 if kind < 4000 else 0
    return order, kind, dimensions, count


def _part(blob: bytes, at: int, wanted: int | None = None) -> tuple[list[np.ndarray], int]:
    """The line, or the rings, of one part, and the place behind it."""
    order, kind, dimensions, count = _head(blob, at)
    if wanted is not None and kind != wanted:
        raise ValueError("a part is of another kind")
    if KINDS.get(kind) == "LineString":
        line, at = _positions(blob, at + 9, order, dimensions, count)
        return [line], at
    rings, at = [], at + 9
    for _ in range(count):
        (size,) = struct.unpack_from(order + "I", blob, at)
        ring, at = _positions(blob, at + 4, order, dimensions, size)
        rings.append(ring)
    return rings, at


def _positions(blob: bytes, at: int, order: str, dimensions: int, count: int) -> tuple[np.ndarray, int]:
    end = at + 8 * dimensions * count
    if end > len(blob):
        raise ValueError("it announces more positions than it holds")
    found = np.frombuffer(blob, order + "f8", dimensions * count, at).reshape(count, dimensions)[:, :3].astype(float)
    if not (np.abs(found) <= LARGEST_M).all():
        raise ValueError("a coordinate is not possible")
    return found, end
