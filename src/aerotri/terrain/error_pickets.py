"""Error pickets: what a person looks for in a set of pickets, as Tran (2007) lists it.

Neighbours usually have almost the same parallax: a picket that is off the plane through its neighbours by more than
their own unevenness explains is one. In the TIN a peak or a pit is formed by one or two pickets. Backward matching is
part of the measuring (see `pickets`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import Delaunay, KDTree

from aerotri.conventions import SIGMA_PER_MAD
from aerotri.terrain.picket_status import PicketStatus
from aerotri.terrain.pickets import Pickets
from aerotri.terrain.tin import order_in_plan

N_NEIGHBOURS = 12
"""Neighbours that a picket is held against; chosen [C]: about the two rings around it; fewer can be outvoted by errors,
more reach over breaks of the ground."""
LIMIT = 6.0
"""Deviations from which on a picket is in error; those of undisturbed terrain are far from normal."""
SMALLEST_PX = 1.0
"""Posts of parallax below which a deviation is none: photographs do not show it."""
PEAK_LIMIT = 4.0
"""What a peak stands out by, over what corners around it differ from their neighbours; chosen [C]: less takes off
summits, more leaves errors in."""


def with_error_pickets(pickets: Pickets, metres_per_px: float) -> Pickets:
    """The pickets with those in error marked.

    Parameters
    ----------
    metres_per_px : of height, per pixel of parallax.
    """
    status = pickets.status.copy()
    floor = SMALLEST_PX * metres_per_px
    for _ in range(2):
        own = np.flatnonzero(status == PicketStatus.ACCEPTED)
        if len(own) <= N_NEIGHBOURS:
            break
        wrong = own[_off_neighbours(pickets.xyz[own], floor)]
        if not len(wrong):
            break
        status[wrong] = PicketStatus.NEIGHBOURS
    own = np.flatnonzero(status == PicketStatus.ACCEPTED)
    if len(own) > N_NEIGHBOURS:
        status[own[peaks_and_pits(pickets.xyz[own], floor)]] = PicketStatus.PEAK
    return replace(pickets, status=status)


def _off_neighbours(xyz: np.ndarray, floor: float) -> np.ndarray:
    """(n,) bool: off the plane through the neighbours, fitted robustly, by more than their unevenness."""
    near = np.asarray(KDTree(xyz[:, :2]).query(xyz[:, :2], N_NEIGHBOURS + 1)[1])[:, 1:]
    delta = xyz[near] - xyz[:, None]
    design = np.concatenate([np.ones((*delta.shape[:2], 1)), delta[..., :2]], axis=2)
    weight = np.ones(delta.shape[:2])
    scale = np.ones(len(xyz))
    plane = np.zeros((len(xyz), 3))
    size = np.sqrt(np.mean(delta[..., :2] ** 2, axis=(1, 2)))
    design[..., 1:] /= np.maximum(size, 1e-9)[:, None, None]
    for _ in range(5):
        weighted = design * weight[..., None]
        normal = np.einsum("nki,nkj->nij", weighted, design) + 1e-9 * np.eye(3)
        plane = np.linalg.solve(normal, np.einsum("nki,nk->ni", weighted, delta[..., 2])[..., None])[..., 0]
        residual = delta[..., 2] - np.einsum("nki,ni->nk", design, plane)
        scale = np.maximum(SIGMA_PER_MAD * np.median(np.abs(residual), axis=1), 1e-9)
        weight = 1.0 / (1.0 + (residual / (2.0 * scale[:, None])) ** 2)
    return np.abs(plane[:, 0]) > np.maximum(LIMIT * scale, floor)


def peaks_and_pits(xyz: np.ndarray, floor: float) -> np.ndarray:
    """(n,) bool: corners of the TIN that stand out of all their neighbours but one, as steeply as no other ground.

    A corner stands out where it is higher, or lower, than its neighbours by more than `PEAK_LIMIT` times what corners
    around differ from theirs.
    """
    order = order_in_plan(xyz)
    standing = np.empty(len(xyz), dtype=bool)
    standing[order] = _stand_out(xyz[order], floor)
    return standing


def _stand_out(xyz: np.ndarray, floor: float) -> np.ndarray:
    delaunay = Delaunay(xyz[:, :2] - xyz[:, :2].mean(axis=0))
    start, neighbours = delaunay.vertex_neighbor_vertices
    count = np.diff(start)
    owner = np.repeat(np.arange(len(xyz)), count)
    difference = xyz[owner, 2] - xyz[neighbours, 2]
    above = np.bincount(owner, difference > 0.0, len(xyz))
    mean = np.bincount(owner, difference, len(xyz)) / np.maximum(count, 1)
    around = np.bincount(owner, np.abs(mean[neighbours]), len(xyz)) / np.maximum(count, 1)
    alone = (above >= count - 1) | (above <= 1)
    typical = np.maximum(around, SIGMA_PER_MAD * np.median(np.abs(mean)))
    return alone & (np.abs(mean) > np.maximum(PEAK_LIMIT * typical, floor))
