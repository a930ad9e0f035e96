"""Errors of observed positions that stay for a while: a first-order Gauss-Markov process along the flight.

[L: Gelb 1974] An observed position has the error c(t) + e: e white, with the σ of the table, and c a process of each
coordinate with covariance σ_c²·exp(−|t − t'|/τ) within a flight. c is an unknown at nodes, observed together as 0 with
the inverse of this covariance, which is tridiagonal. Nodes are the exposures themselves, and the model exact, up to
MOST_EXACT columns. In larger blocks nodes are about a quarter of τ apart [C]. Between two nodes c is its conditional
mean (of such a process given by these two alone), and the conditional variance is added to the white part, so that the
variance of every observed position is exact; only the correlation of what is left over between two nodes is lost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.exposures import Exposures

KIND = "position error"
"""Kind of the shared parameters that are nodes."""
MOST_EXACT = 900
"""Columns up to which every exposure is a node."""
MOST = 2100
"""Columns at most: nodes are then farther apart than NODE_STEP."""
NODE_STEP = 0.25
"""Distance of nodes in correlation times [C]: what they leave to the white part is at most 12 % of the variance."""


@dataclass(frozen=True, eq=False)
class ErrorNodes:
    """Where the process is an unknown, and how it acts on g exposures from there.

    Parameters
    ----------
    rows : (m,) exposures that are nodes, by flight and time.
    before, after : (g,) number of the nodes on both sides. by_before, by_after : (g,) weight of each.
    left : (g,) share of the variance of the process that the nodes do not carry.
    exposures : the m nodes.
    step : (m,) time from the node before, inf for the first of a flight.
    """

    rows: np.ndarray
    before: np.ndarray
    after: np.ndarray
    by_before: np.ndarray
    by_after: np.ndarray
    left: np.ndarray
    exposures: Exposures
    step: np.ndarray

    def precision(self, time: float) -> np.ndarray:
        """(m, m) inverse of the correlation of the nodes."""
        return markov_precision(self.step, time)


def error_nodes(exposures: Exposures, time: float, coordinates: int = 3) -> ErrorNodes:
    """Nodes for a correlation time, at exposures.

    Parameters
    ----------
    coordinates : that have such errors.
    """
    order = exposures.order
    flight, when = exposures.flight[order], exposures.time[order]
    same = np.concatenate([[False], (np.diff(flight) == 0) & (np.diff(when) <= 0.0)])
    distinct = int((~same).sum())
    apart = 0.0
    if coordinates * distinct > MOST_EXACT:
        apart = NODE_STEP * time
        while coordinates * int(_nodes(flight, when, apart).sum()) > MOST:
            apart *= 1.25
    chosen = np.flatnonzero(_nodes(flight, when, apart))
    # number of the last node at or before every exposure, in order
    before = np.searchsorted(chosen, np.arange(len(order)), side="right") - 1
    last = np.append(np.diff(flight[chosen]) != 0, True)
    at_node = when == when[chosen][before]
    after = np.where(at_node | last[before], before, before + 1)
    since, until = when - when[chosen][before], when[chosen][after] - when
    by_before, by_after, left = _bridge(since / time, until / time)
    back = np.empty(len(order), dtype=np.int64)
    back[order] = np.arange(len(order))
    step = np.full(len(chosen), np.inf)
    inner = np.diff(flight[chosen]) == 0
    step[1:][inner] = np.diff(when[chosen])[inner]
    return ErrorNodes(
        order[chosen], before[back], after[back], by_before[back], by_after[back], left[back],
        exposures.taken(order[chosen]), step,
    )  # fmt: skip


def _nodes(flight: np.ndarray, when: np.ndarray, apart: float) -> np.ndarray:
    """(g,) bool of exposures in order: first and last of a flight, between them as few as are `apart` at most."""
    node = np.zeros(len(when), dtype=bool)
    at = -np.inf
    for k in range(len(when)):
        first = k == 0 or flight[k] != flight[k - 1]
        last = k + 1 == len(when) or flight[k + 1] != flight[k]
        if first or (when[k] > at and (last or when[k + 1] - at > apart)):
            node[k], at = True, when[k]
    return node


def _bridge(since: np.ndarray, until: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights of the two nodes around an exposure, and the share of the variance left; times in correlation times."""
    whole = since + until
    inside = whole > 0.0
    scale = -np.expm1(-2.0 * np.where(inside, whole, 1.0))
    by_before = np.where(inside, np.exp(-since) * -np.expm1(-2.0 * until) / scale, 1.0)
    by_after = np.where(inside, np.exp(-until) * -np.expm1(-2.0 * since) / scale, 0.0)
    left = np.where(inside, 1.0 - by_before * np.exp(-since) - by_after * np.exp(-until), 0.0)
    return by_before, by_after, np.maximum(left, 0.0)


def markov_precision(step: np.ndarray, time: float) -> np.ndarray:
    """(m, m) inverse of exp(−|t_i − t_j|/τ), tridiagonal; step (m,) from the one before, inf where a flight begins."""
    from_last = np.exp(-step / time)
    gain = 1.0 / -np.expm1(-2.0 * step / time)
    m = len(step)
    precision = np.zeros((m, m))
    k = np.arange(m)
    precision[k, k] = gain
    precision[k[:-1], k[:-1]] += from_last[1:] ** 2 * gain[1:]
    precision[k[1:], k[:-1]] = precision[k[:-1], k[1:]] = -from_last[1:] * gain[1:]
    return precision
