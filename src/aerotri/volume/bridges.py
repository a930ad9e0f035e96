"""Errors of ground that was bridged below objects: a bridge errs as a whole.

How far the errors of a bridge hold along it nobody has measured. [C] All cells of one bridged patch err together, in
whichever way makes most of a sum: of every patch Σ|w|·σ counts, and patches are independent. That is the most it can
be.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import label

from aerotri.rasters.grids import Grid
from aerotri.terrain.dense.bare_ground import COARSE_M
from aerotri.volume.bases import Surface

STRIP = 1024
"""Rows of cells that are in memory at a time, about."""

Place = tuple[int, int, int, int]
"""First row and column, number of rows and columns."""


@dataclass(frozen=True, eq=False)
class Bridges:
    """Bridged cells of a surface.

    Parameters
    ----------
    sigma : m, σ of bridged cells without what the adjustment adds, 0 or NaN of others, on the cells of the surface.
    is_bridged : gives (rows, columns) bool of a place.
    """

    sigma: Surface
    is_bridged: Callable[[int, int, int, int], np.ndarray]

    @property
    def step(self) -> int:
        """Cells a side of the blocks that patches are told by: those the ground is bridged between."""
        return max(round(COARSE_M / self.sigma.grid.cell_x), 1)

    @cached_property
    def patches(self) -> np.ndarray:
        """(rows, columns) whole, number of the patch that a block of cells belongs to; 0 of blocks without."""
        grid, step = self.sigma.grid, self.step
        coarse = grid.coarser(step)
        found = np.zeros((coarse.rows, coarse.columns), bool)
        height = max(STRIP // step, 1) * step
        for row in range(0, grid.rows, height):
            some, column = np.nonzero(self.is_bridged(row, 0, min(height, grid.rows - row), grid.columns))
            found[(row + some) // step, column // step] = True
        numbers = np.zeros(found.shape, np.int32)
        label(found, np.ones((3, 3), bool), output=numbers)
        return numbers

    def patches_at(self, grid: Grid) -> np.ndarray:
        """(rows, columns) whole, of the cells of another grid; 0 beside the patches."""
        coarse = self.sigma.grid.coarser(self.step)
        row = np.rint(coarse.row(grid.y(np.arange(grid.rows)))).astype(int)
        column = np.rint(coarse.column(grid.x(np.arange(grid.columns)))).astype(int)
        inside = ((row >= 0) & (row < coarse.rows))[:, None] & ((column >= 0) & (column < coarse.columns))
        row, column = np.clip(row, 0, coarse.rows - 1), np.clip(column, 0, coarse.columns - 1)
        return np.where(inside, self.patches[np.ix_(row, column)], 0)

    def errors(self, place: Place, weight: np.ndarray) -> np.ndarray:
        """(n,) Σ|w|·σ of every patch, of cells with weights (rows, columns) m²: m³."""
        grid = self.sigma.grid.window(*place)
        return errors_of_patches(self.patches_at(grid), weight, sigma_of_bridges(self, place), int(self.patches.max()))


def sigma_of_bridges(bridges: Bridges | None, place: Place) -> np.ndarray:
    """(rows, columns) m, σ of bridged cells, 0 of others."""
    if bridges is None:
        return np.zeros(place[2:])
    return np.nan_to_num(bridges.sigma.read(*place).astype(float))


def errors_of_patches(patch: np.ndarray, weight: np.ndarray, sigma: np.ndarray, count: int) -> np.ndarray:
    """(count + 1,) Σ|w|·σ of every patch, of cells with patches, weights and σ (rows, columns)."""
    own = np.abs(weight) * np.nan_to_num(sigma)
    return np.bincount(patch.ravel(), own.ravel(), count + 1)
