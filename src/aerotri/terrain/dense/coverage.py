"""Of the ground that pairs of photographs show, how much has a height."""

from __future__ import annotations

import numpy as np

from aerotri.rasters.grids import Grid
from aerotri.terrain.dense.measure import DenseOutcome
from aerotri.terrain.dense.pairs import possible_pairs
from aerotri.terrain.dense.place import place_at

PLACES = 40_000
"""Cells that are looked at, spread over the surface [C]: a share is then sure to a quarter of a per cent."""
FEWEST = 4
"""Of them along a side of a tile."""


def shown_area(outcome: DenseOutcome) -> float:
    """m², ground that two photographs show under an angle that can be matched, whether it has a height or not.

    Where there is no height the ground is taken to lie as high as in the middle of its tile.
    """
    o = outcome
    every = max(int(np.sqrt(o.grid.rows * o.grid.columns / PLACES)), 1)
    holes = 0.0
    for window, tile in o.files.read_all(list(o.windows)):
        step = max(min(every, min(tile.z.shape) // FEWEST), 1)
        z = tile.z[step // 2 :: step, step // 2 :: step]
        missing = np.isnan(z)
        if missing.any():
            grid = o.grid.window(window.row, window.column, window.rows, window.columns)
            row, column = (step // 2 + step * places for places in np.nonzero(missing))
            shown = _shown(o, grid, row, column, _usual(o, tile.z))
            holes += shown.sum() / z.size * tile.z.size
    return (o.cells + float(holes)) * o.grid.cell_x * o.grid.cell_y


def _usual(o: DenseOutcome, z: np.ndarray) -> float:
    """Median height of a tile; that of the ground where it has none."""
    return float(np.nanmedian(z)) if np.isfinite(z).any() else o.photographs.ground


def _shown(o: DenseOutcome, grid: Grid, row: np.ndarray, column: np.ndarray, height: float) -> np.ndarray:
    """(n,) whether a pair shows the places of a tile."""
    x, y = grid.x(column), grid.y(row)
    left, bottom, right, top = grid.bounds
    middle = np.array([0.5 * (left + right), 0.5 * (bottom + top), height])
    place = place_at(o.photographs, middle, 0.5 * float(np.hypot(right - left, top - bottom)), o.edge)
    ground = place.from_crs(np.column_stack([x, y, np.full(len(x), height)]))
    shown = np.zeros(len(x), bool)
    for candidate in possible_pairs(place, ground):
        shown |= candidate.worth > 0.0
    return shown
