"""The content of accuracy.json."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.diagnosis.accuracy_inspire import inspire_accuracy
from aerotri.diagnosis.accuracy_rules import points_for_area, project_area, reached
from aerotri.diagnosis.accuracy_sentences import STANDARD
from aerotri.formats.results.json_text import number_or_none
from aerotri.results.accuracy import AccuracyRecord, CheckedPoints, CoordinateErrors, Layout


def accuracy_json(r: AccuracyRecord) -> dict[str, Any]:
    """Content of accuracy.json; lengths in m, what is not known is null."""
    area = project_area(r)
    return {
        **r.head.as_dict(), "block": r.block, "verdict": r.verdict, "standard": STANDARD,
        "met": r.met,
        "asked": {"horizontal": r.asked.horizontal, "vertical": r.asked.vertical},
        "reached": {"horizontal": number_or_none(reached(r.rmse_h)), "vertical": number_or_none(reached(r.nva))},
        "accuracy": {
            "RMSE_H": number_or_none(r.rmse_h), "RMSE_V": number_or_none(r.nva), "VVA": number_or_none(r.vva),
            "RMSE_3D": number_or_none(r.rmse_3d),
        },
        "inspire": _inspire(r),
        "coordinates": [_coordinate(one) for one in r.errors],
        "check_points": len(r.points), "control_points": len(r.control_sigma),
        "project_area_km2": None if area is None else area / 1e6,
        "points_for_area": None if area is None else points_for_area(area / 1e6),
        "layout": None if r.layout is None else _layout(r.layout),
        "requirements": [
            {"name": one.name, "source": one.source, "weight": one.weight, "asked": one.asked, "found": one.found,
             "met": one.met, "says": one.says}
            for one in r.requirements
        ],
        "statements": list(r.statements), "warnings": list(r.warnings),
        "suspects": [
            {"point": one.point, "coordinate": one.axis, "error": one.value, "reason": one.reason} for one in r.suspects
        ],
        "points": _points(r.points),
    }  # fmt: skip


def _inspire(r: AccuracyRecord) -> dict[str, Any]:
    one = inspire_accuracy(r)
    numbers = {
        "RMSEP": one.rmse_p, "RMSE_x": one.rmse_x, "RMSE_y": one.rmse_y, "RMSE_z": one.rmse_z,
        "grid_spacing": one.spacing, "contour_interval": one.interval, "scale_denominator": one.scale,
    }  # fmt: skip
    return {name: number_or_none(value) for name, value in numbers.items()}


def _coordinate(one: CoordinateErrors) -> dict[str, Any]:
    numbers = ("mean", "fit", "survey", "rmse", "largest", "skew", "skew_sigma")
    return {
        "coordinate": one.axis, "vegetated": one.vegetated, "count": one.count, "unstated": one.unstated,
        **{name: number_or_none(getattr(one, name)) for name in numbers},
    }  # fmt: skip


def _layout(one: Layout) -> dict[str, Any]:
    return {
        "area_km2": one.area / 1e6, "corners": one.corners.tolist(), "diagonal": one.diagonal,
        "quadrants": one.quadrants.tolist(), "spacing": number_or_none(one.spacing), "crowded": list(one.crowded),
    }  # fmt: skip


def _points(p: CheckedPoints) -> list[dict[str, Any]]:
    def of_axes(start: str, values: np.ndarray) -> dict[str, float | None]:
        return {f"{start}{axis}": number_or_none(v) for axis, v in zip("XYZ", values, strict=True)}

    return [
        {"point": str(p.names[i]), **of_axes("d", p.difference[i]), **of_axes("s", p.sigma[i]),
         "vegetated": bool(p.vegetated[i])}
        for i in range(len(p))
    ]  # fmt: skip
