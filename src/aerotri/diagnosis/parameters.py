"""Rules on unknowns that many rays share: interior orientation, shifts and drifts of GNSS, additional parameters."""

from __future__ import annotations

import numpy as np

from aerotri import of_known
from aerotri.conventions import counted
from aerotri.diagnosis.finding import Finding, critical_of_worst, doubt, graded, times
from aerotri.observations import Camera
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.strategies.parameter_comparison import SIGNIFICANT_T

CHANGED = 0.20
"""Share by which a free principal distance may differ from the one stated; what EXIF says is nearer."""

CORRECTED, GROSS = 4.0, 30.0
"""Correction of a weighted interior element, in its σ."""

SHIFTED = 3.0
"""Least shift of GNSS, in σ of the positions and of the shift together, that is named."""


def of_interior(adjusted: AdjustedBlock) -> list[Finding]:
    """Interior orientation far from what was stated: in σ where it is weighted, in shares where it is free."""
    p, found = adjusted.parameters, []
    for camera in adjusted.block.cameras:
        for k in np.flatnonzero((p.kinds == "interior") & (p.groups == camera.name) & (p.status != "removed")):
            if str(p.names[k]) in camera.interior:
                found += _interior(adjusted, camera, int(k))
    return found


def _interior(adjusted: AdjustedBlock, camera: Camera, k: int) -> list[Finding]:
    p = adjusted.parameters
    name, value = str(p.names[k]), float(p.value[k])
    prior = camera.interior[name]
    change = abs(value - prior.value)
    reason = f"{name} of camera {camera.name} changed from {prior.value:.6g} to {value:.6g} mm"
    if prior.sigma is None:
        share = change / camera.focal_length_mm
        reason += f", by {100.0 * share:.0f} % of the principal distance; nothing holds it"
        grade, expected = graded(share, CHANGED, np.inf), f"{prior.value:.6g} mm within {100 * CHANGED:.0f} %"
    else:
        cofactor = float(p.covariance[k, k]) / adjusted.outcome.sigma0**2
        size = change / np.sqrt(max(prior.sigma**2 - cofactor, 1e-4 * prior.sigma**2))
        reason += f", {times(change / prior.sigma)} its σ"
        grade, expected = graded(float(size), CORRECTED, GROSS), f"{prior.value:.6g} ± {prior.sigma:.2g} mm"
    return doubt(f"{name} of camera {camera.name}", f"{value:.6g} mm", expected, grade, reason)


def of_gnss(adjusted: AdjustedBlock) -> list[Finding]:
    """The largest shift or drift of GNSS, where it is beyond what σ of the positions allow, and what it depends on."""
    p, given = adjusted.parameters, adjusted.block.gnss_ins
    own = np.flatnonzero([str(name).startswith(("gnss.shift_", "gnss.drift_")) for name in p.names])
    if given is None or not len(own):
        return []
    axis = np.array(["XYZ".index(str(p.names[k])[-1]) for k in own])
    reach = np.array([_reach(adjusted) if ".drift_" in str(p.names[k]) else 1.0 for k in own])
    observed = of_known.medians(given.sigma)[axis]
    amount = p.value[own] * reach
    size = np.abs(amount) / np.hypot(observed, p.sigma[own] * reach)
    worst, critical = int(np.argmax(np.nan_to_num(size))), max(SHIFTED, critical_of_worst(len(own)))
    k, letter = own[worst], "XYZ"[axis[worst]]
    what = "drift" if ".drift_" in str(p.names[k]) else "shift"
    during = " within its strip" if what == "drift" else ""
    reason = (
        f"the GNSS {what} in {letter} ({p.groups[k]}) is {amount[worst]:+.3g} m{during}, "
        f"{times(float(size[worst]))} as large as expected from the σ of the positions ({observed[worst]:.3g} m)"
        f"{_with_principal_distance(adjusted, k)}"
    )
    grade = graded(float(size[worst]), critical, np.inf)
    value, expected = f"{amount[worst]:+.3g} m", f"0 ± {observed[worst]:.3g} m"
    return doubt(f"GNSS {what} in {letter}", value, expected, grade, reason)


def _reach(adjusted: AdjustedBlock) -> float:
    """s, half the longest time that a strip took: what turns a drift into a distance."""
    given = adjusted.block.gnss_ins
    if given is None:
        return 0.0
    strips = np.asarray(adjusted.block.images.strip)[given.image]
    timed = np.isfinite(given.time)
    spans = [np.ptp(given.time[timed & (strips == strip)]) for strip in set(strips[timed].tolist())]
    return 0.5 * float(max(spans, default=0.0))


def _with_principal_distance(adjusted: AdjustedBlock, k: int) -> str:
    """The largest correlation of a parameter with a principal distance, in words."""
    p = adjusted.parameters
    lengths = np.flatnonzero((p.names == "focal_length_mm") & (p.status != "removed"))
    if not len(lengths):
        return ""
    r = p.covariance[k, lengths] / (p.sigma[k] * p.sigma[lengths])
    return f"; its correlation with the principal distance is {r[np.argmax(np.abs(r))]:+.2f}"


def of_additional(adjusted: AdjustedBlock) -> list[Finding]:
    """Additional parameters: how many are significant, and whether they can be told apart."""
    p = adjusted.parameters
    rows = (p.kinds == "additional") & np.isin(p.status, ("estimated", "weighted"))
    if not rows.any():
        says = "systematic image errors stay in the block"
        return [Finding("additional parameters", "none", "self-calibration", says, "note")]
    significant = int(np.sum(p.t[rows] > SIGNIFICANT_T))
    limit = adjusted.block.settings.adjustment.correlation_limit
    r = np.abs(np.nan_to_num(p.max_correlation[rows & ~p.is_node]))
    if not len(r):
        return [Finding("additional parameters", f"{rows.sum()} nodes of a field", "–",
                        "whether they help, only check points tell", "good")]  # fmt: skip
    strong = int(np.sum(r > limit))
    return [
        Finding("additional parameters", f"{rows.sum()} estimated, {significant} significant",
                f"significant: t > {SIGNIFICANT_T} (95 %)", "whether they help, only check points tell", "good"),
        Finding("largest correlation of a parameter", f"{r.max():.2f}", f"at most {limit:g}",
                f"{counted(strong, 'parameter is', 'parameters are')} beyond" if strong
                else "the parameters can be told apart",
                "note" if strong else "good"),
    ]  # fmt: skip
