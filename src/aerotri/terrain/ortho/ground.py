"""The ground below an orthophoto: its cells, heights from a surface, and what of the surface may hide a tile."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from threading import Lock
from typing import Any

import numpy as np

from aerotri.rasters.bridging import BridgedReader
from aerotri.rasters.grids import Grid, RasterReader
from aerotri.terrain._view_kernels import View
from aerotri.terrain.ortho._sight_kernels import (
    BLOCK,
    CLEAR_CELLS,
    Cells,
    Obstacles,
    highest_of_blocks,
    surface_heights,
)
from aerotri.terrain.photographs import Photographs, Site, site_at

TILE = 1024
"""Cells along a side of what is computed at a time; chosen [C]: with all that belongs to it some 40 MB."""
SCAN = 128
"""Cells of the surface along a side of the blocks whose lowest and highest height is known [C]."""
MOST_AROUND = 24 << 20
"""Cells of the surface read for a tile at most [C], 100 MB; rays that go further are taken to be free."""
STEEPEST = 3.0
"""Largest tangent of the angle off the vertical of a ray that is followed as far as it goes [C]: flatter ones, of 72°
and more, see little."""


@dataclass(frozen=True, eq=False)
class GroundSurface:
    """A surface read window by window.

    Parameters
    ----------
    reader : of its heights. low, high : (r, c) m of blocks of `SCAN` cells; ∞ and −∞ where nothing is known.
    """

    reader: RasterReader | BridgedReader
    low: np.ndarray
    high: np.ndarray
    lock: Lock

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process has a lock of its own."""
        return _unlocked, (self.reader, self.low, self.high)

    @property
    def grid(self) -> Grid:
        return self.reader.grid

    def read(self, row: int, column: int, rows: int, columns: int) -> np.ndarray:
        """(rows, columns) float32 m; NaN where not known and beyond the edges."""
        with self.lock:
            return self.reader.read(row, column, rows, columns).astype(np.float32)

    def bridged(self, grid: Grid) -> np.ndarray | None:
        """(r, c) bool, cells of a grid whose height is not from measured ones alone; None where nothing is bridged."""
        if not isinstance(self.reader, BridgedReader):
            return None
        i, j = self.grid.row(grid.y(np.arange(grid.rows))), self.grid.column(grid.x(np.arange(grid.columns)))
        row, column = int(np.floor(i.min())), int(np.floor(j.min()))
        with self.lock:
            z = self.reader.measured.read(row, column, int(i.max()) - row + 2, int(j.max()) - column + 2)
        rows = [np.floor(i).astype(np.int64) - row, np.ceil(i).astype(np.int64) - row]
        columns = [np.floor(j).astype(np.int64) - column, np.ceil(j).astype(np.int64) - column]
        return np.any([np.isnan(z[np.ix_(a, b)]) for a in rows for b in columns], axis=0)

    def span(self, row: int, column: int, rows: int, columns: int) -> tuple[float, float]:
        """Lowest and highest height of a window, or somewhat beyond it; ∞ and −∞ where nothing is known."""
        i, last_i = np.clip([row // SCAN, -(-(row + rows) // SCAN)], 0, self.low.shape[0])
        j, last_j = np.clip([column // SCAN, -(-(column + columns) // SCAN)], 0, self.low.shape[1])
        part = np.s_[i:last_i, j:last_j]
        return float(self.low[part].min(initial=np.inf)), float(self.high[part].max(initial=-np.inf))

    def around(self, window: tuple[int, int, int, int], lowest: float, tangent: float) -> int:
        """Cells around a window (row, column, rows, columns) with heights from `lowest` on that may hide some of it.

        tangent : largest of the angles off the vertical of the rays.
        """
        row, column, rows, columns = window
        i, j = np.arange(self.high.shape[0]) * SCAN, np.arange(self.high.shape[1]) * SCAN
        down = np.maximum(np.maximum(row - (i + SCAN), i - (row + rows)), 0)
        right = np.maximum(np.maximum(column - (j + SCAN), j - (column + columns)), 0)
        cell = min(self.grid.cell_x, self.grid.cell_y)
        away = np.hypot(down[:, None], right[None, :])
        hiding = (self.high - lowest) * tangent > away * cell
        far = min(float(away[hiding].max(initial=0.0)) + SCAN, (float(self.high.max()) - lowest) * tangent / cell)
        free = (np.sqrt(MOST_AROUND) - max(rows, columns)) / 2.0
        return max(int(min(far, free)), 0) + 2


def _unlocked(reader: RasterReader | BridgedReader, low: np.ndarray, high: np.ndarray) -> GroundSurface:
    return GroundSurface(reader, low, high, Lock())


def ground_surface(reader: RasterReader | BridgedReader) -> GroundSurface:
    """A surface, after one look at all of its heights."""
    g = reader.grid
    shape = -(-g.rows // SCAN), -(-g.columns // SCAN)
    low, high = np.full(shape, np.inf), np.full(shape, -np.inf)
    starts = np.arange(0, g.columns, SCAN)
    for i in range(shape[0]):
        z = reader.read(i * SCAN, 0, min(SCAN, g.rows - i * SCAN), g.columns)
        low[i] = np.minimum.reduceat(np.where(np.isnan(z), np.inf, z).min(axis=0), starts)
        high[i] = np.maximum.reduceat(np.where(np.isnan(z), -np.inf, z).max(axis=0), starts)
    return GroundSurface(reader, low, high, Lock())


@dataclass(frozen=True, eq=False)
class TileGround:
    """A tile: its cells, what may hide them, and the photographs that may show them.

    Parameters
    ----------
    grid : of its cells, in the CRS. site, view : photographs in Δ. cells, obstacles : in Δ. numbers : (k,) photographs.
    """

    grid: Grid
    site: Site
    view: View
    cells: Cells
    obstacles: Obstacles
    numbers: np.ndarray


def tile_ground(photographs: Photographs, surface: GroundSurface, grid: Grid, edge: float) -> TileGround | None:
    """What a tile of the ground needs to be looked at from photographs; None where it has no heights or photographs.

    Parameters
    ----------
    grid : its cells. edge : share of the format at its edge that is not used.
    """
    left, bottom, right, top = grid.bounds
    site = site_at(photographs, 0.5 * (left + right), 0.5 * (bottom + top))
    row, column = (int(np.floor(v)) for v in (surface.grid.row(top), surface.grid.column(left)))
    rows, columns = (
        int(np.ceil(surface.grid.row(bottom))) - row + 1, int(np.ceil(surface.grid.column(right))) - column + 1,
    )  # fmt: skip
    window = row, column, rows, columns
    lowest, highest = surface.span(*window)
    if not np.isfinite(lowest):
        return None
    low, high = np.array([left, bottom, lowest]), np.array([right, top, highest])
    numbers = photographs_over(site, low - site.place, high - site.place)
    if not len(numbers):
        return None
    away = np.abs(site.centres[numbers][:, None, :2] - _corners(low, high, site)[None]).max(axis=1)
    height = np.maximum(site.centres[numbers, 2] - (highest - site.place[2]), 1e-3)
    around = surface.around(window, lowest, min(float(np.max(np.hypot(*away.T) / height)), STEEPEST))
    obstacles = _obstacles(surface, site, (row - around, column - around, rows + 2 * around, columns + 2 * around))
    cells = Cells(
        np.empty((grid.rows, grid.columns), np.float32),
        np.array([grid.x(0), grid.y(0)]) - site.place[:2], grid.cell_x,
    )  # fmt: skip
    surface_heights(obstacles, cells)
    if np.isnan(cells.z).all():
        return None
    n = len(photographs)
    view = View(
        site.photos, photographs.source, photographs.tables.for_kernels, photographs.sensor, site.centres,
        np.zeros((n, 5), np.int64), np.zeros(1, np.uint16), 1.0, edge,
    )  # fmt: skip
    return TileGround(grid, site, view, cells, obstacles, numbers)


def _corners(low: np.ndarray, high: np.ndarray, site: Site) -> np.ndarray:
    x, y = np.meshgrid([low[0], high[0]], [low[1], high[1]])
    return np.column_stack([x.ravel(), y.ravel()]) - site.place[:2]


def _obstacles(surface: GroundSurface, site: Site, window: tuple[int, int, int, int]) -> Obstacles:
    g = surface.grid
    row, column = max(window[0], 0), max(window[1], 0)
    last_row, last_column = min(window[0] + window[2], g.rows), min(window[1] + window[3], g.columns)
    # two rows and columns at least, so that there is something between centres
    z = surface.read(row, column, max(last_row - row, 2), max(last_column - column, 2))
    z -= np.float32(site.place[2])
    highest = np.empty((-(-z.shape[0] // BLOCK), -(-z.shape[1] // BLOCK)))
    highest_of_blocks(z, highest)
    origin = np.array([g.x(column), g.y(row)]) - site.place[:2]
    cell = np.array([g.cell_x, g.cell_y])
    return Obstacles(z, origin, cell, highest, float(highest.max()), CLEAR_CELLS * float(cell.min()))


def photographs_over(site: Site, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(k,) photographs that may show a box with corners (3,) m in Δ, those most upright over it first."""
    p = site.photographs
    x, y, z = np.meshgrid(*zip(low, high, strict=True))
    corners = np.column_stack([x.ravel(), y.ravel(), z.ravel(), np.ones(8)])
    u = np.einsum("nij,kj->nki", site.photos[0, :, :12].reshape(-1, 3, 4), corners)
    ahead = (u[:, :, 2] < 0.0).all(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = -site.photos[0, :, 12, None] / u[:, :, 2]
    place = site.photos[0, :, None, 13:15] + scale[:, :, None] * u[:, :, :2]
    half = p.sensor[:, :2] / p.sensor[:, 2:] + (p.error_px + 2.0) / p.sensor[:, 2:]
    beyond = (place.min(axis=1) > half).any(axis=1) | (place.max(axis=1) < -half).any(axis=1)
    found = np.flatnonzero(ahead & ~beyond)
    middle = 0.5 * (low + high)
    return found[np.argsort(np.hypot(*(site.centres[found, :2] - middle[:2]).T), kind="stable")]


def tiles_of(grid: Grid, side: int) -> Iterator[tuple[int, int, Grid]]:
    """First row and column and grid of every tile, neighbours near one another in the order (a Z-order curve)."""
    rows, columns = -(-grid.rows // side), -(-grid.columns // side)
    i, j = (index.ravel() for index in np.indices((rows, columns)))
    for place in np.argsort(_interleaved(i, j), kind="stable").tolist():
        row, column = int(i[place]) * side, int(j[place]) * side
        yield row, column, grid.window(row, column, min(side, grid.rows - row), min(side, grid.columns - column))


def _interleaved(i: np.ndarray, j: np.ndarray) -> np.ndarray:
    out = np.zeros(len(i), np.int64)
    for bit in range(16):
        out |= ((j >> bit) & 1) << (2 * bit)
        out |= ((i >> bit) & 1) << (2 * bit + 1)
    return out
