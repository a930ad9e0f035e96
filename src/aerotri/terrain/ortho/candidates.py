"""Which photographs see the cells of a coarse grid, the best first, and the colours they have there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aerotri.adjustment.parallel import thread_count
from aerotri.rasters.grids import Grid
from aerotri.terrain.ortho._sight_kernels import offer
from aerotri.terrain.ortho.ground import TILE, GroundSurface, tile_ground, tiles_of
from aerotri.terrain.ortho.pixels import PixelStore
from aerotri.terrain.photographs import Photographs

CANDIDATES = 5
"""Photographs of a coarse cell that are kept; chosen [C]: beyond them rays are flat."""
SMALLEST_STEP, MOST_CELLS = 8, 1_000_000
"""Cells of the orthophoto along a side of a coarse one at least, and coarse cells at most [C]: some 300 MB."""
REMAP_COLUMNS = 4096
"""Of the table of places that OpenCV takes, which has limits."""
Share = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class Candidates:
    """The photographs of coarse cells, (q, r, c), the best first.

    Parameters
    ----------
    grid : of the coarse cells. step : cells of the orthophoto along their side.
    found : int32 photographs, −1 for none. cost : as of `offer`. column, row : px where they show the middle.
    value : (q, b, r, c) float32 colours, 0 … 1, NaN where there is none.
    detail : float32, how much neighbouring pixels differ there, NaN where not known.
    z : (r, c) m, heights of the middles.
    """

    grid: Grid
    step: int
    found: np.ndarray
    cost: np.ndarray
    column: np.ndarray
    row: np.ndarray
    value: np.ndarray
    detail: np.ndarray
    z: np.ndarray


def coarse_step(grid: Grid) -> int:
    """Cells of the orthophoto along a side of a coarse cell, a power of two."""
    step = SMALLEST_STEP
    while -(-grid.rows // step) * -(-grid.columns // step) > MOST_CELLS and step < TILE:
        step *= 2
    return step


def candidates_of(
    photographs: Photographs, surface: GroundSurface, grid: Grid, gsd: float, edge: float, share: Share
) -> Candidates:
    """The photographs that see the coarse cells of an orthophoto; colours are still missing.

    Parameters
    ----------
    grid : cells of the orthophoto. gsd : m, that pixels are held against.
    """
    step = coarse_step(grid)
    coarse = grid.coarser(step)
    shape = CANDIDATES, coarse.rows, coarse.columns
    found, cost = np.full(shape, -1, np.int32), np.full(shape, np.inf, np.float32)
    column, row = np.full(shape, np.nan, np.float32), np.full(shape, np.nan, np.float32)
    z = np.full(shape[1:], np.nan)

    def one(tile: tuple[int, int, Grid]) -> None:
        first_row, first_column, own = tile
        ground = tile_ground(photographs, surface, own, edge)
        if ground is None:
            return
        part = np.s_[first_row : first_row + own.rows, first_column : first_column + own.columns]
        z[part] = ground.cells.z + ground.site.place[2]
        for k in ground.numbers.tolist():
            offer(
                ground.view, k, k, ground.cells, ground.obstacles, gsd, found[:, *part], cost[:, *part],
                column[:, *part], row[:, *part],
            )  # fmt: skip

    in_threads(one, list(tiles_of(coarse, max(TILE // step, 1))), share)
    value, detail = np.zeros((CANDIDATES, 0, *z.shape), np.float32), np.full(shape, np.nan, np.float32)
    return Candidates(coarse, step, found, cost, column, row, value, detail, z)


def in_threads(work: Callable[[Any], Any], items: list[Any], share: Share) -> None:
    """Do pieces of work in threads, in their order."""
    for _ in results_in_threads(work, items, share):
        pass


def results_in_threads(work: Callable[[Any], Any], items: list[Any], share: Share) -> Iterator[Any]:
    """What pieces of work give, in their order; a few at a time, so that not all of them wait in memory."""
    threads = thread_count()
    with ThreadPoolExecutor(threads) as pool:
        for first in range(0, len(items), threads):
            for done, result in enumerate(pool.map(work, items[first : first + threads]), start=first + 1):
                yield result
                share(done / len(items))


def coloured(candidates: Candidates, photographs: Photographs, pixels: PixelStore, share: Share) -> Candidates:
    """With the colours and the detail: means over about the ground of a coarse cell."""
    flat = candidates.found.ravel()
    order = np.argsort(flat, kind="stable")
    numbers, first = np.unique(flat[order], return_index=True)
    last = np.append(first[1:], len(order))
    shape = candidates.found.shape
    value = np.full((shape[0], pixels.bands, *shape[1:]), np.nan, np.float32)
    detail = np.full(shape, np.nan, np.float32)
    jobs = [(int(n), order[a:b]) for n, a, b in zip(numbers, first, last, strict=True) if n >= 0]

    def one(job: tuple[int, np.ndarray]) -> None:
        number, at = job
        times = candidates.grid.cell_x / float(photographs.gsd[number])
        q, i, j = np.unravel_index(at, shape)
        column, row = candidates.column.ravel()[at], candidates.row.ravel()[at]
        half = photographs.sensor[number]
        value[q, :, i, j] = _at(pixels.reduced(number, times), half, column, row) / np.float32(pixels.white)
        if (fine := pixels.detail(number, times)) is not None:
            detail[q, i, j] = _at(fine[:, :, None], half, column, row)[:, 0]

    in_threads(one, jobs, share)
    return replace(candidates, value=value, detail=detail)


def _at(small: np.ndarray, half: np.ndarray, column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """(n, bands) of a reduced photograph at places (n,) of the whole one; half : of its size, px, both ways."""
    import cv2

    across, along = small.shape[1] / (2.0 * half[0]), small.shape[0] / (2.0 * half[1])
    rows = -(-len(column) // REMAP_COLUMNS)
    places = np.zeros((2, rows * REMAP_COLUMNS), np.float32)
    places[0, : len(column)], places[1, : len(row)] = column * across - 0.5, row * along - 0.5
    x, y = places.reshape(2, rows, REMAP_COLUMNS)
    bands = [
        cv2.remap(np.ascontiguousarray(small[:, :, b]), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        for b in range(small.shape[2])
    ]
    return np.stack([band.ravel()[: len(column)] for band in bands], axis=1)


def covered(candidates: Candidates) -> tuple[Candidates, tuple[int, int]]:
    """Cut to the cells that some photograph sees; and first row and column of what is left.

    At least one cell must be seen.
    """
    seen = candidates.found[0] >= 0
    i, j = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    part = np.s_[i[0] : i[-1] + 1, j[0] : j[-1] + 1]
    c = candidates
    grid = c.grid.window(int(i[0]), int(j[0]), int(i[-1] - i[0]) + 1, int(j[-1] - j[0]) + 1)
    own = np.s_[:, *part]
    cut = replace(
        c, grid=grid, found=c.found[own].copy(), cost=c.cost[own].copy(), column=c.column[own].copy(),
        row=c.row[own].copy(), value=c.value[:, :, *part].copy(), detail=c.detail[own].copy(), z=c.z[part].copy(),
    )  # fmt: skip
    return cut, (int(i[0]), int(j[0]))
