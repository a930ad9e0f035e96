"""GeoJSON checked node by node: features with their attributes, kind of geometry and coordinates, and the CRS."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerotri.conventions import InputError
from aerotri.foreign_json import read_foreign_json

LARGEST_M = 1e12
"""No coordinate lies farther out; numbers beyond lose their decimals, and squares of them overflow."""
DEPTH = {"Point": 0, "MultiPoint": 1, "LineString": 1, "MultiLineString": 2, "Polygon": 2, "MultiPolygon": 3}
"""Lists around a position, by the kind of geometry."""
REMEDY = "give a FeatureCollection, a Feature or a geometry as GeoJSON (RFC 7946) has them"


@dataclass(frozen=True)
class GeoJsonFeature:
    """A feature: attributes, kind of its geometry ('' without one), and coordinates as nested lists of floats."""

    properties: Mapping[str, Any]
    kind: str
    coordinates: list[Any]


def read_geojson(path: Path) -> tuple[str, list[GeoJsonFeature]]:
    """The name of the CRS ('' where there is none) and the features of a file.

    Raises
    ------
    InputError
        When the file cannot be read, is no JSON or no GeoJSON, naming the feature that is wrong.
    """
    content = read_foreign_json(path, REMEDY)
    if not isinstance(content, dict):
        raise InputError("is no GeoJSON", REMEDY, path)
    features = [_feature(entry, number, path) for number, entry in enumerate(_entries(content, path), start=1)]
    return _crs_name(content, path), features


def crs_of_name(name: str) -> dict[str, Any]:
    """A FeatureCollection that says its CRS and nothing else."""
    return {"crs": {"type": "name", "properties": {"name": name}}} if name else {}


def _entries(content: dict[str, Any], path: Path) -> list[Any]:
    """The features of a collection, of a single feature, or of a geometry alone [L: RFC 7946, 3]."""
    kind = content.get("type")
    if isinstance(content.get("features"), list):
        return content["features"]
    if kind == "Feature":
        return [content]
    if kind == "GeometryCollection" or kind in DEPTH:
        return [{"type": "Feature", "properties": None, "geometry": content}]
    raise InputError("is no GeoJSON", REMEDY, path)


def _crs_name(content: dict[str, Any], path: Path) -> str:
    entry = content.get("crs")
    if entry is None:
        return ""
    properties = entry.get("properties") if isinstance(entry, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not isinstance(name, str):
        raise InputError("its crs has no name", 'write "crs": {"type": "name", "properties": {"name": …}}', path)
    return name


def _feature(entry: Any, number: int, path: Path) -> GeoJsonFeature:
    if not isinstance(entry, dict):
        raise InputError(f"feature {number} is no feature", REMEDY, path)
    properties = entry.get("properties")
    if properties is not None and not isinstance(properties, dict):
        raise InputError(f"feature {number} has properties that are no table", REMEDY, path)
    geometry = entry.get("geometry")
    if geometry is None:
        return GeoJsonFeature(properties or {}, "", [])
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if not isinstance(kind, str):
        raise InputError(f"feature {number} has a geometry without a type", REMEDY, path)
    if kind == "GeometryCollection":
        geometry = _collected(geometry)
        kind = geometry["type"]
    if kind not in DEPTH:
        return GeoJsonFeature(properties or {}, kind, [])
    found = _positions(geometry.get("coordinates"), DEPTH[kind])
    if found is None:
        raise InputError(f"the coordinates of feature {number} are those of no {kind}", "give finite numbers", path)
    return GeoJsonFeature(properties or {}, kind, found)


def _collected(geometry: dict[str, Any]) -> dict[str, Any]:
    """A collection of polygons as one of several parts; one that holds something else as it is."""
    members = geometry.get("geometries")
    if not isinstance(members, list) or not members:
        return geometry
    found: list[Any] = []
    for one in members:
        kind = one.get("type") if isinstance(one, dict) else None
        if kind not in ("Polygon", "MultiPolygon"):
            return geometry
        own = one.get("coordinates")
        found += [own] if kind == "Polygon" or not isinstance(own, list) else own
    return {"type": "MultiPolygon", "coordinates": found}


def _positions(value: Any, depth: int) -> list[Any] | None:
    """Nested lists of positions as floats; None where something else stands."""
    if not isinstance(value, list):
        return None
    if depth == 0:
        return _position(value)
    found = [_positions(part, depth - 1) for part in value]
    return None if any(part is None for part in found) else found


def _position(value: list[Any]) -> list[float] | None:
    """Two coordinates or three; what stands behind them is left out."""
    known = value[:3]
    if len(known) < 2 or any(isinstance(v, bool) or not isinstance(v, int | float) for v in known):
        return None
    numbers = [float(v) for v in known]
    return numbers if all(math.isfinite(v) and abs(v) <= LARGEST_M for v in numbers) else None
