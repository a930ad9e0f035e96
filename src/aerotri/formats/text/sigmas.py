"""Standard deviations of coordinates on the ground: which ones nothing measured can have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerotri.conventions import InputError

SMALLEST_SIGMA_M = 1e-9
"""No instrument places a point on the ground to a nanometre [C]; its weight would leave no digit to the others."""
LARGEST_SIGMA_M = 1e7
"""More than the radius of the earth [C]: says nothing, and is mostly a slip or another unit."""
REMEDY = "give it in metres; leave the coordinate empty where it is not known"


def impossible_sigmas(sigma: np.ndarray, may_be_zero: bool = False) -> np.ndarray:
    """Of standard deviations on the ground (…) m, bool: which cannot be; NaN can, as nothing is said then.

    Parameters
    ----------
    may_be_zero : 0 stands for a coordinate without error.
    """
    possible = (sigma >= SMALLEST_SIGMA_M) & (sigma <= LARGEST_SIGMA_M)
    return ~(possible | np.isnan(sigma) | ((sigma == 0.0) & may_be_zero))


def why_impossible(value: float, may_be_zero: bool = False) -> str:
    """What is wrong with a standard deviation that cannot be, in words that follow on its name."""
    if value <= 0.0:
        return "is negative" if may_be_zero else "is not greater than 0"
    if value < SMALLEST_SIGMA_M:
        return f"of {value:.3g} m is smaller than a nanometre, which no instrument reaches"
    return f"of {value:.3g} m is larger than the earth"


def refuse_stated(sigma: Sequence[float] | None, option: str, may_be_zero: bool = False) -> None:
    """Refuse stated standard deviations on the ground, m, that nothing can have.

    Raises
    ------
    InputError
    """
    values = np.zeros(0) if sigma is None else np.array(sigma, dtype=float)
    bad = np.flatnonzero(impossible_sigmas(values, may_be_zero))
    if len(bad):
        message = f"{option}: a standard deviation {why_impossible(float(values[bad[0]]), may_be_zero)}"
        raise InputError(message, "give it in metres")
