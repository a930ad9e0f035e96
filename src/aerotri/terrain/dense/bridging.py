"""Bridges across holes of the ground by triangles, and how wrong they are by their distance from the ground.

The law is measured on the ground itself: discs of it are taken out, bridged and compared; a power law leads from their
distances to all [D]. Errors are summed by distance, so that those of many pieces of ground make one law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation, binary_erosion, distance_transform_edt
from scipy.spatial import Delaunay, QhullError

from aerotri.terrain.surface import LEAST_POWER, MOST_POWER, SMRF_SLOPE

RADII = (1, 2, 4, 8)
"""Of the discs that are taken out to measure bridges, coarse cells."""
FEWEST_BRIDGED = 30
MOVED = 1e-4
"""Cells by which corners of triangles are moved, each by its own number; chosen [C]: four corners on one circle have
two triangulations, and which of them is taken must not depend on what else is triangulated. Moved by a tenth of it,
Qhull still took some of them for equal. Heights change by the slope times as much."""
BESIDE_HULL = 2.0 * MOVED
"""Of the height of a triangle of at least 0.7 cells: so little beyond the outline a cell lies on it but for the
moving."""
CELLS_AT_A_TIME = 100_000
"""That are bridged, so that their triangles take little memory; chosen [C]: 20 MB."""


@dataclass(frozen=True)
class BridgeLaw:
    """RMS error of a bridge: at_1_m · distance^power, m, from the ground; discs : that were taken out to measure it."""

    at_1_m: float
    power: float
    discs: int

    def sigma(self, distance: np.ndarray) -> np.ndarray:
        """m, at distances, m."""
        return self.at_1_m * np.asarray(distance, float) ** self.power


@dataclass(frozen=True, eq=False)
class DiscErrors:
    """Errors of bridges across discs: (n,) distances, m, how many cells have each, sums of their squares, m²."""

    at: np.ndarray
    count: np.ndarray
    squares: np.ndarray
    discs: int


def bridged_heights(z: np.ndarray, first: tuple[int, int] = (0, 0)) -> np.ndarray:
    """(rows, columns) m, heights with their holes (NaN) bridged by triangles between the cells around them.

    NaN remains beyond the outline of what is known.

    Parameters
    ----------
    first : row and column, in the whole, of the first cell.
    """
    known = np.isfinite(z)
    rim = known & binary_dilation(~known, np.ones((3, 3), bool))
    corners = np.argwhere(rim)
    if known.all() or len(corners) < 3:
        return z.copy()
    out = z.copy()
    try:
        triangles = Delaunay(corners + _moved(corners + np.array(first)))
    except QhullError:  # all on one line
        return out
    holes = np.argwhere(~known)
    for start in range(0, len(holes), CELLS_AT_A_TIME):
        cells = holes[start : start + CELLS_AT_A_TIME]
        out[tuple(cells.T)] = _between_corners(triangles, z[rim], cells)
    return out


def _between_corners(triangles: Delaunay, z: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """(n,) m, heights at cells (n, 2) of the triangles they lie in; NaN where there is none."""
    number = triangles.find_simplex(cells)
    lost = number < 0
    if lost.any():
        number[lost] = triangles.find_simplex(cells[lost], tol=BESIDE_HULL)
    to_weights = triangles.transform[number]
    first = np.einsum("nij,nj->ni", to_weights[:, :2], cells - to_weights[:, 2])
    weights = np.column_stack([first, 1.0 - first.sum(axis=1)])
    return np.where(number < 0, np.nan, (weights * z[triangles.simplices[number]]).sum(axis=1))


def _moved(cells: np.ndarray) -> np.ndarray:
    """(n, 2) by how much cells (n, 2) are moved: of no order, but always the same for a cell."""
    row, column = cells.astype(np.uint64).T
    mixed = (row << np.uint64(32)) + column
    for factor in (0xBF58476D1CE4E5B9, 0x94D049BB133111EB):  # of SplitMix64
        mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(factor)
    halves = np.column_stack([mixed >> np.uint64(32), mixed & np.uint64(0xFFFFFFFF)])
    return MOVED * (halves / 2.0**32 - 0.5)


def bridge_law(errors: Sequence[DiscErrors]) -> BridgeLaw:
    """How wrong bridges are by their distance from the ground.

    Where too little ground is whole, the slope that the filter takes for ground, 15 %, is the error.

    Parameters
    ----------
    errors : of pieces of the ground.
    """
    discs = sum(e.discs for e in errors)
    if discs < FEWEST_BRIDGED:
        return BridgeLaw(SMRF_SLOPE, 1.0, discs)
    at, place = np.unique(np.concatenate([e.at for e in errors]), return_inverse=True)
    count, squares = (
        np.bincount(place, np.concatenate(parts)) for parts in ([e.count for e in errors], [e.squares for e in errors])
    )
    return _power_law(at, count, squares, discs)


def disc_errors(
    z: np.ndarray, cell: float, widest: float, first: tuple[int, int] = (0, 0), own: np.ndarray | None = None
) -> DiscErrors:
    """Errors of bridges across discs of ground that are taken out.

    Parameters
    ----------
    z : (rows, columns) m, ground, NaN where it is not known. cell : m. widest : m, of a disc.
    first : row and column, in the whole, of the first cell.
    own : (rows, columns) bool, where the middles of discs lie; everywhere where None.
    """
    known, discs = np.isfinite(z), 0
    distances, errors = [np.zeros(0)], [np.zeros(0)]
    for radius in (r for r in RADII if (2 * r + 1) * cell <= max(widest, 3.0 * cell)):
        middles = _middles(known, radius, first)
        if own is not None:
            middles &= own
        if not middles.any():
            continue
        taken = np.asarray(binary_dilation(middles, disc(radius)), bool)
        error = bridged_heights(np.where(taken, np.nan, z), first) - z
        told = taken & np.isfinite(error)
        distances.append(away_from(known & ~taken, cell)[told])
        errors.append(error[told])
        discs += int(middles.sum())
    at, place = np.unique(np.round(np.concatenate(distances), 6), return_inverse=True)
    count = np.bincount(place, minlength=len(at))
    return DiscErrors(at, count, np.bincount(place, np.concatenate(errors) ** 2, len(at)), discs)


def _power_law(at: np.ndarray, count: np.ndarray, squares: np.ndarray, discs: int) -> BridgeLaw:
    """By least squares through the logarithms of RMS errors at equal distances, weighted by their number."""
    rms = np.sqrt(np.maximum(squares / count, 1e-12))
    x, y, w = np.log(at), np.log(rms), count / count.sum()
    dx, dy = x - w @ x, y - w @ y
    spread = float(w @ dx**2)
    power = float(np.clip(w @ (dx * dy) / spread, LEAST_POWER, MOST_POWER)) if spread > 1e-12 else 1.0
    scale = float(np.sqrt((count @ rms**2) / (count @ at ** (2.0 * power))))
    return BridgeLaw(scale, power, discs)


def away_from(known: np.ndarray, cell: float) -> np.ndarray:
    """(rows, columns) m, distance from the nearest known cell."""
    if not known.any():
        return np.full(known.shape, np.inf)
    return np.asarray(distance_transform_edt(~known), float) * cell


def _middles(known: np.ndarray, radius: int, first: tuple[int, int]) -> np.ndarray:
    """Cells of a lattice about which a disc and the cells around it are known."""
    whole = np.asarray(binary_erosion(known, disc(radius + 1)), bool)
    every, step = np.zeros(known.shape, bool), 4 * radius
    every[-first[0] % step :: step, -first[1] % step :: step] = True
    return whole & every


def disc(radius: int) -> np.ndarray:
    """(2 radius + 1, 2 radius + 1) bool."""
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    return x * x + y * y <= radius * radius
