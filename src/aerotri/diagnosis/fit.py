"""Rules on how the observations and the check points fit their standard deviations."""

from __future__ import annotations

import numpy as np
from scipy.special import gammaincc, ndtri

from aerotri.diagnosis.reason import SIGNIFICANCE, Reason, graded
from aerotri.statistics.adjusted_block import AdjustedBlock
from aerotri.statistics.observation_groups import group_fits

POOR_FIT, NO_FIT = 2.0, 10.0
"""Ratio of residuals to their σ. A σ is seldom known better than by a factor of two; at ten, what was measured and the
model have little to do with each other, whatever the σ."""

WRONG, ABSURD = 3.0, 30.0
"""Least size, in σ, of a single observation that is named, and the size from which it spoils the block."""

CHECK_POOR, CHECK_ABSURD = 2.0, 10.0
"""RMS at check points over what the σ let expect."""


def chi_square_p(statistic: float, freedom: float) -> float:
    """Probability that χ² of `freedom` degrees of freedom exceeds the statistic."""
    return float(gammaincc(freedom / 2.0, statistic / 2.0)) if freedom > 0.0 and statistic >= 0.0 else 1.0


def of_sigma0(adjusted: AdjustedBlock) -> list[Reason]:
    """σ̂0 against 1: by χ², and by its size."""
    o = adjusted.outcome
    if o.redundancy < 1 or not np.isfinite(o.sigma0):
        return [Reason("doubtful", f"redundancy {o.redundancy}: nothing controls the observations, σ is not known")]
    level = graded(o.sigma0, POOR_FIT, NO_FIT)
    if level == "accepted" or chi_square_p(o.redundancy * o.sigma0**2, o.redundancy) > SIGNIFICANCE:
        return []
    return [Reason(level, f"σ₀ is {o.sigma0:.3g}: the residuals are {o.sigma0:.2g} times what the stated σ allow")]


def of_groups(adjusted: AdjustedBlock) -> list[Reason]:
    """Every group of observations by itself: image points by camera, control, GNSS, INS, conditions."""
    reasons = []
    for group in group_fits(adjusted):
        freedom = max(group.redundancy, 1.0)
        ratio = float(np.sqrt(group.omega / freedom))
        level = graded(ratio, POOR_FIT, NO_FIT)
        if level != "accepted" and chi_square_p(group.omega, freedom) < SIGNIFICANCE:
            unit, scale = ("°", np.degrees(1.0)) if group.unit == "rad" else (f" {group.unit}", 1.0)
            sentence = (
                f"{group.name}: the residuals (RMS {group.rms * scale:.3g}{unit}) are {ratio:.2g} times what their "
                f"σ of {group.sigma * scale:.3g}{unit} allow"
            )
            reasons.append(Reason(level, sentence))
    return reasons


def of_single_observations(adjusted: AdjustedBlock) -> list[Reason]:
    """The worst control coordinate, position and attitude, where it is worse than the worst of so many may be.

    Tests are against max(1, σ̂0): a block that fits badly everywhere has no single culprit.
    """
    names, axes = adjusted.block.points[adjusted.control.point], ("X", "Y", "Z")
    w, v = adjusted.control.w, adjusted.control.difference
    reasons = []
    if adjusted.block.settings.adjustment.datum == "control" and w.size:
        labels = [f"control point {name}: {axis}" for name in names for axis in axes]
        reasons += _worst(adjusted, labels, w.ravel(), v.ravel(), "m")
    o = adjusted.observations
    if o is not None:
        for group, noun, unit in (("projection centres", "position", "m"), ("attitudes", "attitude", "rad")):
            own = np.flatnonzero(o.group == group)
            labels = [f"{noun} of photograph {o.label[k]}: {o.component[k]}" for k in own]
            reasons += _worst(adjusted, labels, o.w[own], o.v[own], unit)
    return reasons


def _worst(adjusted: AdjustedBlock, labels: list[str], w: np.ndarray, v: np.ndarray, unit: str) -> list[Reason]:
    size = np.abs(np.nan_to_num(w)) / max(1.0, float(np.nan_to_num(adjusted.outcome.sigma0, nan=1.0)))
    tested = int(np.isfinite(w).sum())
    if not tested:
        return []
    k = int(np.argmax(size))
    critical = max(WRONG, float(-ndtri(SIGNIFICANCE / (2.0 * tested))))
    level = graded(float(size[k]), critical, ABSURD)
    if level == "accepted":
        return []
    amount = f"{np.degrees(v[k]):+.3g}°" if unit == "rad" else f"{v[k]:+.3g} m"
    return [Reason(level, f"{labels[k]} is corrected by {amount}, {size[k]:.2g} times its σ")]


def of_check_points(adjusted: AdjustedBlock) -> list[Reason]:
    """Check points against σ of the adjusted and the given coordinates together."""
    d, w = adjusted.check.difference, adjusted.check.w
    tested = np.isfinite(w)
    if not tested.any():
        return []
    statistic, n = float(np.sum(w[tested] ** 2)), int(tested.sum())
    ratio = float(np.sqrt(statistic / n))
    level = graded(ratio, CHECK_POOR, CHECK_ABSURD)
    if level == "accepted" or chi_square_p(statistic, n) > SIGNIFICANCE:
        return []
    rms = float(np.sqrt(np.mean(d[tested] ** 2)))
    return [Reason(level, f"check points: RMS {rms:.3g} m a coordinate, {ratio:.2g} times what the σ let expect")]
