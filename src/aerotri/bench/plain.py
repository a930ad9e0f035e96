"""Arrays as what JSON knows: lists, and null where there is no number."""

from __future__ import annotations

from typing import Any

import numpy as np


def numbers(values: np.ndarray, digits: int) -> list[Any]:
    """Nested lists of numbers rounded to digits after the point; None where there is none."""
    rounded = np.round(np.asarray(values, dtype=float), digits)
    if np.isfinite(rounded).all():
        return rounded.tolist()
    out = rounded.astype(object)
    out[~np.isfinite(rounded)] = None
    return out.tolist()


def number(value: float, digits: int) -> float | None:
    """One number rounded; None where there is none."""
    return round(float(value), digits) if np.isfinite(value) else None


def texts(values: np.ndarray) -> list[str]:
    """Names as they are."""
    return [str(value) for value in values.tolist()]
