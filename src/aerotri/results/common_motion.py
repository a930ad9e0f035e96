"""A turn and a scale of all observed positions against control and photographs, as they are found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.quantiles import noncentrality

CHANCE = 3e-4
"""Probability of a turn or a scale by chance below which it counts: a third of 0.1 % for each of the three tests."""

SUSPECTED = 1e-2 / 3.0
"""The same below which it is told without a doubt of the result [C]: one block in a hundred has one by chance."""
POWER = 0.8
"""Probability with which a motion of the detectable size is found."""


@dataclass(frozen=True, eq=False)
class CommonMotion:
    """What the observed positions as a whole differ by from where the rest of the block would have them.

    Parameters
    ----------
    turn, turn_sigma : (3,) rad, about X, Y and Z. scale, scale_sigma : observed − adjusted, relative.
    p_tilt, p_turn, p_scale : probability of as much by chance, of the tilt about X and Y, the turn about Z, the scale.
    extent : (3,) m, of the positions. tilt_correlation : of the turns about X and Y.
    with_attitudes : whether the observed attitudes are turned alike.
    """

    turn: np.ndarray
    turn_sigma: np.ndarray
    scale: float
    scale_sigma: float
    p_tilt: float
    p_turn: float
    p_scale: float
    extent: np.ndarray
    with_attitudes: bool = False
    tilt_correlation: float = 0.0

    @property
    def least_chance(self) -> float:
        """The smallest of the three probabilities."""
        return min(self.p_tilt, self.p_turn, self.p_scale)

    @property
    def counts(self) -> bool:
        """Whether chance does not explain it."""
        return self.least_chance < CHANCE

    @property
    def tilt_m(self) -> tuple[float, float]:
        """Difference in height over the length of the block by the tilt, m, and its σ along the tilt."""
        along, sigma = self._along_axes(self.turn), self._along_axes(self.turn_sigma)
        size = float(np.hypot(*along))
        if size == 0.0:
            return 0.0, float(sigma.max())
        x, y = along / size * sigma
        return size, float(np.sqrt(max(x**2 + y**2 + 2.0 * self.tilt_correlation * x * y, 0.0)))

    @property
    def detectable_tilt_m(self) -> np.ndarray:
        """(2,) m, differences in height over the extent along X and along Y that count with a probability of POWER."""
        size = noncentrality(2.0, CHANCE, POWER) * max(1.0 - self.tilt_correlation**2, 0.0)
        return np.sqrt(size) * self._along_axes(self.turn_sigma)

    @property
    def detectable_scale(self) -> float:
        """The scale that counts with a probability of POWER."""
        return float(np.sqrt(noncentrality(1.0, CHANCE, POWER))) * self.scale_sigma

    def _along_axes(self, turn: np.ndarray) -> np.ndarray:
        """(2,) m, what turns about Y and X lift over the extent along X and Y."""
        return turn[[1, 0]] * self.extent[:2]
