"""A plan as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.formats.results.json_text import number_or_none
from aerotri.planning.plan import PlanRecord, shortest_interval
from aerotri.simulation.flight import format_along_across_mm
from aerotri.version import __version__


def plan_json(r: PlanRecord) -> dict[str, Any]:
    """The content of plan.json."""
    o = r.options
    return {
        "aerotri": __version__,
        "area": {
            "name": r.area.name,
            "crs": r.area.crs or "local",
            "size_m2": float(r.area.polygon.area),
            "wkt": r.area.polygon.wkt,
        },
        "ground": r.ground.name,
        "camera": {
            "name": r.camera.name,
            "size_px": list(r.camera.size_px),
            "pixel_um": float(r.camera.pixel_um),
            "focal_length_mm": float(r.camera.interior["focal_length_mm"].value),
            "format_mm": list(format_along_across_mm(r.camera)),
        },
        "asked": {
            "gsd_m": o.gsd,
            "forward_overlap": o.forward_overlap,
            "side_overlap": o.side_overlap,
            "cross_strips": o.cross_strips,
            "height_mode": o.height_mode,
            "rays": o.rays,
            "speed_m_s": o.speed,
            "turn_s": o.turn,
            "positions_sigma_m": list(o.positions_sigma or ()),
            "control_sigma_m": list(o.control_sigma),
            "tie_points": o.tie_points,
            "tie_probability": o.probability,
            "image_sigma_px": o.image_sigma,
            "self_calibration": o.self_calibration,
        },
        "flight": flight_json(r),
        "accuracy": accuracy_json(r),
        "target": None if r.target is None else {
            "kind": r.target.kind, "value": r.target.value, "unit": r.target.unit, "predicted": r.judged,
            "met": bool(r.met),
        },
        "piles": [
            {"name": one.name, "area_m2": one.area, "sigma_m3": one.sigma, "places": len(one.points)} for one in r.piles
        ],
        "control": _control_json(r),
        "warnings": list(r.warnings),
    }  # fmt: skip


def flight_json(r: PlanRecord) -> dict[str, Any]:
    """Numbers of the flight."""
    f, seen = r.flight, r.seen
    return {
        "strips": len(f.strips),
        "photographs": len(f),
        "direction_deg": float(np.degrees(f.axis)),
        "length_m": f.length,
        "time_s": float(f.time[-1]),
        "altitude_m": [float(f.centre[:, 2].min()), float(f.centre[:, 2].max())],
        "shortest_interval_s": number_or_none(shortest_interval(f)),
        "gsd_m": list(seen.gsd),
        "forward_overlap": float(seen.forward),
        "side_overlap": float(seen.side),
        "least_rays": int(seen.rays.min()),
    }


def accuracy_json(r: PlanRecord) -> dict[str, Any]:
    """Accuracy to be expected over the area."""
    horizontal, vertical = r.quality.rmse
    z = r.sigma[:, 2]
    return {
        "ground_points": len(z),
        "cell_m": r.step,
        "rmse_h_m": horizontal,
        "rmse_v_m": vertical,
        "sigma_z_median_m": float(np.median(z)),
        "sigma_z_95_m": float(np.quantile(z, 0.95)),
        "sigma_z_largest_m": float(z.max()),
        "shared_z_95_m": float(np.quantile(r.deformation[:, 2], 0.95)),
        "largest_mode_share": float(r.mode_share),
        "sigma_volume_m3": r.volume_sigma,
    }


def _control_json(r: PlanRecord) -> list[dict[str, Any]]:
    given = len(r.control) - len(r.added)
    out = []
    for k, (name, xyz) in enumerate(zip(r.control_names, r.control, strict=True)):
        added = r.added[k - given] if k >= given else None
        out.append({
            "point": name, "X": float(xyz[0]), "Y": float(xyz[1]), "Z": float(xyz[2]), "order": max(k - given + 1, 0),
            "before": None if added is None else number_or_none(added.before),
            "after": None if added is None else number_or_none(added.after),
        })  # fmt: skip
    return out
