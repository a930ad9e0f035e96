"""The ground between heights, above or below a base: what straight lines leave out of a cut or a fill.

[D] Half of what they leave out of the net volume, with its sign, and what both lose alike (see `either_side`). Given
the heights, the ground at a place is normal with mean and variance of kriging, and what is above the base scatters as
that does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from aerotri.volume.counted import PLACES, Counted, near_the_line
from aerotri.volume.either_side import WITHIN
from aerotri.volume.rectified import covariance_above
from aerotri.volume.roughness import AROUND, CHUNK, Between, Ground, Roughness, terms_of_second_order


def between_on_side(ground: Ground, counted: Counted, lost: float) -> Between:
    """What straight triangles leave out above the base, or below it.

    Triangles that lie on one side of the base as a whole scatter as in the net volume, or not at all.

    Parameters
    ----------
    lost : m³, by which straight triangles make the cut and the fill too small alike.
    """
    corners = ground.xyz[ground.triangles]
    scale = np.sqrt(2.0 * ground.area) ** ground.roughness.exponent * ground.roughness.s
    near = near_the_line(counted, corners, np.hypot(scale, np.sqrt(ground.noise)))
    side = counted.sign * counted.at(np.full((len(corners), 1, 3), 1.0 / 3.0), corners)[:, 0] > 0.0
    part, own, tree = side.astype(float), np.flatnonzero(near), KDTree(ground.xyz[:, :2])
    for few in (own[k : k + CHUNK] for k in range(0, len(own), CHUNK)):
        part[few] = _share_above(ground, tree, few, counted)
    found = ground.between(0.5 * counted.sign * ground.more, ground.variance * part)
    return replace(found, curvature=found.curvature + lost)


def sigma_at_places(ground: Ground) -> float:
    """m, root of the mean variance of the ground at a place, given the heights."""
    corners = ground.xyz[ground.triangles[ground.share > 0.0][:CHUNK]]
    covariance = _at_places(ground, KDTree(ground.xyz[:, :2]), corners).covariance
    return float(np.sqrt(max(np.einsum("tqq->tq", covariance).mean(), 0.0)))


def sigma_of_straight_lines(ground: Ground) -> float:
    """m, root of the mean square by which straight lines between heights without noise are off the ground at a place.

    [D] By kriging, in the mean of the ground and beside it; what it finds because of noise is taken off.
    """
    corners = ground.xyz[ground.triangles[ground.share > 0.0][:CHUNK]]
    found = _at_places(ground, KDTree(ground.xyz[:, :2]), corners)
    bent = found.mean - np.einsum("qk,nk->nq", PLACES, corners[:, :, 2])
    square = np.mean(np.einsum("tqq->tq", found.covariance) + np.square(bent))
    return float(np.sqrt(max(square - WITHIN * ground.noise, 0.0)))


@dataclass(frozen=True, eq=False)
class _Places:
    """Ground at `PLACES` of triangles, given the heights around: mean (t, q) m, covariance (t, q, q) m²."""

    mean: np.ndarray
    covariance: np.ndarray


def _share_above(ground: Ground, tree: KDTree, few: np.ndarray, counted: Counted) -> np.ndarray:
    """(t,) variance of the mean over triangles of the ground on a side, over that of the mean of all ground."""
    corners = ground.xyz[ground.triangles[few]]
    found = _at_places(ground, tree, corners)
    straight = counted.at(np.broadcast_to(PLACES, (len(few), *PLACES.shape)), corners)
    places = np.einsum("qk,nkc->nqc", PLACES, corners)
    above = counted.sign * (straight + found.mean - places[:, :, 2])
    sigma = np.sqrt(np.maximum(np.einsum("tqq->tq", found.covariance), 0.0))
    t = np.clip(above / np.maximum(sigma, 1e-300), -40.0, 40.0)
    whole = np.maximum(found.covariance.mean(axis=(1, 2)), 1e-300)
    return np.clip(covariance_above(t, sigma, found.covariance).mean(axis=(1, 2)) / whole, 0.0, 1.0)


def _at_places(ground: Ground, tree: KDTree, corners: np.ndarray) -> _Places:
    """[L: universal kriging] in coordinates of the size of each neighbourhood, as the means over triangles.

    The weights know the noise of the heights, the covariance is of the ground less the same mean of heights without it:
    what noise does to that mean moves the volume as well, and is its part of matching.
    """
    middle = corners.mean(axis=1)
    near = np.asarray(tree.query(middle[:, :2], AROUND)[1])
    at = ground.xyz[near][:, :, :2] - middle[:, None, :2]
    size = np.abs(at).max(axis=(1, 2))
    at = at / size[:, None, None]
    inside = PLACES @ (corners - middle[:, None])[:, :, :2] / size[:, None, None]
    unit = Roughness(1.0, ground.roughness.exponent)
    gap, to_inside, within = (
        unit.covariance(np.linalg.norm(a[:, :, None] - b[:, None], axis=-1))
        for a, b in ((at, at), (at, inside), (inside, inside))
    )
    level = ground.roughness.s**2 * size ** (2.0 * unit.exponent)
    share = level / np.maximum(level + ground.noise, 1e-300)
    nugget = np.where(level > 0.0, 1.0 - share, 1.0)
    system = np.zeros((len(at), AROUND + 6, AROUND + 6))
    system[:, :AROUND, :AROUND] = share[:, None, None] * gap + nugget[:, None, None] * np.eye(AROUND)
    system[:, :AROUND, AROUND:] = terms_of_second_order(at)
    system[:, AROUND:, :AROUND] = np.swapaxes(system[:, :AROUND, AROUND:], 1, 2)
    right = [share[:, None, None] * to_inside, np.swapaxes(terms_of_second_order(inside), 1, 2)]
    weights = np.linalg.solve(system, np.concatenate(right, axis=1))[:, :AROUND]
    mean = np.einsum("tiq,ti->tq", weights, ground.xyz[near, 2] - middle[:, 2:]) + middle[:, 2:]
    cross = np.swapaxes(weights, 1, 2) @ to_inside
    covariance = within - cross - np.swapaxes(cross, 1, 2) + np.swapaxes(weights, 1, 2) @ gap @ weights
    return _Places(mean, level[:, None, None] * covariance)
