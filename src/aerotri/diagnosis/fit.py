"""Rules on how the observations fit their standard deviations."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.ray_status import RayStatus
from aerotri.diagnosis.finding import (
    SIGNIFICANCE,
    Finding,
    chi_square_p,
    critical_of_worst,
    doubt,
    graded,
    sigma0_by_group,
    sigma0_in_image,
    times,
)
from aerotri.quantiles import chi_square_quantile, normal_quantile
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.observation_groups import GroupFit, group_fits

POOR_FIT, NO_FIT = 2.0, 10.0
"""Ratio of residuals to their σ. A σ is seldom known better than by a factor of two; at ten, what was measured and the
model have little to do with each other, whatever the σ."""

NO_GROUP_FIT = 30.0
"""The same of one group. Control carries what a camera without self-calibration does wrong: up to some twenty σ."""

NOTED_FIT = 1.5
"""σ̂0 from which it is to be looked at."""

WORST_OFFENDER, GROSS = 3.0, 30.0
"""Least size, in σ, of a single observation that is named, and the size from which it spoils the block."""

WEAK_REDUNDANCY = 0.1
"""Redundancy number below which an observation counts as nearly uncontrolled [C]: less than a tenth of an error shows
in its own residual."""


def of_status(adjusted: AdjustedBlock) -> list[Finding]:
    """An adjustment that has not converged is no result."""
    o = adjusted.outcome
    if o.status == "converged":
        return []
    return doubt("status", o.status, "converged", "rejected", f"{o.status}: {o.message}")


def of_sigma0(adjusted: AdjustedBlock) -> list[Finding]:
    """σ̂0 against 1: by χ², and by its size."""
    o = adjusted.outcome
    value = f"{o.sigma0:.3f} ({'; '.join([sigma0_in_image(adjusted), *sigma0_by_group(adjusted)])})"
    if o.redundancy < 1 or not np.isfinite(o.sigma0):
        says = "without redundancy nothing can be said"
        reason = f"redundancy {o.redundancy}: nothing controls the observations, σ is not known"
        return [Finding("σ₀", value, "–", says, "attention", "doubtful", reason)]
    low, high = (float(np.sqrt(chi_square_quantile(p, o.redundancy) / o.redundancy)) for p in (0.025, 0.975))
    expected = f"{low:.3f} to {high:.3f} (χ², 95 %) if the a-priori σ are right"
    if o.sigma0 < low:
        return [Finding("σ₀", value, expected, "observations fit better than their a-priori σ: σ too large", "note")]
    if o.sigma0 <= high:
        return [Finding("σ₀", value, expected, "agrees with the a-priori σ", "good")]
    says = "observations fit worse than their a-priori σ: σ too small, or errors not modelled"
    ratio, grade = _overall_ratio(adjusted), "accepted"
    if chi_square_p(o.redundancy * ratio**2, o.redundancy) < SIGNIFICANCE:
        grade = graded(ratio, POOR_FIT, NO_FIT)
    reason = f"σ₀ is {o.sigma0:.3g}: the residuals are {times(ratio)} as large as expected from the stated σ"
    return [Finding("σ₀", value, expected, says, "note" if o.sigma0 < NOTED_FIT else "attention", grade,
                    reason if grade != "accepted" else "")]  # fmt: skip


def _overall_ratio(adjusted: AdjustedBlock) -> float:
    """σ̂0; of a robust adjustment without the gross errors that it turned down and that σ̂0 still knows."""
    groups = group_fits(adjusted)
    if not any(group.robust for group in groups):
        return adjusted.outcome.sigma0
    return float(np.sqrt(sum(group.omega for group in groups) / sum(group.redundancy for group in groups)))


def of_redundancy(adjusted: AdjustedBlock) -> list[Finding]:
    """How well the observations control each other."""
    o = adjusted.outcome
    share = o.redundancy / o.observations if o.observations else float("nan")
    r = adjusted.rays.r[np.isfinite(adjusted.rays.r)]
    weak = int(np.sum(r < WEAK_REDUNDANCY))
    value = f"{o.redundancy} of {o.observations} observations (mean r {share:.2f})"
    expected = "mean r above 0.5: observations control each other"
    says = f"{weak} of {r.size} image coordinates are nearly uncontrolled (r < {WEAK_REDUNDANCY})"
    return [Finding("redundancy", value, expected, says, "good" if share > 0.5 else "attention")]


def of_groups(adjusted: AdjustedBlock) -> list[Finding]:
    """Every group of observations by itself: control, GNSS, INS, conditions, and the worst camera's image points."""
    found = sorted(
        ((ratio, group) for group in group_fits(adjusted) if (ratio := _ratio(group)) >= POOR_FIT),
        key=lambda pair: -pair[0],
    )
    cameras = [pair for pair in found if pair[1].name.startswith("image points")]
    others = [pair for pair in found if pair not in cameras]
    return [finding for ratio, group in cameras[:1] + others for finding in _group(ratio, group)]


def _ratio(group: GroupFit) -> float:
    """Of the residuals to their σ; 0 where it may be chance."""
    freedom = max(group.redundancy, 1.0)
    by_chance = chi_square_p(group.omega, freedom) > SIGNIFICANCE
    return 0.0 if by_chance else float(np.sqrt(group.omega / freedom))


def _group(ratio: float, group: GroupFit) -> list[Finding]:
    grade = graded(ratio, POOR_FIT, NO_GROUP_FIT)
    unit, scale = ("°", np.degrees(1.0)) if group.unit == "rad" else (f" {group.unit}", 1.0)
    value, sigma = f"{group.rms * scale:.3g}{unit}", f"{group.sigma * scale:.3g}{unit}"
    reason = f"{group.name}: residuals of {value} (RMS) are {times(ratio)} as large as expected from their σ of {sigma}"
    return doubt(f"residuals of {group.name}", f"RMS {value}, ratio {ratio:.2g}", f"σ {sigma}", grade, reason)


def of_single_observations(adjusted: AdjustedBlock) -> list[Finding]:
    """The worst control coordinate, position and attitude, where it is worse than the worst of so many may be.

    Against max(1, σ̂0): a block that fits badly everywhere has no single culprit.
    """
    found = []
    control = adjusted.control
    if adjusted.block.settings.adjustment.datum == "control" and len(control):
        names = adjusted.block.points[control.point]
        labels = [f"{axis} of control point {name}" for name in names for axis in "XYZ"]
        v = control.difference
        if control.lone_sigma is not None:
            # a held coordinate has no residual: how far the others would put it from there
            v = np.where(np.isfinite(control.lone_sigma), -control.w * control.lone_sigma, v)
        found += _worst(adjusted, labels, control.w.ravel(), v.ravel(), "m")
    o = adjusted.observations
    if o is not None:
        for group, noun, unit in (("projection centres", "position", "m"), ("attitudes", "attitude", "rad")):
            own = np.flatnonzero(o.group == group)
            labels = [f"{o.component[k]} of the {noun} of photograph {o.label[k]}" for k in own]
            found += _worst(adjusted, labels, o.w[own], o.v[own], unit)
    return found


def _worst(adjusted: AdjustedBlock, labels: list[str], w: np.ndarray, v: np.ndarray, unit: str) -> list[Finding]:
    tested = int(np.isfinite(w).sum())
    if not tested:
        return []
    size = np.abs(np.nan_to_num(w)) / max(1.0, float(np.nan_to_num(adjusted.outcome.sigma0, nan=1.0)))
    k, critical = int(np.argmax(size)), max(WORST_OFFENDER, critical_of_worst(tested))
    amount = f"{np.degrees(v[k]):+.3g}°" if unit == "rad" else f"{v[k]:+.3g} m"
    reason = f"{labels[k]} disagrees with the rest by {amount}, {times(float(size[k]))} its σ"
    expected = f"|w| at most {critical:.1f}, the largest of {tested} by chance"
    return doubt(labels[k], f"{amount}, |w| {size[k]:.2g}", expected, graded(float(size[k]), critical, GROSS), reason)


MANY_LARGE = (
    "more than chance leaves: look at the largest residuals. Possible causes: wrong matches, and points that move from "
    "photograph to photograph, such as shadows, water and vehicles. The coordinates of such points err by more than "
    "their σ"
)


def of_large_residuals(adjusted: AdjustedBlock) -> list[Finding]:
    """Image coordinates beyond the test, and how many chance leaves there."""
    settings = adjusted.block.settings.adjustment
    critical = -normal_quantile(settings.alpha / 2.0)
    w = np.abs(adjusted.rays.w[adjusted.rays.status == RayStatus.USED])
    w = w[np.isfinite(w)]
    beyond = int(np.sum(w > critical))
    chance = settings.alpha * w.size
    largest = f", largest {w.max():.1f}" if w.size else ""
    level = "good" if beyond <= chance + 3.0 * np.sqrt(chance) + 1.0 else "attention"
    says = "as many as chance leaves" if level == "good" else MANY_LARGE
    return [Finding(f"image coordinates with |w| > {critical:.2f}", f"{beyond} of {w.size}{largest}",
                    f"about {chance:.0f} by chance (α = {100 * settings.alpha:g} %)", says, level)]  # fmt: skip
