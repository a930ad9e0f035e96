"""A turn and a scale of all observed positions against control and photographs, as they are found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CHANCE = 3e-4
"""Probability of a turn or a scale by chance below which it counts: a third of 0.1 % for each of the three tests."""


@dataclass(frozen=True, eq=False)
class CommonMotion:
    """What the observed positions as a whole differ by from where the rest of the block would have them.

    Parameters
    ----------
    turn, turn_sigma : (3,) rad, about X, Y and Z. scale, scale_sigma : observed − adjusted, relative.
    p_tilt, p_turn, p_scale : probability of as much by chance, of the tilt about X and Y, the turn about Z, the scale.
    extent : (3,) m, of the positions.
    """

    turn: np.ndarray
    turn_sigma: np.ndarray
    scale: float
    scale_sigma: float
    p_tilt: float
    p_turn: float
    p_scale: float
    extent: np.ndarray

    @property
    def counts(self) -> bool:
        """Whether chance does not explain it."""
        return min(self.p_tilt, self.p_turn, self.p_scale) < CHANCE
