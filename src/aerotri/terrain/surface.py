"""Surfaces on grids: from pickets by their TIN, each cell with its σ; what interpolation costs; ground without objects.

σ of a cell holds the σ of the pickets around it and the error of interpolation between them. The latter is measured on
the pickets themselves: a part of them is left out and predicted by the others, at two and at four times the interval;
the power law between the two leads to the interval itself [D].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation, distance_transform_edt, grey_opening

from aerotri.memory import fitting, refuse_beyond_memory
from aerotri.rasters.grids import Grid
from aerotri.terrain.settings import WIDEST_OBJECT_M
from aerotri.terrain.tin import triangulate

LONGEST_SIDE = 2.6
"""Sides of triangles, in intervals, that still count as ground between pickets; longer ones bridge a hole."""
ROWS_AT_A_TIME = 256
"""Rows of a surface that are interpolated at a time; chosen [C]: 20 MB an array where a raster has 10 000 columns."""
BYTES_OF_CELL = 160
"""Two surfaces with their σ, and what the filter of objects holds at its peak."""
FEWEST_LEFT_OUT = 30
"""Pickets left out, and kept, of which an RMS is taken; chosen [C]: the RMS of 30 is known to 13 %."""
LEAST_POWER, MOST_POWER = 0.5, 2.0
"""Bounds of the power with which the error grows with the interval: 2 is that of straight triangles over smooth ground,
a half that over ground as rough as a random walk."""
SMRF_SLOPE, SMRF_WINDOW_M, SMRF_HEIGHT_M, SMRF_SCALE = 0.15, WIDEST_OBJECT_M, 0.5, 1.25
"""Slope, width of the widest object, m, height tolerance, m, and its growth with the slope times the cell: those that
PDAL's filters.smrf has for this method."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Heights and their σ (rows, columns) m on the cells of a grid; NaN where there is no surface."""

    grid: Grid
    z: np.ndarray
    sigma: np.ndarray


def grid_over(xy: np.ndarray, cell: float, bytes_of_cell: int = BYTES_OF_CELL) -> Grid:
    """A grid whose cells' centres are multiples of the cell, over all points (n, 2).

    Raises
    ------
    InputError
        When what is computed on it, with so many bytes a cell, does not fit into memory.
    """
    low, high = np.floor(xy.min(axis=0) / cell), np.ceil(xy.max(axis=0) / cell)
    count = float((high - low + 1.0).prod())
    refuse_beyond_memory(
        bytes_of_cell * count, f"{count:.3g} cells of {cell:g} m",
        f"give a --cell of at least {cell * np.sqrt(count / fitting(bytes_of_cell)):.2g} m",
    )  # fmt: skip
    columns, rows = (high - low + 1).astype(int).tolist()
    return Grid(rows, columns, float(low[0] - 0.5) * cell, float(high[1] + 0.5) * cell, cell, cell)


def surface_of(
    xyz: np.ndarray, variance: np.ndarray, interval: float, grid: Grid, breaklines: Sequence[np.ndarray] = (),
    interpolation: float = 0.0, common: np.ndarray | None = None,
) -> Surface:  # fmt: skip
    """The surface of pickets on a grid.

    Parameters
    ----------
    xyz : (n, 3) m. variance : (n,) m² of their heights, of each for itself; common : (n,) m², what neighbours share.
    interval : m between them.
    breaklines : (k, 3) m each. interpolation : m, RMS error of a place between pickets.
    """
    tin = triangulate(xyz, variance, LONGEST_SIDE * interval, breaklines, common)
    z, sigma = np.empty((grid.rows, grid.columns)), np.empty((grid.rows, grid.columns))
    x = grid.x(np.arange(grid.columns))
    for first in range(0, grid.rows, ROWS_AT_A_TIME):
        rows = slice(first, min(first + ROWS_AT_A_TIME, grid.rows))
        y = grid.y(np.arange(rows.start, rows.stop))
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        found, of_pickets, away = tin.interpolate(places)
        z[rows] = found.reshape(len(y), -1)
        sigma[rows] = np.sqrt(of_pickets + interpolation**2 * away).reshape(len(y), -1)
    return Surface(grid, z, sigma)


def errors_by_interval(
    xyz: np.ndarray, node: np.ndarray, interval: float, factors: Sequence[int], variance: np.ndarray | None = None
) -> np.ndarray:
    """RMS error (k,) m of the surface between pickets `factor` times as far apart, at the pickets left out.

    Parameters
    ----------
    xyz : (n, 3) m. node : (n, 2) m, their nodes on the grid of the interval. factors : whole numbers from 2 on.
    variance : (n,) m² of heights, taken off the squares: the error is that of the surface, not of the pickets.

    Returns
    -------
    NaN where too few are left.
    """
    number = np.round(node / interval).astype(np.int64)
    out = np.full(len(factors), np.nan)
    for k, factor in enumerate(factors):
        kept = (number % factor == 0).all(axis=1)
        if kept.sum() < FEWEST_LEFT_OUT or (~kept).sum() < FEWEST_LEFT_OUT:
            continue
        of_kept = None if variance is None else variance[kept]
        tin = triangulate(xyz[kept], of_kept, LONGEST_SIDE * factor * interval)
        z, of_corners, _ = tin.interpolate(xyz[~kept, :2])
        known = np.isfinite(z)
        if known.sum() < FEWEST_LEFT_OUT:
            continue
        square = (z[known] - xyz[~kept][known, 2]) ** 2
        if variance is not None:
            square = square - variance[~kept][known] - of_corners[known]
        out[k] = np.sqrt(max(float(square.mean()), 0.0))
    return out


def interpolation_error(xyz: np.ndarray, node: np.ndarray, interval: float, variance: np.ndarray) -> float:
    """RMS error m of the surface between pickets at their own interval; 0 where too few tell."""
    two, four = errors_by_interval(xyz, node, interval, (2, 4), variance)
    if not np.isfinite(two) or two <= 0.0:
        return 0.0
    power = np.log2(four / two) if np.isfinite(four) and four > 0.0 else 1.0
    return float(two * 2.0 ** -np.clip(power, LEAST_POWER, MOST_POWER))


def ground_cells(
    z: np.ndarray, cell: float, blur: float = 0.0, stated: np.ndarray | None = None, widest: float = SMRF_WINDOW_M
) -> np.ndarray:
    """(rows, columns) bool: cells of a surface that are ground and no object on it.

    The simple morphological filter [L: Pingel, Clarke, McBride 2013]: the surface is opened by ever wider discs; what
    a disc takes off more than the slope allows is an object; the ground then is what lies near the surface of the
    rest. Openings are those of scipy.ndimage. Widest object 18 m, slope 15 %, threshold 0.5 m + 1.25 · slope.

    Parameters
    ----------
    blur : m beside an object that are no ground either: the windows of matching have some of the object in them, so
        that walls become slopes, whose feet no opening takes off.
    stated : bool as z, cells that are ground whatever their shape: a stockpile is steeper than the filter allows.
    widest : m, of the objects.
    """
    known = np.isfinite(z)
    if not known.any():
        return known
    filled = _nearest(z, known)
    last, objects = filled, np.zeros(z.shape, bool)
    for radius in range(1, max(int(np.ceil(widest / 2.0 / cell)), 1) + 1):
        opened = grey_opening(last, footprint=_disc(radius))
        objects |= last - opened > SMRF_SLOPE * radius * cell
        last = opened
    if stated is not None:
        objects &= ~stated
    reach = int(np.ceil(blur / cell))
    ground = known & ~_widened(objects, reach)
    if stated is not None:
        ground |= known & stated
    if not ground.any():
        return ground
    surface = _nearest(np.where(ground, z, np.nan), ground)
    slope = np.hypot(*np.gradient(surface, cell)) if min(z.shape) > 1 else np.zeros(z.shape)
    near = known & (np.abs(filled - surface) <= SMRF_HEIGHT_M + SMRF_SCALE * slope * cell)
    # what stands out after all is an object, and so is what its blur reaches
    found = near & ~_widened(known & ~near, reach)
    return found if stated is None else found | (known & stated)


def _nearest(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    place = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return values[tuple(np.asarray(place))]


def _widened(cells: np.ndarray, reach: int) -> np.ndarray:
    return np.asarray(binary_dilation(cells, _disc(reach)), dtype=bool)


def _disc(radius: int) -> np.ndarray:
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    return x * x + y * y <= radius * radius
