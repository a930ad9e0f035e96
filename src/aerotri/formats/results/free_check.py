"""The content of check_free.json."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.diagnosis.free_verdict import in_words
from aerotri.formats.results.json_text import number_or_none
from aerotri.strategies.free_stages import FreeCheck, Stage, Suspect


def free_check_json(check: FreeCheck) -> dict[str, Any]:
    """A free check as plain values: metres, degrees (attitudes of suspects: rad), null where not known."""
    return {
        "verdict": check.verdict,
        "sentence": in_words(check),
        "sigma0_free": number_or_none(check.stages[0].sigma0),
        "sigma0_full": number_or_none(check.sigma0_full),
        "spread_free": number_or_none(check.spread),
        "rays_beyond": check.beyond,
        "robust": check.robust,
        "stages": [_stage(stage) for stage in check.stages],
        "transformation": _similarity(check),
        "position_offset_m": None if check.position_offset is None else [float(v) for v in check.position_offset],
    }


def _stage(stage: Stage) -> dict[str, Any]:
    return {
        "name": stage.name,
        "status": stage.status,
        "message": stage.message,
        "sigma0": number_or_none(stage.sigma0),
        "vtpv": number_or_none(stage.vtpv),
        "redundancy": stage.redundancy,
        "added_observations": stage.added,
        "ratio": number_or_none(stage.ratio),
        "limit": number_or_none(stage.limit),
        "largest_w": number_or_none(stage.largest_w),
        "w_limit": number_or_none(stage.w_limit),
        "fits": stage.fits if stage.tested else None,
        "suspects": [_suspect(suspect) for suspect in stage.suspects],
    }


def _suspect(suspect: Suspect) -> dict[str, Any]:
    return {
        "kind": suspect.kind,
        "name": suspect.name,
        "component": suspect.component,
        "w": number_or_none(suspect.w),
        "error": number_or_none(suspect.error),
        "error_px": number_or_none(suspect.error_px),
    }


def _similarity(check: FreeCheck) -> dict[str, Any] | None:
    s = check.similarity
    if s is None:
        return None
    points = [
        {"point": str(name)} | {f"d{axis}": number_or_none(value) for axis, value in zip("XYZ", row, strict=True)}
        for name, row in zip(check.point, s.residual, strict=True)
    ]
    return {
        "translation_m": [float(value) for value in s.translation],
        "rotation_deg": [float(value) for value in np.degrees(s.rotation)],
        "scale_ppm": (s.scale - 1.0) * 1e6,
        "redundancy": s.redundancy,
        "rms": {axis: number_or_none(value) for axis, value in zip("XYZ", s.rms, strict=True)},
        "points": points,
    }
