"""The boundary of a volume: which part of every cell and triangle it holds, exactly."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import mapping
from shapely.geometry.base import BaseGeometry

from aerotri.conventions import InputError, in_digits, regular_file
from aerotri.rasters.grids import Grid, rasterise
from aerotri.vectors.crs import vector_system
from aerotri.vectors.polygons import (
    FILE_REMEDY,
    KINDS,
    VECTOR_ENDINGS,
    WKT_KINDS,
    placed,
    polygon_features,
    polygon_of_wkt,
    srid_of_wkt,
)

NAMES = ("name", "pile", "label", "title")
"""Attributes that name a polygon, in any case."""
SHARED_CELLS, SHARED_REACH = 4.0, 0.1
"""Cells of outline that two polygons share before the user is told, and how near the lines are, in cells [C]."""
OVERLAP = 1e-9
"""Share of the area by which polygons may overlap: rounding of common corners."""
SLIVER = 1e-3
"""Share of the smaller of two piles that both may have and count one by one still; chosen [C]: outlines drawn side by
side by hand overlap by slivers, and a thousandth is less than any σ of a volume."""


@dataclass(frozen=True, eq=False)
class Boundary:
    """A polygon or several, holes included, in the CRS of the surface.

    Parameters
    ----------
    polygon : valid shapely geometry. name : where it came from. note : about its CRS, '' where there is nothing to say.
    piles : names and polygons that count one by one; empty where the boundary is one.
    polygon_name : that a file gives its only polygon, '' where it gives none.
    beside : other polygons that are measured at the same time: no ground around this one.
    """

    polygon: BaseGeometry
    name: str
    note: str = ""
    piles: tuple[tuple[str, BaseGeometry], ...] = ()
    polygon_name: str = ""
    beside: BaseGeometry | None = None

    @property
    def area(self) -> float:
        """m²."""
        return float(self.polygon.area)

    @property
    def rings(self) -> list[np.ndarray]:
        """Corners (n, 2) of every ring, the first one repeated at the end; outer rings run counter-clockwise."""
        parts = shapely.get_parts(shapely.orient_polygons(self.polygon))
        return [np.asarray(ring.coords)[:, :2] for part in parts for ring in (part.exterior, *part.interiors)]

    @property
    def outline(self) -> BaseGeometry:
        """The polygon with its holes filled: a base runs along its rings."""
        parts = shapely.get_parts(self.polygon)
        if not shapely.get_num_interior_rings(parts).any():
            return self.polygon
        return shapely.normalize(shapely.union_all([shapely.Polygon(part.exterior) for part in parts]))

    @property
    def outer_rings(self) -> list[np.ndarray]:
        """As `rings`, of the outline."""
        return replace(self, polygon=self.outline).rings

    def coverage(self, grid: Grid) -> np.ndarray:
        """(rows, columns), which part of every cell lies inside, 0 … 1."""
        near = self.within(grid.bounds)
        inside = rasterise([(mapping(near), 1)] if not near.is_empty else [], grid, 0).astype(float)
        edges = self.polygon.boundary.intersection(shapely.box(*_widened(grid)))
        if edges.is_empty:
            return inside
        row, column = np.nonzero(_dilated(rasterise([(mapping(edges), 1)], grid, 0, touched=True) == 1))
        left, top = grid.left + column * grid.cell_x, grid.top - row * grid.cell_y
        boxes = shapely.box(left, top - grid.cell_y, left + grid.cell_x, top)
        inside[row, column] = shapely.area(shapely.intersection(boxes, near)) / (grid.cell_x * grid.cell_y)
        return inside

    def within(self, bounds: tuple[float, float, float, float]) -> BaseGeometry:
        """The part of the polygon inside a rectangle (left, bottom, right, top)."""
        part = shapely.intersection(self.polygon, shapely.box(*bounds))
        shapely.prepare(part)
        return part


def boundary_of(polygon: BaseGeometry, name: str, note: str = "", file: Path | None = None) -> Boundary:
    """A boundary, its rings beginning at their lowest corner and going one way, whatever the file has.

    Places along the rings, through which bases are laid, would else hang on the corner a ring begins with.

    Raises
    ------
    InputError
        When it has no area, or crosses itself.
    """
    if not polygon.is_valid:
        # GEOS computes the place of a fault even where coordinates are beyond all numbers
        with np.errstate(all="ignore"):
            reason = shapely.is_valid_reason(polygon)
        raise InputError(f"the boundary '{name}' is not valid: {reason}", "correct the polygon", file)
    if not polygon.area > 0.0:
        raise InputError(f"the boundary '{name}' has no area", "give a polygon", file)
    return Boundary(shapely.normalize(polygon), name, note)


def boundary_of_parts(polygon: BaseGeometry, name: str, note: str = "", file: Path | None = None) -> Boundary:
    """As `boundary_of`; the parts of a polygon of several are piles, 1, 2, …

    Raises
    ------
    InputError
    """
    return boundary_of_piles([("", polygon)], name, note, file)


def boundary_of_piles(
    piles: Sequence[tuple[str, BaseGeometry]], name: str, note: str = "", file: Path | None = None
) -> Boundary:
    """A boundary of several polygons, each with a name; those that overlap by more than slivers count together.

    One of several parts is a pile for every part: 'NAME 1', 'NAME 2', …

    Raises
    ------
    InputError
        When one has no area, crosses itself, or two have the same name.
    """
    each = [
        (own, boundary_of(part, own or name, file=file).polygon)
        for stated, polygon in piles
        for own, part in _each_part(stated, polygon)
    ]
    names = [own for own, _ in each]
    twice = {own for own in names if names.count(own) > 1}
    if twice:
        raise InputError(f"has two polygons called '{min(twice)}'", "give each its own name", file)
    whole = _united([polygon for _, polygon in each], file)
    found = boundary_of(whole, name, note, file)
    if len(each) == 1:
        return found
    overlap = sum(polygon.area for _, polygon in each) - whole.area
    if overlap <= OVERLAP * whole.area:
        return replace(found, piles=tuple(each))
    alone, said = _only_slivers([polygon for _, polygon in each]), f"its polygons overlap by {in_digits(overlap, 4)} m²"
    if alone:
        said += ", less than a thousandth of the smaller one: they count one by one, and what two share is in both"
    else:
        said += ": they count together, not one by one"
    note = "; ".join(text for text in (note, said) if text)
    return replace(found, note=note, piles=tuple(each) if alone else ())


def _only_slivers(polygons: Sequence[BaseGeometry]) -> bool:
    """Whether any two have no more than `SLIVER` of the smaller one in common."""
    near = shapely.STRtree(polygons).query(polygons, predicate="intersects")
    pairs = [(polygons[a], polygons[b]) for a, b in near.T.tolist() if a < b]
    return all(shapely.intersection(one, two).area <= SLIVER * min(one.area, two.area) for one, two in pairs)


def _each_part(name: str, polygon: BaseGeometry) -> list[tuple[str, BaseGeometry]]:
    """The parts of a polygon by their names; one that is not valid as it is, so that it is refused as a whole."""
    parts = shapely.get_parts(polygon).tolist()
    if polygon.geom_type == "GeometryCollection":
        if not all(part.geom_type in KINDS for part in parts):
            raise InputError("holds other shapes than polygons", "give polygons only")
        parts = [own for part in parts for own in shapely.get_parts(part).tolist()]
        polygon = shapely.MultiPolygon(parts)
    if len(parts) < 2 or not polygon.is_valid:
        return [(name, polygon)]
    return [(f"{name} {number}".lstrip(), part) for number, part in enumerate(parts, start=1)]


def outline_notes(boundary: Boundary, cell: float) -> tuple[str, ...]:
    """Sentences about a base that follows from the surface along outlines which may lie on the pile itself.

    Parameters
    ----------
    cell : m, of the surface.
    """
    polygons = [polygon for _, polygon in boundary.piles] or [boundary.polygon]
    holes = sum(int(shapely.get_num_interior_rings(shapely.get_parts(one)).sum()) for one in polygons)
    notes = []
    if holes:
        notes.append(
            f"the boundary has {holes} hole{'s' if holes > 1 else ''}: the base runs through the outer outline alone; "
            "what lies inside a hole is not in the volume"
        )
    notes += [
        f"the outlines of {first} and {second} share {in_digits(length, 4)} m: the base runs through the surface "
        "there, which is the pile itself where the line crosses it; give a height or a surface as base, or draw one "
        "outline around both"
        for first, second, length in _shared_outlines(boundary.piles, cell)
    ]
    return tuple(notes)


def _shared_outlines(piles: Sequence[tuple[str, BaseGeometry]], cell: float) -> list[tuple[str, str, float]]:
    """Names of two polygons and how much of their outlines lies side by side, m."""
    polygons = [polygon for _, polygon in piles]
    reach = SHARED_REACH * cell
    if not polygons:
        return []
    near = shapely.STRtree(polygons).query(polygons, predicate="dwithin", distance=reach)
    found = []
    for first, second in sorted((int(a), int(b)) for a, b in near.T if a < b):
        band = shapely.buffer(polygons[second].boundary, reach, quad_segs=2)
        length = float(shapely.intersection(polygons[first].boundary, band).length)
        if length > SHARED_CELLS * cell:
            found.append((piles[first][0], piles[second][0], length))
    return found


def _named(attributes: Sequence[Mapping[str, Any]]) -> tuple[list[str], str]:
    """Names that attributes give their polygons, '' where they give none; and a sentence about which was taken."""
    stated = any(str(key).lower() in NAMES for own in attributes for key in own)
    other = "" if stated else _attribute_of_names(attributes)
    found = []
    for own in attributes:
        names = (own[key] for key in own if str(key).lower() in NAMES and own[key] not in (None, ""))
        found.append(str(own[other] if other else next(names, "")))
    return found, f"the attribute '{other}' names the polygons" if other else ""


def _attribute_of_names(attributes: Sequence[Mapping[str, Any]]) -> str:
    """The first attribute that is a text and different for all polygons; '' where there is none, or it is not told."""
    texts = [key for key in attributes[0] if all(isinstance(own.get(key), str) and own[key] for own in attributes)]
    if len(attributes) == 1 and len(texts) > 1:
        return ""
    return next((key for key in texts if len({own[key] for own in attributes}) == len(attributes)), "")


def read_boundary(source: str, crs: str = "") -> Boundary:
    """The boundary of a file (see `FILE_REMEDY`) or of a WKT text; several polygons are piles.

    Parameters
    ----------
    crs : of the surface, see `crs_text`, '' where not known; what names another one is brought to it, and GeoJSON is
        longitude and latitude.
    """
    if source.lstrip().upper().startswith((*WKT_KINDS, "SRID=")):
        return _of_wkt(source, "the polygon given", crs)
    path = Path(source)
    if path.suffix.lower() in VECTOR_ENDINGS:
        features, note = polygon_features(path, crs)
        polygons = [polygon for _, polygon in features]
        if not polygons:
            raise InputError("has no polygons", "give the boundary of the volume", path)
        names, said = _named([properties for properties, _ in features])
        note = "; ".join(text for text in (note, said and f"{path.name}: {said}") if text)
        if len(polygons) == 1:
            found = boundary_of_piles([(names[0], polygons[0])], path.name, note, path)
            return found if found.piles else replace(found, polygon_name=names[0])
        numbered = [own or str(number) for number, own in enumerate(names, start=1)]
        return boundary_of_piles(list(zip(numbered, polygons, strict=True)), path.name, note, path)
    if os.path.lexists(path):
        regular_file(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read: {error}", FILE_REMEDY, path) from error
    return _of_wkt(text, path.name, crs, path)


def _of_wkt(text: str, name: str, crs: str, path: Path | None = None) -> Boundary:
    system = vector_system(srid_of_wkt(text), crs, name)
    return boundary_of_parts(placed(polygon_of_wkt(text, path), system, path), name, system.note, path)


def _united(polygons: list[BaseGeometry], path: Path | None) -> BaseGeometry:
    try:
        return shapely.union_all(polygons)
    except shapely.errors.ShapelyError as error:
        raise InputError(f"its polygons do not unite: {error}", "correct those that cross themselves", path) from error


def boundary_of_grid(grid: Grid) -> Boundary:
    """All between the centres of the outermost cells: where a surface is known without extrapolation."""
    return Boundary(shapely.box(*grid.between_centres().bounds), "the whole surface")


def _widened(grid: Grid) -> tuple[float, float, float, float]:
    left, bottom, right, top = grid.bounds
    return left - grid.cell_x, bottom - grid.cell_y, right + grid.cell_x, top + grid.cell_y


def _dilated(mask: np.ndarray) -> np.ndarray:
    """With all eight neighbours: an edge along the border of cells is rounded to one of its sides."""
    padded = np.pad(mask, 1)
    rows, columns = mask.shape
    out = np.zeros_like(mask)
    for i in range(3):
        for j in range(3):
            out |= padded[i : i + rows, j : j + columns]
    return out
