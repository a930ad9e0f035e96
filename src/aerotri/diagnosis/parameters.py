"""Rules on unknowns that many rays share: interior orientation, shifts of GNSS."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

from aerotri.diagnosis.reason import SIGNIFICANCE, Reason, graded
from aerotri.statistics.adjusted_block import AdjustedBlock

CHANGED = 0.10
"""Share by which a free principal distance may differ from the one stated; EXIF is right within some per cent."""

SHIFTED, FAR_SHIFTED = 3.0, 30.0
"""Shift of GNSS, in σ of the positions and of the shift together."""


def of_interior(adjusted: AdjustedBlock) -> list[Reason]:
    """Interior orientation far from what was stated: in σ where it is weighted, in shares where it is free."""
    p, reasons = adjusted.parameters, []
    critical = float(-ndtri(SIGNIFICANCE / 2.0))
    for camera in adjusted.block.cameras:
        for k in np.flatnonzero((p.kinds == "interior") & (p.groups == camera.name)):
            name = str(p.names[k])
            prior = camera.interior.get(name)
            if prior is None or p.status[k] == "removed":
                continue
            change = float(p.value[k] - prior.value)
            stated = f"{name} of camera {camera.name} changed from {prior.value:.6g} to {p.value[k]:.6g} mm"
            if prior.sigma is not None:
                variance = max(prior.sigma**2 - float(p.covariance[k, k]) / adjusted.outcome.sigma0**2, 1e-30)
                size = abs(change) / np.sqrt(variance)
                level = graded(float(size), max(critical, 4.0), 30.0)
                sentence = f"{stated}, {abs(change) / prior.sigma:.2g} times its σ"
            else:
                scale = prior.value if name == "focal_length_mm" else camera.focal_length_mm
                size = abs(change) / scale
                level = graded(float(size), CHANGED, np.inf)
                sentence = f"{stated}, {100.0 * size:.0f} % of the principal distance, and nothing holds it"
            if level != "accepted":
                reasons.append(Reason(level, sentence))
    return reasons


def of_gnss_shifts(adjusted: AdjustedBlock) -> list[Reason]:
    """Shifts of GNSS beyond what σ of the positions allow; with what they are correlated."""
    p, given = adjusted.parameters, adjusted.block.gnss_ins
    own = np.flatnonzero([str(name).startswith("gnss.shift_") for name in p.names])
    if given is None or not len(own):
        return []
    observed = np.nanmedian(given.sigma, axis=0)
    axis = np.array(["XYZ".index(str(p.names[k])[-1]) for k in own])
    variance = observed[axis] ** 2 + np.diagonal(p.covariance)[own]
    size = np.abs(p.value[own]) / np.sqrt(variance)
    worst = int(np.argmax(np.nan_to_num(size)))
    critical = max(SHIFTED, float(-ndtri(SIGNIFICANCE / (2.0 * len(own)))))
    level = graded(float(size[worst]), critical, np.inf)
    if level == "accepted":
        return []
    k = own[worst]
    sentence = (
        f"the GNSS shift in {'XYZ'[axis[worst]]} ({p.groups[k]}) is {p.value[k]:+.3g} m, {size[worst]:.2g} times what "
        f"the σ of the positions ({observed[axis[worst]]:.3g} m) allow{_with_principal_distance(adjusted, k)}"
    )
    return [Reason(level, sentence)]


def _with_principal_distance(adjusted: AdjustedBlock, k: int) -> str:
    """The largest correlation of a parameter with a principal distance, in words."""
    p = adjusted.parameters
    lengths = np.flatnonzero((p.names == "focal_length_mm") & (p.status != "removed"))
    if not len(lengths):
        return ""
    sigma = np.sqrt(np.diagonal(p.covariance))
    r = p.covariance[k, lengths] / (sigma[k] * sigma[lengths])
    return f"; its correlation with the principal distance is {r[np.argmax(np.abs(r))]:+.2f}"
