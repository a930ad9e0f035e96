"""One number of a result beside what it should be, and what it weighs in the verdict."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import gammaincc, ndtri

from aerotri.adjustment.ray_status import RayStatus
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.stated_sigma import ImageSigma, image_sigmas

Grade = Literal["accepted", "doubtful", "rejected"]
GRADES: tuple[Grade, ...] = ("accepted", "doubtful", "rejected")

SIGNIFICANCE = 0.001
"""Probability with which a rule may doubt a faultless block by chance."""

NO_DOUBT = "One faultless block in a hundred shows as much, so it does not count in the verdict: compare check points"
"""Of a finding that chance explains with a probability below 1 %, all its tests together."""

SIGMA_GROUPS = 5
"""Groups of image points of one a-priori σ that are listed; of more the range is given."""


@dataclass(frozen=True)
class Finding:
    """One number of a result and what it is compared with.

    Parameters
    ----------
    quantity, value, expected, says : in words; `says` is what the comparison comes to.
    level : 'good', 'note' or 'attention', the light beside it.
    grade : of the result as far as this number goes; where it is not 'accepted', `reason` is a sentence.
    """

    quantity: str
    value: str
    expected: str
    says: str
    level: str
    grade: Grade = "accepted"
    reason: str = ""


def doubt(quantity: str, value: str, expected: str, grade: Grade, reason: str) -> list[Finding]:
    """The finding of a rule that speaks only of what is wrong; none where the grade is 'accepted'."""
    if grade == "accepted":
        return []
    return [Finding(quantity, value, expected, grade, "attention", grade, reason)]


def graded(value: float, doubtful: float, rejected: float) -> Grade:
    """The grade of a measure that grows as a result gets worse; NaN is accepted: nothing was measured."""
    if value >= rejected:
        return "rejected"
    return "doubtful" if value >= doubtful else "accepted"


def chi_square_p(statistic: float, freedom: float) -> float:
    """Probability that χ² of `freedom` degrees of freedom exceeds the statistic."""
    return float(gammaincc(freedom / 2.0, statistic / 2.0)) if freedom > 0.0 and statistic >= 0.0 else 1.0


def critical_of_worst(count: int) -> float:
    """What the largest of `count` normalised residuals exceeds with the probability `SIGNIFICANCE`, either sign."""
    return float(-ndtri(SIGNIFICANCE / (2.0 * max(count, 1))))


def times(ratio: float) -> str:
    """'3.4 times', '522 times', '1.3e+03 times': how many times too large."""
    return f"{ratio:.0f} times" if 10.0 <= ratio < 1000.0 else f"{ratio:.2g} times"


def some(names: np.ndarray) -> str:
    """The first few names."""
    return ", ".join(str(name) for name in names[:3]) + (" …" if len(names) > 3 else "")


def metre_digits(sigma: np.ndarray) -> int:
    """Decimals with which the first doubtful digit of a coordinate is still shown: 3, more for close range."""
    finite = sigma[np.isfinite(sigma) & (sigma > 0.0)]
    return int(np.clip(np.ceil(-np.log10(np.median(finite))) + 1, 3, 6)) if len(finite) else 3


def sigma0_in_image(adjusted: AdjustedBlock) -> str:
    """σ̂0 as standard deviation of an image coordinate: '1.16 µm, 0.29 px'; of most where their σ differ."""
    o, groups = adjusted.outcome, _image_sigmas(adjusted)
    if len(groups) == 1:
        return groups[0].text(o.sigma0)
    sizes = {camera.pixel_um for camera in adjusted.block.cameras}
    pixel = f", {o.sigma0_um / sizes.pop():.2f} px" if len(sizes) == 1 else ""
    return f"{o.sigma0_um:.2f} µm{pixel}" + (" in the median" if groups else "")


def sigma0_by_group(adjusted: AdjustedBlock) -> list[str]:
    """σ̂0 of every group of image points, where their a-priori σ differ: a line each, of many groups the range."""
    sigma0, groups = adjusted.outcome.sigma0, _image_sigmas(adjusted)
    if len(groups) < 2:
        return []
    if len(groups) > SIGMA_GROUPS:
        low, high = min(group.sigma_um for group in groups), max(group.sigma_um for group in groups)
        return [f"stated σ of image points {low:.3g} to {high:.3g} µm: {sigma0 * low:.2f} to {sigma0 * high:.2f} µm"]
    return [f"{group.count} image points of stated σ {group.sigma_um:.3g} µm: {group.text(sigma0)}" for group in groups]


def _image_sigmas(adjusted: AdjustedBlock) -> list[ImageSigma]:
    return image_sigmas(adjusted.block, np.flatnonzero(adjusted.rays.status == RayStatus.USED))
