"""Breaklines: lines with heights from GeoPackage, GeoJSON, Shapefile, FlatGeobuf or DXF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from aerotri.conventions import InputError
from aerotri.crs_text import plan_of
from aerotri.vectors.crs import VectorSystem, system_of_geojson, vector_system, vector_system_or_note
from aerotri.vectors.drawing import lines_of_drawing
from aerotri.vectors.gdal_layers import ENDINGS, read_layers
from aerotri.vectors.geojson import LARGEST_M, crs_of_name, read_geojson
from aerotri.vectors.geopackage import read_geopackage

REMEDY = "give breaklines as .gpkg, .geojson, .shp (also zipped), .fgb or .dxf"
LINES = ("LineString", "MultiLineString")


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
    suffix = path.suffix.lower()
    if suffix in (".kml", ".kmz"):
        raise InputError("heights in KML are seldom those of its lines, and in no stated system", REMEDY, path)
    readers = {".gpkg": _of_geopackage, ".dxf": _of_dxf, ".geojson": _of_geojson, ".json": _of_geojson}
    reader = readers.get(suffix, _of_library if suffix in ENDINGS else None)
    if reader is None:
        raise InputError("is of no known kind", REMEDY, path)
    if not path.is_file():
        raise InputError("there is no such file", REMEDY, path)
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
        if feature.kind in LINES:
            for line in [feature.coordinates] if feature.kind == "LineString" else feature.coordinates:
                # a position without height makes all of its line one without
                width = min((len(position) for position in line), default=0)
                lines.append(np.array([position[:width] for position in line], dtype=float).reshape(len(line), width))
    xy = np.concatenate([line[:, :2] for line in lines if len(line)] or [np.zeros((0, 2))])
    return lines, system_of_geojson(crs_of_name(name), xy, crs, path.name)


def _of_dxf(path: Path, crs: str) -> tuple[list[np.ndarray], VectorSystem]:
    """A drawing names no CRS: its coordinates are those of the block."""
    lines, note = lines_of_drawing(path)
    return lines, VectorSystem(None, note)


def _of_library(path: Path, crs: str) -> tuple[list[np.ndarray], VectorSystem]:
    """Lines of a Shapefile or FlatGeobuf; what is no line is named."""
    lines, other, system = [], [], VectorSystem()
    for layer in read_layers(path):
        system = vector_system_or_note(layer.crs, crs, path.name)
        other += [kind for kind in layer.kinds if kind not in LINES]
        for _, geometry in layer.features:
            if geometry is not None and geometry.geom_type in LINES:
                has_z = bool(geometry.has_z)
                lines += [shapely.get_coordinates(part, include_z=has_z) for part in shapely.get_parts(geometry)]
    unused = f"{path.name} holds shapes that are no lines, not used: {', '.join(other)}" if other else ""
    return lines, system.with_note(unused)


def _of_geopackage(path: Path, crs: str) -> tuple[list[np.ndarray], VectorSystem]:
    lines, systems = [], {}
    for _, srs, rows in read_geopackage(path):
        systems[srs] = vector_system(srs, crs, path.name)
        if len(systems) > 1:
            raise InputError("has layers in several CRS", "give one layer", path)
        for row in rows:
            if row.kind in LINES:
                lines += [line for part in row.parts for line in part]
    return lines, next(iter(systems.values()), VectorSystem())
