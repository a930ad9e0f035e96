"""The area of a plan, in metres of a projected system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from aerotri.conventions import InputError
from aerotri.crs_text import system_in_words
from aerotri.vectors.crs import LON_LAT, stated_crs
from aerotri.vectors.gdal_layers import ENDINGS, read_layers
from aerotri.vectors.geojson import GeoJsonFeature, crs_of_name, read_geojson
from aerotri.vectors.geopackage import read_geopackage
from aerotri.vectors.polygons import VECTOR_ENDINGS, polygon_layer, srid_of_wkt
from aerotri.volume.boundary import read_boundary


@dataclass(frozen=True, eq=False)
class Area:
    """Where is flown.

    Parameters
    ----------
    polygon : valid, m. crs : 'EPSG:n', None where it is not known. name : of the file. note : what was done to it.
    piles : polygons by their names, where there are several.
    """

    polygon: BaseGeometry
    crs: str | None
    name: str
    note: str = ""
    piles: tuple[tuple[str, BaseGeometry], ...] = ()

    def cells(self, count: int) -> np.ndarray:
        """(n, 2) m, about `count` places evenly over the area: middles of square cells that lie inside, and places on
        its border at the same distance."""
        step = float(np.sqrt(self.polygon.area / count))
        inside = self.raster(step)
        rings = shapely.segmentize(self.polygon.boundary, step)
        return np.unique(np.concatenate([inside, shapely.get_coordinates(rings)]), axis=0)

    def raster(self, step: float) -> np.ndarray:
        """(n, 2) m, middles of the square cells of a size that lie inside, row by row from the north."""
        left, bottom, right, top = self.polygon.bounds
        columns, rows = int(np.ceil((right - left) / step)), int(np.ceil((top - bottom) / step))
        x, y = np.meshgrid(left + (np.arange(columns) + 0.5) * step, top - (np.arange(rows) + 0.5) * step)
        inside = shapely.contains_xy(self.polygon, x.ravel(), y.ravel())
        return np.column_stack([x.ravel(), y.ravel()])[inside]


def read_area(source: str, wanted: str | None = None) -> Area:
    """The area of a file with polygons (see `VECTOR_ENDINGS`), a WKT file or a WKT text.

    Longitudes and latitudes are brought to the CRS wanted, else to the UTM zone of their middle.

    Parameters
    ----------
    wanted : 'EPSG:n' of the plan; None for that of the area.

    Raises
    ------
    InputError
        When there is no polygon, it has no area or crosses itself, or its CRS does not count in metres.
    """
    own = _own_crs(source)
    target = wanted
    if target is None and own is not None:
        target = _metric(own, source)
    if own is not None and own.upper() in (LON_LAT, "EPSG:4326") and Path(source).suffix.lower() not in VECTOR_ENDINGS:
        own = LON_LAT
    boundary = read_boundary(source, target or "")
    polygon = boundary.polygon
    left, bottom, right, top = polygon.bounds
    if target is None and max(-left, right) <= 180.0 and max(-bottom, top) <= 90.0:
        raise InputError(
            f"'{boundary.name}' seems to have longitudes and latitudes, and names no CRS",
            "give SRID=4326; before the WKT, GeoJSON, or coordinates in metres",
        )
    if wanted is not None:
        _refuse_degrees(wanted)
    note = boundary.note.replace("the surface has no CRS", "no CRS was asked for")
    return Area(polygon, target, boundary.name, note, boundary.piles or _parts(polygon))


def with_piles(area: Area, source: str) -> Area:
    """The area with the piles of another source, in its own CRS.

    Raises
    ------
    InputError
        As `read_area`.
    """
    found = read_area(source, area.crs)
    return replace(area, piles=found.piles or ((found.name, found.polygon),))


def _parts(polygon: BaseGeometry) -> tuple[tuple[str, BaseGeometry], ...]:
    """The polygons of a text that holds several, numbered; none of a single one."""
    parts = shapely.get_parts(polygon).tolist()
    return tuple((f"{k}", part) for k, part in enumerate(parts, start=1)) if len(parts) > 1 else ()


def _own_crs(source: str) -> str | None:
    """The CRS that a file or a text names, None where it does not."""
    if source.lstrip().upper().startswith("SRID="):
        return srid_of_wkt(source)
    path = Path(source)
    suffix = path.suffix.lower()
    if suffix == ".gpkg":
        return next((srs for _, srs, _ in read_geopackage(path)), None)
    if suffix in (".geojson", ".json"):
        name, features = read_geojson(path)
        stated = stated_crs(crs_of_name(name))
        return stated or (LON_LAT if _like_degrees(features) else None)
    if suffix in ENDINGS:
        return polygon_layer(read_layers(path), path).crs
    if suffix in VECTOR_ENDINGS:
        return None
    return srid_of_wkt(path.read_text(encoding="utf-8-sig")) if _is_text(path) else None


def _is_text(path: Path) -> bool:
    try:
        return path.is_file() and path.stat().st_size < 50_000_000 and bool(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return False


def _like_degrees(features: Sequence[GeoJsonFeature]) -> bool:
    flat = [np.asarray(ring, dtype=float)[:, :2] for one in features for ring in _rings(one.coordinates)]
    return bool(flat) and bool((np.abs(np.concatenate(flat)) <= [180.0, 90.0]).all())


def _rings(coordinates: Any) -> list[Any]:
    """Lists of places within nested lists."""
    if not isinstance(coordinates, list | tuple) or not coordinates:
        return []
    first = coordinates[0]
    if isinstance(first, list | tuple) and first and isinstance(first[0], int | float):
        return [coordinates]
    return [ring for part in coordinates for ring in _rings(part)]


def _metric(own: str, source: str) -> str:
    """The system itself, or the UTM zone of an area in degrees."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    from aerotri.coordinates.georeference import utm_on_datum

    try:
        crs = CRS.from_user_input(own)
    except CRSError:
        raise InputError(f"PROJ does not know {own}", "give the area in a CRS with an EPSG code") from None
    if not crs.is_geographic:
        return _refuse_degrees(own)
    # with a code of its own CRS, what is read stays in degrees
    boundary = read_boundary(source, "EPSG:4326")
    lon, lat = boundary.polygon.centroid.coords[0]
    return utm_on_datum("EPSG:4326" if own == LON_LAT else own, lon, lat)


def _refuse_degrees(crs: str) -> str:
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        found = CRS.from_user_input(crs)
    except CRSError:
        raise InputError(f"PROJ does not know {system_in_words(crs)}", "give EPSG:n") from None
    if not found.is_projected or any(axis.unit_name not in ("metre", "meter") for axis in found.axis_info[:2]):
        raise InputError(
            f"{system_in_words(crs)} does not count in metres", "give a projected CRS in metres, such as UTM"
        )
    return f"EPSG:{found.to_epsg()}" if found.to_epsg() else crs
