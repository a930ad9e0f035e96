"""What the orientation of a photograph over flat ground does to the image: of the camera it says nothing."""

from __future__ import annotations

import numpy as np


def orientation_patterns(x: np.ndarray, y: np.ndarray, f: float) -> np.ndarray:
    """(n, 2, 6) what the orientation of a photograph over flat ground takes: shifts, scale, rotation, two tilts."""
    one, zero = np.ones_like(x), np.zeros_like(x)
    dx = [one, zero, x, -y, f + x * x / f, x * y / f]
    dy = [zero, one, y, x, x * y / f, f + y * y / f]
    return np.stack([np.stack(dx, axis=1), np.stack(dy, axis=1)], axis=1)
