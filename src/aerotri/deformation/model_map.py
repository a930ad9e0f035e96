"""Which model every cell of a DEM was made in: one model, polygons (GeoJSON, GeoPackage) or a raster of numbers.

Polygons have the attributes `left` and `right`, names of photographs, and the coordinates of the DEM; where they
overlap the last one counts. A raster of numbers goes with a table `number,left,right`.
"""

from __future__ import annotations

import csv
import json
import sqlite3
import struct
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from aerotri.conventions import InputError
from aerotri.rasters import Grid, RasterReader, rasterise

VECTOR_ENDINGS = (".geojson", ".json", ".gpkg")
POLYGON, MULTIPOLYGON = 3, 6
ENVELOPE_BYTES = (0, 32, 48, 48, 64)
"""Of a GeoPackage geometry, by the kind of envelope its header has."""


class ModelMap(Protocol):
    """names : (left, right) of every model. numbers : (rows, columns) int32, models of the cells of a window."""

    @property
    def names(self) -> tuple[tuple[str, str], ...]: ...
    def numbers(self, grid: Grid, row: int, column: int, rows: int, columns: int) -> np.ndarray: ...


@dataclass(frozen=True)
class OneModel:
    """Every cell lies in the same model."""

    left: str
    right: str

    @property
    def names(self) -> tuple[tuple[str, str], ...]:
        return ((self.left, self.right),)

    def numbers(self, grid: Grid, row: int, column: int, rows: int, columns: int) -> np.ndarray:
        """(rows, columns) of zeros."""
        return np.zeros((rows, columns), np.int32)


@dataclass(frozen=True, eq=False)
class PolygonMap:
    """Polygons: GeoJSON geometries with their model and their (left, bottom, right, top)."""

    names: tuple[tuple[str, str], ...]
    shapes: tuple[tuple[Mapping[str, Any], int], ...]
    bounds: np.ndarray

    def numbers(self, grid: Grid, row: int, column: int, rows: int, columns: int) -> np.ndarray:
        """(rows, columns); −1 where no polygon holds the centre of the cell."""
        left, top = grid.left + column * grid.cell_x, grid.top - row * grid.cell_y
        window = Grid(rows, columns, left, top, grid.cell_x, grid.cell_y)
        right, bottom = left + columns * grid.cell_x, top - rows * grid.cell_y
        b = self.bounds
        near = (b[:, 0] <= right) & (b[:, 2] >= left) & (b[:, 1] <= top) & (b[:, 3] >= bottom)
        return rasterise([self.shapes[k] for k in np.flatnonzero(near)], window)


@dataclass(frozen=True, eq=False)
class NumberMap:
    """A raster of numbers; `known` (k,) rising are those of the models."""

    names: tuple[tuple[str, str], ...]
    known: np.ndarray
    reader: RasterReader

    def numbers(self, grid: Grid, row: int, column: int, rows: int, columns: int) -> np.ndarray:
        """(rows, columns); −1 where the raster has another number or none."""
        own = self.reader.grid
        at_row = np.floor(own.row(grid.y(row + np.arange(rows))) + 0.5).astype(np.int64)
        at_column = np.floor(own.column(grid.x(column + np.arange(columns))) + 0.5).astype(np.int64)
        size = at_row[-1] - at_row[0] + 1, at_column[-1] - at_column[0] + 1
        window = self.reader.read(int(at_row[0]), int(at_column[0]), int(size[0]), int(size[1]))
        number = window[np.ix_(at_row - at_row[0], at_column - at_column[0])]
        place = np.minimum(np.searchsorted(self.known, number), len(self.known) - 1)
        return np.where(self.known[place] == number, place, -1).astype(np.int32)


def read_polygons(path: Path, epsg: int | None = None) -> PolygonMap:
    """Polygons of models from GeoJSON or GeoPackage.

    Parameters
    ----------
    epsg : code of the DEM's CRS, which the polygons have to share; None when not known.

    Raises
    ------
    InputError
        When the file cannot be read, has another CRS, or a polygon lacks its photographs.
    """
    read = _gpkg_features if path.suffix.lower() == ".gpkg" else _geojson_features
    found: dict[tuple[str, str], int] = {}
    shapes, bounds = [], []
    try:
        for number, (properties, geometry) in enumerate(read(path, epsg), start=1):
            corners = _corners(geometry)
            if corners is None:
                raise InputError(f"feature {number} is no polygon", "give polygons only", path)
            names = str(properties.get("left") or ""), str(properties.get("right") or "")
            if not all(names):
                raise InputError(
                    f"feature {number} has no attribute 'left' or 'right'", "name the photographs of its model", path
                )
            shapes.append((geometry, found.setdefault(names, len(found))))
            bounds.append([*corners.min(axis=0), *corners.max(axis=0)])
    except (OSError, ValueError, KeyError, TypeError, IndexError, struct.error, sqlite3.Error) as error:
        raise InputError(f"cannot be read: {error}", "give polygons as GeoJSON or GeoPackage", path) from error
    if not shapes:
        raise InputError("has no polygons", "give a polygon for every model", path)
    return PolygonMap(tuple(found), tuple(shapes), np.array(bounds))


def read_number_table(path: Path) -> dict[int, tuple[str, str]]:
    """The table `number,left,right` of a raster of models.

    Raises
    ------
    InputError
        With the line.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"cannot be read: {error}", "give a table number,left,right", path) from error
    out: dict[int, tuple[str, str]] = {}
    for line, row in enumerate(rows, start=2):
        try:
            number, names = int(row["number"]), (row["left"].strip(), row["right"].strip())
        except (KeyError, ValueError, AttributeError, TypeError) as error:
            remedy = "give a whole number and two names"
            raise InputError("is no row of number,left,right", remedy, path, line) from error
        if number in out or not all(names):
            raise InputError(f"number {number} is there twice or lacks a name", "correct the table", path, line)
        out[number] = names
    if not out:
        raise InputError("has no rows", "give a row number,left,right for every model", path)
    return out


def number_map(reader: RasterReader, table: Mapping[int, tuple[str, str]]) -> NumberMap:
    """The map of a raster of numbers and its table."""
    known = sorted(table)
    return NumberMap(tuple(table[number] for number in known), np.array(known), reader)


def _geojson_features(path: Path, epsg: int | None) -> Iterator[tuple[Mapping[str, Any], Mapping[str, Any]]]:
    content = json.loads(path.read_text(encoding="utf-8-sig"))
    name = str(((content.get("crs") or {}).get("properties") or {}).get("name", ""))
    code = name.rpartition(":")[2]
    _check_crs(path, int(code) if "EPSG" in name.upper() and code.isdigit() else None, epsg)
    for feature in content["features"]:
        yield feature.get("properties") or {}, feature["geometry"]


def _check_crs(path: Path, own: int | None, epsg: int | None) -> None:
    if own is not None and epsg is not None and own != epsg:
        raise InputError(f"is in EPSG:{own}, the DEM in EPSG:{epsg}", "bring it into the CRS of the DEM", path)


def _gpkg_features(path: Path, epsg: int | None) -> Iterator[tuple[Mapping[str, Any], Mapping[str, Any]]]:
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


def _gpkg_geometry(blob: bytes) -> Mapping[str, Any]:
    """The GeoJSON geometry of a GeoPackage blob: its header, then WKB [L: OGC 12-128, 06-103]."""
    if blob[:2] != b"GP":
        raise ValueError("a geometry is none of GeoPackage")
    kind = (blob[3] >> 1) & 7
    geometry, _ = _wkb(blob, 8 + ENVELOPE_BYTES[kind])
    return geometry


def _wkb(blob: bytes, at: int) -> tuple[Mapping[str, Any], int]:
    """A polygon or polygons from a place on, and the place behind; heights are left out."""
    order = "<" if blob[at] == 1 else ">"
    (code,) = struct.unpack_from(order + "I", blob, at + 1)
    kind, plain = code & 0x1FFFFFFF, code & 0x1FFFFFFF
    dimensions = 2 + bool(code & 0x80000000) + bool(code & 0x40000000)
    if plain > 1000:
        kind, dimensions = plain % 1000, 2 + (1, 1, 2)[plain // 1000 - 1]
    (count,) = struct.unpack_from(order + "I", blob, at + 5)
    at += 9
    parts: list[Any] = []
    for _ in range(count):
        if kind == MULTIPOLYGON:
            part, at = _wkb(blob, at)
            parts.append(part["coordinates"])
        elif kind == POLYGON:
            (points,) = struct.unpack_from(order + "I", blob, at)
            ring = np.frombuffer(blob, order + "f8", points * dimensions, at + 4).reshape(points, dimensions)
            parts.append(ring[:, :2].tolist())
            at += 4 + 8 * points * dimensions
        else:
            return {"type": f"WKB {kind}", "coordinates": []}, at
    return {"type": "MultiPolygon" if kind == MULTIPOLYGON else "Polygon", "coordinates": parts}, at


def _corners(geometry: Mapping[str, Any] | None) -> np.ndarray | None:
    """(n, 2) all corners of a polygon or of several; None of anything else."""
    if not geometry or geometry.get("type") not in ("Polygon", "MultiPolygon"):
        return None
    polygons = geometry["coordinates"] if geometry["type"] == "MultiPolygon" else [geometry["coordinates"]]
    corners = [point[:2] for polygon in polygons for ring in polygon for point in ring]
    return np.array(corners, dtype=float) if corners else None
