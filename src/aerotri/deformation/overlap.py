"""In how many photographs every place of the ground is seen: footprints counted in the cells of a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CELLS = 220
"""Cells along the longer side of the block at most [C]: finer ones are not seen on a page, and any number of
photographs is counted in bounded memory."""
STEPS = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""Cells are so many times a power of ten large."""
ENOUGH = 3
"""Photographs from which on a ground point is controlled: one gross error among two rays stays unseen."""


@dataclass(frozen=True, eq=False)
class Overlap:
    """Photographs a cell.

    Parameters
    ----------
    corner : (2,) m, lower left corner of the first cell. cell : m, its side.
    count : (rows, columns) photographs that see the middle of the cell; the rows go up.
    inside : (rows, columns) bool, whether it lies within the outermost projection centres.
    """

    corner: np.ndarray
    cell: float
    count: np.ndarray
    inside: np.ndarray

    def area(self, least: int, most: int | None = None, inside: bool = False) -> float:
        """m² that are seen by `least` to `most` photographs.

        Parameters
        ----------
        inside : within the outermost projection centres only.
        """
        there = self.count >= least
        if most is not None:
            there &= self.count <= most
        return float(np.sum(there & self.inside if inside else there)) * self.cell**2


def overlap_of(polygons: np.ndarray, centres: np.ndarray) -> Overlap | None:
    """Count footprints.

    Parameters
    ----------
    polygons : (n,) shapely geometries, None of photographs without one. centres : (n, 2) m, of projection; NaN where
        not known.

    Returns
    -------
    None where no photograph has a footprint.
    """
    import shapely

    there = np.array([one for one in polygons if one is not None and not one.is_empty], dtype=object)
    if not len(there):
        return None
    bounds = shapely.bounds(there)
    low, high = bounds[:, :2].min(axis=0), bounds[:, 2:].max(axis=0)
    cell = _rounded_up(float((high - low).max()) / CELLS)
    corner = np.floor(low / cell) * cell
    columns, rows = (np.ceil((high - corner) / cell).astype(np.int64) + 1).tolist()
    x, y = (corner[k] + cell * (np.arange(size) + 0.5) for k, size in enumerate((columns, rows)))
    count = np.zeros((rows, columns), np.int64)
    shapely.prepare(there)
    first = np.maximum(np.floor((bounds[:, :2] - corner) / cell - 0.5).astype(np.int64), 0)
    last = np.ceil((bounds[:, 2:] - corner) / cell - 0.5).astype(np.int64) + 1
    for polygon, (j, i), (to_j, to_i) in zip(there, first.tolist(), last.tolist(), strict=True):
        count[i:to_i, j:to_j] += shapely.contains_xy(polygon, *np.meshgrid(x[j:to_j], y[i:to_i]))
    known = centres[np.isfinite(centres).all(axis=1)]
    hull = shapely.MultiPoint(known).convex_hull
    inside = np.zeros_like(count, dtype=bool)
    if hull.geom_type == "Polygon":
        shapely.prepare(hull)
        inside = shapely.contains_xy(hull, *np.meshgrid(x, y))
    return Overlap(corner, cell, count, inside)


def _rounded_up(size: float) -> float:
    """The smallest of `STEPS` times a power of ten that is not below a size; 1 for what has no size."""
    if not size > 0.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(size))
    return float(next(step for step in STEPS if step * power >= size * (1 - 1e-9)) * power)
