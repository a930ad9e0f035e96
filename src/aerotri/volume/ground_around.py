"""How well a spline through the boundary tells the ground below it, from the ground around.

[C] The ground is a plane and a random function. Its covariance is not known: ground that is rough at all sizes, smooth
ground of some size, or ground that rolls in waves. Each of `covariances` is as probable beforehand as the others, with
every share of what is rough within a cell; the heights around the boundary make one of them more probable than another
by its restricted likelihood [L: Patterson & Thompson 1971], and the variance is averaged over them [L: Handcock & Stein
1993].

[D] With the weights λ of the ground below, its places and the integral of the spline by the heights it goes through
(negative), the spline leaves out Σλz, which no plane moves, with the variance λᵀKλ. Of K = s²·k + τ the likelihood
tells s² as the mean square of the contrasts of the heights over their variances. No covariance is quite right: the
largest patterns of a ring tell what reaches over a boundary, and where they alone say more s² is theirs [C].

Heights near the boundary do not count where there are others: they may stand on the foot of what is measured.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from weakref import WeakKeyDictionary

import numpy as np
import shapely
from scipy.spatial.distance import cdist
from scipy.special import j0
from shapely.geometry.base import BaseGeometry

from aerotri.rasters.grids import Grid
from aerotri.volume.bases import SplineBase, Surface, sampled
from aerotri.volume.boundary import Boundary

RING_FROM, RING_TO = 0.1, 0.4
"""Edges of the ring of ground outside the boundary that a base is judged by, over the root of the boundary's area."""
PLACES = 160
"""Heights of the ring that are used at most; chosen [C]: more take longer and change little."""
ENOUGH = 30
"""Heights of the ring from which ground is judged at least."""
AT_ONCE = 4
"""Places read at once, neighbours in their order: the ring of a large boundary is never in memory as a whole."""
EXPONENTS = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Of ground that is rough at all sizes: differences of heights grow with that power of the distance."""
LENGTHS, WAVES = np.geomspace(0.06, 1.6, 6), np.geomspace(0.3, 5.0, 6)
"""Of smooth ground, from the spacing of the places to the width of the boundary and more, and lengths of waves; over
the root of the area."""
FADING = (0.4, 1.5)
"""Over how many of their lengths waves keep in step."""
ROUGH_WITHIN = np.geomspace(1e-2, 1.0, 5)
"""τ, variance that a place has alone, over the mean power of the patterns; the least chosen [C]: a covariance is not to
be chosen by details of a tenth of the heights."""
LARGEST_PATTERNS = 12
"""Patterns that tell s² by themselves; chosen [C]: as many as terms of second, third and fourth order."""
COUNTS = 0.01
"""Probability below which a covariance is left out."""

Covariance = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class _Model:
    """A covariance, how probable it is, and its level s², m²."""

    probability: float
    covariance: Covariance
    level: float


@dataclass(frozen=True)
class GroundAround:
    """The ground around a boundary.

    Parameters
    ----------
    size : m, root of the boundary's area. models : the covariances that are probable; none where it is a plane.
    """

    size: float
    models: tuple[_Model, ...]

    def contrast_variance(self, xy: np.ndarray, weights: np.ndarray) -> float:
        """Variance of Σλz at places (n, 2) m with weights (n,) that no plane moves; m⁶ where these are m²."""
        distance = cdist(xy, xy) / self.size
        total = sum(model.probability for model in self.models)
        of_each = (
            model.probability * model.level * float(weights @ model.covariance(distance) @ weights)
            for model in self.models
        )
        return max(sum(of_each), 0.0) / total if self.models else 0.0


_KNOWN: WeakKeyDictionary[SplineBase, GroundAround | None] = WeakKeyDictionary()


def ground_around(base: SplineBase, boundary: Boundary, surface: Surface) -> GroundAround | None:
    """The ground around the boundary of a base, found once for it; None where too little of it is known."""
    if base not in _KNOWN:
        xyz = _heights_around(boundary, surface, RING_FROM)
        if len(xyz) < ENOUGH:
            xyz = _heights_around(boundary, surface, 0.0)
        size = float(np.sqrt(boundary.area))
        _KNOWN[base] = GroundAround(size, _probable(xyz / size, xyz[:, 2])) if len(xyz) >= ENOUGH else None
    return _KNOWN[base]


def covariances() -> Iterator[Covariance]:
    """Of the heights at two places by their distance over the size of the boundary; of a level 1."""
    for exponent in EXPONENTS:
        yield partial(_fractal, exponent=exponent)
    for length in LENGTHS:
        yield partial(_creased, length=float(length))
        yield partial(_smooth, length=float(length))
    for wave in WAVES:
        for fading in FADING:
            yield partial(_rolling, wave=float(wave), length=float(fading * wave))


def _fractal(distance: np.ndarray, exponent: float) -> np.ndarray:
    """Generalised: of differences alone."""
    return -(distance ** (2.0 * exponent))


def _creased(distance: np.ndarray, length: float) -> np.ndarray:
    """[L: Matérn 1960, of order 3/2]."""
    return (1.0 + distance / length) * np.exp(-distance / length)


def _smooth(distance: np.ndarray, length: float) -> np.ndarray:
    return np.exp(-0.5 * (distance / length) ** 2)


def _rolling(distance: np.ndarray, wave: float, length: float) -> np.ndarray:
    """Waves in all directions that fade [L: Yaglom 1987, of the plane]."""
    return j0(2.0 * np.pi * distance / wave) * _smooth(distance, length)


def _probable(xyz: np.ndarray, z: np.ndarray) -> tuple[_Model, ...]:
    """The covariances that heights z (k,) m at places (k, 2 or more), over the size, make probable."""
    places = xyz[:, :2] - xyz[:, :2].mean(axis=0)
    distance = cdist(places, places)
    left = np.linalg.qr(np.column_stack([np.ones(len(z)), places]), mode="complete").Q[:, 3:]
    contrasts = left.T @ (z - z.mean())
    if not contrasts @ contrasts > 0.0:
        return ()
    found: list[tuple[float, Covariance, float]] = []
    for covariance in covariances():
        power, patterns = np.linalg.eigh(left.T @ covariance(distance) @ left)
        power, squares = np.maximum(power[::-1], 0.0), ((patterns.T @ contrasts) ** 2)[::-1]
        for alone in ROUGH_WITHIN * power.mean():
            ratio = squares / (power + alone)
            level = float(ratio.mean())
            likelihood = -0.5 * (len(ratio) * np.log(level) + float(np.log(power + alone).sum()))
            found.append((likelihood, covariance, max(level, float(ratio[:LARGEST_PATTERNS].mean()))))
    share = np.exp(np.array([one[0] for one in found]) - max(one[0] for one in found))
    share /= share.sum()
    return tuple(
        _Model(float(p), covariance, level)
        for p, (_, covariance, level) in zip(share, found, strict=True)
        if p >= COUNTS
    )


def _heights_around(boundary: Boundary, surface: Surface, start: float) -> np.ndarray:
    """(n, 3) m, heights of cells drawn from the ring around the boundary, without what is measured beside it.

    Parameters
    ----------
    start : inner edge of the ring, as `RING_FROM`.
    """
    outline = boundary.outline
    size = np.sqrt(boundary.area)
    ring = shapely.difference(outline.buffer(RING_TO * size), outline.buffer(start * size))
    if boundary.beside is not None:
        ring = shapely.difference(ring, boundary.beside)
    ring = shapely.intersection(ring, shapely.box(*surface.grid.bounds))
    if ring.is_empty:
        return np.zeros((0, 3))
    xy = _cells_of(ring, surface.grid)
    # in the order of their direction, so that those read together are neighbours
    off = xy - np.array(outline.centroid.coords[0])
    xy = xy[np.argsort(np.arctan2(off[:, 1], off[:, 0]))]
    z = sampled(surface, xy[:, 0], xy[:, 1], AT_ONCE)
    known = np.isfinite(z)
    return np.column_stack([xy[known], z[known]])


def _cells_of(ring: BaseGeometry, grid: Grid) -> np.ndarray:
    """(n, 2) m, centres of cells that lie in the ring, as many as are used at most; always the same ones."""
    left, bottom, right, top = ring.bounds
    rng, found = np.random.default_rng(0), np.zeros((0, 2))
    shapely.prepare(ring)
    tries = int(np.ceil(2.0 * PLACES * (right - left) * (top - bottom) / max(ring.area, 1e-300)))
    for _ in range(4):
        xy = rng.uniform((left, bottom), (right, top), (min(tries, 200_000), 2))
        row, column = np.rint(grid.row(xy[:, 1])), np.rint(grid.column(xy[:, 0]))
        xy = np.column_stack([grid.x(column), grid.y(row)])
        found = np.concatenate([found, xy[np.asarray(shapely.contains_xy(ring, xy[:, 0], xy[:, 1]))]])
        found = found[np.sort(np.unique(found, axis=0, return_index=True)[1])]
        if len(found) >= PLACES:
            break
    return found[:PLACES]
