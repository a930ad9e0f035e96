"""Adjusted against given positions of the photographs, in the order of time or of the strips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.results.adjusted_block import AdjustedBlock

SECONDS_A_MINUTE = 60.0


@dataclass(frozen=True, eq=False)
class PositionDifferences:
    """Adjusted antenna position − given position of g photographs, in order.

    Parameters
    ----------
    image : (g,) index. difference : (g, 3) m, NaN in a coordinate that was not given. sigma : (g, 3) m, as given.
    time : (g,) s; None where not all photographs have a time: they are then in the order of their strips.
    strip : (g,) str.
    """

    image: np.ndarray
    difference: np.ndarray
    sigma: np.ndarray
    time: np.ndarray | None
    strip: np.ndarray

    @property
    def count(self) -> np.ndarray:
        """(3,) coordinates given."""
        return np.isfinite(self.difference).sum(axis=0)

    @property
    def offset(self) -> np.ndarray:
        """(2, 3) m, mean and its σ as if the differences were independent of one another."""
        count = self.count
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.nansum(self.difference, axis=0) / count
            spread = np.sqrt(np.nansum((self.difference - mean) ** 2, axis=0) / (count - 1))
            return np.stack([mean, np.where(count > 1, spread / np.sqrt(count), np.nan)])

    @property
    def rms(self) -> np.ndarray:
        """(3,) m."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.sqrt(np.nansum(self.difference**2, axis=0) / self.count)

    @property
    def drift(self) -> np.ndarray:
        """(2, 3) m a minute and its σ, of a straight line through all differences; NaN without times."""
        out = np.full((2, 3), np.nan)
        if self.time is None:
            return out
        minutes = self.time / SECONDS_A_MINUTE
        for k in range(3):
            known = np.isfinite(self.difference[:, k])
            t, d = minutes[known], self.difference[known, k]
            spread = float(np.sum((t - t.mean()) ** 2)) if len(t) > 2 else 0.0
            if spread > 0.0:
                slope = float((t - t.mean()) @ d) / spread
                left = d - d.mean() - slope * (t - t.mean())
                out[:, k] = slope, np.sqrt(left @ left / (len(t) - 2) / spread)
        return out


def position_differences(adjusted: AdjustedBlock) -> PositionDifferences | None:
    """The differences of all photographs that have a given position and are adjusted; None where there are none.

    The lever arm is taken into account. Shifts, drifts and a time offset that were estimated stay in the differences.
    """
    block = adjusted.block
    given = block.gnss_ins
    if given is None:
        return None
    rotation = rotation_from_angles(np.nan_to_num(adjusted.images.angles[given.image]), block.rotation)
    antenna = adjusted.images.centre[given.image] + rotation @ _lever_arm(adjusted)
    difference = antenna - given.xyz
    rows = np.flatnonzero(np.isfinite(difference).any(axis=1))
    if not len(rows):
        return None
    timed = bool(np.isfinite(given.time[rows]).all()) and bool(np.ptp(given.time[rows]) > 0.0)
    strip = block.images.strip[given.image[rows]]
    if timed:
        order = np.argsort(given.time[rows], kind="stable")
    else:
        _, first, of_strip = np.unique(strip, return_index=True, return_inverse=True)
        order = np.lexsort((rows, first[of_strip]))
    rows = rows[order]
    return PositionDifferences(
        given.image[rows], difference[rows], np.broadcast_to(given.sigma[rows], (len(rows), 3)),
        given.time[rows] if timed else None, strip[order],
    )  # fmt: skip


def _lever_arm(adjusted: AdjustedBlock) -> np.ndarray:
    """(3,) m, in the camera frame, as given or as adjusted."""
    arm, p = np.array(adjusted.block.settings.gnss.lever_arm_m, dtype=float), adjusted.parameters
    for k, axis in enumerate(("x", "y", "z")):
        own = np.flatnonzero((p.names == f"gnss.lever_arm_{axis}") & (p.status != "removed"))
        if len(own):
            arm[k] = p.value[own[0]]
    return arm
