"""The ground between pickets above, or below, a base: what straight triangles leave out of a cut or a fill.

[D] Given the heights, the ground at a place is normal with the mean and variance of kriging. Where the base runs through
the ground between pickets, the cut holds E max(h, 0) there, which is more than that of the mean: straight triangles
make both cut and fill too small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from aerotri.volume.rectified import covariance_above, expected_above
from aerotri.volume.roughness import (
    AROUND,
    CHUNK,
    PARTS,
    RULES,
    Roughness,
    places_within,
    terms_of_second_order,
)

PLACES = places_within(PARTS, RULES[0])
"""(q, 3) places within a triangle."""


@dataclass(frozen=True, eq=False)
class Crossed:
    """Triangles that the base cuts, or may cut.

    Parameters
    ----------
    more : (t,) m, mean over each of what the ground above the base is expected to hold beyond the straight triangle.
    share : (t,) variance of the mean of the ground above the base over that of the mean of all its ground.
    variance : (t,) m², mean over each of the variance of the ground at a place.
    """

    more: np.ndarray
    share: np.ndarray
    variance: np.ndarray


def crossed(
    roughness: Roughness, xyz: np.ndarray, triangles: np.ndarray, noise: float, below: np.ndarray, sign: float,
    tree: KDTree,
) -> Crossed:  # fmt: skip
    """Of triangles (t, 3): `below` (t, q) m, the base at `PLACES` of each; sign 1 for what is above it, −1 below."""
    parts = [
        _kriged(roughness, xyz, triangles[k : k + CHUNK], noise, below[k : k + CHUNK], sign, tree)
        for k in range(0, len(triangles), CHUNK)
    ]
    return Crossed(*(np.concatenate([np.asarray(part[i]) for part in parts] or [np.zeros(0)]) for i in range(3)))


def _kriged(roughness, xyz, triangles, noise, below, sign, tree):
    corners = xyz[triangles]
    middle = corners.mean(axis=1)
    near = np.asarray(tree.query(middle[:, :2], AROUND)[1])
    at = xyz[near][:, :, :2] - middle[:, None, :2]
    size = np.abs(at).max(axis=(1, 2))
    at = at / size[:, None, None]
    inside = PLACES @ (corners - middle[:, None])[:, :, :2] / size[:, None, None]
    unit = Roughness(1.0, roughness.exponent)
    gap = unit.covariance(_gaps(at, at))
    to_inside = unit.covariance(_gaps(at, inside))
    within = unit.covariance(_gaps(inside, inside))
    level = roughness.s**2 * size ** (2.0 * roughness.exponent)
    share = (level / np.maximum(level + noise, 1e-300))[:, None, None]
    nugget = np.where(level > 0.0, 1.0 - share[:, 0, 0], 1.0)[:, None, None] * np.eye(AROUND)
    system = np.zeros((len(at), AROUND + 6, AROUND + 6))
    system[:, :AROUND, :AROUND] = share * gap + nugget
    system[:, :AROUND, AROUND:] = terms_of_second_order(at)
    system[:, AROUND:, :AROUND] = np.swapaxes(system[:, :AROUND, AROUND:], 1, 2)
    right = np.concatenate([share * to_inside, np.swapaxes(terms_of_second_order(inside), 1, 2)], axis=1)
    weights = np.linalg.solve(system, right)[:, :AROUND]
    mean = np.einsum("tiq,ti->tq", weights, xyz[near, 2] - middle[:, 2:]) + middle[:, 2:]
    cross = np.swapaxes(weights, 1, 2) @ to_inside
    covariance = within - cross - np.swapaxes(cross, 1, 2) + np.swapaxes(weights, 1, 2) @ gap @ weights
    covariance *= level[:, None, None]
    diagonal = np.einsum("tqq->tq", covariance)
    sigma = np.sqrt(np.maximum(diagonal, 0.0))
    above = sign * (mean - below)
    straight = np.maximum(sign * (np.einsum("qk,tk->tq", PLACES, corners[:, :, 2]) - below), 0.0)
    t = np.clip(above / np.maximum(sigma, 1e-300), -40.0, 40.0)
    whole = covariance.mean(axis=(1, 2))
    part = covariance_above(t, sigma, covariance).mean(axis=(1, 2)) / np.maximum(whole, 1e-300)
    return (expected_above(above, sigma) - straight).mean(axis=1), np.clip(part, 0.0, 1.0), diagonal.mean(axis=1)


def _gaps(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.linalg.norm(one[:, :, None] - other[:, None], axis=-1)
