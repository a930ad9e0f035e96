"""How rough the ground is between its pickets, and what that leaves open about integrals.

[C] The ground is an intrinsic random function [L: Matheron 1973] with the generalised covariance ±s²·h^(2H): rough for
small H, with creases at H about 1.5, smooth above. Σλz that no surface of second order moves has the variance
ΣΣ λ_i·λ_j·K(d_ij). s and H are the likeliest for all such contrasts of neighbouring heights [L: Patterson & Thompson
1971, restricted likelihood, here the product over neighbourhoods], the noise of the heights known.

Straight triangles cut hills off and fill hollows. What the ground is expected to hold beyond them the pickets around
tell (kriging over a second-order surface); how far that is off is the same contrast's variance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from aerotri.rasters.grids import Grid
from aerotri.volume.triangles import areas

SMOOTHEST, ROUGHEST = 2.5, 0.05
"""Largest and smallest exponent H that is tried; chosen [C]: the covariance holds for 0 < H < 3 and degenerates at
either end, at 0 to noise that does not depend on the distance."""
NEAR_WHOLE = 0.01
"""At a whole H the covariance is that of a surface of second order: kept so far away."""
AROUND = 20
"""Pickets of a neighbourhood."""
ENOUGH = 30
"""Pickets or cells a roughness is taken from at least; chosen [C]: an exponent from fewer is chance."""
MOST_NEIGHBOURHOODS = 300
"""Neighbourhoods drawn for a roughness; chosen [C]: fewer leave the exponent to chance, more take longer and change it
little."""
MOST_TRIANGLES = 20_000
"""Triangles whose curvature and variance are integrated, the sums scaled from them to all; chosen [C]: enough for most
volumes, and what drawing adds to the variance is counted."""
CHUNK = 2000
"""Triangles integrated at a time; chosen [C]: their matrices of 20 pickets stay within some tens of MB."""
PARTS = 2
"""Into so many parts a side of a triangle is divided for the rules below; chosen [C]: 12 places a triangle; one part, 3
places, is too few for distances within a triangle."""
RULES = (2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0), (0.5, 0.5, 0.0)
"""Two rules for means over a triangle, of second order both and without a place in common, so that a mean over pairs of
places has none of distance zero [L: Hammer & Stroud 1956]."""
PATCHES, PATCH_TRIANGLES = 12, 100
"""Neighbouring triangles share pickets, so their errors are correlated. The factor is taken from so many patches of so
many triangles (within 10 % of that of large areas)."""


@dataclass(frozen=True)
class Roughness:
    """K(h) = ±s²·h^(2H), minus for H < 1, plus up to 2, minus up to 3; s in m at a distance of 1 m."""

    s: float
    exponent: float

    def covariance(self, distance: np.ndarray) -> np.ndarray:
        """m², generalised."""
        sign = -1.0 if int(self.exponent) % 2 == 0 else 1.0
        return sign * self.s**2 * np.asarray(distance) ** (2.0 * self.exponent)


@dataclass(frozen=True)
class Between:
    """The ground between pickets less the straight triangles over them: expected m³, and the variance of that, m⁶."""

    curvature: float = 0.0
    variance: float = 0.0

    @property
    def mean_square(self) -> float:
        """m⁶, of what a volume by triangles is off."""
        return self.curvature**2 + self.variance


def roughness_of_pickets(
    xyz: np.ndarray, noise: float, own: np.ndarray | None = None, seed: int = 0
) -> Roughness | None:
    """The roughness of the ground between pickets; None where there are too few.

    Parameters
    ----------
    xyz : (k, 3) m. noise : m², variance of a height that is its own alone.
    own : rows where it counts; None: all.
    """
    rows = np.arange(len(xyz)) if own is None else own
    if len(rows) < ENOUGH:
        return None
    if len(rows) > MOST_NEIGHBOURHOODS:
        rows = np.random.default_rng(seed).choice(rows, MOST_NEIGHBOURHOODS, replace=False)
    near = xyz[np.asarray(KDTree(xyz[:, :2]).query(xyz[rows, :2], AROUND)[1])]
    return _likeliest(near[:, :, :2], near[:, :, 2], noise)


def roughness_of_cells(z: np.ndarray, grid: Grid, seed: int = 0) -> Roughness | None:
    """The roughness of a surface of cells, (rows, columns) m with NaN where not known."""
    j, i = (v.ravel() for v in np.meshgrid(np.arange(5), np.arange(5)))
    rows, columns = (max(n - 4, 0) for n in z.shape)
    known = np.logical_and.reduce([np.isfinite(z[a:, b:][:rows, :columns]) for a, b in zip(i, j, strict=True)])
    places = np.argwhere(known)
    if len(places) < ENOUGH:
        return None
    if len(places) > MOST_NEIGHBOURHOODS:
        places = places[np.random.default_rng(seed).choice(len(places), MOST_NEIGHBOURHOODS, replace=False)]
    xy = np.column_stack([j * grid.cell_x, i * grid.cell_y])[None].astype(float)
    return _likeliest(xy, z[places[:, :1] + i, places[:, 1:] + j], 0.0)


def curvature_of_cells(z: np.ndarray, grid: Grid) -> float:
    """m per m², mean of what straight lines between centres of cells miss: −h²/12·∇²z [L: Euler–Maclaurin]."""
    across = (z[1:-1, 2:] - 2.0 * z[1:-1, 1:-1] + z[1:-1, :-2]) + (z[2:, 1:-1] - 2.0 * z[1:-1, 1:-1] + z[:-2, 1:-1])
    return -float(np.nanmean(across)) / 12.0 if np.isfinite(across).any() else 0.0


def ground_between(
    roughness: Roughness, xyz: np.ndarray, triangles: np.ndarray, share: np.ndarray, noise: float, seed: int = 0
) -> Between:
    """What straight triangles over pickets leave out; arguments as of `ground_of`."""
    ground = ground_of(roughness, xyz, triangles, share, noise, seed)
    return Between() if ground is None else ground.between(ground.more, ground.variance)


@dataclass(frozen=True, eq=False)
class Ground:
    """The ground between pickets, over triangles that stand for all of them.

    Parameters
    ----------
    xyz : (k, 3) m. triangles : (t, 3) corners, share : (t,) which part of each counts, area : (t,) m².
    more : (t,) m³, ground expected beyond the straight triangle. variance : (t,) m⁶.
    noise : m², variance of a height that is its own alone.
    number : of all the triangles. factor : by which neighbours make the variance of the sum larger.
    """

    roughness: Roughness
    xyz: np.ndarray
    triangles: np.ndarray
    share: np.ndarray
    area: np.ndarray
    more: np.ndarray
    variance: np.ndarray
    noise: float
    number: int
    factor: float

    def between(self, more: np.ndarray, variance: np.ndarray) -> Between:
        """Of all triangles, from what is expected (t,) m³ of these, and its variance (t,) m⁶."""
        few, own = len(self.triangles), more * self.share
        scale = self.number / few
        sampling = self.number**2 * (1.0 - 1.0 / scale) * float(np.var(own)) / few
        return Between(scale * float(own.sum()), scale * float(variance @ self.share) * self.factor + sampling)


def ground_of(
    roughness: Roughness, xyz: np.ndarray, triangles: np.ndarray, share: np.ndarray, noise: float, seed: int = 0
) -> Ground | None:
    """The ground between pickets; None where there is none.

    Parameters
    ----------
    xyz : (k, 3) m. triangles : (t, 3) corners. share : (t,) which part of each lies inside the boundary.
    noise : m², variance of a height that is its own alone.
    """
    own = np.flatnonzero(share > 0.0)
    if not len(own) or len(xyz) < AROUND:
        return None
    rng = np.random.default_rng(seed)
    few = own if len(own) <= MOST_TRIANGLES else rng.choice(own, MOST_TRIANGLES, replace=False)
    tree = KDTree(xyz[:, :2])
    parts = [_over(roughness, xyz, triangles[few[k : k + CHUNK]], noise, tree) for k in range(0, len(few), CHUNK)]
    area, more, variance = (
        np.concatenate(part) for part in zip(*((one.area, one.more, one.variance) for one in parts), strict=True)
    )
    factor = _neighbours(roughness, xyz, triangles[own], noise, tree, rng)
    return Ground(
        roughness, xyz, triangles[few], share[few], area, more, variance, noise, len(own), factor
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Over:
    """Triangles and the pickets around them.

    Parameters
    ----------
    near : (t, m) rows of the pickets. weights : (t, m) their mean over the triangle. area : (t,) m².
    more : (t,) m³, ground expected beyond the straight triangle. variance : (t,) m⁶.
    """

    near: np.ndarray
    weights: np.ndarray
    area: np.ndarray
    more: np.ndarray
    variance: np.ndarray


def _over(roughness: Roughness, xyz: np.ndarray, triangles: np.ndarray, noise: float, tree: KDTree) -> _Over:
    """[L: universal kriging of a block] in coordinates of the size of each neighbourhood."""
    corners = xyz[triangles]
    middle = corners.mean(axis=1)
    near = np.asarray(tree.query(middle[:, :2], AROUND)[1])
    at = xyz[near][:, :, :2] - middle[:, None, :2]
    size = np.abs(at).max(axis=(1, 2))
    at = at / size[:, None, None]
    inside, other = (places_within(PARTS, rule) @ (corners - middle[:, None])[:, :, :2] / size[:, None, None]
                     for rule in RULES)  # fmt: skip
    unit = Roughness(1.0, roughness.exponent)
    gap = np.linalg.norm(at[:, :, None] - at[:, None], axis=-1)
    to_inside = 0.5 * sum(
        unit.covariance(np.linalg.norm(at[:, :, None] - of[:, None], axis=-1)).mean(axis=2) for of in (inside, other)
    )
    level = roughness.s**2 * size ** (2.0 * roughness.exponent)
    # without roughness the pickets' noise alone weighs them: a surface of second order by least squares
    share = level / np.maximum(level + noise, 1e-300)
    system = np.zeros((len(at), AROUND + 6, AROUND + 6))
    system[:, :AROUND, :AROUND] = share[:, None, None] * unit.covariance(gap) + (
        np.where(level > 0.0, 1.0 - share, 1.0)[:, None, None] * np.eye(AROUND)
    )
    system[:, :AROUND, AROUND:] = terms_of_second_order(at)
    system[:, AROUND:, :AROUND] = np.swapaxes(system[:, :AROUND, AROUND:], 1, 2)
    right = np.concatenate([share[:, None] * to_inside, terms_of_second_order(inside).mean(axis=1)], axis=1)
    weights = np.linalg.solve(system, right[..., None])[:, :AROUND, 0]
    area = areas(corners[:, :, :2])
    heights = xyz[near, 2] - middle[:, 2:]
    between = np.linalg.norm(inside[:, :, None] - other[:, None], axis=-1)
    variance = unit.covariance(between).mean(axis=(1, 2)) - 2.0 * np.sum(weights * to_inside, axis=1)
    variance += np.einsum("ti,tij,tj->t", weights, unit.covariance(gap), weights)
    return _Over(near, weights, area, area * np.sum(weights * heights, axis=1),
                 np.maximum(level * variance, 0.0) * area**2)  # fmt: skip


def _neighbours(
    roughness: Roughness, xyz: np.ndarray, triangles: np.ndarray, noise: float, tree: KDTree, rng: np.random.Generator
) -> float:
    """Variance of the sum over neighbouring triangles over the sum of their variances."""
    middles = xyz[triangles].mean(axis=1)[:, :2]
    of_middles = KDTree(middles)
    together, apart = 0.0, 0.0
    for place in middles[rng.choice(len(middles), PATCHES)]:
        own = triangles[np.atleast_1d(of_middles.query(place, min(PATCH_TRIANGLES, len(middles)))[1])]
        one, all_ = patch_variances(roughness, xyz, own, noise, tree)
        apart, together = apart + one, together + all_
    return together / apart if apart > 0.0 else 1.0


def patch_variances(
    roughness: Roughness, xyz: np.ndarray, triangles: np.ndarray, noise: float, tree: KDTree
) -> tuple[float, float]:
    """m⁶, the sum of the variances over triangles (t, 3), and the variance of their sum."""
    over = _over(roughness, xyz, triangles, noise, tree)
    area = float(over.area.sum())
    pickets, column = np.unique(over.near, return_inverse=True)
    of_pickets = np.zeros(len(pickets))
    np.add.at(of_pickets, column.ravel(), -(over.area[:, None] * over.weights).ravel())
    at = xyz[pickets, :2]
    middle = at.mean(axis=0)
    size = np.abs(at - middle).max()
    sides = []
    for rule in RULES:
        inside = places_within(PARTS, rule) @ xyz[triangles][:, :, :2]
        share = np.repeat(over.area / inside.shape[1], inside.shape[1])
        sides.append((np.concatenate([inside.reshape(-1, 2), at]), np.concatenate([share, of_pickets]) / area))
    (first, own), (second, other) = sides
    gap = cdist((first - middle) / size, (second - middle) / size)
    sum_ = float(own @ Roughness(1.0, roughness.exponent).covariance(gap) @ other)
    level = roughness.s**2 * size ** (2.0 * roughness.exponent)
    return float(over.variance.sum()), max(sum_, 0.0) * level * area**2


def places_within(n: int, within: tuple[float, float, float]) -> np.ndarray:
    """(3n², 3) barycentric coordinates: three places in every one of n² equal parts of a triangle."""
    own = np.array([np.roll(within, k) for k in range(3)])
    out = []
    for i in range(n):
        for j in range(n - i):
            corner = np.array([(i, j), (i + 1, j), (i, j + 1)])
            out.append(own @ corner / n)
            if i + j < n - 1:
                out.append(own @ (np.array([(i + 1, j + 1), (i + 1, j), (i, j + 1)])) / n)
    first = np.concatenate(out)
    return np.column_stack([first, 1.0 - first.sum(axis=1)])


def _likeliest(xy: np.ndarray, z: np.ndarray, noise: float) -> Roughness:
    """From neighbourhoods: places (n or 1, m, 2), heights (n, m)."""
    at = xy - xy.mean(axis=1, keepdims=True)
    size = float(np.median(np.abs(at).max(axis=(1, 2))))
    at = at / size
    left = np.linalg.qr(terms_of_second_order(at), mode="complete").Q[:, :, 6:]
    contrasts = np.einsum("nmi,nm->ni", np.broadcast_to(left, (len(z), *left.shape[1:])), z - z.mean(axis=1)[:, None])
    gap = np.linalg.norm(at[:, :, None] - at[:, None], axis=-1)
    # what rounding leaves of heights is no roughness
    least = 1e-18 * max(float(np.var(z)), 1e-300)

    def fit(exponent: float) -> tuple[float, float]:
        """−2·log of the likelihood, and s² at a distance of `size`."""
        covariance = np.swapaxes(left, 1, 2) @ Roughness(1.0, _not_whole(exponent)).covariance(gap) @ left
        values, vectors = np.linalg.eigh(covariance)
        own = np.einsum("nij,ni->nj", np.broadcast_to(vectors, (len(z), *vectors.shape[1:])), contrasts) ** 2
        values = np.maximum(values, 1e-12 * values[:, -1:])
        start = max(float(np.mean(own / values)), least)

        def minus(log_level: float) -> float:
            variance = np.exp(log_level) * values + noise
            return float(np.mean(np.log(variance) + own / variance))

        if noise == 0.0:
            return minus(np.log(start)), start
        best = minimize_scalar(minus, bounds=(np.log(start) - 25.0, np.log(start) + 1.0), method="bounded")
        # scipy has no types, and what is inferred for its results changes with the order of the files
        return float(best.fun), float(np.exp(best.x))  # pyright: ignore[reportAttributeAccessIssue]

    def of_exponent(h: float) -> float:
        return fit(h)[0]

    found = minimize_scalar(of_exponent, bounds=(ROUGHEST, SMOOTHEST), method="bounded", options={"xatol": 0.01})
    exponent = _not_whole(float(found.x))  # pyright: ignore[reportAttributeAccessIssue]
    return Roughness(float(np.sqrt(fit(exponent)[1])) / size**exponent, exponent)


def _not_whole(exponent: float) -> float:
    whole = round(exponent)
    off = exponent - whole
    return exponent if abs(off) >= NEAR_WHOLE else whole + (NEAR_WHOLE if off >= 0.0 else -NEAR_WHOLE)


def terms_of_second_order(xy: np.ndarray) -> np.ndarray:
    """(…, 6) of a surface of second order at places (…, 2)."""
    x, y = np.moveaxis(xy, -1, 0)
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
