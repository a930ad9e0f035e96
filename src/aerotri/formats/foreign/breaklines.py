"""Breaklines: lines with heights from GeoPackage, GeoJSON or DXF."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.crs_text import plan_of
from aerotri.vectors.crs import VectorSystem, system_of_geojson, vector_system
from aerotri.vectors.geojson import LARGEST_M, crs_of_name, read_geojson
from aerotri.vectors.geopackage import read_geopackage


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
    parts, system = reader(path, plan_of(crs or ""))
    lines = [np.asarray(line, dtype=float) for line in parts]
    for number, line in enumerate(lines, start=1):
        if line.ndim != 2 or line.shape[1] < 3:
            raise InputError(f"line {number} has no heights", "give lines in three dimensions", path)
        if not (np.abs(line[:, :3]) <= LARGEST_M).all():
            raise InputError(f"line {number} has a coordinate that is not possible", "give metres", path)
    lines = [np.column_stack([system.place(line[:, :2], path), line[:, 2]]) for line in lines if len(line) > 1]
    if not lines:
        raise InputError("has no lines", "give lines with heights", path)
    return tuple(lines), system.note


def _of_geojson(path: Path, crs: str) -> tuple[list[np.ndarray], VectorSystem]:
    name, features = read_geojson(path)
    lines = []
    for feature in features:
        if feature.kind in ("LineString", "MultiLineString"):
            for line in [feature.coordinates] if feature.kind == "LineString" else feature.coordinates:
                # a position without height makes all of its line one without
                width = min((len(position) for position in line), default=0)
                lines.append(np.array([position[:width] for position in line], dtype=float).reshape(len(line), width))
    xy = np.concatenate([line[:, :2] for line in lines if len(line)] or [np.zeros((0, 2))])
    return lines, system_of_geojson(crs_of_name(name), xy, crs, path.name)


def _of_dxf(path: Path, crs: str) -> tuple[list[np.ndarray], VectorSystem]:
    """A drawing names no CRS: its coordinates are those of the block."""
    return list(_lines_of_dxf(path)), VectorSystem()


def _lines_of_dxf(path: Path) -> Iterator[np.ndarray]:
    """Lines and polylines in three dimensions."""
    try:
        yield from list(_entities(path))
    except Exception as error:  # ezdxf raises whatever a damaged file leads to
        short = (str(error).splitlines() or [type(error).__name__])[0][:200]
        raise InputError(f"cannot be read: {short}", "write the DXF anew, with lines with heights", path) from error


def _entities(path: Path) -> Iterator[np.ndarray]:
    import ezdxf
    from ezdxf.entities import LWPolyline, Polyline

    space = ezdxf.readfile(path).modelspace()
    for entity in space.query("LINE"):
        yield np.array([entity.dxf.start, entity.dxf.end], dtype=float)
    for entity in space.query("POLYLINE"):
        assert isinstance(entity, Polyline)
        points = np.array([vertex.dxf.location for vertex in entity.vertices], dtype=float)
        yield np.vstack([points, points[:1]]) if entity.is_closed else points
    for entity in space.query("LWPOLYLINE"):
        assert isinstance(entity, LWPolyline)
        plan = np.array([(x, y) for x, y, *_ in entity.get_points()], dtype=float).reshape(-1, 2)
        points = np.column_stack([plan, np.full(len(plan), float(entity.dxf.elevation))])
        yield np.vstack([points, points[:1]]) if entity.closed else points


def _of_geopackage(path: Path, crs: str) -> tuple[list[np.ndarray], VectorSystem]:
    lines, systems = [], {}
    for _, srs, rows in read_geopackage(path):
        systems[srs] = vector_system(srs, crs, path.name)
        if len(systems) > 1:
            raise InputError("has layers in several CRS", "give one layer", path)
        for row in rows:
            if row.kind in ("LineString", "MultiLineString"):
                lines += [line for part in row.parts for line in part]
    return lines, next(iter(systems.values()), VectorSystem())
