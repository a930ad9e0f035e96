"""Polygons from GeoJSON, GeoPackage and WKT; heights of their corners are left out."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry import shape
from shapely.geometry.base import BaseGeometry

from aerotri.conventions import InputError

VECTOR_ENDINGS = (".geojson", ".json", ".gpkg")
KINDS = ("Polygon", "MultiPolygon")
ENVELOPE_BYTES = (0, 32, 48, 48, 64)
"""Of a GeoPackage geometry, by the kind of envelope its header has."""

Feature = tuple[Mapping[str, Any], BaseGeometry]


def polygon_features(path: Path, epsg: int | None = None) -> Iterator[Feature]:
    """Attributes and polygons of GeoJSON or GeoPackage, in the order of the file.

    Parameters
    ----------
    epsg : code of the CRS they have to be in; None when not known.

    Raises
    ------
    InputError
        When the file cannot be read, has another CRS, or a feature is no polygon.
    """
    read = _gpkg_features if path.suffix.lower() == ".gpkg" else _geojson_features
    try:
        for number, (properties, geometry) in enumerate(read(path, epsg), start=1):
            if geometry is None or geometry.geom_type not in KINDS or geometry.is_empty:
                raise InputError(f"feature {number} is no polygon", "give polygons only", path)
            yield properties, shapely.force_2d(geometry)
    except (OSError, ValueError, KeyError, TypeError, IndexError, sqlite3.Error, shapely.errors.ShapelyError) as error:
        raise InputError(f"cannot be read: {error}", "give polygons as GeoJSON or GeoPackage", path) from error


def polygon_of_wkt(text: str, path: Path | None = None) -> BaseGeometry:
    """The polygon or polygons of a WKT text; `SRID=…;` before it is passed over.

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


def _geojson_features(path: Path, epsg: int | None) -> Iterator[tuple[Mapping[str, Any], BaseGeometry | None]]:
    content = json.loads(path.read_text(encoding="utf-8-sig"))
    name = str(((content.get("crs") or {}).get("properties") or {}).get("name", ""))
    code = name.rpartition(":")[2]
    _check_crs(path, int(code) if "EPSG" in name.upper() and code.isdigit() else None, epsg)
    for feature in content["features"]:
        geometry = feature["geometry"]
        yield feature.get("properties") or {}, None if geometry is None else shape(geometry)


def _check_crs(path: Path, own: int | None, epsg: int | None) -> None:
    if own is not None and epsg is not None and own != epsg:
        raise InputError(f"is in EPSG:{own}, the DEM in EPSG:{epsg}", "bring it into the CRS of the DEM", path)


def _gpkg_features(path: Path, epsg: int | None) -> Iterator[tuple[Mapping[str, Any], BaseGeometry | None]]:
    if not path.is_file():
        raise InputError("there is no such file", "give a GeoPackage", path)
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as database:
        database.row_factory = sqlite3.Row
        layers = database.execute("SELECT table_name, column_name, srs_id FROM gpkg_geometry_columns").fetchall()
        if len(layers) != 1:
            raise InputError(f"has {len(layers)} layers", "give a GeoPackage with one layer of polygons", path)
        table, column, srs = layers[0]
        _check_crs(path, int(srs) if srs > 0 else None, epsg)
        quoted = '"' + str(table).replace('"', '""') + '"'
        for row in database.execute(f"SELECT * FROM {quoted}"):
            properties = {key.lower(): row[key] for key in row.keys() if key != column}  # noqa: SIM118
            yield properties, _gpkg_geometry(row[column])


def _gpkg_geometry(blob: bytes) -> BaseGeometry:
    """The geometry of a GeoPackage blob: a header, then WKB [L: OGC 12-128]."""
    if blob[:2] != b"GP":
        raise ValueError("a geometry is none of GeoPackage")
    return shapely.from_wkb(blob[8 + ENVELOPE_BYTES[(blob[3] >> 1) & 7] :])
