"""A shift of all observed positions against the control points, as it is found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.results.position_errors import CHECK_LEVEL


@dataclass(frozen=True, eq=False)
class CommonShift:
    """What the observed positions have in common against the rest of the block.

    Parameters
    ----------
    shift, sigma : (3,) m, X, Y, Z: observed − adjusted, and its σ.
    p : probability of as much without a shift.
    """

    shift: np.ndarray
    sigma: np.ndarray
    p: float

    @property
    def counts(self) -> bool:
        """Whether chance does not explain it."""
        return self.p < CHECK_LEVEL
