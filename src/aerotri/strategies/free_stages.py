"""What a free check found: the adjustments of its row, and what they say about tie points and control."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.statistics.similarity import Similarity

FREE, CONTROL, POSITIONS = "tie points alone", "with control", "with observed positions"
INFLATED = 1.1
"""σ̂0 of the free block over the robust spread of its residuals, from which on gross errors decide the fit."""
POOR_SIGMA0 = 1.5
"""σ̂0 of the free block from which on the tie points fit worse than their σ says, gross errors or not."""


@dataclass(frozen=True)
class Suspect:
    """A value that contradicts the rest.

    Parameters
    ----------
    kind : 'ray', 'control', or the group of other observations. name : the point, photograph or condition. component :
        'X', 'x', 'omega' ….
    w : normalised residual. error : −v/r, m (rad for attitudes, mm for rays). error_px : pixels, of rays.
    """

    kind: str
    name: str
    component: str
    w: float
    error: float
    error_px: float = np.nan


@dataclass(frozen=True)
class Stage:
    """One adjustment of the row, and the test of what it added to the one before.

    Parameters
    ----------
    name : what takes part. status, message : as in `Outcome`.
    sigma0, vtpv, redundancy : of this adjustment, with the weights of the test.
    added : observations and conditions it has more. ratio : Δ(vᵀPv)/Δr/σ̂0²free, NaN where nothing is tested.
    limit : what the ratio exceeds with probability α.
    largest_w, w_limit : largest normalised residual of what was added, and what the largest exceeds with probability α.
    suspects : the first of the values with a large w, largest first; rays in the free block.
    """

    name: str
    status: str
    message: str
    sigma0: float
    vtpv: float
    redundancy: int
    added: int = 0
    ratio: float = np.nan
    limit: float = np.nan
    largest_w: float = np.nan
    w_limit: float = np.nan
    suspects: tuple[Suspect, ...] = ()

    @property
    def tested(self) -> bool:
        return bool(np.isfinite(self.ratio))

    @property
    def fits(self) -> bool:
        """Neither all that was added together nor any single value of it contradicts."""
        return self.tested and self.ratio <= self.limit and not self.largest_w > self.w_limit


@dataclass(frozen=True, eq=False)
class FreeCheck:
    """Tie points or control?

    Parameters
    ----------
    stages : the adjustments, the free one first. sigma0_full : of the adjustment as delivered, NaN if there is none.
    spread : robust spread of w in the free block. beyond : rays whose |w| no chance explains.
    point : (k,) str, control points of the free block. similarity : onto their given coordinates, None if these do not
        determine it.
    position_offset : (3,) m, mean of observed positions less where control alone puts them; None if not known.
    robust : whether the weights are robust, so that the limits hold only approximately.
    """

    stages: tuple[Stage, ...]
    sigma0_full: float
    spread: float
    beyond: int
    point: np.ndarray
    similarity: Similarity | None
    position_offset: np.ndarray | None
    robust: bool = False

    @property
    def tie_points_poor(self) -> bool:
        return poor_fit(self.stages[0], self.spread)

    @property
    def verdict(self) -> str:
        """'fits', 'control', 'positions', 'tie points', 'both' (tie points and others), 'not tested' or 'failed'."""
        free, added = self.stages[0], self.stages[1:]
        if free.status != "converged":
            return "failed"
        against = [stage.name for stage in added if stage.status != "converged" or (stage.tested and not stage.fits)]
        if self.tie_points_poor:
            return "both" if against else "tie points"
        if against:
            alone = against == [POSITIONS] and any(stage.name == CONTROL for stage in added)
            return "positions" if alone else "control"
        return "fits" if any(stage.tested for stage in added) else "not tested"


def poor_fit(free: Stage, spread: float) -> bool:
    """Whether gross errors or errors not modelled decide how the tie points fit one another.

    Parameters
    ----------
    spread : robust spread of w in the free block.
    """
    return free.redundancy > 0 and (free.sigma0 > INFLATED * spread or free.sigma0 > POOR_SIGMA0)
