"""The layers of result.gpkg: photographs, strips, points with their σ; what to look at.

Columns are those of the written tables of the same things, in their units; what is added says its own in its name
(``_m``, ``_deg``) or in the reference.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from aerotri.adjustment.track import along_strip, exposure_times, one_an_exposure, order_of_exposure, strips_of_track
from aerotri.deformation.footprints import Footprints
from aerotri.diagnosis import findings
from aerotri.diagnosis.work_list import WorkList
from aerotri.formats.gis.styles import STYLES, qml
from aerotri.formats.results.adjustment import image_columns, point_columns, residual_table
from aerotri.formats.results.evaluation import work_columns
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.outliers import judge_rays
from aerotri.statistics.precision import plan_ellipses
from aerotri.vectors.geopackage_writer import Layer

FEWEST_RESIDUALS, MOST_RESIDUALS = 100, 1000
"""Image points of the layer of largest residuals [C]: all beyond the limit between these bounds."""
ROLES = ("tie", "control", "check")


def footprint_layer(adjusted: AdjustedBlock, found: Footprints) -> Layer:
    """Formats of the photographs on the ground."""
    import shapely

    block, there = adjusted.block, np.array([one is not None for one in found.polygons], dtype=bool)
    cameras = np.array([camera.name for camera in block.cameras])
    polygons = found.polygons[there]
    columns = {
        "image": block.images.names, "camera": cameras[block.images.camera], "strip": block.images.strip,
        "rays": adjusted.images.rays, "is_cut": found.is_cut, "gsd_m": found.gsd, "height_m": found.height,
        "tilt_deg": np.degrees(found.tilt),
    }  # fmt: skip
    chosen = {name: values[there] for name, values in columns.items()} | {"area_m2": shapely.area(polygons)}
    return Layer("footprints", "MULTIPOLYGON", polygons, chosen, text="Photographs on the ground")


def centre_layer(adjusted: AdjustedBlock) -> Layer:
    """Projection centres: a row a photograph, as images.csv; those that were set aside have no place."""
    places = points_at(adjusted.images.centre)
    return Layer(
        "projection_centres", "POINT", places, image_columns(adjusted), True, "Projection centres with their σ"
    )


def strip_layer(adjusted: AdjustedBlock) -> Layer:
    """Lines through the projection centres of strips; where they have no names, as the track turns."""
    import shapely

    lines, rows = [], []
    for name, named, members in strips_in(adjusted.block, adjusted.images.centre):
        centre = adjusted.images.centre[members]
        lines.append(shapely.LineString(centre))
        ends, names = centre[-1] - centre[0], adjusted.block.images.names[members]
        azimuth = float(np.degrees(np.arctan2(ends[0], ends[1]))) % 360.0
        length = float(shapely.length(lines[-1]))
        rows.append((name, named, len(members), length, azimuth, str(names[0]), str(names[-1])))
    kinds = {"strip": str, "is_named": bool, "exposures": int, "length_m": float, "azimuth_deg": float, "first": str,
             "last": str}  # fmt: skip
    columns = {name: np.array([row[k] for row in rows], kind) for k, (name, kind) in enumerate(kinds.items())}
    return Layer("strips", "LINESTRING", lines, columns, True, "Strips, through the projection centres")


def strips_in(block: Block, centre: np.ndarray) -> Iterator[tuple[str, bool, np.ndarray]]:
    """Name, whether it was given, and photographs in their order, one an exposure, of every strip of two or more.

    Parameters
    ----------
    centre : (n, 3) m, the projection centres.
    """
    known = np.flatnonzero(np.isfinite(centre).all(axis=1))
    if not len(known):
        return
    rows = known[one_an_exposure(block, known)[0]]
    strips = block.images.strip.astype(str)
    for name in dict.fromkeys(strips[rows].tolist()):
        own = rows[strips[rows] == name]
        if name and len(own) > 1:
            yield name, True, own[along_strip(centre[own])]
    nameless = rows[strips[rows] == ""]
    if len(nameless) < 2:
        return
    empty = np.full(len(nameless), "")
    time = exposure_times(block)[nameless]
    nameless = nameless[order_of_exposure(centre[nameless], empty, block.images.names[nameless], time)]
    number = strips_of_track(centre[nameless], empty)
    for k in np.unique(number):
        if (number == k).sum() > 1:
            yield f"{k + 1}", False, nameless[number == k]


def roles_of(adjusted: AdjustedBlock) -> np.ndarray:
    """(N,) str of every object point, of `ROLES`."""
    role = np.full(len(adjusted.block.points), ROLES[0], dtype=object)
    role[adjusted.control.point], role[adjusted.check.point] = ROLES[1], ROLES[2]
    return role


def points_table_columns(adjusted: AdjustedBlock) -> dict[str, np.ndarray]:
    """Columns of points.csv, the role of a point, and its error ellipse in plan by the total covariance."""
    a, b, azimuth = plan_ellipses(adjusted.points.total_covariance)
    return point_columns(adjusted) | {
        "role": roles_of(adjusted), "ellipse_a_m": a, "ellipse_b_m": b, "ellipse_azimuth_deg": np.degrees(azimuth),
    }  # fmt: skip


def point_layer(adjusted: AdjustedBlock) -> Layer:
    """Object points: a row a point, as points.csv; those that were set aside have no place."""
    places = points_at(adjusted.points.xyz)
    return Layer("points", "POINT", places, points_table_columns(adjusted), True, "Object points with their σ")


def residual_layer(adjusted: AdjustedBlock) -> Layer:
    """Image points with the largest normalised residuals, the largest first, at their object points."""
    tests, block = judge_rays(adjusted), adjusted.block
    beyond = int((np.abs(tests.w[tests.order]) > tests.limit).sum())
    rows = tests.order[: min(max(beyond, FEWEST_RESIDUALS), MOST_RESIDUALS)]
    table = residual_table(adjusted).take(rows)
    names = ("image", "point", "x", "y", "vx", "vy", "rx", "ry", "wx", "wy", "weight", "status")
    columns = {name: table.column(name).to_numpy() for name in names}
    columns |= {
        "w": tests.w[rows], "axis": np.array(["x", "y"])[tests.axis[rows]], "error_px": tests.estimated_px[rows],
        "limit": np.full(len(rows), tests.limit), "beyond_limit": np.abs(tests.w[rows]) > tests.limit,
    }  # fmt: skip
    text = f"Image points with the largest residuals; {beyond} are beyond the limit"
    places = points_at(adjusted.points.xyz[block.image_points.point[rows]])
    return Layer("largest_residuals", "POINT", places, columns, True, text)


def work_layer(adjusted: AdjustedBlock, work: WorkList) -> Layer:
    """What to look at first, where it is; items about parameters have no place.

    Parameters
    ----------
    adjusted : in the CRS of the block. work : of the same block.
    """
    place = adjusted.points.xyz.copy()
    control = adjusted.block.control
    lost = ~np.isfinite(place[control.point]).all(axis=1)
    place[control.point[lost]] = control.xyz[lost]
    start = adjusted.block.images.centre
    centre = np.where(np.isfinite(adjusted.images.centre), adjusted.images.centre, start)
    places = [_several(place[list(item.points)] if item.points else centre[list(item.images)]) for item in work.items]
    columns = {"number": np.arange(1, len(places) + 1), **work_columns(work)}
    return Layer("work_list", "MULTIPOINT", places, columns, True, "What to look at first, the most urgent first")


def finding_table(adjusted: AdjustedBlock) -> Layer:
    """What the verdict rests on, a table without places.

    Parameters
    ----------
    adjusted : in the frame of the adjustment.
    """
    found = findings(adjusted)
    names = ("quantity", "value", "expected", "says", "level", "grade")
    columns = {name: np.array([str(getattr(one, name)) for one in found], dtype=object) for name in names}
    text = f"The verdict is {adjusted.outcome.verdict}: the numbers it rests on"
    return Layer("findings", "", (), columns, text=text)


def points_at(xyz: np.ndarray) -> np.ndarray:
    """(n,) shapely points with heights, m; None where a coordinate is not known."""
    import shapely

    known = np.isfinite(xyz).all(axis=1)
    out = np.full(len(xyz), None)
    out[known] = shapely.points(xyz[known])
    return out


def _several(xyz: np.ndarray) -> object:
    """A shapely MultiPoint of the known ones of (k, 3) m, None where none is; a height that is not known is 0."""
    import shapely

    known = xyz[np.isfinite(xyz[:, :2]).all(axis=1)]
    return shapely.MultiPoint(np.nan_to_num(known)) if len(known) else None


def with_texts(layers: Sequence[Layer], fields: Mapping[str, Mapping[str, str]]) -> list[Layer]:
    """Layers with what their columns are, by the names of layer and column, and their styles."""
    return [replace(layer, fields=fields[layer.name], style=_style_of(layer)) for layer in layers]


def _style_of(layer: Layer) -> str:
    """Its style for QGIS, '' for a layer without one; photographs are named where the map has room for their names."""
    if layer.name not in STYLES:
        return ""
    return qml(STYLES[layer.name], spacing_of(layer.geometries) if layer.name == "projection_centres" else None)


def spacing_of(places: Sequence[Any] | np.ndarray) -> float | None:
    """m between neighbours of evenly spread places; None for fewer than two."""
    import shapely

    known = [place for place in places if place is not None]
    if len(known) < 2:
        return None
    left, bottom, right, top = shapely.total_bounds(known)
    wide, tall = float(right - left), float(top - bottom)
    return max(float(np.sqrt(wide * tall / len(known))), max(wide, tall) / len(known)) or None
