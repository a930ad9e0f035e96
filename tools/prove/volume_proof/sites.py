"""Ground of known volume: a fractal hill, rolling country, a dump of tipped loads, benches of a quarry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.linalg import cholesky
from scipy.spatial import KDTree

Heights = Callable[[np.random.Generator], np.ndarray]
LEVEL = 85.0
EXPONENT, ROUGH = 0.6, 0.08
WAVES, WAVELENGTH, RELIEF = 12, 120.0, 5.0
REPOSE, LOADS_EVERY, LOAD = np.tan(np.radians(37.0)), 12.0, (3.0, 6.0)
NEAREST_LOADS = 6
BENCH, FACE, BENCHES_EVERY = 6.0, np.tan(np.radians(60.0)), 30.0


@dataclass(frozen=True, eq=False)
class Site:
    """Ground that is new in every run, under pickets that stay.

    Parameters
    ----------
    xy : (k, 2) m of the pickets. dense : (n, 2) m of a fine lattice, weight : (n,) m² of its cells inside.
    ground : heights of both, m, one after the other.
    """

    name: str
    xy: np.ndarray
    dense: np.ndarray
    weight: np.ndarray
    polygon: shapely.Polygon
    ground: Heights

    def heights(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Heights of the pickets, and of the dense lattice."""
        z = self.ground(rng)
        return z[: len(self.xy)], z[len(self.xy) :]


def sites() -> dict[str, Callable[[], Site]]:
    """All there are, by name: made when called."""
    return {
        "fractal hill, pickets every 14 m": lambda: make_site("fractal", 14.0, 120.0, 4.0),
        "rolling, every 10 m": lambda: make_site("rolling", 10.0, 120.0, 2.0),
        "rolling, every 25 m": lambda: make_site("rolling", 25.0, 120.0, 4.0),
        "dump, every 3 m": lambda: make_site("dump", 3.0, 60.0, 0.5),
        "dump, every 8 m": lambda: make_site("dump", 8.0, 120.0, 1.0),
        "benches, every 6 m": lambda: make_site("benches", 6.0, 100.0, 0.8),
    }


def make_site(kind: str, spacing: float, radius: float, cell: float, seed: int = 1) -> Site:
    """A circle of 16 corners, pickets in a jittered grid reaching beyond it; all in m."""
    rng = np.random.default_rng(seed)
    reach = radius + 2.0 * spacing
    x, y = np.meshgrid(np.arange(-reach, reach, spacing), np.arange(-reach, reach, spacing))
    xy = np.column_stack([x.ravel(), y.ravel()]) + rng.uniform(-0.25, 0.25, (x.size, 2)) * spacing
    angle = np.arange(16) * np.pi / 8.0
    # from its lowest corner, as volumes take it
    polygon = shapely.normalize(shapely.Polygon(radius * np.column_stack([np.cos(angle), np.sin(angle)])))
    x, y = np.meshgrid(np.arange(-radius, radius, cell), np.arange(-radius, radius, cell))
    cells = shapely.intersection(shapely.box(x.ravel(), y.ravel(), x.ravel() + cell, y.ravel() + cell),
                                 polygon)  # fmt: skip
    area = shapely.area(cells)
    dense = shapely.get_coordinates(shapely.centroid(cells[area > 0.0]))
    places = np.concatenate([xy, dense])
    make = {"fractal": fractal, "rolling": rolling, "dump": dump, "benches": benches}[kind]
    return Site(kind, xy, dense, area[area > 0.0], polygon, make(places))


def fractal(places: np.ndarray) -> Heights:
    """A fractional Brownian surface over a smooth hill."""
    at = 1e4 + places
    length = np.linalg.norm(at, axis=1) ** (2.0 * EXPONENT)
    near = at - at.mean(axis=0)
    squares = np.sum(near**2, axis=1)
    gap = np.maximum(squares[:, None] + squares - 2.0 * near @ near.T, 0.0) ** EXPONENT
    covariance = ROUGH**2 * (length[:, None] + length - gap)
    # a constant that the volume would see belongs to no part: heights count from the first picket
    covariance = covariance - covariance[:1] - covariance[:, :1] + covariance[0, 0]
    root = cholesky(covariance + 1e-9 * np.eye(len(at)), lower=True)
    hill = 100.0 + 25.0 * np.exp(-np.sum(places**2, axis=1) / (2.0 * 60.0**2))
    return lambda rng: hill + root @ rng.normal(size=len(hill))


def rolling(places: np.ndarray) -> Heights:
    """Waves in all directions."""

    def heights(rng: np.random.Generator) -> np.ndarray:
        direction = rng.uniform(0.0, 2.0 * np.pi, WAVES)
        number = 2.0 * np.pi / (WAVELENGTH * 2.0 ** rng.uniform(-0.5, 0.5, WAVES))
        phase = rng.uniform(0.0, 2.0 * np.pi, WAVES)
        along = np.outer(places[:, 0], number * np.cos(direction)) + np.outer(places[:, 1], number * np.sin(direction))
        return 100.0 + RELIEF * np.sqrt(2.0 / WAVES) * np.cos(along + phase).sum(axis=1)

    return heights


def dump(places: np.ndarray) -> Heights:
    """Loads tipped side by side: cones at the angle of repose, with sharp valleys and tops."""

    def heights(rng: np.random.Generator) -> np.ndarray:
        reach = np.abs(places).max() + 2.0 * LOADS_EVERY
        x, y = np.meshgrid(*[np.arange(-reach, reach, LOADS_EVERY)] * 2)
        at = np.column_stack([x.ravel(), y.ravel()]) + rng.uniform(-0.4, 0.4, (x.size, 2)) * LOADS_EVERY
        top = rng.uniform(*LOAD, len(at))
        distance, load = KDTree(at).query(places, NEAREST_LOADS)
        z = np.maximum((top[load] - REPOSE * distance).max(axis=1), 0.0)
        return 100.0 + z

    return heights


def benches(places: np.ndarray) -> Heights:
    """Levels with steep faces between them, their edges winding."""

    def heights(rng: np.random.Generator) -> np.ndarray:
        angle, phase = rng.uniform(0.0, 2.0 * np.pi, 2)
        along = places @ np.array([np.cos(angle), np.sin(angle)])
        across = places @ np.array([-np.sin(angle), np.cos(angle)])
        winding = along + 6.0 * np.sin(across / 23.0 + phase) + rng.uniform(0.0, BENCHES_EVERY)
        step, rest = np.divmod(winding, BENCHES_EVERY)
        return 100.0 + BENCH * step + np.minimum(rest * FACE, BENCH)

    return heights
