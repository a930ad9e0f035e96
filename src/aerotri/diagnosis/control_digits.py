"""Whether the coordinates of the control points have as many digits as their σ need."""

from __future__ import annotations

import numpy as np

from aerotri.diagnosis.finding import Finding, doubt, times
from aerotri.results.adjusted_block import AdjustedBlock

FEWEST = 4
"""Coordinates of one axis below which their common last digit may be chance: one in 10⁴ of four has a zero more."""
STEPS_M = (1.0, 0.1, 0.01)
"""Last digits looked for, m."""
READ = 1e-3
"""Share of a step within which a coordinate counts as a multiple of it: rounding of computed coordinates."""
SEEN = 0.5
"""Share of a rounding error that the control points have to be off by (RMS, redundancy taken into account): marks that
were set out at round coordinates are not."""


def of_digits(adjusted: AdjustedBlock) -> list[Finding]:
    """Coordinates rounded so much that the rounding alone is larger than their σ."""
    control, given = adjusted.block.control, adjusted.control
    if adjusted.block.settings.adjustment.datum != "control" or len(given) < FEWEST:
        return []
    row = {int(point): k for k, point in enumerate(control.point) if not control.is_check[k]}
    rows = [row[int(point)] for point in given.point if int(point) in row]
    if len(rows) != len(given):
        return []
    found = [
        _axis(control.xyz[rows, k], control.sigma[rows, k], given.difference[:, k], given.r[:, k]) for k in range(3)
    ]
    rounded = [("XYZ"[k], *one) for k, one in enumerate(found) if one is not None]
    if not rounded:
        return []
    axes, step, sigma = "".join(axis for axis, *_ in rounded), rounded[0][1], rounded[0][2]
    rounding = step / np.sqrt(12.0)
    reason = (
        f"{' and '.join(axes)} of all control points are rounded to {step:g} m. Rounding alone is an error of "
        f"{rounding:.3g} m, {times(rounding / sigma)} the stated σ of {sigma:.3g} m. Give the coordinates with all "
        f"their digits, or a σ that contains the rounding"
    )
    return doubt("digits of the control points", f"multiples of {step:g} m", f"σ {sigma:.3g} m", "doubtful", reason)


def _axis(xyz: np.ndarray, sigma: np.ndarray, v: np.ndarray, r: np.ndarray) -> tuple[float, float] | None:
    """The step that all coordinates of an axis are multiples of and their median σ, where the step is too large."""
    known = np.isfinite(xyz) & np.isfinite(v) & (sigma > 0.0)
    if known.sum() < FEWEST or np.ptp(xyz[known]) == 0.0:
        return None
    xyz, sigma, v, r = xyz[known], sigma[known], v[known], r[known]
    step = next((s for s in STEPS_M if (np.abs(xyz / s - np.round(xyz / s)) < READ).all()), None)
    if step is None or step / np.sqrt(12.0) <= float(np.median(sigma)):
        return None
    off = float(np.sqrt(np.sum(v**2) / max(float(np.sum(r)), 1e-9)))
    return (step, float(np.median(sigma))) if off > SEEN * step / np.sqrt(12.0) else None
