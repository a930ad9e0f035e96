"""Independent random streams by name: one more option in a spec does not disturb what the others draw."""

from __future__ import annotations

from zlib import crc32

import numpy as np


def stream(seed: int, *names: str) -> np.random.Generator:
    """A generator that depends on the seed and the names alone, the same on every machine.

    Parameters
    ----------
    seed : non-negative.
    names : what the numbers are for, for example 'noise' or 'camera', 'ucd2'.
    """
    return np.random.default_rng([seed, *(crc32(name.encode()) for name in names)])


def scattered(count: int, rng: np.random.Generator, jitter: float = 0.5) -> np.ndarray:
    """Points of the unit square, evenly scattered; so is every leading part of them.

    [L] The additive recurrence by the plastic number (R2 sequence), at a random origin, each point moved at random.

    Parameters
    ----------
    jitter : σ of the movement in units of the mean distance of points.

    Returns
    -------
    (count, 2) in [0, 1).
    """
    plastic = 1.32471795724474602596
    steps = np.arange(1, count + 1)[:, None] * np.array([1.0 / plastic, 1.0 / plastic**2])
    moved = rng.normal(size=(count, 2)) * jitter / np.sqrt(max(count, 1))
    return (rng.random(2) + steps + moved) % 1.0
