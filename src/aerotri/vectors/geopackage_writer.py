"""Layers written as a GeoPackage, without further libraries [L: OGC 12-128]; styles as QGIS reads them from it."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from pyproj import CRS

APPLICATION, VERSION = 0x47504B47, 10200
"""'GPKG', and version 1.2 of the standard."""
LOCAL = -1
"""Number of a Cartesian system that is not defined."""
WITHOUT_CODE = 100_000
"""Number in the file of a system that has no EPSG code of its own, such as a plan with heights of another code."""
KINDS = {"b": "BOOLEAN", "i": "INTEGER", "u": "INTEGER", "f": "REAL"}
"""Types of columns by the kind of the numpy array; text is all else."""
ROWS_AT_A_TIME = 50_000
"""Rows that become Python objects at a time [C]: some 50 MB."""
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
CREATE TABLE gpkg_extensions (table_name TEXT, column_name TEXT, extension_name TEXT NOT NULL, definition TEXT NOT
 NULL, scope TEXT NOT NULL, CONSTRAINT ge_tce UNIQUE (table_name, column_name, extension_name));
"""
DESCRIBED = """
CREATE TABLE gpkg_data_columns (table_name TEXT NOT NULL, column_name TEXT NOT NULL, name TEXT, title TEXT, description
 TEXT, mime_type TEXT, constraint_name TEXT, CONSTRAINT pk_gdc PRIMARY KEY (table_name, column_name), CONSTRAINT
 gdc_tn UNIQUE (table_name, name));
CREATE TABLE gpkg_data_column_constraints (constraint_name TEXT NOT NULL, constraint_type TEXT NOT NULL, value TEXT,
 min NUMERIC, min_is_inclusive BOOLEAN, max NUMERIC, max_is_inclusive BOOLEAN, description TEXT, CONSTRAINT gdcc_ntv
 UNIQUE (constraint_name, constraint_type, value));
INSERT INTO gpkg_extensions VALUES
 ('gpkg_data_columns', NULL, 'gpkg_schema', 'http://www.geopackage.org/spec121/#extension_schema', 'read-write'),
 ('gpkg_data_column_constraints', NULL, 'gpkg_schema', 'http://www.geopackage.org/spec121/#extension_schema',
  'read-write');
"""
"""What columns mean: the schema extension of the standard."""
INDEX = """
CREATE VIRTUAL TABLE "rtree_{t}_geom" USING rtree(id, minx, maxx, miny, maxy);
INSERT INTO gpkg_extensions VALUES
 ('{t}', 'geom', 'gpkg_rtree_index', 'http://www.geopackage.org/spec120/#extension_rtree', 'write-only');
"""
KEEPING_INDEX = """
CREATE TRIGGER "rtree_{t}_geom_insert" AFTER INSERT ON "{t}" WHEN {placed} BEGIN {enter} END;
CREATE TRIGGER "rtree_{t}_geom_update1" AFTER UPDATE OF geom ON "{t}" WHEN OLD.fid = NEW.fid AND {placed}
 BEGIN {enter} END;
CREATE TRIGGER "rtree_{t}_geom_update2" AFTER UPDATE OF geom ON "{t}" WHEN OLD.fid = NEW.fid AND NOT {placed}
 BEGIN DELETE FROM "rtree_{t}_geom" WHERE id = OLD.fid; END;
CREATE TRIGGER "rtree_{t}_geom_update3" AFTER UPDATE ON "{t}" WHEN OLD.fid != NEW.fid AND {placed}
 BEGIN DELETE FROM "rtree_{t}_geom" WHERE id = OLD.fid; {enter} END;
CREATE TRIGGER "rtree_{t}_geom_update4" AFTER UPDATE ON "{t}" WHEN OLD.fid != NEW.fid AND NOT {placed}
 BEGIN DELETE FROM "rtree_{t}_geom" WHERE id IN (OLD.fid, NEW.fid); END;
CREATE TRIGGER "rtree_{t}_geom_delete" AFTER DELETE ON "{t}" WHEN OLD.geom NOT NULL
 BEGIN DELETE FROM "rtree_{t}_geom" WHERE id = OLD.fid; END;
"""
PLACED = "(NEW.geom NOT NULL AND NOT ST_IsEmpty(NEW.geom))"
ENTER = """INSERT OR REPLACE INTO "rtree_{t}_geom"
 VALUES (NEW.fid, ST_MinX(NEW.geom), ST_MaxX(NEW.geom), ST_MinY(NEW.geom), ST_MaxY(NEW.geom));"""
"""The spatial index, and what keeps it when a program edits the layer: the R-tree extension of the standard."""
STYLES = """
CREATE TABLE layer_styles (id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, f_table_catalog TEXT(256), f_table_schema
 TEXT(256), f_table_name TEXT(256), f_geometry_column TEXT(256), styleName TEXT(30), styleQML TEXT, styleSLD TEXT,
 useAsDefault BOOLEAN, description TEXT, owner TEXT(30), ui TEXT(30),
 update_time DATETIME DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')));
INSERT INTO gpkg_contents (table_name, data_type, identifier, description) VALUES
 ('layer_styles', 'attributes', 'layer_styles', 'How QGIS draws the layers.');
"""


@dataclass(frozen=True)
class Layer:
    """Features of one kind of geometry.

    Parameters
    ----------
    name : of the layer. kind : of its geometries, such as 'MULTIPOLYGON'; '' for a table without.
    geometries : shapely's, X, Y and where there is a height Z in m; None for a feature that has no place.
    columns : attributes by name, one value a feature.
    z : whether the geometries have heights.
    text : what the layer is. fields : what its columns are, by name.
    style : QML of QGIS, its default style.
    """

    name: str
    kind: str
    geometries: Sequence[Any] | np.ndarray
    columns: Mapping[str, Sequence[Any] | np.ndarray]
    z: bool = False
    text: str = ""
    fields: Mapping[str, str] = field(default_factory=dict)
    style: str = ""


def write_geopackage(path: Path, layers: Sequence[Layer], crs: str | None) -> None:
    """Write layers into a new file.

    Parameters
    ----------
    crs : 'EPSG:n' of the coordinates, 'EPSG:n+m' with that of the heights; None for local ones.
    """
    with closing(sqlite3.connect(path)) as database:
        database.execute(f"PRAGMA application_id = {APPLICATION}")
        database.execute(f"PRAGMA user_version = {VERSION}")
        database.executescript(TABLES)
        srs = _enter_system(database, crs)
        for layer in layers:
            _enter_layer(database, layer, srs)
        _enter_descriptions(database, layers)
        _enter_styles(database, layers)
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
        own = CRS.from_user_input(crs)
        code = _code(crs, own)
        srs = WITHOUT_CODE if code is None else code
        organization = "NONE" if code is None else "EPSG"
        rows.append((own.name, srs, organization, srs, own.to_wkt("WKT1_GDAL"), crs))
    database.executemany("INSERT OR REPLACE INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)", rows)
    return srs


def _code(crs: str, own: CRS) -> int | None:
    """The EPSG code of a system; None for a plan and heights that have none together."""
    authority, _, alone = crs.partition(":")
    return int(alone) if authority.upper() == "EPSG" and alone.isdecimal() else own.to_epsg()


def _enter_layer(database: sqlite3.Connection, layer: Layer, srs: int) -> None:
    columns = {name: np.asarray(values) for name, values in layer.columns.items()}
    attributes = "".join(f', "{name}" {KINDS.get(values.dtype.kind, "TEXT")}' for name, values in columns.items())
    geom = f", geom {layer.kind}" if layer.kind else ""
    database.execute(f'CREATE TABLE "{layer.name}" (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL{geom}{attributes})')
    if not layer.kind:
        database.execute(
            "INSERT INTO gpkg_contents (table_name, data_type, identifier, description) VALUES (?, 'attributes', ?, ?)",
            (layer.name, layer.name, layer.text),
        )
        return _enter_rows(database, layer.name, list(columns), lambda rows: _lists(columns, rows), _count(columns))
    geometries = np.array(list(layer.geometries), dtype=object)
    database.execute(
        "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, min_x, min_y, max_x, max_y, srs_id)"
        " VALUES (?, 'features', ?, ?, ?, ?, ?, ?, ?)",
        (layer.name, layer.name, layer.text, *_bounds(geometries), srs),
    )
    kind = (layer.name, layer.kind, srs, int(layer.z))
    database.execute("INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, ?, 0)", kind)

    def parts(rows: slice) -> list[Iterable[Any]]:
        return [_blobs(geometries[rows], srs, layer.z), *_lists(columns, rows)]

    _enter_rows(database, layer.name, ["geom", *columns], parts, len(geometries))
    _enter_index(database, layer.name, geometries)


def _enter_index(database: sqlite3.Connection, table: str, geometries: np.ndarray) -> None:
    """The spatial index of a layer; none where this SQLite was built without: the file is whole all the same."""
    import shapely

    if not database.execute("SELECT sqlite_compileoption_used('ENABLE_RTREE')").fetchone()[0]:
        return
    database.executescript(INDEX.format(t=table))
    for first in range(0, len(geometries), ROWS_AT_A_TIME):
        bounds = shapely.bounds(geometries[first : first + ROWS_AT_A_TIME]).reshape(-1, 4)
        placed = np.flatnonzero(np.isfinite(bounds).all(axis=1))
        rows = bounds[placed][:, [0, 2, 1, 3]].tolist()
        entries = [(first + 1 + k, *row) for k, row in zip(placed.tolist(), rows, strict=True)]
        database.executemany(f'INSERT INTO "rtree_{table}_geom" VALUES (?, ?, ?, ?, ?)', entries)
    database.executescript(KEEPING_INDEX.format(t=table, placed=PLACED, enter=ENTER.format(t=table)))


def _enter_rows(
    database: sqlite3.Connection, table: str, names: Sequence[str], parts: Callable[[slice], Any], count: int
) -> None:
    """Enter rows piece by piece; `parts` gives the columns of some rows."""
    quoted, places = ", ".join(f'"{name}"' for name in names), ", ".join("?" * len(names))
    query = f'INSERT INTO "{table}" ({quoted}) VALUES ({places})'
    for first in range(0, count, ROWS_AT_A_TIME):
        database.executemany(query, zip(*parts(slice(first, first + ROWS_AT_A_TIME)), strict=True))


def _lists(columns: Mapping[str, np.ndarray], rows: slice) -> list[Iterable[Any]]:
    return [values[rows].tolist() for values in columns.values()]


def _count(columns: Mapping[str, np.ndarray]) -> int:
    return max((len(values) for values in columns.values()), default=0)


def _enter_descriptions(database: sqlite3.Connection, layers: Sequence[Layer]) -> None:
    rows = [(layer.name, name, text) for layer in layers for name, text in layer.fields.items()]
    if rows:
        database.executescript(DESCRIBED)
        query = "INSERT INTO gpkg_data_columns (table_name, column_name, description) VALUES (?, ?, ?)"
        database.executemany(query, rows)


def _enter_styles(database: sqlite3.Connection, layers: Sequence[Layer]) -> None:
    rows = [(layer.name, layer.name, layer.style, layer.text) for layer in layers if layer.style]
    if rows:
        database.executescript(STYLES)
        database.executemany(
            "INSERT INTO layer_styles (f_table_catalog, f_table_schema, f_table_name, f_geometry_column, styleName,"
            " styleQML, styleSLD, useAsDefault, description, owner, ui)"
            " VALUES ('', '', ?, 'geom', ?, ?, '', 1, ?, '', '')", rows,
        )  # fmt: skip


def _bounds(geometries: np.ndarray) -> list[float | None]:
    """Smallest X and Y, largest X and Y; None where nothing has a place."""
    import shapely

    found = shapely.bounds(geometries).reshape(-1, 4)
    found = found[np.isfinite(found).all(axis=1)]
    return [*found[:, :2].min(axis=0).tolist(), *found[:, 2:].max(axis=0).tolist()] if len(found) else [None] * 4


def _blobs(geometries: np.ndarray, srs: int, z: bool) -> Iterator[bytes | None]:
    """Geometries in the form of GeoPackage: a header with an envelope, then WKB; None for what has no place."""
    import shapely

    if not len(geometries):
        return
    wkb = shapely.to_wkb(geometries, output_dimension=3 if z else 2, byte_order=1, flavor="iso")
    for own, bounds in zip(wkb.tolist(), shapely.bounds(geometries).tolist(), strict=True):
        if own is None:
            yield None
            continue
        x, y, last_x, last_y = bounds
        yield struct.pack("<2sBBi4d", b"GP", 0, 0b00000011, srs, x, last_x, y, last_y) + own
