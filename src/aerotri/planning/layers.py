"""A plan as layers of a GeoPackage, as KML, as a table of waypoints and as a raster."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from aerotri.planning.plan import PlanRecord
from aerotri.rasters.grids import Grid
from aerotri.simulation.flight import format_along_across_mm
from aerotri.vectors.geopackage_writer import Layer

BANDS = (
    "sigma Z (m)", "sigma Z, part that neighbours share (m)", "sigma X (m)", "sigma Y (m)", "photographs",
)  # fmt: skip
"""Of sigma_z.tif."""
NAMESPACE = "http://www.opengis.net/kml/2.2"


def plan_layers(r: PlanRecord) -> list[Layer]:
    """Area, strips, exposures, footprints, and control in the order of its gain."""
    import shapely

    f = r.flight
    area = Layer("area", r.area.polygon.geom_type.upper(), [r.area.polygon], {"name": np.array([r.area.name])},
                 text="Area of the plan")  # fmt: skip
    lines = [shapely.LineString(f.centre[own]) if len(own) > 1 else None for own in f.strips]
    strips = Layer(
        "strips", "LINESTRING", lines,
        {"strip": np.array([str(f.strip[own[0]]) for own in f.strips]),
         "exposures": np.array([len(own) for own in f.strips]),
         "altitude_m": np.array([f.centre[own[0], 2] for own in f.strips]),
         "heading_deg": np.array([np.degrees(f.heading[own[0]]) for own in f.strips]),
         "length_m": np.array([float(np.linalg.norm(f.centre[own[-1]] - f.centre[own[0]])) for own in f.strips])},
        True, "Strips in the order flown",
    )  # fmt: skip
    exposures = Layer(
        "exposures", "POINT", np.asarray(shapely.points(f.centre)), exposure_columns(r), True, "Exposures in order"
    )
    prints = Layer("footprints", "POLYGON", _footprints(r), {"image": f.names, "strip": f.strip},
                   text="Photographs on level ground at the height below them")  # fmt: skip
    return [area, strips, exposures, prints, _control_layer(r)]


def exposure_columns(r: PlanRecord) -> dict[str, np.ndarray]:
    """Columns of the exposures beside their place."""
    f = r.flight
    return {
        "image": f.names, "strip": f.strip, "altitude_m": f.centre[:, 2], "height_above_ground_m":
        f.centre[:, 2] - f.ground, "heading_deg": np.degrees(f.heading), "time_s": f.time,
    }  # fmt: skip


def _control_layer(r: PlanRecord) -> Layer:
    import shapely

    given = len(r.control) - len(r.added)
    before = np.array([np.nan] * given + [one.before for one in r.added])
    after = np.array([np.nan] * given + [one.after for one in r.added])
    order = np.array([0] * given + list(range(1, len(r.added) + 1)), dtype=np.int64)
    columns = {"point": np.array(r.control_names, dtype=str), "order": order, "before": before, "after": after}
    points = np.asarray(shapely.points(r.control)) if len(r.control) else np.array([], dtype=object)
    fields = {"order": "0: control that was given", "before": "quantity judged by without it, m or m³",
              "after": "quantity judged by with it, m or m³"}  # fmt: skip
    return Layer("control", "POINT", points, columns, True, "Control points, in the order of their gain", fields)


def _footprints(r: PlanRecord) -> list[Any]:
    import shapely

    f, focal = r.flight, r.camera.interior["focal_length_mm"].value
    along, across = (0.5 * side / focal for side in format_along_across_mm(r.camera))
    corners = np.array([(-along, -across), (along, -across), (along, across), (-along, across)])
    ahead = np.column_stack([np.sin(f.heading), np.cos(f.heading)])
    aside = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    height = (f.centre[:, 2] - f.ground)[:, None, None]
    xy = corners[None, :, :1] * ahead[:, None] + corners[None, :, 1:] * aside[:, None]
    return [shapely.Polygon(one) for one in f.centre[:, None, :2] + height * xy]


def geographic(r: PlanRecord, xy: np.ndarray) -> np.ndarray | None:
    """(n, 2) longitude and latitude on WGS 84; None without a CRS."""
    if r.area.crs is None:
        return None
    from pyproj import Transformer

    found = Transformer.from_crs(r.area.crs, "OGC:CRS84", always_xy=True).transform(xy[:, 0], xy[:, 1])
    return np.column_stack(found)


def waypoints_text(r: PlanRecord) -> str:
    """The table of waypoints; longitude and latitude are empty without a CRS."""
    f, degrees = r.flight, geographic(r, r.flight.centre[:, :2])
    rows = ["image,strip,X,Y,Z,longitude,latitude,height_above_ground_m,heading_deg,time_s"]
    for k in range(len(f)):
        place = ",," if degrees is None else f",{degrees[k, 0]:.9f},{degrees[k, 1]:.9f}"
        x, y, z = f.centre[k]
        rows.append(
            f"{f.names[k]},{f.strip[k]},{x:.3f},{y:.3f},{z:.3f}{place},{z - f.ground[k]:.2f},"
            f"{np.degrees(f.heading[k]) % 360.0:.3f},{f.time[k]:.2f}"
        )
    return "\n".join(rows) + "\n"


def kml_text(r: PlanRecord) -> str | None:
    """Area, strips, exposures and control as KML; None without a CRS."""
    degrees = geographic(r, r.flight.centre[:, :2])
    if degrees is None:
        return None
    f = r.flight
    strips = [
        _placemark(f"strip {f.strip[own[0]]}", "LineString", _coordinates(degrees[own], f.centre[own, 2]))
        for own in f.strips if len(own) > 1
    ]  # fmt: skip
    exposures = [
        _placemark(str(f.names[k]), "Point", _coordinates(degrees[k : k + 1], f.centre[k : k + 1, 2]),
                   f"heading {np.degrees(f.heading[k]) % 360.0:.1f} deg")
        for k in range(len(f))
    ]  # fmt: skip
    control = []
    if len(r.control):
        places = geographic(r, r.control[:, :2])
        assert places is not None
        control = [_placemark(name, "Point", _coordinates(places[k : k + 1], r.control[k : k + 1, 2]))
                   for k, name in enumerate(r.control_names)]  # fmt: skip
    parts = [_folder("area", [_area_placemark(r)]), _folder("strips", strips), _folder("exposures", exposures),
             _folder("control", control)]  # fmt: skip
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="{NAMESPACE}">\n<Document>\n<name>'
        f"{escape(_printable(r.area.name))}</name>\n{''.join(parts)}</Document>\n</kml>\n"
    )


def _printable(text: str) -> str:
    return "".join(c for c in text if c.isprintable())


def _coordinates(lon_lat: np.ndarray, z: np.ndarray) -> str:
    return " ".join(f"{x:.9f},{y:.9f},{h:.2f}" for (x, y), h in zip(lon_lat, z, strict=True))


def _placemark(name: str, kind: str, coordinates: str, text: str = "") -> str:
    said = f"<description>{escape(text)}</description>" if text else ""
    return (
        f"<Placemark><name>{escape(_printable(name))}</name>{said}<{kind}><altitudeMode>absolute</altitudeMode>"
        f"<coordinates>{coordinates}</coordinates></{kind}></Placemark>\n"
    )


def _area_placemark(r: PlanRecord) -> str:
    import shapely

    def ring(xy: np.ndarray) -> str:
        found = geographic(r, xy)
        assert found is not None
        text = " ".join(f"{x:.9f},{y:.9f}" for x, y in found)
        return f"<LinearRing><coordinates>{text}</coordinates></LinearRing>"

    polygons = [
        f"<Polygon><outerBoundaryIs>{ring(np.asarray(one.exterior.coords)[:, :2])}</outerBoundaryIs>"
        + "".join(
            f"<innerBoundaryIs>{ring(np.asarray(hole.coords)[:, :2])}</innerBoundaryIs>" for hole in one.interiors
        )
        + "</Polygon>"
        for one in shapely.get_parts(r.area.polygon)
    ]
    return f"<Placemark><name>area</name><MultiGeometry>{''.join(polygons)}</MultiGeometry></Placemark>\n"


def _folder(name: str, parts: list[str]) -> str:
    return f"<Folder><name>{name}</name>\n{''.join(parts)}</Folder>\n"


def write_sigma(r: PlanRecord, path: Path) -> None:
    """The σ of the ground points as a raster, a cell each."""
    from aerotri.rasters.surface_files import write_bands

    left, bottom, right, top = r.area.polygon.bounds
    rows, columns = (max(int(np.ceil(size / r.step)), 1) for size in (top - bottom, right - left))
    grid = Grid(rows, columns, left, top, r.step, r.step)
    row = np.clip(((top - r.ground_points[:, 1]) / r.step).astype(int), 0, rows - 1)
    column = np.clip(((r.ground_points[:, 0] - left) / r.step).astype(int), 0, columns - 1)
    values = r.sigma[:, 2], r.deformation[:, 2], r.sigma[:, 0], r.sigma[:, 1], r.rays.astype(float)
    bands = {}
    for name, of_points in zip(BANDS, values, strict=True):
        bands[name] = np.full((rows, columns), np.nan)
        bands[name][row, column] = of_points
    write_bands(path, bands, grid, r.area.crs)
