"""What a surface or an orthophoto says of the adjustment it was made with."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.formats.results.json_text import number_or_none
from aerotri.results.adjusted_block import AdjustedBlock


def adjusted_json(adjusted: AdjustedBlock) -> dict[str, Any]:
    """Its verdict, the first reason for it, and its control and check points."""
    o, relative = adjusted.outcome, adjusted.relative
    return {
        "verdict": o.verdict, "reason": next(iter(o.reasons), ""), "good_for": o.good_for, "purpose": o.purpose,
        "scale": None if relative is None else number_or_none(relative.scale),
        "control_points": len(adjusted.control), "check_points": len(adjusted.check),
        "rms_check_m": _rms(adjusted.check.difference),
    }  # fmt: skip


def _rms(difference: np.ndarray) -> dict[str, float | None]:
    """Root mean square of X, Y, Z over the check points that have them; None without."""
    known = [d[np.isfinite(d)] for d in difference.T]
    return {
        axis: number_or_none(np.sqrt(np.mean(d**2))) if len(d) else None for axis, d in zip("XYZ", known, strict=True)
    }
