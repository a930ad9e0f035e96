"""Levenberg's damping: none until a step fails, then led by how well the steps keep their promise."""

from __future__ import annotations

from dataclasses import dataclass

FIRST_DAMPING = 1e-5
"""λ after the first step that failed: far below the diagonal, so that only directions that the observations hardly
determine are held back."""

LAST_DAMPING = 1e12
"""λ at which steps are shorter than rounding: nothing further down is to be found."""

NO_DAMPING = 1e-11
"""λ that changes a step by no more than rounding does: set to zero, and the full steps come back."""

SLIGHT_DAMPING = 5e-8
"""λ that counts for none where the curvature is heeded: the secants tell more of it than so little damping."""

GROWTH = 10.0
"""Factor of λ after the first failure; it doubles with every one that follows [L: Nielsen 1999, from 2; D: 10, since a
factor costs more than the few steps that are damped too much]."""


@dataclass(frozen=True)
class Damping:
    """λ, by which every diagonal element is multiplied by 1 + λ.

    [L: Nielsen, Damping parameter in Marquardt's method, 1999]
    """

    value: float = 0.0
    growth: float = GROWTH
    first: float = FIRST_DAMPING

    def raised(self) -> Damping:
        """After a step that failed."""
        value = max(self.first, self.value * self.growth)
        return Damping(value, 2.0 * self.growth if self.value else GROWTH, self.first)

    def lowered(self, gain_ratio: float, heeds_curvature: bool) -> Damping:
        """After a step that improved; gain_ratio is the gain over the gain promised.

        Where the curvature is heeded, slight damping is none, and the one that was enough is the first to be tried
        should the next step fail.
        """
        value = self.value * max(0.1, 1.0 - (2.0 * gain_ratio - 1.0) ** 3)
        if heeds_curvature and 0.0 < value <= SLIGHT_DAMPING:
            return Damping(first=max(10.0 * value, SLIGHT_DAMPING))
        return Damping(value if value > NO_DAMPING else 0.0, first=self.first)
