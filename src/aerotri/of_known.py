"""Statistics of the values that are known: those that are numbers. Of none they are NaN, without a warning."""

from __future__ import annotations

import numpy as np


def median(values: np.ndarray) -> float:
    """Of all that are known, whatever the shape."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else float("nan")


def medians(values: np.ndarray) -> np.ndarray:
    """(k,) of every column of values (n, k)."""
    return np.array([median(column) for column in values.T])


def mean(values: np.ndarray) -> float:
    """Of all that are known, whatever the shape."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else float("nan")


def means(values: np.ndarray) -> np.ndarray:
    """(k,) of every column of values (n, k)."""
    return np.array([mean(column) for column in values.T])


def rms(values: np.ndarray) -> float:
    """Root mean square of all that are known, whatever the shape."""
    return float(np.sqrt(mean(np.square(values))))


def smallest(values: np.ndarray) -> float:
    """Of all that are known, whatever the shape."""
    known = values[np.isfinite(values)]
    return float(known.min()) if known.size else float("nan")


def largest(values: np.ndarray) -> float:
    """Of all that are known, whatever the shape."""
    known = values[np.isfinite(values)]
    return float(known.max()) if known.size else float("nan")
