"""What a spline through the boundary leaves out of the ground below it, as the ground around tells it.

[C] The ground is a plane and a random function. Its covariance is not known: ground that is rough at all sizes, smooth
ground of some size, or ground that rolls in waves. Each of `covariances` is as probable beforehand as the others, with
every share of what is rough within a cell; the heights around the boundary and along it make one of them more probable
than another by its restricted likelihood [L: Patterson & Thompson 1971], and what is asked for is averaged over them
[L: Handcock & Stein 1993].

[D] Given these heights z the integral of the ground below, I = ∫z, has the mean Î = x·z and the variance C [L:
universal kriging of a block], with K of the places among themselves, k to the integral, κ of the integral and the terms
A and a of a plane:

    [K + τ, A; Aᵀ, 0]·[x; μ] = [k; a],   C = s²·(κ − x·k − μ·a).

The base stays the spline, with the integral B: what it leaves out has the mean square (B − Î)² + C. Where the ground
around says nothing of the ground below it is what the covariance alone makes it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from weakref import WeakKeyDictionary

import numpy as np
import shapely
from scipy.linalg import lu_factor, lu_solve
from scipy.spatial.distance import cdist
from scipy.special import j0
from shapely.geometry.base import BaseGeometry

from aerotri.rasters.grids import Grid
from aerotri.volume.bases import SplineBase, Surface, sampled
from aerotri.volume.boundary import Boundary

RING_SHARE = 0.3
"""Width of the ring of ground outside the boundary that a base is judged by, over the root of the boundary's area."""
PLACES_AROUND, PLACES_ALONG = 130, 70
"""Heights of the ring and along the boundary that are used at most; chosen [C]: more take longer and change little."""
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
ROUGH_WITHIN = np.geomspace(1e-3, 1.0, 7)
"""Variance that a place has alone, over the mean of what it shares; chosen [C] the least: a covariance is not to be
chosen by details of a thirtieth of the heights."""
COUNTS = 0.01
"""Probability below which a covariance is left out."""

Covariance = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class _Model:
    """A covariance and how probable it is.

    Parameters
    ----------
    level : s², m². alone : τ, over the level. system : factors of the system above, solved : (k + 3,) of the heights.
    """

    probability: float
    covariance: Covariance
    level: float
    alone: float
    system: tuple[np.ndarray, np.ndarray]
    solved: np.ndarray


@dataclass(frozen=True, eq=False)
class GroundAround:
    """The ground around a boundary.

    Parameters
    ----------
    places : (k, 2), from the middle, over the size. middle : (2,) m. size : m, root of the boundary's area.
    height : m, that heights count from. models : the covariances that are probable.
    """

    places: np.ndarray
    middle: np.ndarray
    size: float
    height: float
    models: tuple[_Model, ...]

    def left_out(self, places: np.ndarray, weight: np.ndarray, of_base: float) -> tuple[float, float]:
        """What a base is above the ground: expected m³, and the mean square m⁶; over a plane nothing.

        Parameters
        ----------
        places : (q, 2) m. weight : (q,) m², what they stand for. of_base : m³, integral of the base over them.
        """
        at = (places - self.middle) / self.size
        if not self.models:
            return 0.0, 0.0
        far, own = cdist(self.places, at), cdist(at, at)
        more = of_base - self.height * float(weight.sum())
        expected, square, total = 0.0, 0.0, 0.0
        for model in self.models:
            side = np.concatenate([model.covariance(far) @ weight, weight @ _plane(at)])
            off = more - float(side @ model.solved)
            variance = float(weight @ model.covariance(own) @ weight - side @ lu_solve(model.system, side))
            expected += model.probability * off
            square += model.probability * (off**2 + model.level * max(variance, 0.0))
            total += model.probability
        return expected / total, square / total


_KNOWN: WeakKeyDictionary[SplineBase, GroundAround | None] = WeakKeyDictionary()


def ground_around(base: SplineBase, boundary: Boundary, surface: Surface) -> GroundAround | None:
    """The ground around the boundary of a base, found once for it; None where too little of it is known."""
    if base not in _KNOWN:
        _KNOWN[base] = _found(base, boundary, surface)
    return _KNOWN[base]


def _found(base: SplineBase, boundary: Boundary, surface: Surface) -> GroundAround | None:
    xyz = _heights_around(boundary, surface)
    if len(xyz) < ENOUGH:
        return None
    along = np.unique(np.linspace(0, len(base.xy) - 1, PLACES_ALONG).astype(int))
    xyz = np.concatenate([xyz, np.column_stack([base.xy, base.z])[along]])
    size, middle, height = float(np.sqrt(boundary.area)), xyz[:, :2].mean(axis=0), float(xyz[:, 2].mean())
    places = (xyz[:, :2] - middle) / size
    return GroundAround(places, middle, size, height, _probable(places, xyz[:, 2] - height))


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


def _plane(places: np.ndarray) -> np.ndarray:
    """(n, 3)."""
    return np.column_stack([np.ones(len(places)), places])


def _probable(places: np.ndarray, z: np.ndarray) -> tuple[_Model, ...]:
    """The covariances that heights (k,) m at places (k, 2) make probable."""
    distance, plane = cdist(places, places), _plane(places)
    left = np.linalg.qr(plane, mode="complete").Q[:, 3:]
    contrasts = left.T @ z
    if not contrasts @ contrasts > 0.0:
        return ()
    found: list[tuple[float, Covariance, float, float]] = []
    for covariance in covariances():
        power, patterns = np.linalg.eigh(left.T @ covariance(distance) @ left)
        power, squares = np.maximum(power, 0.0), (patterns.T @ contrasts) ** 2
        for alone in ROUGH_WITHIN * power.mean():
            level = float(np.mean(squares / (power + alone)))
            likelihood = -0.5 * (len(squares) * np.log(level) + float(np.log(power + alone).sum()))
            found.append((likelihood, covariance, level, float(alone)))
    share = np.exp(np.array([one[0] for one in found]) - max(one[0] for one in found))
    share /= share.sum()
    models: list[_Model] = []
    for p, (_, covariance, level, alone) in zip(share, found, strict=True):
        if p >= COUNTS:
            system = np.zeros((len(z) + 3, len(z) + 3))
            system[: len(z), : len(z)] = covariance(distance) + alone * np.eye(len(z))
            system[: len(z), len(z) :], system[len(z) :, : len(z)] = plane, plane.T
            factors = lu_factor(system)
            solved = lu_solve(factors, np.concatenate([z, np.zeros(3)]))
            models.append(_Model(float(p), covariance, level, alone, factors, solved))
    return tuple(models)


def _heights_around(boundary: Boundary, surface: Surface) -> np.ndarray:
    """(n, 3) m, heights of cells drawn from the ring around the boundary, without what is measured beside it."""
    outline = boundary.outline
    ring = shapely.difference(outline.buffer(RING_SHARE * np.sqrt(boundary.area)), outline)
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
    tries = int(np.ceil(2.0 * PLACES_AROUND * (right - left) * (top - bottom) / max(ring.area, 1e-300)))
    for _ in range(4):
        xy = rng.uniform((left, bottom), (right, top), (min(tries, 200_000), 2))
        row, column = np.rint(grid.row(xy[:, 1])), np.rint(grid.column(xy[:, 0]))
        xy = np.column_stack([grid.x(column), grid.y(row)])
        found = np.concatenate([found, xy[np.asarray(shapely.contains_xy(ring, xy[:, 0], xy[:, 1]))]])
        found = found[np.sort(np.unique(found, axis=0, return_index=True)[1])]
        if len(found) >= PLACES_AROUND:
            break
    return found[:PLACES_AROUND]
