"""Whether the terrain stands between a photograph and a place on the ground."""

from __future__ import annotations

import numpy as np

from aerotri.planning.ground import Ground
from aerotri.simulation.projection import Rays

SAMPLES = 160
"""Places along a ray at which the ground below it is looked at, at most [C]."""
TOLERANCE = 0.02
"""Of a node of the ground: so far it may stand above a ray that grazes it, without hiding anything [C]."""
AT_A_TIME = 20_000
"""Rays that are followed together [C]: some 50 MB."""


def in_sight(ground: Ground, centre: np.ndarray, points: np.ndarray, rays: Rays) -> np.ndarray:
    """(m,) bool: rays along which the ground is below all the way.

    A ray is followed from its point on the ground up to the height of the highest ground, at steps of half a node.

    Parameters
    ----------
    centre : (n, 3) m, of the photographs. points : (N, 3) m.
    """
    clear = np.ones(len(rays), bool)
    highest = float(ground.z.max())
    if highest - float(ground.z.min()) <= 0.0:
        return clear
    for first in range(0, len(rays), AT_A_TIME):
        own = slice(first, first + AT_A_TIME)
        clear[own] = _clear(ground, centre[rays.image[own]], points[rays.point[own]], highest)
    return clear


def _clear(ground: Ground, centre: np.ndarray, point: np.ndarray, highest: float) -> np.ndarray:
    rise = np.maximum(centre[:, 2] - point[:, 2], 1e-9)
    end = np.clip((highest - point[:, 2]) / rise, 0.0, 1.0)
    reach = end * np.hypot(*(centre - point)[:, :2].T)
    count = int(np.clip(np.ceil(2.0 * float(reach.max(initial=0.0)) / ground.step), 1, SAMPLES))
    share = (np.arange(count) + 1.0) / count
    at = point[:, None] + (end[:, None] * share)[:, :, None] * (centre - point)[:, None]
    over = ground.heights(at[:, :, :2].reshape(-1, 2)).reshape(len(point), count) - at[:, :, 2]
    return np.asarray((over <= TOLERANCE * ground.step).all(axis=1))
