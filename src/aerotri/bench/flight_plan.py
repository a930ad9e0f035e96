"""What the page of a planned flight shows, from the files of its folder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.bench.json_record import read_record
from aerotri.bench.plain import numbers
from aerotri.conventions import InputError
from aerotri.formats.text.tables import Columns, read_table
from aerotri.rasters.mosaics import bounds_of, read_mosaic

RECORD, REQUEST, WAYPOINTS, SIGMA = "plan.json", "request.json", "waypoints.csv", "sigma_z.tif"
REMEDY = "give the folder that `aerotri plan` wrote, or plan again"
COLUMNS = Columns(
    text=("image", "strip"), numbers=("X", "Y", "Z", "height_above_ground_m", "heading_deg"), free_text=True
)
LAYERS = ("sigma_z", "shared_z", "sigma_x", "sigma_y", "photographs")
"""Bands of sigma_z.tif in their order."""


@dataclass(frozen=True)
class FlightRecord:
    """A plan as its folder has it.

    Parameters
    ----------
    folder : of the plan. outcome : content of plan.json. request : arguments it was made with; empty in an old folder.
    """

    folder: Path
    outcome: Mapping[str, Any]
    request: Mapping[str, Any]


def read_flight(folder: Path) -> FlightRecord:
    """The plan of a folder.

    Raises
    ------
    InputError
        Where a file is missing or damaged.
    """
    outcome = read_record(folder / RECORD, "a plan", REMEDY)
    request = read_record(folder / REQUEST, "a plan", REMEDY) if (folder / REQUEST).is_file() else {}
    return FlightRecord(folder, outcome, request)


def flight_content(record: FlightRecord) -> dict[str, Any]:
    """The map as lists, m from `origin`: area, strips, exposures, footprints, control, and cells with their values.

    Raises
    ------
    InputError
        Where a file is missing or damaged.
    """
    table = _waypoints(record.folder / WAYPOINTS)
    xyz, strip = table.stack("X", "Y", "Z"), table.text["strip"].rows()
    origin = np.round(np.median(xyz[:, :2], axis=0))
    strips, first = np.unique(strip, return_index=True)
    return {
        "origin": origin.tolist(),
        "area": [numbers(ring - origin, 2) for ring in _rings(record)],
        "strips": [{"name": str(name), "line": numbers(xyz[strip == name, :2] - origin, 2)}
                   for name in strips[np.argsort(first)]],
        "exposures": {"name": [str(one) for one in table.text["image"].rows()], "xy": numbers(xyz[:, :2] - origin, 2),
                      "z": numbers(xyz[:, 2], 2), "above": numbers(table.numbers["height_above_ground_m"], 1)},
        "footprints": numbers(_footprints(record, table) - origin, 2),
        "control": [
            {**one, "xy": [one["X"] - origin[0], one["Y"] - origin[1]]} for one in record.outcome.get("control", [])
        ],
        "cells": _cells(record.folder / SIGMA, origin),
    }  # fmt: skip


def _cells(path: Path, origin: np.ndarray) -> dict[str, Any]:
    """Middles (n, 2) m, size and values of the cells of the area."""
    if not path.is_file():
        raise InputError("is missing", REMEDY, path)
    left, _, right, top = bounds_of(path)
    bands = read_mosaic(path)
    if len(bands) != len(LAYERS):
        raise InputError(f"has {len(bands)} bands, not {len(LAYERS)}", REMEDY, path)
    size = (right - left) / bands.shape[2]
    row, column = np.nonzero(bands[0] > 0.0)
    xy = np.column_stack([left + (column + 0.5) * size, top - (row + 0.5) * size]) - origin
    values = {name: numbers(band[row, column].astype(float), 5) for name, band in zip(LAYERS, bands, strict=True)}
    return {"xy": numbers(xy, 2), "size": size, "values": values}


def _footprints(record: FlightRecord, table: Any) -> np.ndarray:
    """(n, 4, 2) m, the formats on level ground at the height below them."""
    camera = record.outcome.get("camera", {})
    try:
        along, across = (0.5 * float(side) / float(camera["focal_length_mm"]) for side in camera["format_mm"])
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        raise InputError("says nothing of the camera", REMEDY, record.folder / RECORD) from None
    heading = np.radians(table.numbers["heading_deg"])
    ahead = np.column_stack([np.sin(heading), np.cos(heading)])
    aside = np.column_stack([ahead[:, 1], -ahead[:, 0]])
    height = table.numbers["height_above_ground_m"][:, None, None]
    corners = np.array([(-along, -across), (along, -across), (along, across), (-along, across)])
    xy = corners[None, :, :1] * ahead[:, None] + corners[None, :, 1:] * aside[:, None]
    return table.stack("X", "Y")[:, None] + height * xy


def _rings(record: FlightRecord) -> list[np.ndarray]:
    """(k, 2) m each: outlines of the area and of its holes; none in a folder that does not tell them."""
    import shapely

    text = record.outcome.get("area", {}).get("wkt", "")
    try:
        parts = shapely.get_parts(shapely.from_wkt(text)) if text else ()
    except shapely.errors.ShapelyError:
        raise InputError("has no polygon as its area", REMEDY, record.folder / RECORD) from None
    return [np.asarray(ring.coords)[:, :2] for one in parts for ring in (one.exterior, *one.interiors)]


def _waypoints(path: Path) -> Any:
    if not path.is_file():
        raise InputError("is missing", REMEDY, path)
    table = read_table(path, COLUMNS)
    table.require("image", "strip", "X", "Y", "Z", "height_above_ground_m", "heading_deg")
    return table
