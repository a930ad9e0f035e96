"""Which model every cell of a DEM was made in: one model, polygons (GeoJSON, GeoPackage) or a raster of numbers.

Polygons have the attributes `left` and `right`, names of photographs, and the coordinates of the DEM; where they
overlap the last one counts. A raster of numbers goes with a table `number,left,right`.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from shapely.geometry import mapping

from aerotri.conventions import InputError
from aerotri.rasters.grids import Grid, RasterReader, rasterise
from aerotri.rasters.held import HeldRaster
from aerotri.spreadsheet import with_formula
from aerotri.vectors.polygons import polygon_features


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
    """Polygons: GeoJSON geometries with their model and their (left, bottom, right, top); note : about their CRS."""

    names: tuple[tuple[str, str], ...]
    shapes: tuple[tuple[Mapping[str, Any], int], ...]
    bounds: np.ndarray
    note: str = ""

    def numbers(self, grid: Grid, row: int, column: int, rows: int, columns: int) -> np.ndarray:
        """(rows, columns); −1 where no polygon holds the centre of the cell."""
        window = grid.window(row, column, rows, columns)
        left, bottom, right, top = window.bounds
        b = self.bounds
        near = (b[:, 0] <= right) & (b[:, 2] >= left) & (b[:, 1] <= top) & (b[:, 3] >= bottom)
        return rasterise([self.shapes[k] for k in np.flatnonzero(near)], window)


@dataclass(frozen=True, eq=False)
class NumberMap:
    """A raster of numbers; `known` (k,) rising are those of the models."""

    names: tuple[tuple[str, str], ...]
    known: np.ndarray
    reader: RasterReader | HeldRaster

    def numbers(self, grid: Grid, row: int, column: int, rows: int, columns: int) -> np.ndarray:
        """(rows, columns); −1 where the raster has another number or none."""
        own = self.reader.grid
        at_row = np.floor(own.row(grid.y(row + np.arange(rows))) + 0.5).astype(np.int64)
        at_column = np.floor(own.column(grid.x(column + np.arange(columns))) + 0.5).astype(np.int64)
        size = at_row[-1] - at_row[0] + 1, at_column[-1] - at_column[0] + 1
        window = self.reader.read(int(at_row[0]), int(at_column[0]), int(size[0]), int(size[1]))
        place = np.minimum(np.searchsorted(self.known, window), len(self.known) - 1)
        number = np.where(self.known[place] == window, place, -1).astype(np.int32)
        return number[np.ix_(at_row - at_row[0], at_column - at_column[0])]


def read_polygons(path: Path, crs: str = "") -> PolygonMap:
    """Polygons of models from a file of polygons.

    Parameters
    ----------
    crs : of the DEM, which they are brought to, see `crs_text`; '' where not known.

    Raises
    ------
    InputError
        When the file cannot be read, or a polygon lacks its photographs.
    """
    found: dict[tuple[str, str], int] = {}
    shapes, bounds = [], []
    features, note = polygon_features(path, crs)
    for number, (properties, polygon) in enumerate(features, start=1):
        names = str(properties.get("left") or ""), str(properties.get("right") or "")
        if not all(names):
            raise InputError(
                f"feature {number} has no attribute 'left' or 'right'", "name the photographs of its model", path
            )
        shapes.append((mapping(polygon), found.setdefault(names, len(found))))
        bounds.append(polygon.bounds)
    if not shapes:
        raise InputError("has no polygons", "give a polygon for every model", path)
    return PolygonMap(tuple(found), tuple(shapes), np.array(bounds), note)


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
            number = int(row["number"])
            names = with_formula(row["left"].strip()), with_formula(row["right"].strip())
        except (KeyError, ValueError, AttributeError, TypeError) as error:
            remedy = "give a whole number and two names"
            raise InputError("is no row of number,left,right", remedy, path, line) from error
        if number in out or not all(names):
            raise InputError(f"number {number} is there twice or lacks a name", "correct the table", path, line)
        out[number] = names
    if not out:
        raise InputError("has no rows", "give a row number,left,right for every model", path)
    return out


def table_beside(models: Path) -> Path:
    """The table of a raster of models: NAME.csv, else models.csv."""
    own = models.with_suffix(".csv")
    return own if own.exists() else models.with_name("models.csv")


def number_map(reader: RasterReader | HeldRaster, table: Mapping[int, tuple[str, str]]) -> NumberMap:
    """The map of a raster of numbers and its table."""
    known = sorted(table)
    return NumberMap(tuple(table[number] for number in known), np.array(known), reader)
