"""The part of a large block on which sets of additional parameters are compared.

Sets differ by far more than a tenth of the image points of a large block can tell, and each is adjusted: the choice is
made on a sample, the set chosen is adjusted with everything.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.ray_status import RayStatus, with_lonely_rays
from aerotri.adjustment.unknowns import Unknowns
from aerotri.observations.order import ranks_of

MOST_PHOTOGRAPHS = 600
"""Photographs of a sample [C]: an area of some twenty by thirty, more than image errors need to be told apart."""
RAYS_A_PHOTOGRAPH = 60
"""Image points of a photograph that a sample keeps at least, where it has so many [C]: a point for each cell of 9 × 7,
and with hundreds of photographs some tens of thousands of rays."""
HELD_BY = 3
"""Control points that hold a block without positions of its photographs: an area with fewer has no datum."""
PLACES_TRIED = 30
"""Places at most where the area of a sample may lie [C]."""


def sampled_status(prepared: Prepared) -> np.ndarray:
    """(m,) status of the rays with those outside the sample off; that of the block where it is small enough.

    The area is where most control points are; of its object points those with the most rays stay, until every
    photograph has enough, and every point whose coordinates are given. Control alone has to hold the area as well.
    """
    u = prepared.system.unknowns
    status = prepared.ray_status.copy()
    inside = _area(u, prepared.state.centre, prepared.state.points)
    if inside is not None:
        off = np.ones(len(u.block.images), dtype=bool)
        off[inside] = False
        of_area = status.copy()
        of_area[(status == RayStatus.USED) & off[u.block.image_points.image]] = RayStatus.OFF
        of_area = with_lonely_rays(u.block, of_area)
        if u.block.gnss_ins is not None or _control_seen(u, of_area) >= min(_control_seen(u, status), HELD_BY):
            status = of_area
    return with_lonely_rays(u.block, _thinned(u, status))


def _control_seen(unknowns: Unknowns, status: np.ndarray) -> int:
    """Control points with two rays or more."""
    rays = unknowns.block.image_points
    count = np.bincount(rays.point[status == RayStatus.USED], minlength=len(unknowns.block.points))
    return int(np.sum(count[unknowns.points[(unknowns.prior_weight > 0.0).any(axis=1)]] >= 2))


def _area(unknowns: Unknowns, centre: np.ndarray, points: np.ndarray) -> np.ndarray | None:
    """Rows of the photographs nearest to the place with most control; None where all may stay."""
    if len(centre) <= MOST_PHOTOGRAPHS:
        return None
    control = points[(unknowns.prior_weight > 0.0).any(axis=1), :2]
    middle = np.median(centre[:, :2], axis=0)
    order = np.lexsort((*control.T, np.linalg.norm(control - middle, axis=1)))
    places = [middle, *control[order[:: max(len(control) // PLACES_TRIED, 1)]]]
    best, most = None, -1
    for place in places:
        distance = np.linalg.norm(centre[:, :2] - place, axis=1)
        rows = np.lexsort((ranks_of(unknowns.block).image[unknowns.images], distance))[:MOST_PHOTOGRAPHS]
        radius = float(distance[rows[-1]])
        count = int(np.sum(np.linalg.norm(control - place, axis=1) < radius))
        if count > most:
            best, most = rows, count
    assert best is not None
    return unknowns.images[best]


def _thinned(unknowns: Unknowns, status: np.ndarray) -> np.ndarray:
    """The status with rays of object points off that no photograph needs to have enough."""
    block, rays = unknowns.block, unknowns.block.image_points
    used = np.flatnonzero(status == RayStatus.USED)
    image, point = rays.image[used], rays.point[used]
    photographs = len(np.unique(image))
    if len(used) <= RAYS_A_PHOTOGRAPH * max(photographs, 1):
        return status
    count = np.bincount(point, minlength=len(block.points))
    given = np.zeros(len(block.points), dtype=bool)
    given[block.control.point] = True
    if block.constraints is not None:
        for members in block.constraints.points:
            given[members] = True
    by_point = np.argsort(point, kind="stable")
    first = np.searchsorted(point[by_point], np.arange(len(block.points) + 1))
    # places by rank are as good as drawn: ranks follow image coordinates, not the ground
    order = np.lexsort((_scattered(ranks_of(block).point), -count))
    kept, have = given & (count > 0), np.zeros(len(block.images), dtype=np.int64)
    for row in order.tolist():
        if count[row] < 2 or kept[row]:
            continue
        own = image[by_point[first[row] : first[row + 1]]]
        if have[own].min() < RAYS_A_PHOTOGRAPH:
            kept[row] = True
            have[own] += 1
    status = status.copy()
    status[used[~kept[point]]] = RayStatus.OFF
    return status


def _scattered(rank: np.ndarray) -> np.ndarray:
    """Ranks in an order as if drawn, the same for any order of rows."""
    return np.random.default_rng(len(rank)).permutation(len(rank))[rank]
