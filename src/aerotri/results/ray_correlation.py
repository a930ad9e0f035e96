"""How much neighbouring rays of a photograph err alike; of a result."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

LEVEL = 0.001
"""Probability with which residuals that are alike are taken for chance: the test is made in every block."""
WORTH_SAYING = 0.1
"""Correlation from which it is told [C]: below, a mean of many neighbouring points loses less than a tenth."""


def _nothing() -> np.ndarray:
    return np.zeros((0, 2))


@dataclass(frozen=True, eq=False)
class RayCorrelation:
    """Correlation of the residuals of two rays of one photograph, by their distance in the image.

    Parameters
    ----------
    limits_px : (k + 1,) px, the limits of k classes of distance.
    pairs : (k,) pairs of rays.
    correlation : (k, 2) of x with x and of y with y; NaN in classes with too few pairs.
    sigma : (k, 2) its σ, from the scatter of the photographs.
    p : probability of residuals that are as much alike in the near classes, if rays err independently.
    near_px : px, the distance up to which pairs took part in that test.
    reason : why there is no test, '' otherwise.
    """

    limits_px: np.ndarray = field(default_factory=lambda: np.zeros(1))
    pairs: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    correlation: np.ndarray = field(default_factory=_nothing)
    sigma: np.ndarray = field(default_factory=_nothing)
    p: float = float("nan")
    near_px: float = float("nan")
    reason: str = ""

    @property
    def nearest(self) -> int:
        """The class of the nearest pairs that are enough, −1 where there is none."""
        known = np.flatnonzero(np.isfinite(self.correlation).any(axis=1))
        return int(known[0]) if len(known) else -1

    @property
    def largest(self) -> float:
        """The larger correlation, of x or of y, of the nearest pairs."""
        return float(np.nanmax(self.correlation[self.nearest])) if self.nearest >= 0 else float("nan")

    @property
    def half_px(self) -> float:
        """px, the upper limit of the last class with at least half of the largest correlation; NaN without a test."""
        if self.nearest < 0:
            return float("nan")
        axis = int(np.nanargmax(self.correlation[self.nearest]))
        below = np.flatnonzero(~(self.correlation[self.nearest :, axis] >= 0.5 * self.largest))
        last = len(self.pairs) if not len(below) else self.nearest + int(below[0])
        return float(self.limits_px[last])

    @property
    def alike(self) -> bool:
        """Whether neighbours err alike, beyond chance and so much that it matters."""
        return self.p < LEVEL and self.largest >= WORTH_SAYING

    def as_dict(self) -> dict[str, Any]:
        """For JSON; None for what is not known."""

        def plain(value: float) -> float | None:
            return float(value) if np.isfinite(value) else None

        classes = [
            {
                "from_px": float(self.limits_px[k]),
                "to_px": float(self.limits_px[k + 1]),
                "pairs": int(self.pairs[k]),
                "x": plain(self.correlation[k, 0]),
                "y": plain(self.correlation[k, 1]),
                "s_x": plain(self.sigma[k, 0]),
                "s_y": plain(self.sigma[k, 1]),
            }
            for k in range(len(self.pairs))
        ]
        return {"classes": classes, "p": plain(self.p), "near_px": plain(self.near_px), "reason": self.reason}
