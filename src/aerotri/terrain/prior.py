"""Where to look for heights: a surface that is as good as what has been measured so far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator, RegularGridInterpolator
from scipy.ndimage import distance_transform_edt, gaussian_filter, median_filter
from scipy.spatial import KDTree

from aerotri.conventions import InputError
from aerotri.terrain.pickets import Area

COARSE_NODES_PX = 8
"""Pixels of a level between its nodes; chosen [C]: less than a window, so that no ground lies between the windows;
every level doubles the resolution."""
SPARE_PX = 4.0
"""Posts of parallax by which a height is looked for about the one of the level above."""
OUTLIER_PX = 3.0
"""Posts of parallax off the median of the neighbours from which a height is taken out; chosen [C]: less takes off true
edges of the ground, more leaves outliers that mislead the next level."""
NEIGHBOURS = 8
"""Points around one with whose median height it is compared; chosen [C]: a pit or tower with six points stays."""
COARSE_CORRELATION = 0.5
"""Correlation from which a coarse height counts; chosen [C]: coarse levels only guide the search; more leaves holes
over weak texture, less lets chance in."""
STEEPEST = 1.5
"""Steepest slope of ground that windows are tilted to; chosen [C]: 56°; steeper is the wall of an object, and a window
so tilted shrinks to nothing in a photograph."""
CURVATURE_NODES = 2.0
"""σ, in nodes, over which the square of the curvature is averaged; chosen [C]: less follows the noise of single
heights, more hides where rough ground begins."""


@dataclass(frozen=True, eq=False)
class Prior:
    """Where to look: heights (ny, nx) m on nodes x rising and y rising, and how far about them."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    spare: np.ndarray

    def at(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Heights (n,) m, slopes (n, 2) and half ranges (n,) m."""
        by_y, by_x = np.gradient(self.z, self.y, self.x)
        found = self._between(xy, self.z, by_x, by_y, self.spare)
        return found[:, 0], np.clip(found[:, 1:3], -STEEPEST, STEEPEST), found[:, 3]

    def curvatures(self, xy: np.ndarray) -> np.ndarray:
        """(n,) 1/m, RMS of the second derivatives by x and by y around places (n, 2)."""
        by_y, by_x = np.gradient(self.z, self.y, self.x)
        second = np.gradient(by_x, self.x, axis=1), np.gradient(by_y, self.y, axis=0)
        mean_square = gaussian_filter(0.5 * (second[0] ** 2 + second[1] ** 2), CURVATURE_NODES)
        return np.sqrt(self._between(xy, mean_square)[:, 0])

    def _between(self, xy: np.ndarray, *tables: np.ndarray) -> np.ndarray:
        place = np.column_stack([np.clip(xy[:, 1], self.y[0], self.y[-1]), np.clip(xy[:, 0], self.x[0], self.x[-1])])
        return RegularGridInterpolator((self.y, self.x), np.stack(tables, axis=-1))(place)


def first_prior(known: np.ndarray, area: Area, gsd: float, levels: int) -> Prior:
    """From points of the ground: their heights, and as much about them as they differ.

    A point that lies farther than that from the median of its neighbours does not count: it would bend the search over
    all ground as far as the next points.
    """
    known = known[np.isfinite(known).all(axis=1)]
    if len(known) < 3:
        raise InputError("the block has fewer than three object points", "adjust a block with tie points")
    low, high = np.percentile(known[:, 2], [0.5, 99.5])
    about = 0.75 * (high - low) + SPARE_PX * gsd * 2 ** (levels - 1) / 0.3
    known = known[np.abs(known[:, 2] - _of_neighbours(known)) <= about]
    size = area.high - area.low
    spacing = max(size.max() / 60.0, COARSE_NODES_PX * gsd * 2 ** (levels - 1))
    x, y = (np.linspace(a, b, max(int((b - a) / spacing) + 1, 3)) for a, b in zip(area.low, area.high, strict=True))
    nodes = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    z = LinearNDInterpolator(known[:, :2], known[:, 2])(nodes)
    nearest = NearestNDInterpolator(known[:, :2], known[:, 2])(nodes)
    z = gaussian_filter(np.where(np.isfinite(z), z, nearest).reshape(len(y), len(x)), 1.0)
    return Prior(x, y, z, np.full(z.shape, about))


def _of_neighbours(known: np.ndarray) -> np.ndarray:
    """(n,) m, median height of the neighbours in plan of points (n, 3); their own where there are too few."""
    if len(known) <= NEIGHBOURS:
        return known[:, 2]
    near = np.asarray(KDTree(known[:, :2]).query(known[:, :2], NEIGHBOURS + 1)[1])
    return np.median(known[near[:, 1:], 2], axis=1)


def cleaned(z: np.ndarray, score: np.ndarray, per_post: float, prior: np.ndarray) -> np.ndarray:
    """Heights without outliers and holes; where hardly anything was found those of the level above."""
    good = np.isfinite(z) & (score > COARSE_CORRELATION)
    if not good.any():
        return prior
    for size in (5, 3):
        offset = _filled(z - prior, good)
        off = np.abs(offset - median_filter(offset, size)) > OUTLIER_PX * per_post
        good &= ~off
        if not good.any():
            return prior
    offset = median_filter(_filled(z - prior, good), 3)
    away = distance_transform_edt(~good)
    return prior + np.where(good, offset, gaussian_filter(offset, 1.0) * np.exp(-np.asarray(away) / 20.0))


def _filled(values: np.ndarray, good: np.ndarray) -> np.ndarray:
    """Values with those that are not good taken from the nearest good one."""
    place = distance_transform_edt(~good, return_distances=False, return_indices=True)
    return values[tuple(np.asarray(place))]
