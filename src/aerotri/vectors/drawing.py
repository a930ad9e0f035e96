"""Lines and outlines of DXF drawings, read by ezdxf."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import shapely

from aerotri.conventions import InputError, regular_file

ARC_M = 0.001
"""How far the corners of a drawn arc may leave it, in units of the drawing [C]: a millimetre."""
METRES = (0, 6)
"""Units of a drawing ($INSUNITS) that are metres, or not stated [L: Autodesk, DXF Reference, HEADER section]."""
UNITS = {
    1: "inches", 2: "feet", 3: "miles", 4: "millimetres", 5: "centimetres", 7: "kilometres", 8: "microinches",
    9: "mils", 10: "yards", 14: "decimetres", 21: "US survey feet",
}  # fmt: skip
"""Names of other units by their number in $INSUNITS."""

T = TypeVar("T")


def lines_of_drawing(path: Path) -> tuple[list[np.ndarray], str]:
    """Lines and polylines (k, 3) of a drawing, and a sentence about its units.

    Raises
    ------
    InputError
    """
    return _of(path, lambda drawing: list(_lines(drawing)), "write the DXF anew, with lines with heights")


def outlines_of_drawing(path: Path) -> tuple[list[tuple[dict[str, Any], shapely.Polygon]], str]:
    """Closed polylines and circles of a drawing as polygons with their `layer`, and a sentence about all else in it.

    Raises
    ------
    InputError
    """
    (outlines, left), note = _of(path, _outlines, "write the DXF anew, with closed polylines")
    counts = ", ".join(f"{number} {kind}" for kind, number in sorted(left.items()))
    unused = f"{path.name}: only closed polylines and circles are outlines; not used: {counts}" if left else ""
    return outlines, "; ".join(text for text in (unused, note) if text)


def _of(path: Path, read: Callable[[Any], T], remedy: str) -> tuple[T, str]:
    import ezdxf

    regular_file(path)
    try:
        drawing = ezdxf.readfile(path)
        return read(drawing), _note_of_units(drawing, path.name)
    except Exception as error:  # ezdxf raises whatever a damaged file leads to
        short = (str(error).splitlines() or [type(error).__name__])[0][:200]
        raise InputError(f"cannot be read: {short}", remedy, path) from error


def _note_of_units(drawing: Any, name: str) -> str:
    unit = int(drawing.header.get("$INSUNITS", 0))
    if unit in METRES:
        return ""
    words = UNITS.get(unit, f"the unit {unit}")
    return f"{name} states {words} as its unit ($INSUNITS {unit}); its coordinates are taken for those of the CRS"


def _lines(drawing: Any) -> Iterator[np.ndarray]:
    from ezdxf.entities import LWPolyline, Polyline

    space = drawing.modelspace()
    for entity in space.query("LINE"):
        yield np.array([entity.dxf.start, entity.dxf.end], dtype=float)
    for entity in space.query("POLYLINE"):
        assert isinstance(entity, Polyline)
        points = np.array([vertex.dxf.location for vertex in entity.vertices], dtype=float)
        yield np.vstack([points, points[:1]]) if entity.is_closed else points
    for entity in space.query("LWPOLYLINE"):
        assert isinstance(entity, LWPolyline)
        plan = np.array([(x, y) for x, y, *_ in entity.get_points()], dtype=float).reshape(-1, 2)
        points = np.column_stack([plan, np.full(len(plan), float(entity.dxf.elevation))])
        yield np.vstack([points, points[:1]]) if entity.closed else points


def _outlines(drawing: Any) -> tuple[list[tuple[dict[str, Any], shapely.Polygon]], Counter[str]]:
    """Polygons by their layer, and how many entities of which kind are none."""
    from ezdxf.path import make_path

    outlines, left = [], Counter[str]()
    for entity in drawing.modelspace():
        kind = entity.dxftype()
        # meshes are polylines too
        drawn = make_path(entity) if kind in ("LWPOLYLINE", "CIRCLE") or _is_plain_polyline(entity) else None
        if drawn is None or not drawn.is_closed:
            left[kind] += 1
            continue
        corners = [(place.x, place.y) for place in drawn.flattening(ARC_M)]
        outlines.append(({"layer": str(entity.dxf.layer)}, shapely.Polygon(corners)))
    return outlines, left


def _is_plain_polyline(entity: Any) -> bool:
    return entity.dxftype() == "POLYLINE" and (entity.is_2d_polyline or entity.is_3d_polyline)
