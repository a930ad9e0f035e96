"""Breaklines: lines with heights from GeoPackage, GeoJSON or DXF."""

from __future__ import annotations

import json
import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.vector_crs import VectorSystem, system_of_geojson, vector_system

LINE, MULTILINE = 2, 5
ENVELOPE_BYTES = (0, 32, 48, 48, 64)
"""Of a GeoPackage geometry, by the kind of envelope its header has."""


def read_breaklines(path: Path, crs: str | None = None) -> tuple[np.ndarray, ...]:
    """Lines (k, 3) m of a file, see `breaklines_and_note`."""
    return breaklines_and_note(path, crs)[0]


def breaklines_and_note(path: Path, crs: str | None = None) -> tuple[tuple[np.ndarray, ...], str]:
    """Lines (k, 3) m of a file, and a sentence about their CRS.

    GeoJSON is longitude and latitude by RFC 7946, GeoPackage and the old member "crs" name their CRS; heights stay as
    they are.

    Parameters
    ----------
    crs : 'EPSG:…' of the block, to which the lines are brought; None when not known.

    Raises
    ------
    InputError
        When it cannot be read, or a line has no heights.
    """
    readers = {".gpkg": _of_geopackage, ".dxf": _of_dxf, ".geojson": _of_geojson, ".json": _of_geojson}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError("is of no known kind", "give breaklines as .gpkg, .geojson or .dxf", path)
    if not path.is_file():
        raise InputError("there is no such file", "give breaklines as .gpkg, .geojson or .dxf", path)
    try:
        parts, system = reader(path, None if crs is None else int(crs.rpartition(":")[2]))
        lines = [np.asarray(line, dtype=float) for line in parts]
    except (OSError, ValueError, KeyError, TypeError, IndexError, struct.error, sqlite3.Error) as error:
        raise InputError(f"cannot be read: {error}", "give lines with heights", path) from error
    for number, line in enumerate(lines, start=1):
        if line.ndim != 2 or line.shape[1] < 3 or not np.isfinite(line[:, :3]).all():
            raise InputError(f"line {number} has no heights", "give lines in three dimensions", path)
    lines = [np.column_stack([system.place(line[:, :2], path), line[:, 2]]) for line in lines if len(line) > 1]
    if not lines:
        raise InputError("has no lines", "give lines with heights", path)
    return tuple(lines), system.note


def _of_geojson(path: Path, epsg: int | None) -> tuple[list, VectorSystem]:
    content = json.loads(path.read_text(encoding="utf-8-sig"))
    lines = []
    for feature in content["features"]:
        geometry = feature["geometry"]
        if geometry["type"] == "LineString":
            lines.append(geometry["coordinates"])
        elif geometry["type"] == "MultiLineString":
            lines += geometry["coordinates"]
    xy = np.array([place[:2] for line in lines for place in line], dtype=float).reshape(-1, 2)
    return lines, system_of_geojson(content, xy, epsg, path.name)


def _of_dxf(path: Path, epsg: int | None) -> tuple[list[np.ndarray], VectorSystem]:
    """A drawing names no CRS: its coordinates are those of the block."""
    return list(_lines_of_dxf(path)), VectorSystem()


def _lines_of_dxf(path: Path) -> Iterator[np.ndarray]:
    """Lines and polylines in three dimensions."""
    import ezdxf

    try:
        space = ezdxf.readfile(path).modelspace()  # pyright: ignore[reportPrivateImportUsage]
    except ezdxf.DXFError as error:  # pyright: ignore[reportPrivateImportUsage]
        raise ValueError(str(error)) from error
    for entity in space.query("LINE"):
        yield np.array([entity.dxf.start, entity.dxf.end])
    for entity in space.query("POLYLINE"):
        points = np.array([vertex.dxf.location for vertex in entity.vertices])  # pyright: ignore
        yield np.vstack([points, points[:1]]) if entity.is_closed else points  # pyright: ignore
    for entity in space.query("LWPOLYLINE"):
        plan = np.array([(x, y) for x, y, *_ in entity.get_points()])  # pyright: ignore
        points = np.column_stack([plan, np.full(len(plan), entity.dxf.elevation)])
        yield np.vstack([points, points[:1]]) if entity.closed else points  # pyright: ignore


def _of_geopackage(path: Path, epsg: int | None) -> tuple[list[np.ndarray], VectorSystem]:
    lines, systems = [], {}
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as database:
        query = "SELECT table_name, column_name, srs_id FROM gpkg_geometry_columns"
        for table, column, srs in database.execute(query).fetchall():
            systems[srs] = vector_system(f"EPSG:{srs}" if srs > 0 else None, epsg, path.name)
            if len(systems) > 1:
                raise InputError("has layers in several CRS", "give one layer", path)
            names = ['"' + str(name).replace('"', '""') + '"' for name in (column, table)]
            for (blob,) in database.execute(f"SELECT {names[0]} FROM {names[1]}"):
                if blob is not None:
                    lines += _lines_of_wkb(blob, 8 + ENVELOPE_BYTES[(blob[3] >> 1) & 7])[0]
    return lines, next(iter(systems.values()), VectorSystem())


def _lines_of_wkb(blob: bytes, at: int) -> tuple[list[np.ndarray], int]:
    """The lines of a geometry from a place on, and the place behind [L: OGC 06-103]."""
    order = "<" if blob[at] == 1 else ">"
    code, count = struct.unpack_from(order + "II", blob, at + 1)
    kind = code & 0x1FFFFFFF
    dimensions = 2 + bool(code & 0x80000000) + bool(code & 0x40000000)
    if kind > 1000:
        kind, dimensions = kind % 1000, 2 + (1, 1, 2)[kind // 1000 - 1]
    at += 9
    if kind == LINE:
        line = np.frombuffer(blob, order + "f8", count * dimensions, at).reshape(count, dimensions)
        return [line], at + 8 * count * dimensions
    lines: list[np.ndarray] = []
    if kind == MULTILINE:
        for _ in range(count):
            part, at = _lines_of_wkb(blob, at)
            lines += part
    return lines, at
