"""How rough the ground is between its pickets, and what that leaves open about integrals.

[C] The ground is taken as an intrinsic random function with the semivariogram γ(h) = s²·h^(2H), 0 < H < 1: rough for
small H, smooth for H near 1. s and H come from the surface itself: from how far a point lies off the second-order
surface through its neighbours (contrasts Σλz with Σλ = 0 that no such surface moves), at two spacings. Var Σλz =
−ΣΣ λ_i·λ_j·γ(d_ij) holds for every contrast; the error of an integral by interpolation is one too. What curves smoothly
is no chance: straight triangles cut every hill off and fill every hollow. How much, a smooth surface through the same
pickets tells; that difference counts as a σ besides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CloughTocher2DInterpolator, LinearNDInterpolator
from scipy.spatial import KDTree

from aerotri.rasters import Grid
from aerotri.volume.bases import quadrature_of
from aerotri.volume.boundary import Boundary
from aerotri.volume.triangles import areas

SMOOTHEST, ROUGHEST = 0.9, 0.05
NEIGHBOURS = 14
"""Pickets that the second-order surface goes through by least squares."""
LONGEST_WEIGHT = 1.5
"""Contrasts that extrapolate are left out."""
ENOUGH = 30
MOST_CONTRASTS = 4000
THINNED = 4
"""The wider spacing has a picket in so many."""
SUBDIVISION = 4
CURVATURE_PANELS = 60
MOST_TRIANGLES = 4000
MEAN_DISTANCE = 0.364
"""Of two random places in an equilateral triangle, over its side."""
PATCHES, PATCH_TRIANGLES = 12, 100
"""Neighbouring triangles share corners, so their errors add up: the variance of a sum is two to three times the sum of
variances. The factor is taken from so many patches of so many triangles (within 10 % of that of large areas)."""


@dataclass(frozen=True)
class Roughness:
    """γ(h) = s²·h^(2H); s in m at a distance of 1 m."""

    s: float
    exponent: float

    def semivariogram(self, distance: np.ndarray) -> np.ndarray:
        """m²."""
        return self.s**2 * np.asarray(distance) ** (2.0 * self.exponent)

    def contrast_variance(self, xy: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """(…,) m², variance of Σλz at places (…, n, 2) with weights (…, n) that add up to zero."""
        gap = np.linalg.norm(xy[..., :, None, :] - xy[..., None, :, :], axis=-1)
        return -np.einsum("...i,...ij,...j->...", weights, self.semivariogram(gap), weights)


@dataclass(frozen=True, eq=False)
class _Contrasts:
    """Places (n or 1, m, 2), weights (n or 1, m), and the contrasts' squares less their noise (n,)."""

    xy: np.ndarray
    weights: np.ndarray
    square: np.ndarray


def roughness_of_pickets(xyz: np.ndarray, noise: float, seed: int = 0) -> Roughness | None:
    """The roughness of the ground between pickets; None where there are too few.

    Parameters
    ----------
    xyz : (k, 3) m. noise : m², variance of a height that is its own alone.
    """
    if len(xyz) < THINNED * (NEIGHBOURS + ENOUGH):
        return None
    rng = np.random.default_rng(seed)
    fine = _picket_contrasts(xyz, noise, rng)
    coarse = _picket_contrasts(xyz[rng.choice(len(xyz), len(xyz) // THINNED, replace=False)], noise, rng)
    return None if min(len(fine.square), len(coarse.square)) < ENOUGH else _fitted(fine, coarse)


def roughness_of_cells(z: np.ndarray, grid: Grid, steps: tuple[int, int] = (1, 2)) -> Roughness | None:
    """The roughness of a surface of cells, (rows, columns) m with NaN where not known; at two spacings in cells."""
    found = [_cell_contrasts(z, grid, step) for step in steps]
    return None if min(len(part.square) for part in found) < ENOUGH else _fitted(*found)


def curvature_of_pickets(xyz: np.ndarray, boundary: Boundary) -> float:
    """m³, volume under a smooth surface through the pickets less that under their TIN [L: Clough & Tocher 1965]."""
    places, weight = quadrature_of(boundary, CURVATURE_PANELS)
    at = xyz - xyz.mean(axis=0)
    places = places - xyz[:, :2].mean(axis=0)
    smooth = CloughTocher2DInterpolator(at[:, :2], at[:, 2])(places)
    straight = LinearNDInterpolator(at[:, :2], at[:, 2])(places)
    return float(np.nansum(weight * (smooth - straight)))


def curvature_of_cells(z: np.ndarray, grid: Grid) -> float:
    """m per m², mean of what straight lines between centres of cells miss: −h²/12·∇²z [L: Euler–Maclaurin]."""
    across = (z[1:-1, 2:] - 2.0 * z[1:-1, 1:-1] + z[1:-1, :-2]) + (z[2:, 1:-1] - 2.0 * z[1:-1, 1:-1] + z[:-2, 1:-1])
    return -float(np.nanmean(across)) / 12.0 if np.isfinite(across).any() else 0.0


def interpolation_variance(roughness: Roughness, corners: np.ndarray, share: np.ndarray, seed: int = 0) -> float:
    """m⁶, variance of the volume over triangles from the ground between their corners.

    Parameters
    ----------
    corners : (t, 3, 2) m. share : (t,) which part of each lies inside the boundary.
    """
    if not len(corners):
        return 0.0
    rng = np.random.default_rng(seed)
    few = np.arange(len(corners)) if len(corners) <= MOST_TRIANGLES else rng.choice(len(corners), MOST_TRIANGLES)
    single = float(np.mean(triangle_variance(roughness, corners[few]) * share[few])) * len(corners)
    return single * _neighbours(roughness, corners, rng)


def _neighbours(roughness: Roughness, corners: np.ndarray, rng: np.random.Generator) -> float:
    """Variance of the sum over neighbouring triangles over the sum of their variances."""
    tree = KDTree(corners.mean(axis=1))
    count = min(PATCH_TRIANGLES, len(corners))
    together, apart = 0.0, 0.0
    for middle in corners[rng.choice(len(corners), PATCHES)].mean(axis=1):
        own = corners[np.atleast_1d(tree.query(middle, count)[1])]
        one, all_ = patch_variances(roughness, own)
        apart, together = apart + one, together + all_
    return together / apart if apart > 0.0 else 1.0


def patch_variances(roughness: Roughness, corners: np.ndarray, subdivision: int = 2) -> tuple[float, float]:
    """m⁶, the sum of the variances of triangles (t, 3, 2), and the variance of their sum."""
    weights = _subdivision(subdivision)
    n, area = len(weights), areas(corners)
    places = np.concatenate([weights @ corners, corners], axis=1).reshape(-1, 2)
    of_place = (area[:, None] * np.concatenate([np.full(n, 1.0 / n), np.full(3, -1.0 / 3.0)])).ravel()
    gap = np.sqrt(np.maximum(_squared_gaps(places), 0.0))
    within = float(np.sum(_within(roughness, area, n)))
    together = -float(of_place @ roughness.semivariogram(gap) @ of_place) - within
    return float(np.sum(triangle_variance(roughness, corners, subdivision))), together


def triangle_variance(roughness: Roughness, corners: np.ndarray, subdivision: int = SUBDIVISION) -> np.ndarray:
    """(t,) m⁶, of ∫ z over a triangle by the mean of its corners; corners (t, 3, 2)."""
    weights = _subdivision(subdivision)
    places = np.concatenate([weights @ corners, corners], axis=1)
    n, area = len(weights), areas(corners)
    of_place = np.concatenate([np.full(n, 1.0 / n), np.full(3, -1.0 / 3.0)])
    variance = roughness.contrast_variance(places, np.broadcast_to(of_place, places.shape[:2]))
    return np.maximum(variance * area**2 - _within(roughness, area, n), 0.0)


def _within(roughness: Roughness, area: np.ndarray, n: int) -> np.ndarray:
    """(t,) m⁶, what n places that stand for equal parts of a triangle leave out: the distances within a part."""
    side = np.sqrt(4.0 / np.sqrt(3.0) * area / n)
    return roughness.semivariogram(MEAN_DISTANCE * side) * area**2 / n


def _squared_gaps(places: np.ndarray) -> np.ndarray:
    """(n, n) m²."""
    at = places - places.mean(axis=0)
    squares = np.sum(at**2, axis=1)
    return squares[:, None] + squares[None, :] - 2.0 * at @ at.T


def _subdivision(n: int) -> np.ndarray:
    """(n², 3) barycentric coordinates of the middles of n² equal parts of a triangle."""
    out = []
    for i in range(n):
        for j in range(n - i):
            out.append(((3 * i + 1) / (3 * n), (3 * j + 1) / (3 * n)))
            if i + j < n - 1:
                out.append(((3 * i + 2) / (3 * n), (3 * j + 2) / (3 * n)))
    first = np.array(out)
    return np.column_stack([first, 1.0 - first.sum(axis=1)])


def _fitted(fine: _Contrasts, coarse: _Contrasts) -> Roughness:
    """H from the ratio of both spacings, s from the finer one."""

    def scale(part: _Contrasts, exponent: float) -> float:
        return max(float(part.square.mean()), 0.0) / float(
            Roughness(1.0, exponent).contrast_variance(part.xy, part.weights).mean()
        )

    low, high = ROUGHEST, SMOOTHEST
    for _ in range(40):
        middle = (low + high) / 2.0
        # a larger exponent explains more of the wider contrasts
        low, high = (middle, high) if scale(coarse, middle) > scale(fine, middle) else (low, middle)
    return Roughness(float(np.sqrt(scale(fine, low))), low)


def _picket_contrasts(xyz: np.ndarray, noise: float, rng: np.random.Generator) -> _Contrasts:
    """Pickets off the second-order surface through their neighbours."""
    tree = KDTree(xyz[:, :2])
    rows = np.arange(len(xyz)) if len(xyz) <= MOST_CONTRASTS else rng.choice(len(xyz), MOST_CONTRASTS, replace=False)
    near = np.asarray(tree.query(xyz[rows, :2], NEIGHBOURS + 1)[1])
    xy = xyz[near][:, :, :2]
    weights = _second_order(xy)
    good = np.abs(weights[:, 1:]).max(axis=1) <= LONGEST_WEIGHT
    xy, weights = xy[good], weights[good]
    value = np.einsum("ni,ni->n", weights, xyz[near[good], 2])
    return _Contrasts(xy, weights, value**2 - noise * np.sum(weights**2, axis=1))


def _second_order(xy: np.ndarray) -> np.ndarray:
    """(n, m) weights: 1 for the first place, and less what the second-order surface through the others has there."""
    gap = xy[:, 1:] - xy[:, :1]
    x, y = np.moveaxis(gap / np.abs(gap).max(axis=(1, 2), keepdims=True), -1, 0)
    design = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    return np.concatenate([np.ones((len(xy), 1)), -np.linalg.pinv(design)[:, 0]], axis=1)


def _cell_contrasts(z: np.ndarray, grid: Grid, step: int) -> _Contrasts:
    """Cells off the second-order surface through the 24 around them."""
    j, i = (v.ravel().astype(float) for v in np.meshgrid(np.arange(-2, 3), np.arange(-2, 3)))
    order = np.argsort(np.hypot(i, j), kind="stable")
    i, j = i[order], j[order]
    xy = step * np.column_stack([j * grid.cell_x, i * grid.cell_y])[None]
    weights = _second_order(xy)
    rows, columns = (max(n - 4 * step, 0) for n in z.shape)
    value = np.zeros((rows, columns))
    for weight, di, dj in zip(weights[0], i.astype(int), j.astype(int), strict=True):
        value += weight * z[(2 + di) * step :, (2 + dj) * step :][:rows, :columns]
    return _Contrasts(xy, weights, value[np.isfinite(value)] ** 2)
