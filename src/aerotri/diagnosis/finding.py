"""One number of a result beside what it should be, and what it weighs in the verdict."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import gammaincc, ndtri

from aerotri.results.adjusted_block import AdjustedBlock

Grade = Literal["accepted", "doubtful", "rejected"]
GRADES: tuple[Grade, ...] = ("accepted", "doubtful", "rejected")

SIGNIFICANCE = 0.001
"""Probability with which a rule may doubt a faultless block by chance."""


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


def pixel_text(value_um: float, adjusted: AdjustedBlock) -> str:
    """', 0.29 px' where all cameras have one size of pixel, '' otherwise."""
    sizes = {camera.pixel_um for camera in adjusted.block.cameras}
    return f", {value_um / sizes.pop():.2f} px" if len(sizes) == 1 else ""
