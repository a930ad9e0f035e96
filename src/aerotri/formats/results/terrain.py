"""Surfaces and their comparison for machines: dtm.json, compare.json."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from aerotri.terrain.compare import Comparison
from aerotri.terrain.dtm import TerrainOutcome, base_ratio
from aerotri.terrain.picket_status import PicketStatus
from aerotri.version import __version__


def terrain_json(outcome: TerrainOutcome, block: str, crs: str) -> dict[str, Any]:
    """The content of dtm.json."""
    o, p = outcome, outcome.pickets
    count = np.bincount(p.status, minlength=len(PicketStatus))
    holes = count[PicketStatus.LOW_CORRELATION : PicketStatus.BACKWARD]
    own = p.accepted
    matching, adjustment = p.covariance[own, 2, 2], o.adjustment[own, 2]
    seen = int(len(p) - count[1])
    pixel = 1.0 / o.photographs.sensor[0, 2]
    return {
        "aerotri": __version__, "block": block, "crs": crs, "photographs": len(p.names),
        "gsd_m": float(np.median(o.photographs.gsd)), "interval_m": o.interval, "interval_source": o.interval_source,
        "cell_m": o.cell,
        "pickets": {
            "nodes": len(p), "seen": seen, "accepted": int(own.sum()), "errors": int(p.errors.sum()),
            "stepped_aside": int((own & (p.tries > 0)).sum()), "holes": int(holes.sum()),
            "rays_mean": float((p.photographs[own] >= 0).sum(axis=1).mean()),
        },
        "status": {status.text: int(n) for status, n in zip(PicketStatus, count, strict=True)},
        "sigma_Z_m": {
            "median": float(np.nanmedian(np.sqrt(matching + adjustment))),
            "matching": float(np.median(np.sqrt(matching))),
            "adjustment": float(np.nanmedian(np.sqrt(adjustment))), "interpolation": o.interpolation,
        },
        "ray_sigma_px": float(_ray_sigma_mm(o) / pixel), "sigma0_rays": float(np.nan_to_num(p.sigma0)),
        "ground_share": float(o.ground[own].mean()),
    }  # fmt: skip


def _ray_sigma_mm(o: TerrainOutcome) -> float:
    """Median σ of a matched image coordinate along the base, from σ of the heights: σ_Z·b/h·c/h/√2."""
    p = o.pickets
    own = p.accepted
    height = np.median(o.photographs.centres[:, 2]) - np.median(p.xyz[own, 2])
    sigma = np.median(np.sqrt(p.covariance[own, 2, 2])) * base_ratio(o.photographs, p)
    return float(sigma * np.median(o.photographs.orientation.interior[:, 0]) / height / np.sqrt(2.0))


def comparison_json(found: Comparison, test: str, control: str, method: str) -> dict[str, Any]:
    """The content of compare.json."""
    a = found.alignment
    moved = None
    if a is not None:
        moved = {"kind": a.kind, "shift_m": a.shift.tolist(), "rotation_rad": a.rotation.tolist(),
                 "about_m": a.middle.tolist()}  # fmt: skip
    return {
        "aerotri": __version__, "test": test, "control": control, "method": method, "cell_m": found.grid.cell_x,
        "difference_m": asdict(found.statistics), "coverage": found.coverage, "alignment": moved,
    }  # fmt: skip
