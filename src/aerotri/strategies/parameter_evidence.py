"""What observations that had no part in it say of a set of additional parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri import of_known
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.unknowns import State, Unknowns
from aerotri.observations.order import ranks_of
from aerotri.results.parameter_comparison import Evidence
from aerotri.statistics.clusters import cluster_schemes
from aerotri.strategies.control_prediction import ControlPrediction, control_rows
from aerotri.strategies.group_prediction import areas, predict_groups

MOST_AREAS, PHOTOGRAPHS_OF_AREA = 12, 3
"""Areas that a block is divided into at most, and photographs that each has at least [C]: twelve differences give a
standard error good to a fifth, and points in three photographs tell image errors from orientation."""
FEWEST_AREAS = 3
"""Areas below which nothing is said [C]: no standard error worth the name."""


@dataclass(frozen=True, eq=False)
class Divisions:
    """Groups of photographs, each rows of the block, that are predicted by the rest: areas and strips."""

    areas: tuple[np.ndarray, ...]
    strips: tuple[np.ndarray, ...]


def divisions_of(unknowns: Unknowns, state: State) -> Divisions:
    """Areas and strips of a block, where it has enough photographs."""
    count = min(MOST_AREAS, len(unknowns.images) // PHOTOGRAPHS_OF_AREA)
    if count < FEWEST_AREAS:
        return Divisions((), ())
    found = areas(unknowns.block, unknowns.images, state.centre, count)
    strips: list[np.ndarray] = []
    for clusters in cluster_schemes(unknowns.block, unknowns.images, state.centre):
        if clusters.scheme == "strip":
            rank = ranks_of(unknowns.block).image
            strips = [unknowns.images[clusters.label == k] for k in range(len(clusters))]
            strips.sort(key=lambda own: int(rank[own].min()))
    if len(strips) < FEWEST_AREAS:
        strips = []
    return Divisions(tuple(found), tuple(strips))


def evidence_of(
    system: NormalSystem,
    solution: Solution,
    factor: Factor,
    status: np.ndarray,
    divisions: Divisions,
    predicted: ControlPrediction,
    variance: float,
) -> Evidence:
    """Image points of areas and strips, and control points, each predicted by the rest.

    Parameters
    ----------
    factor : undamped, at the solution. status : (m,) of the rays of the block. variance : σ̂0².
    """
    said = [
        predict_groups(system, solution, factor, status, groups, variance).deviance
        for groups in (divisions.areas, divisions.strips)
    ]
    u = system.unknowns
    weight = u.prior_weight[control_rows(u)]
    with np.errstate(divide="ignore", invalid="ignore"):
        of_axes = np.square(predicted.sigma) + 1.0 / weight
        density = np.square(predicted.difference) / of_axes + np.log(of_axes)
        height = of_known.rms(predicted.sigma[:, 2])
    control = np.where(np.isfinite(density).any(axis=1), np.nansum(density, axis=1), np.nan)
    return Evidence(said[0], said[1], control, height)
