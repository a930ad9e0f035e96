"""Where control helps most: one point after the other, each where it lowers what the plan is judged by.

A point that becomes control adds three observations of its coordinates. With C the covariance of ground points,
candidates and the volume, I its rows of the candidate and S its σ² as control,

    C' = C − C[:, I]·(C[I, I] + S)⁻¹·C[I, :]

is what an adjustment with it would give, exactly: the candidate's image points are in the block already.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.planning.options import Target

SHARE = 0.95
"""Share of the area on which 'sigma-z' is asked for."""
DATUM = 4
"""Control points that a block without positions begins with, towards the corners of the area."""


@dataclass(frozen=True, eq=False)
class Quality:
    """What is judged.

    Parameters
    ----------
    variance : (g, 3) m², of the ground points. volume : m⁶, variance of the volume over the area.
    """

    variance: np.ndarray
    volume: float

    def of(self, target: Target) -> float:
        """The quantity of a target: m, or m³."""
        if target.kind == "sigma-volume":
            return float(np.sqrt(max(self.volume, 0.0)))
        if target.kind == "sigma-z":
            return float(np.quantile(np.sqrt(self.variance[:, 2]), SHARE))
        return max(self.rmse)

    @property
    def rmse(self) -> tuple[float, float]:
        """m, RMSE_H and RMSE_V to be expected over the area."""
        by_axis = self.variance.mean(axis=0)
        return float(np.sqrt(by_axis[0] + by_axis[1])), float(np.sqrt(by_axis[2]))


@dataclass(frozen=True, eq=False)
class Joint:
    """Ground points, candidates and the volume together.

    Parameters
    ----------
    covariance : (3g + 3c + 1, …) of ground points, then candidates, then the volume.
    ground, candidates : g and c.
    """

    covariance: np.ndarray
    ground: int
    candidates: int

    @property
    def quality(self) -> Quality:
        diagonal = np.diagonal(self.covariance)
        return Quality(diagonal[: 3 * self.ground].reshape(-1, 3), float(diagonal[-1]))

    def rows(self, candidate: int) -> np.ndarray:
        """Rows of a candidate's X, Y, Z."""
        return 3 * (self.ground + candidate) + np.arange(3)

    def quality_with(self, candidate: int, sigma: np.ndarray) -> Quality:
        """What is judged, were a candidate control."""
        own = self.rows(candidate)
        kept = np.r_[0 : 3 * self.ground, len(self.covariance) - 1]
        both = self.covariance[np.ix_(kept, own)]
        gain = np.linalg.solve(self.covariance[np.ix_(own, own)] + np.diag(sigma**2), both.T).T
        after = np.diagonal(self.covariance)[kept] - np.sum(gain * both, axis=1)
        return Quality(after[:-1].reshape(-1, 3), float(after[-1]))

    def with_control(self, candidate: int, sigma: np.ndarray) -> Joint:
        """The covariance once a candidate is control."""
        own = self.rows(candidate)
        both = self.covariance[:, own]
        gain = np.linalg.solve(self.covariance[np.ix_(own, own)] + np.diag(sigma**2), both.T).T
        after = self.covariance - gain @ both.T
        return Joint(0.5 * (after + after.T), self.ground, self.candidates)


def joint_of(covariance: np.ndarray, own: np.ndarray, area: float) -> Joint:
    """With the volume over the area, the mean height of its ground points times its size.

    Noise of single points averages out over a surface and is left out of the volume.

    Parameters
    ----------
    covariance : (3g + 3c, 3g + 3c) m² of ground points and candidates. own : (g, 3, 3) m², noise of ground points.
    area : m².
    """
    g = len(own)
    weight = np.zeros(len(covariance))
    weight[2 : 3 * g : 3] = area / g
    by_volume = covariance @ weight
    variance = float(weight @ by_volume) - float((area / g) ** 2 * own[:, 2, 2].sum())
    # a ground point's own noise belongs to it, not to the volume
    by_volume[: 3 * g] -= (area / g) * own[:, :, 2].ravel()
    whole = np.block([[covariance, by_volume[:, None]], [by_volume[None, :], np.array([[variance]])]])
    return Joint(whole, g, (len(covariance) - 3 * g) // 3)


def next_control(joint: Joint, sigma: np.ndarray, target: Target, taken: list[int]) -> tuple[int, Quality]:
    """The candidate that lowers the quantity of the target most, and what is judged then."""
    free = [c for c in range(joint.candidates) if c not in taken]
    tried = [joint.quality_with(c, sigma) for c in free]
    # where quantities are alike, as in a symmetrical block, the mean variance decides
    key = [(round(one.of(target), 9), one.variance.sum()) for one in tried]
    best = min(range(len(free)), key=lambda k: key[k])
    return free[best], tried[best]


def first_control(xy: np.ndarray, count: int = DATUM) -> list[int]:
    """Candidates towards the corners of their smallest rectangle, each one once."""
    import shapely

    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shapely.multipoints(xy)))[:count]
    chosen: list[int] = []
    for corner in corners:
        order = np.argsort(np.hypot(*(xy - corner).T))
        chosen += [int(k) for k in order if int(k) not in chosen][:1]
    return chosen
