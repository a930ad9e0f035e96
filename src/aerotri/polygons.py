"""Polygons from GeoJSON, GeoPackage and WKT; heights of their corners are left out."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import shape
from shapely.geometry.base import BaseGeometry

from aerotri.conventions import InputError
from aerotri.vector_crs import VectorSystem, system_of_geojson, vector_system

VECTOR_ENDINGS = (".geojson", ".json", ".gpkg")
KINDS = ("Polygon", "MultiPolygon")
ENVELOPE_BYTES = (0, 32, 48, 48, 64)
"""Of a GeoPackage geometry, by the kind of envelope its header has."""

Feature = tuple[Mapping[str, Any], BaseGeometry]


def polygon_features(path: Path, epsg: int | None = None) -> tuple[list[Feature], str]:
    """Attributes and polygons of GeoJSON or GeoPackage, in the order of the file, and a sentence about their CRS.

    Parameters
    ----------
    epsg : code of the CRS they are wanted in; None when not known.

    Raises
    ------
    InputError
        When the file cannot be read, or a feature is no polygon.
    """
    read = _gpkg_features if path.suffix.lower() == ".gpkg" else _geojson_features
    found: list[Feature] = []
    try:
        features, system = read(path, epsg)
        for number, (properties, geometry) in enumerate(features, start=1):
            if geometry is None or geometry.geom_type not in KINDS or geometry.is_empty:
                raise InputError(f"feature {number} is no polygon", "give polygons only", path)
            found.append((properties, placed(shapely.force_2d(geometry), system, path)))
    except (OSError, ValueError, KeyError, TypeError, IndexError, sqlite3.Error, shapely.errors.ShapelyError) as error:
        raise InputError(f"cannot be read: {error}", "give polygons as GeoJSON or GeoPackage", path) from error
    return found, system.note


def placed(geometry: BaseGeometry, system: VectorSystem, path: Path | None = None) -> BaseGeometry:
    """A polygon in the CRS of the surface."""
    if system.transformer is None:
        return geometry
    return shapely.transform(geometry, lambda xy: system.place(xy, path))


def srid_of_wkt(text: str) -> str | None:
    """The CRS that `SRID=…;` before a WKT text names, None where there is none."""
    number = text.strip()[5:].partition(";")[0].strip() if text.strip().upper().startswith("SRID=") else ""
    return f"EPSG:{int(number)}" if number.isdigit() and int(number) > 0 else None


def polygon_of_wkt(text: str, path: Path | None = None) -> BaseGeometry:
    """The polygon or polygons of a WKT text, in its own coordinates; `SRID=…;` before it is passed over.

    Raises
    ------
    InputError
    """
    try:
        geometry = shapely.from_wkt(text.partition(";")[2] if text.upper().startswith("SRID=") else text)
    except shapely.errors.ShapelyError as error:
        raise InputError(f"is no WKT: {error}", "give POLYGON ((X Y, …)) or MULTIPOLYGON", path) from error
    if geometry is None or geometry.geom_type not in KINDS or geometry.is_empty:
        raise InputError("is no polygon", "give POLYGON ((X Y, …)) or MULTIPOLYGON", path)
    return shapely.force_2d(geometry)


def _geojson_features(path: Path, epsg: int | None) -> tuple[Sequence[tuple[Mapping[str, Any], Any]], VectorSystem]:
    content = json.loads(path.read_text(encoding="utf-8-sig"))
    features = [
        (feature.get("properties") or {}, None if feature["geometry"] is None else shape(feature["geometry"]))
        for feature in content["features"]
    ]
    xy = [shapely.get_coordinates(geometry) for _, geometry in features if geometry is not None]
    places = np.concatenate(xy) if xy else np.zeros((0, 2))
    return features, system_of_geojson(content, places, epsg, path.name)


def _gpkg_features(path: Path, epsg: int | None) -> tuple[Sequence[tuple[Mapping[str, Any], Any]], VectorSystem]:
    if not path.is_file():
        raise InputError("there is no such file", "give a GeoPackage", path)
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as database:
        database.row_factory = sqlite3.Row
        layers = database.execute("SELECT table_name, column_name, srs_id FROM gpkg_geometry_columns").fetchall()
        if len(layers) != 1:
            raise InputError(f"has {len(layers)} layers", "give a GeoPackage with one layer of polygons", path)
        table, column, srs = layers[0]
        quoted = '"' + str(table).replace('"', '""') + '"'
        features = [
            ({key.lower(): row[key] for key in row.keys() if key != column}, _gpkg_geometry(row[column]))  # noqa: SIM118
            for row in database.execute(f"SELECT * FROM {quoted}")
        ]
    return features, vector_system(f"EPSG:{srs}" if srs > 0 else None, epsg, path.name)


def _gpkg_geometry(blob: bytes) -> BaseGeometry:
    """The geometry of a GeoPackage blob: a header, then WKB [L: OGC 12-128]."""
    if blob[:2] != b"GP":
        raise ValueError("a geometry is none of GeoPackage")
    return shapely.from_wkb(blob[8 + ENVELOPE_BYTES[(blob[3] >> 1) & 7] :])
