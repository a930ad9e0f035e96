"""An adjusted block as an item of a STAC catalogue [L: STAC 1.0.0, projection 2.0.0, processing 1.2.0]."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import InputError, real_path
from aerotri.crs_text import plan_of
from aerotri.deformation.footprints import Footprints
from aerotri.formats.results.json_text import number_or_none
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.version import __version__

EXTENSIONS = (
    "https://stac-extensions.github.io/projection/v2.0.0/schema.json",
    "https://stac-extensions.github.io/processing/v1.2.0/schema.json",
)
MEDIA_TYPES = {
    ".csv": "text/csv", ".gpkg": "application/geopackage+sqlite3", ".html": "text/html", ".json": "application/json",
    ".laz": "application/vnd.laszip", ".parquet": "application/vnd.apache.parquet", ".png": "image/png",
    ".tif": "image/tiff; application=geotiff",
}  # fmt: skip
CLOUD_OPTIMISED = "; profile=cloud-optimized"
ROLES = {".html": "overview", ".json": "metadata", ".png": "overview"}
"""Of files by their ending; others are data."""
SIMPLIFIED = 1e-3
"""By which the outline may be off, in diagonals of the block [C]: catalogues need no more."""
DECIMALS = 7
"""Of longitudes and latitudes: a centimetre."""
DATE_REMEDY = "give a date such as 2026-05-17, or a time such as 2026-05-17T10:30:00Z"


@dataclass(frozen=True)
class Asset:
    """A file of the catalogue's item. path : of it. key : its name there. title : what it is."""

    path: Path
    key: str
    title: str
    cloud_optimised: bool = False


def stac_item(
    adjusted: AdjustedBlock, found: Footprints, place: Path, assets: Sequence[Asset], made: datetime, flown: str = ""
) -> dict[str, Any]:
    """The item.

    Parameters
    ----------
    adjusted : in its CRS. found : its footprints. place : the folder that the item will lie in.
    made : when the result was written. flown : date or time of the flight, '' where unknown.

    Raises
    ------
    InputError
        For a block in local coordinates, and for a date that is none.
    """
    import shapely

    outline = _outline(adjusted, found)
    geometry = in_degrees(outline, adjusted.block.crs)
    return {
        "type": "Feature", "stac_version": "1.0.0", "stac_extensions": list(EXTENSIONS),
        "id": str(adjusted.block.name), "geometry": shapely.geometry.mapping(geometry), "bbox": _bbox(geometry),
        "properties": {
            **_times(made, flown), "title": str(adjusted.block.name),
            "description": "Adjusted block of aerial photographs (bundle block adjustment with self-calibration)",
            "instruments": [camera.name for camera in adjusted.block.cameras],
            **({"gsd": float(np.nanmedian(found.gsd))} if np.isfinite(found.gsd).any() else {}),
            **_projection(adjusted.block.crs, outline.bounds), "processing:software": {"aerotri": __version__},
            **_outcome(adjusted),
        },
        "links": [], "assets": {asset.key: _asset(asset, place) for asset in assets},
    }  # fmt: skip


def in_degrees(outline: Any, crs: str) -> Any:
    """A shapely MultiPolygon in longitude and latitude on WGS 84, cut at 180° where it reaches over.

    Raises
    ------
    InputError
        For local coordinates.
    """
    import shapely
    from pyproj import Transformer

    if crs == "local":
        raise InputError(
            "the block has local coordinates, STAC needs longitude and latitude",
            'write crs = "EPSG:n" in block.toml where the coordinates are of a known system, and adjust it again',
        )
    transformer = Transformer.from_crs(plan_of(crs), "EPSG:4326", always_xy=True)
    turned = shapely.transform(outline, lambda xy: np.column_stack(transformer.transform(xy[:, 0], xy[:, 1])))
    west, _, east, _ = turned.bounds
    parts = [turned]
    if east - west > 180.0:
        whole = shapely.transform(turned, lambda xy: np.column_stack([xy[:, 0] % 360.0, xy[:, 1]]))
        beyond = shapely.intersection(whole, shapely.box(180.0, -90.0, 360.0, 90.0))
        parts = [shapely.intersection(whole, shapely.box(0.0, -90.0, 180.0, 90.0)),
                 shapely.transform(beyond, lambda xy: xy - (360.0, 0.0))]  # fmt: skip
    polygons = [one for part in parts for one in shapely.get_parts(part) if one.geom_type == "Polygon"]
    rounded = shapely.transform(shapely.MultiPolygon(polygons), lambda xy: np.round(xy, DECIMALS))
    return shapely.orient_polygons(rounded, exterior_cw=False)


def _bbox(geometry: Any) -> list[float]:
    """West, south, east, north; west is the larger one where the block lies across 180°."""
    west, south, east, north = geometry.bounds
    if east - west > 180.0:
        bounds = np.array([part.bounds for part in geometry.geoms])
        west, east = bounds[bounds[:, 0] > 0.0, 0].min(), bounds[bounds[:, 2] < 0.0, 2].max()
    return [float(west), float(south), float(east), float(north)]


def _outline(adjusted: AdjustedBlock, found: Footprints) -> Any:
    """The ground that the photographs show, else that between the points."""
    import shapely

    there = [one for one in found.polygons if one is not None]
    if there:
        whole = shapely.union_all(there)
    else:
        xy = np.concatenate([adjusted.points.xyz[:, :2], adjusted.images.centre[:, :2]])
        whole = shapely.MultiPoint(xy[np.isfinite(xy).all(axis=1)]).convex_hull
    west, south, east, north = whole.bounds
    whole = shapely.simplify(whole, SIMPLIFIED * float(np.hypot(east - west, north - south)))
    return shapely.MultiPolygon([one for one in shapely.get_parts(whole) if one.geom_type == "Polygon"])


def _times(made: datetime, flown: str) -> dict[str, str | None]:
    written = _utc(made)
    if not flown:
        return {"datetime": written, "created": written}
    try:
        when = datetime.fromisoformat(flown)
    except ValueError:
        raise InputError(f"'{flown[:40]}' is no date", DATE_REMEDY) from None
    if len(flown) > len("2026-05-17"):
        return {"datetime": _utc(when if when.tzinfo else when.replace(tzinfo=UTC)), "created": written}
    day = when.strftime("%Y-%m-%d")
    return {
        "datetime": None, "start_datetime": f"{day}T00:00:00Z", "end_datetime": f"{day}T23:59:59Z", "created": written,
    }  # fmt: skip


def _utc(time: datetime) -> str:
    return time.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _projection(crs: str, bounds: Sequence[float]) -> dict[str, Any]:
    from pyproj import CRS

    own = CRS.from_user_input(crs)
    code = own.to_epsg()
    named: dict[str, Any] = {"proj:code": f"EPSG:{code}"} if code else {"proj:code": None, "proj:wkt2": own.to_wkt()}
    return named | {"proj:bbox": [float(value) for value in bounds]}


def _outcome(adjusted: AdjustedBlock) -> dict[str, Any]:
    o, check = adjusted.outcome, adjusted.check.difference
    rms = [float(np.sqrt(np.mean(d[np.isfinite(d)] ** 2))) if np.isfinite(d).any() else None for d in check.T]
    return {
        "aerotri:verdict": o.verdict, "aerotri:good_for": o.good_for,
        "aerotri:reasons": list(o.reasons), "aerotri:sigma0": number_or_none(o.sigma0),
        "aerotri:photographs": int((adjusted.images.rays > 0).sum()),
        "aerotri:points": int(np.isfinite(adjusted.points.xyz[:, 0]).sum()),
        "aerotri:control_points": len(adjusted.control), "aerotri:check_points": len(adjusted.check),
        **{f"aerotri:check_rms_{axis}_m": value for axis, value in zip("XYZ", rms, strict=True)},
    }  # fmt: skip


def _asset(asset: Asset, place: Path) -> dict[str, Any]:
    ending = asset.path.suffix.lower()
    media = MEDIA_TYPES.get(ending, "application/octet-stream") + (CLOUD_OPTIMISED if asset.cloud_optimised else "")
    href = Path(os.path.relpath(real_path(asset.path), real_path(place))).as_posix()
    return {"href": href, "title": asset.title, "type": media, "roles": [ROLES.get(ending, "data")]}
