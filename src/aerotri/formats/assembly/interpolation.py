"""A trajectory at the times of photographs, with the error of the interpolation from epochs that are left out.

Between two epochs the path is a cubic through them and the next on either side [L: Lagrange]; a straight line where one
of these is missing, far off or of a worse kind of solution. What that costs is measured on the trajectory itself:
epochs are left out as if they were a gap of the same length, and interpolated from the same number of neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.coordinates.ellipsoid import metres_of_units
from aerotri.formats.assembly.timed import RANK, Trajectory, true_sigma

LONGEST_GAP_S = 5.0
"""Time between two epochs beyond which nothing is interpolated [C]: a drone turns around in it."""
TESTED = 40
"""Places of left-out epochs around a photograph that its error is taken from [C]: σ is then known to 11 %."""
FEWEST = 10
"""Such places at least [C]; with fewer the error cannot be stated."""
STEP_TOLERANCE = 0.25
"""Part of the usual step of time by which steps may differ that count as equal [C]: clocks jitter."""
SAME_TIME_S = 1e-6
"""Time stamps have digits of 1e-6 s."""


@dataclass(frozen=True, eq=False)
class Interpolated:
    """Positions at n times.

    Parameters
    ----------
    place, sigma : (n, 3) as in `Trajectory`, of the antenna; NaN where refused.
    error : (n, 3) m, the part of σ that is the interpolation.
    quality : (n,) str, the worse of both epochs around. refused : (n,) str, why there is no position, '' where one is.
    """

    place: np.ndarray
    sigma: np.ndarray
    error: np.ndarray
    quality: np.ndarray
    refused: np.ndarray


def interpolated(trajectory: Trajectory, time: np.ndarray) -> Interpolated:
    """The trajectory at times.

    Parameters
    ----------
    time : (n,) GPS seconds.
    """
    count, epochs = len(time), trajectory.time
    before = np.clip(np.searchsorted(epochs, time + SAME_TIME_S, side="right") - 1, 0, max(len(epochs) - 2, 0))
    refused = _refused(epochs, time, before)
    place, error = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    rank = np.array([RANK.get(kind, len(RANK)) for kind in trajectory.quality.tolist()])
    errors = _Errors(trajectory)
    for k in np.flatnonzero(refused == ""):
        nodes = _nodes(errors.step, epochs, rank, int(before[k]))
        weights = lagrange_weights(epochs[nodes] - time[k])
        place[k] = weights @ trajectory.place[nodes]
        gap = float(epochs[before[k] + 1] - epochs[before[k]])
        share = float(np.clip((time[k] - epochs[before[k]]) / gap, 0.0, 1.0))
        error[k] = errors.around(int(before[k]), gap, len(nodes)) * _share_of_error(share, len(nodes))
        if np.isnan(error[k]).any():
            refused[k] = f"in a gap of {gap:.1f} s, whose error cannot be told"
    worse = np.where(rank[before] >= rank[np.minimum(before + 1, len(epochs) - 1)], before, before + 1)
    quality = np.where(refused == "", trajectory.quality[worse], "")
    sigma = true_sigma(np.maximum(trajectory.sigma[before], trajectory.sigma[worse]), quality)
    place[refused != ""] = np.nan
    return Interpolated(place, np.hypot(sigma, error), error, quality, refused)


def _refused(epochs: np.ndarray, time: np.ndarray, before: np.ndarray) -> np.ndarray:
    """(n,) str, why a time has no position."""
    refused = np.full(len(time), "", dtype="<U80")
    if len(epochs) < 2:
        refused[:] = "the trajectory has a single epoch"
        return refused
    gap = epochs[before + 1] - epochs[before]
    for k in np.flatnonzero(gap > LONGEST_GAP_S):
        refused[k] = f"in a gap of {gap[k]:.1f} s"
    for k in np.flatnonzero(time < epochs[0] - SAME_TIME_S):
        refused[k] = f"{epochs[0] - time[k]:.1f} s before the first epoch"
    for k in np.flatnonzero(time > epochs[-1] + SAME_TIME_S):
        refused[k] = f"{time[k] - epochs[-1]:.1f} s after the last epoch"
    return refused


def _nodes(step: float, epochs: np.ndarray, rank: np.ndarray, before: int) -> np.ndarray:
    """Epochs that are interpolated from: four, or two where an outer one is no good."""
    nodes = np.arange(before - 1, before + 3)
    if nodes[0] < 0 or nodes[-1] >= len(epochs):
        return nodes[1:3]
    outer = np.array([epochs[nodes[1]] - epochs[nodes[0]], epochs[nodes[3]] - epochs[nodes[2]]])
    is_far = (np.abs(outer - step) > STEP_TOLERANCE * step).any()
    is_worse = max(rank[nodes[0]], rank[nodes[3]]) > max(rank[nodes[1]], rank[nodes[2]])
    return nodes[1:3] if is_far or is_worse else nodes


def lagrange_weights(x: np.ndarray) -> np.ndarray:
    """(k,) weights of values at places x (k,) in the polynomial through them at 0 [L: Lagrange]."""
    return np.array([np.prod(np.delete(x, i) / (np.delete(x, i) - x[i])) for i in range(len(x))])


def _share_of_error(share: float, nodes: int) -> float:
    """Error at a place in the gap (0 … 1) over that in its middle [D: the remainder of the polynomial]."""
    inner = 4.0 * share * (1.0 - share)
    return inner if nodes == 2 else inner * (1.0 + share) * (2.0 - share) / 2.25


class _Errors:
    """Errors of interpolation in gaps of a trajectory, by leaving out epochs; each kind of gap is computed once."""

    def __init__(self, trajectory: Trajectory):
        self.trajectory = trajectory
        self.step = float(np.median(np.diff(trajectory.time))) if len(trajectory) > 1 else np.nan
        self._known: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}

    def around(self, epoch: int, gap: float, nodes: int) -> np.ndarray:
        """(3,) m east, north, up: RMS of the error in the middle of a gap (s), near an epoch; NaN if it cannot be told.

        A gap of a single usual step cannot be made by leaving out. Its error goes on from that of four steps over that
        of two: by as much again, and not further than the error of a smooth path does [D: its power is `nodes`].
        """
        steps = max(1, round(gap / self.step))
        if steps > 1:
            return self._rms(epoch, steps, nodes)
        two, four = self._rms(epoch, 2, nodes), self._rms(epoch, 4, nodes)
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.where(four > 0.0, two / four, 1.0)
        return two * np.where(np.isfinite(ratio), np.clip(ratio, 1.0 / 2.0**nodes, 1.0), 1.0)

    def _rms(self, epoch: int, steps: int, nodes: int) -> np.ndarray:
        """(3,) m, RMS of the `TESTED` places nearest to an epoch."""
        key = steps, nodes
        if key not in self._known:
            self._known[key] = self._squares(steps, nodes)
        middle, sums = self._known[key]
        if len(middle) < FEWEST:
            return np.full(3, np.nan)
        first = int(np.clip(np.searchsorted(middle, epoch) - TESTED // 2, 0, max(len(middle) - TESTED, 0)))
        last = min(first + TESTED, len(middle))
        return np.sqrt((sums[last] - sums[first]) / (last - first))

    def _squares(self, steps: int, nodes: int) -> tuple[np.ndarray, np.ndarray]:
        """Epochs in the middle of gaps that leaving out makes, and the running sums (m + 1, 3) of squared errors."""
        time, place = self.trajectory.time, self.trajectory.place
        half = steps // 2
        reach = (-half, steps - half) if nodes == 2 else (-half - 1, -half, steps - half, steps - half + 1)
        middle = np.arange(-reach[0], len(time) - reach[-1])
        if not len(middle):
            return middle, np.zeros((1, 3))
        span = time[middle + reach[-1]] - time[middle + reach[0]]
        even = np.abs(span - (reach[-1] - reach[0]) * self.step) < STEP_TOLERANCE * self.step
        middle = middle[even]
        x = np.stack([time[middle + r] - time[middle] for r in reach])
        weights = [np.prod([x[j] / (x[j] - x[i]) for j in range(len(x)) if j != i], axis=0) for i in range(len(x))]
        found = sum(w[:, None] * (place[middle + r] - place[middle]) for w, r in zip(weights, reach, strict=True))
        squares = (found * metres_of_units(place[middle])) ** 2
        return middle, np.concatenate([np.zeros((1, 3)), np.cumsum(squares, axis=0)])
