"""Polygons from GeoJSON, GeoPackage, Shapefile, FlatGeobuf, KML, DXF and WKT; heights of their corners are left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import shape
from shapely.geometry.base import BaseGeometry

from aerotri.conventions import InputError
from aerotri.vectors.crs import VectorSystem, system_of_geojson, vector_system, vector_system_or_note
from aerotri.vectors.drawing import outlines_of_drawing
from aerotri.vectors.gdal_layers import ENDINGS, VectorLayer, read_layers
from aerotri.vectors.geojson import LARGEST_M, crs_of_name, read_geojson
from aerotri.vectors.geopackage import read_geopackage

VECTOR_ENDINGS = (".geojson", ".json", ".gpkg", ".dxf", *ENDINGS)
"""Of files with polygons."""
KINDS = ("Polygon", "MultiPolygon")
WKT_KINDS = ("POLYGON", "MULTIPOLYGON", "GEOMETRYCOLLECTION")
WKT_REMEDY = "give POLYGON ((X Y, …)) or MULTIPOLYGON (((X Y, …)), ((X Y, …))), whose parts are piles"
FILE_REMEDY = (
    "give a GeoPackage (.gpkg), GeoJSON (.geojson, .json), Shapefile (.shp, also zipped), FlatGeobuf (.fgb), KML "
    "(.kml, .kmz), DXF, or a text file with WKT: POLYGON ((X Y, …))"
)

Feature = tuple[Mapping[str, Any], BaseGeometry]


def polygon_features(path: Path, crs: str = "") -> tuple[list[Feature], str]:
    """Attributes and polygons of a file, in its order, and a sentence about its CRS and what of it is not used.

    Parameters
    ----------
    crs : that they are wanted in, see `crs_text`; '' where not known.

    Raises
    ------
    InputError
        When the file cannot be read, or a feature is no polygon.
    """
    suffix = path.suffix.lower()
    readers = {".gpkg": _gpkg_features, ".dxf": _drawn_features}
    read = readers.get(suffix, _library_features if suffix in ENDINGS else _geojson_features)
    found: list[Feature] = []
    number = 0
    try:
        features, system = read(path, crs)
        for number, (properties, geometry) in enumerate(features, start=1):
            if geometry is None or geometry.is_empty:
                raise InputError(f"feature {number} is no polygon", "give polygons only", path)
            found.append((properties, placed(shapely.force_2d(geometry), system, path)))
    except (ValueError, shapely.errors.ShapelyError) as error:
        # shapely refuses rings of too few corners
        raise InputError(f"a feature is no polygon: {error}", "correct its rings", path) from error
    return found, system.note


def placed(geometry: BaseGeometry, system: VectorSystem, path: Path | None = None) -> BaseGeometry:
    """A polygon in the CRS of the surface."""
    if system.transformer is None:
        return geometry
    return shapely.transform(geometry, lambda xy: system.place(xy, path))


def srid_of_wkt(text: str) -> str | None:
    """The CRS that `SRID=…;` before a WKT text names, None where there is none."""
    number = text.strip()[5:].partition(";")[0].strip() if text.strip().upper().startswith("SRID=") else ""
    known = number.isascii() and number.isdigit() and len(number) < 9
    return f"EPSG:{int(number)}" if known and int(number) > 0 else None


def polygon_of_wkt(text: str, path: Path | None = None) -> BaseGeometry:
    """The polygon or polygons of a WKT text, in its own coordinates; `SRID=…;` before it is passed over.

    Raises
    ------
    InputError
    """
    plain = text.partition(";")[2] if text.upper().lstrip().startswith("SRID=") else text
    if not plain.lstrip().upper().startswith(WKT_KINDS):
        raise InputError("is no polygon", WKT_REMEDY if path is None else FILE_REMEDY, path)
    try:
        # numbers beyond all bounds are refused below
        with np.errstate(all="ignore"):
            geometry = shapely.from_wkt(plain)
    except shapely.errors.ShapelyError as error:
        raise InputError(f"is no WKT: {str(error)[:200]}", WKT_REMEDY, path) from error
    if geometry.geom_type == "GeometryCollection" and not geometry.is_empty:
        geometry = _united_parts(geometry, path)
    if geometry.geom_type not in KINDS or geometry.is_empty:
        raise InputError("is no polygon", WKT_REMEDY, path)
    if not (np.abs(shapely.get_coordinates(geometry)) <= LARGEST_M).all():
        raise InputError("has a coordinate that is not possible", "give metres", path)
    return shapely.force_2d(geometry)


def _united_parts(collection: BaseGeometry, path: Path | None) -> BaseGeometry:
    """The polygons of a collection as one of several parts."""
    parts = shapely.get_parts(collection)
    if not all(part.geom_type in KINDS for part in parts):
        raise InputError("holds other shapes than polygons", WKT_REMEDY, path)
    return shapely.MultiPolygon([own for part in parts for own in shapely.get_parts(part)])


def _geojson_features(path: Path, crs: str) -> tuple[Sequence[tuple[Mapping[str, Any], Any]], VectorSystem]:
    name, read = read_geojson(path)
    features = [
        (one.properties, shape({"type": one.kind, "coordinates": one.coordinates}) if one.kind in KINDS else None)
        for one in read
    ]
    xy = [shapely.get_coordinates(geometry) for _, geometry in features if geometry is not None]
    places = np.concatenate(xy) if xy else np.zeros((0, 2))
    return features, system_of_geojson(crs_of_name(name), places, crs, path.name)


def _gpkg_features(path: Path, crs: str) -> tuple[Sequence[tuple[Mapping[str, Any], Any]], VectorSystem]:
    names, features, system = [], [], VectorSystem()
    for name, srs, rows in read_geopackage(path):
        names.append(f"'{name}'")
        if len(names) == 1:
            features = [(row.properties, _polygon(row.parts) if row.kind in KINDS else None) for row in rows]
            system = vector_system(srs, crs, path.name)
    if len(names) != 1:
        message = f"has {len(names)} layers: {', '.join(names)}" if names else "has no layers"
        raise InputError(message, "give a GeoPackage with one layer of polygons", path)
    return features, system


def _drawn_features(path: Path, crs: str) -> tuple[Sequence[tuple[Mapping[str, Any], Any]], VectorSystem]:
    """A drawing names no CRS: its coordinates are those of the surface."""
    outlines, note = outlines_of_drawing(path)
    if not outlines:
        raise InputError(
            "has no closed polylines" + (f"; {note}" if note else ""), "close the polylines of the outlines", path
        )
    return outlines, vector_system_or_note(None, crs, path.name).with_note(note)


def _library_features(path: Path, crs: str) -> tuple[Sequence[tuple[Mapping[str, Any], Any]], VectorSystem]:
    layers = read_layers(path)
    layer = polygon_layer(layers, path)
    other = [f"'{one.name}' ({', '.join(one.kinds) or 'no geometry'})" for one in layers if one is not layer]
    unused = f"{path.name}: layers without polygons, not used: {', '.join(other)}" if other else ""
    features = [
        (properties, _polygon_of(geometry, number, path))
        for number, (properties, geometry) in enumerate(layer.features, start=1)
    ]
    return features, vector_system_or_note(layer.crs, crs, path.name).with_note(unused)


def polygon_layer(layers: Sequence[VectorLayer], path: Path) -> VectorLayer:
    """The one layer that holds polygons.

    Raises
    ------
    InputError
        Where there is none, or there are several: none is silently taken for all.
    """
    found = [layer for layer in layers if set(layer.kinds) & {*KINDS, "GeometryCollection"}]
    if len(found) == 1:
        return found[0]
    if not found:
        kinds = ", ".join(dict.fromkeys(kind for layer in layers for kind in layer.kinds)) or "nothing"
        raise InputError(f"has no polygons, it holds {kinds}", "give polygons", path)
    names = ", ".join(f"'{layer.name}'" for layer in found)
    raise InputError(f"has {len(found)} layers with polygons: {names}", "give a file with one of them", path)


def _polygon_of(geometry: BaseGeometry | None, number: int, path: Path) -> BaseGeometry | None:
    if geometry is None or geometry.geom_type in KINDS:
        return geometry
    if geometry.geom_type == "GeometryCollection" and not geometry.is_empty:
        return _united_parts(geometry, path)
    raise InputError(f"feature {number} is a {geometry.geom_type}, no polygon", "give polygons only", path)


def _polygon(parts: list[list[np.ndarray]]) -> BaseGeometry:
    polygons = [shapely.Polygon(rings[0], rings[1:]) if rings else shapely.Polygon() for rings in parts]
    return polygons[0] if len(polygons) == 1 else shapely.MultiPolygon(polygons)
