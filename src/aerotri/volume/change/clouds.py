"""Distances of two point clouds along the normals of the first (M3C2), each against its σ.

[L] Lague, Brodu and Leroux 2013 (ISPRS J. 82): at a core point the normal n is that of the first cloud within half the
diameter D; of both clouds the points in a cylinder of diameter d about n, at most `reach` away, have the mean places
i₁ and i₂ along it; the distance is L = i₂ − i₁. Without σ of the points its level of detection (95 %) is
1.96·(√(s₁²/n₁ + s₂²/n₂) + reg), s the scatter along n; with them, as James, Robson and Smith 2017 (Earth Surf. Process.
Landf. 42) have it, 1.96·(√(σ₁² + σ₂²) + reg), σ² the mean of nᵀCn over the cylinder: errors that neighbours share do
not average out, so nothing is divided by n.

[D] Where the adjustments are known by themselves, see `adjusted_clouds`, the noise of matching is left. It is an error
of Z, n_z·σ along the normal, and neighbours share it over the noise length ℓ: its mean over a cylinder, which covers
A = n_z·πd²/4 in plan, has the variance n_z²·mean σ²·max(1/n, min(1, ℓ²/A)).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from aerotri.conventions import SIGMAS_OF_95

LEVEL = SIGMAS_OF_95
"""Standard deviations of 95 %."""
FEWEST = 4
"""Points of a cloud in a cylinder, or about a normal, from which there is a distance [C]."""
PAIRS_AT_ONCE = 2_000_000
"""Pairs of core point and point looked at together [C]: some 300 MB."""


@dataclass(frozen=True, eq=False)
class Cloud:
    """A point cloud.

    Parameters
    ----------
    xyz : (n, 3) m. covariance : (n, 6) m², XX, YY, ZZ, XY, XZ, YZ; None where the points have no σ.
    matching : (n,) m, σ of Z by matching alone; None where not known apart.
    photographs : (n,) how many measured a point; None where not known.
    noise_length : m, side of the square in plan whose points share their noise of matching; None where not known.
    """

    xyz: np.ndarray
    covariance: np.ndarray | None
    matching: np.ndarray | None = None
    photographs: np.ndarray | None = None
    noise_length: float | None = None


@dataclass(frozen=True)
class Scales:
    """Sizes of M3C2, m.

    Parameters
    ----------
    cylinder : its diameter. normal : diameter of the ball whose points give a normal. reach : largest distance sought.
    """

    cylinder: float
    normal: float
    reach: float


@dataclass(frozen=True, eq=False)
class CloudDistances:
    """Distances at core points; NaN where one of the clouds has too few points.

    Parameters
    ----------
    core, normal : (k, 3) m, unit vectors that point upwards. distance, sigma : (k,) m, second less first along the
        normal. count : (k, 2) points in the cylinder. scatter : (k, 2) m, of them along the normal.
    variance : (k, 2) m², of the mean place of either cloud along the normal, in all.
    noise : (k, 2) m², what matching alone has of it; NaN where that is not known apart.
    """

    core: np.ndarray
    normal: np.ndarray
    distance: np.ndarray
    sigma: np.ndarray
    count: np.ndarray
    scatter: np.ndarray
    variance: np.ndarray
    noise: np.ndarray

    def level(self, registration_m: float) -> np.ndarray:
        """(k,) m, level of detection, 95 %."""
        return LEVEL * (self.sigma + registration_m)

    def with_variances(self, variance: np.ndarray) -> CloudDistances:
        """The same with variances (k,) m² of the distances."""
        return replace(self, sigma=np.where(np.isfinite(self.distance), np.sqrt(variance), np.nan))


def core_points(xyz: np.ndarray, spacing: float) -> np.ndarray:
    """(k,) rows of points, the one nearest to the middle of every cube of a side that holds any."""
    cube = np.floor((xyz - xyz.min(axis=0)) / spacing)
    away = np.linalg.norm((xyz - xyz.min(axis=0)) / spacing - cube - 0.5, axis=1)
    order = np.lexsort((away, *cube.T))
    first = np.append(True, (np.diff(cube[order], axis=0) != 0.0).any(axis=1))
    return np.sort(order[first])


def cloud_distances(first: Cloud, second: Cloud, core: np.ndarray, scales: Scales) -> CloudDistances:
    """Distances from a cloud to another one.

    Parameters
    ----------
    core : (k, 3) m, places where distances are wanted.
    """
    origin = first.xyz.mean(axis=0)
    clouds = [replace(cloud, xyz=cloud.xyz - origin) for cloud in (first, second)]
    trees = [KDTree(cloud.xyz) for cloud in clouds]
    normal = normals(trees[0], clouds[0].xyz, core - origin, 0.5 * scales.normal)
    known = np.isfinite(normal[:, 0])
    means, variances, scatter, noise = (np.full((len(core), 2), np.nan) for _ in range(4))
    count = np.zeros((len(core), 2), np.int64)
    for k, (tree, cloud) in enumerate(zip(trees, clouds, strict=True)):
        found = _along(tree, cloud, (core - origin)[known], normal[known], scales)
        count[known, k], means[known, k], scatter[known, k], variances[known, k], noise[known, k] = found
    few = (count < FEWEST).any(axis=1)
    distance = np.where(few, np.nan, means[:, 1] - means[:, 0])
    sigma = np.where(few, np.nan, np.sqrt(variances.sum(axis=1)))
    return CloudDistances(core, normal, distance, sigma, count, scatter, variances, noise)


def normals(tree: KDTree, xyz: np.ndarray, core: np.ndarray, radius: float) -> np.ndarray:
    """(k, 3) upward normals of the points within a radius of places; NaN where they are too few or lie on a line."""
    out = np.full((len(core), 3), np.nan)
    for rows, place, point in _pairs(tree, core, radius):
        u, n = xyz[point] - core[rows[place]], len(rows)
        count = np.bincount(place, minlength=n)
        mean = np.column_stack([np.bincount(place, u[:, a], n) for a in range(3)]) / np.maximum(count, 1)[:, None]
        u -= mean[place]
        spread = np.empty((n, 3, 3))
        for a in range(3):
            for b in range(a, 3):
                spread[:, a, b] = spread[:, b, a] = np.bincount(place, u[:, a] * u[:, b], n)
        values, vectors = np.linalg.eigh(spread)
        found = vectors[:, :, 0] * np.where(vectors[:, 2:3, 0] < 0.0, -1.0, 1.0)
        flat = (count >= FEWEST) & (values[:, 1] > 1e-9 * np.maximum(values[:, 2], 1e-300))
        out[rows[flat]] = found[flat]
    return out


def _along(tree: KDTree, cloud: Cloud, core: np.ndarray, normal: np.ndarray, scales: Scales) -> tuple[np.ndarray, ...]:
    """Number, mean, scatter, variance of the mean and that of matching (k,) of the points in the cylinders."""
    k, half = len(core), 0.5 * scales.cylinder
    slices = int(np.ceil(scales.reach / scales.cylinder))
    # the cylinder in pieces as long as wide, each of which a ball about its middle holds
    offset = np.arange(-slices, slices + 1) * scales.cylinder
    count, sums = np.zeros(k, np.int64), np.zeros((k, 4))
    for away in offset.tolist():
        for rows, place, point in _pairs(tree, core + away * normal, np.sqrt(2.0) * half):
            axis, n = normal[rows[place]], len(rows)
            u = cloud.xyz[point] - core[rows[place]]
            along = np.einsum("ij,ij->i", u, axis)
            across = np.linalg.norm(u - along[:, None] * axis, axis=1)
            inside = (across <= half) & (along >= away - half) & (along < away + half) & (np.abs(along) <= scales.reach)
            place, along, axis, point = place[inside], along[inside], axis[inside], point[inside]
            count[rows] += np.bincount(place, minlength=n)
            nothing = np.zeros_like(along)
            terms = [
                along, along**2,
                nothing if cloud.covariance is None else quadratic(cloud.covariance[point], axis),
                nothing if cloud.matching is None else (cloud.matching[point] * axis[:, 2]) ** 2,
            ]  # fmt: skip
            sums[rows] += np.column_stack([np.bincount(place, term, n) for term in terms])
    with np.errstate(invalid="ignore", divide="ignore"):
        mean, square, of_points, of_matching = (sums / count[:, None]).T
        scatter = np.sqrt(np.maximum(square - mean**2, 0.0) * count / np.maximum(count - 1, 1))
        variance = scatter**2 / count if cloud.covariance is None else of_points
        noise = np.full(k, np.nan) if cloud.matching is None else of_matching * _left(cloud, count, normal, scales)
    return count, mean, scatter, variance, noise


def _left(cloud: Cloud, count: np.ndarray, normal: np.ndarray, scales: Scales) -> np.ndarray:
    """(k,) share of a point's noise that a mean over a cylinder has left; 1 where the noise length is not known."""
    if cloud.noise_length is None:
        return np.ones(len(count))
    area = 0.25 * np.pi * scales.cylinder**2 * np.maximum(normal[:, 2], 1e-9)
    return np.maximum(1.0 / count, np.minimum(1.0, cloud.noise_length**2 / area))


def quadratic(c: np.ndarray, n: np.ndarray) -> np.ndarray:
    """(m,) nᵀCn of covariances (m, 6), as in `Cloud`, and directions (m, 3)."""
    x, y, z = n.T
    return (
        c[:, 0] * x**2 + c[:, 1] * y**2 + c[:, 2] * z**2
        + 2.0 * (c[:, 3] * x * y + c[:, 4] * x * z + c[:, 5] * y * z)
    )  # fmt: skip


def _pairs(tree: KDTree, places: np.ndarray, radius: float) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Points within a radius of places, some at a time: rows of the places, place among them and point of a pair."""
    begin = 0
    while begin < len(places):
        end = min(begin + 100_000, len(places))
        counts = tree.query_ball_point(places[begin:end], radius, return_length=True, workers=-1)
        fit = int(np.searchsorted(np.cumsum(counts), PAIRS_AT_ONCE, side="right"))
        end = begin + max(min(fit, end - begin), 1)
        found = tree.query_ball_point(places[begin:end], radius, workers=-1)
        own = counts[: end - begin]
        point = np.concatenate([np.asarray(one, dtype=np.int64) for one in found])
        yield np.arange(begin, end), np.repeat(np.arange(end - begin), own), point
        begin = end


def registration_of(found: CloudDistances, stable: np.ndarray) -> tuple[float, float]:
    """Mean distance on stable ground, m, and what distances scatter there beyond their σ, m.

    Parameters
    ----------
    stable : (k,) bool.
    """
    own = stable & np.isfinite(found.distance) & np.isfinite(found.sigma)
    if not own.any():
        return np.nan, np.nan
    excess = float(np.mean(found.distance[own] ** 2 - found.sigma[own] ** 2))
    return float(found.distance[own].mean()), float(np.sqrt(max(excess, 0.0)))
