"""Lines and polygons written as a GeoPackage, without further libraries [L: OGC 12-128]."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

APPLICATION, VERSION = 0x47504B47, 10200
"""'GPKG', and version 1.2 of the standard."""
LOCAL = -1
"""Number of a Cartesian system that is not defined."""
KINDS = {str: "TEXT", int: "INTEGER", float: "REAL"}
TABLES = """
CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY,
 organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT);
CREATE TABLE gpkg_contents (table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
 description TEXT DEFAULT '', last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
 min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
 CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (table_name TEXT NOT NULL, column_name TEXT NOT NULL, geometry_type_name TEXT NOT
 NULL, srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL, CONSTRAINT pk_geom_cols PRIMARY KEY
 (table_name, column_name), CONSTRAINT uk_gc_table_name UNIQUE (table_name));
"""


@dataclass(frozen=True)
class Layer:
    """Features of one kind of geometry.

    Parameters
    ----------
    name : of the layer. kind : 'MULTILINESTRING' or 'MULTIPOLYGON'. geometries : shapely's, X and Y in m.
    columns : attributes by name, one value a feature.
    """

    name: str
    kind: str
    geometries: Sequence[Any]
    columns: Mapping[str, Sequence[str | int | float]]


def write_geopackage(path: Path, layers: Sequence[Layer], crs: str | None) -> None:
    """Write layers into a new file.

    Parameters
    ----------
    crs : 'EPSG:n' of the coordinates; None for local ones.
    """
    with closing(sqlite3.connect(path)) as database:
        database.execute(f"PRAGMA application_id = {APPLICATION}")
        database.execute(f"PRAGMA user_version = {VERSION}")
        database.executescript(TABLES)
        srs = _enter_system(database, crs)
        for layer in layers:
            _enter_layer(database, layer, srs)
        database.commit()


def _enter_system(database: sqlite3.Connection, crs: str | None) -> int:
    from pyproj import CRS

    local = 'ENGCRS["local",EDATUM["local"],CS[Cartesian,2],AXIS["X",east],AXIS["Y",north],LENGTHUNIT["m",1]]'
    wgs84 = CRS.from_epsg(4326)
    rows = [
        ("Undefined Cartesian", LOCAL, "NONE", LOCAL, "undefined", local),
        ("Undefined geographic", 0, "NONE", 0, "undefined", None),
        (wgs84.name, 4326, "EPSG", 4326, wgs84.to_wkt("WKT1_GDAL"), None),
    ]
    srs = LOCAL
    if crs is not None:
        own, srs = CRS.from_user_input(crs), int(crs.partition(":")[2])
        rows.append((own.name, srs, "EPSG", srs, own.to_wkt("WKT1_GDAL"), None))
    database.executemany("INSERT OR REPLACE INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)", rows)
    return srs


def _enter_layer(database: sqlite3.Connection, layer: Layer, srs: int) -> None:
    import shapely

    names = list(layer.columns)
    kinds = [KINDS[type(values[0])] if len(values) else "TEXT" for values in layer.columns.values()]
    attributes = "".join(f', "{name}" {kind}' for name, kind in zip(names, kinds, strict=True))
    database.execute(
        f'CREATE TABLE "{layer.name}" (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom {layer.kind}{attributes})'
    )
    bounds = shapely.total_bounds(layer.geometries).tolist() if len(layer.geometries) else [None] * 4
    database.execute(
        "INSERT INTO gpkg_contents (table_name, data_type, identifier, min_x, min_y, max_x, max_y, srs_id)"
        " VALUES (?, 'features', ?, ?, ?, ?, ?, ?)", (layer.name, layer.name, *bounds, srs),
    )  # fmt: skip
    database.execute("INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 0, 0)", (layer.name, layer.kind, srs))
    places = ", ".join("?" * (len(names) + 1))
    columns = "".join(f', "{name}"' for name in names)
    rows = zip((_blob(g, srs) for g in layer.geometries), *layer.columns.values(), strict=True)
    database.executemany(f'INSERT INTO "{layer.name}" (geom{columns}) VALUES ({places})', rows)


def _blob(geometry: Any, srs: int) -> bytes:
    """A geometry in the form of GeoPackage: a header with an envelope, then WKB."""
    x, y, last_x, last_y = geometry.bounds
    return struct.pack("<2sBBi4d", b"GP", 0, 0b00000011, srs, x, last_x, y, last_y) + geometry.wkb
