"""Internal reliability of every observation: redundancy numbers, tests, and the errors that a test can find.

[L: Baarda 1968, A testing procedure for use in geodetic networks; Pope 1976; paper 002] An observation with redundancy
number r is tested by w = −v/(σ√r), or by τ = w/σ̂0 where the a-priori σ is not to be trusted. An error of the size
∇0l = δ0·σ/√r is found with the probability `power` by a test of the level `alpha`, δ0 = z(1 − α/2) + z(power). What
stays undetected changes no function of the unknowns by more than δ̄0 = δ0·√((1 − r)/r) of its σ; which unknown suffers
most is a matter of `external_reliability`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.observations import Block
from aerotri.quantiles import normal_quantile
from aerotri.results.adjusted_block import AdjustedBlock, Blunder, GroundPointResults, RayResults
from aerotri.results.normalised import MIN_REDUNDANCY

LISTED_BLUNDERS = 100
"""Suspected gross errors that are named, the largest |w| first [C]: the largest hide the others, which come up when
they are mended."""


@dataclass(frozen=True, eq=False)
class Reliability:
    """Reliability of observations, arrays of one shape; NaN where there is no test.

    Parameters
    ----------
    tau : Pope's τ = w/σ̂0.
    detectable : ∇0l, the error found with probability `power`, in the unit of the observation's σ.
    external : δ̄0, the most that an undetected ∇0l changes any function of the unknowns, over that function's σ.
    """

    tau: np.ndarray
    detectable: np.ndarray
    external: np.ndarray


def critical_value(alpha: float) -> float:
    """Two-sided limit of a standard normal test of level `alpha`: 3.29 for 0.1 %."""
    return normal_quantile(1.0 - alpha / 2.0)


def noncentrality(alpha: float, power: float) -> float:
    """δ0 = z(1 − α/2) + z(power): 4.13 for 0.1 % and 80 %. Paper 002's 4.0 has 76 % there, not its 93 %."""
    return critical_value(alpha) + normal_quantile(power)


def detectable_share(r: np.ndarray, alpha: float, power: float) -> np.ndarray:
    """∇0l/σ = δ0/√r of observations with redundancy numbers r; NaN where r is practically zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(r > MIN_REDUNDANCY, noncentrality(alpha, power) / np.sqrt(np.maximum(r, 0.0)), np.nan)


def reliability(adjusted: AdjustedBlock, w: np.ndarray, r: np.ndarray, sigma: np.ndarray) -> Reliability:
    """Reliability of observations with tests w, redundancy numbers r and a-priori σ, at the block's α and power."""
    settings = adjusted.block.settings.adjustment
    share = detectable_share(r, settings.alpha, settings.power)
    with np.errstate(invalid="ignore"):
        external = share * np.sqrt(np.maximum(1.0 - r, 0.0))
    return Reliability(w / adjusted.outcome.sigma0, share * sigma, external)


def ray_reliability(adjusted: AdjustedBlock) -> Reliability:
    """Of the image coordinates, (m, 2), mm."""
    return reliability(adjusted, adjusted.rays.w, adjusted.rays.r, adjusted.block.image_points.sigma)


def control_reliability(adjusted: AdjustedBlock) -> Reliability:
    """Of the coordinates of control points, (k, 3), m.

    A given coordinate touches no unknown but its own point's, and among these itself most: there its effect is δ̄0.
    """
    control, settings = adjusted.control, adjusted.block.settings.adjustment
    found = reliability(adjusted, control.w, control.r, given_sigma(adjusted.block, control))
    if control.lone_sigma is None:
        return found
    # of what is held, δ0·σ/√r tends to δ0 times σ of its prediction
    of_held = noncentrality(settings.alpha, settings.power) * control.lone_sigma
    return replace(found, detectable=np.where(np.isfinite(of_held), of_held, found.detectable))


def observation_reliability(adjusted: AdjustedBlock) -> Reliability | None:
    """Of GNSS, INS and conditions, (o,), m or rad; None where there are none."""
    o = adjusted.observations
    return None if o is None else reliability(adjusted, o.w, o.r, o.sigma)


def given_sigma(block: Block, ground: GroundPointResults) -> np.ndarray:
    """(k, 3) m, the σ given for control or check points."""
    row = np.zeros(len(block.points), dtype=np.int64)
    row[block.control.point] = np.arange(len(block.control))
    return block.control.sigma[row[ground.point]]


def suspected_blunders(block: Block, rays: RayResults, control: GroundPointResults) -> tuple[Blunder, ...]:
    """Rays and control points with a normalised residual beyond the limit of `alpha`, largest first.

    The estimated error of a coordinate is −v/r; of the coordinates of a ray or point the one with the largest |w|
    speaks. A control point has no photograph.
    """
    limit = critical_value(block.settings.adjustment.alpha)
    names, points = block.images.names, block.points
    found = [
        Blunder(
            image=str(names[block.image_points.image[k]]),
            point=str(points[block.image_points.point[k]]),
            w=w,
            estimated_mm=float(-rays.v[k, axis] / rays.r[k, axis]),
            action="down-weighted" if rays.weight[k] < 1.0 else "kept",
        )
        for k, axis, w in _beyond(rays.w, limit)
    ]
    for k, axis, w in _beyond(control.w, limit):
        error_mm = 1e3 * _control_error(control, k, axis)
        found.append(Blunder("", str(points[control.point[k]]), w, error_mm, "kept"))
    return tuple(sorted(found, key=lambda blunder: -abs(blunder.w))[:LISTED_BLUNDERS])


def _control_error(control: GroundPointResults, k: int, axis: int) -> float:
    """m, estimated error of a given coordinate."""
    if control.lone_sigma is not None and np.isfinite(control.lone_sigma[k, axis]):
        return float(control.w[k, axis] * control.lone_sigma[k, axis])
    return float(-control.difference[k, axis] / control.r[k, axis])


def _beyond(w: np.ndarray, limit: float) -> list[tuple[int, int, float]]:
    """(row, axis, w) of the rows whose largest |w| is beyond the limit, largest first."""
    w = np.nan_to_num(w)
    if not w.size:
        return []
    axis = np.argmax(np.abs(w), axis=1)
    size = np.take_along_axis(w, axis[:, None], axis=1)[:, 0]
    rows = np.flatnonzero(np.abs(size) > limit)
    rows = rows[np.argsort(-np.abs(size[rows]), kind="stable")][:LISTED_BLUNDERS]
    return [(int(k), int(axis[k]), float(size[k])) for k in rows]
