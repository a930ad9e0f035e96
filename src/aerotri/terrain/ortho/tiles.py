"""The cells of a tile, each from its photograph, or from the next best one where that one does not see it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.rasters.grids import Grid
from aerotri.terrain.ortho._sight_kernels import Cells, centres_for, look
from aerotri.terrain.ortho.balance import Balance
from aerotri.terrain.ortho.candidates import Candidates
from aerotri.terrain.ortho.ground import GroundSurface, TileGround, tile_ground
from aerotri.terrain.ortho.pixels import PixelStore
from aerotri.terrain.ortho.seams import Choice
from aerotri.terrain.photographs import Photographs

SMALLER = 2.0
"""Pixels in a cell from which a photograph is made smaller before it is resampled, so that nothing is skipped."""
MARGIN_PX = 4
"""Pixels around what is needed of a photograph; bicubic interpolation takes two."""


@dataclass(frozen=True, eq=False)
class Sources:
    """All that tiles are made of.

    Parameters
    ----------
    photographs, pixels, surface : the input. candidates, choice, balance : what was found on the coarse grid.
    edge : share of the format that is not used. resampling : 'nearest', 'bilinear' or 'bicubic'.
    """

    photographs: Photographs
    pixels: PixelStore
    surface: GroundSurface
    candidates: Candidates
    choice: Choice
    balance: Balance
    edge: float
    resampling: str


@dataclass(frozen=True, eq=False)
class Tile:
    """A finished tile.

    Parameters
    ----------
    row, column : of its first cell. colours : (bands + 1, r, c), the last one the mask, 0 where no photograph sees.
    number : (r, c) int32 photograph, −1 for none. heights : cells with a height. hidden : those among them that the
        photograph chosen for their place does not see. bridged : (r, c) bool, cells over bridged holes of the surface;
        None where none are bridged.
    """

    row: int
    column: int
    colours: np.ndarray
    number: np.ndarray
    heights: int
    hidden: int
    bridged: np.ndarray | None


def make_tile(sources: Sources, row: int, column: int, grid: Grid) -> Tile | None:
    """A tile of an orthophoto; None where there is nothing to see.

    Parameters
    ----------
    row, column : of its first cell. grid : its cells.
    """
    s = sources
    ground = tile_ground(s.photographs, s.surface, grid, s.edge)
    if ground is None:
        return None
    shape = ground.cells.z.shape
    out = np.zeros((*shape, s.pixels.bands), s.pixels.dtype)
    number = np.full(shape, -1, np.int32)
    known = ~np.isnan(ground.cells.z)
    todo, hidden = known.copy(), 0
    for place, chosen in enumerate((s.choice.number, *s.candidates.found)):
        own, wanted = _wanted(chosen, s.candidates.step, row, column, shape)
        for k in np.unique(own).tolist():
            if k >= 0:
                _take(sources, ground, k, todo & (wanted == k), out, number)
        todo &= number < 0
        if place == 0:
            hidden = int((todo & (wanted >= 0)).sum())
        if not todo.any():
            break
    for k in ground.numbers.tolist():
        if not todo.any():
            break
        _take(sources, ground, k, todo, out, number)
        todo &= number < 0
    mask = np.where(number >= 0, np.iinfo(out.dtype).max, 0).astype(out.dtype)
    colours = np.concatenate([np.moveaxis(out, -1, 0), mask[None]])
    bridged = s.surface.bridged(grid)
    return Tile(row, column, colours, number, int(known.sum()), hidden, None if bridged is None else bridged & known)


def _wanted(
    chosen: np.ndarray, step: int, row: int, column: int, shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Photographs of the coarse cells of a tile, and (r, c) of its cells.

    Parameters
    ----------
    chosen : of all coarse cells. step : cells along a side of one. row, column : of the tile's first cell.
    """
    i, j = (row + np.arange(shape[0])) // step, (column + np.arange(shape[1])) // step
    return chosen[i[0] : i[-1] + 1, j[0] : j[-1] + 1], chosen[np.ix_(i, j)]


def _take(
    sources: Sources, ground: TileGround, k: int, wanted: np.ndarray, out: np.ndarray, number: np.ndarray
) -> None:
    """Cells that are wanted of photograph k, as far as it sees them."""
    rows, columns = np.flatnonzero(wanted.any(axis=1)), np.flatnonzero(wanted.any(axis=0))
    if not len(rows):
        return
    part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    c = ground.cells
    cells = Cells(c.z[part], c.origin + c.cell * np.array([columns[0], -rows[0]]), c.cell)
    column, row = np.empty(cells.z.shape, np.float32), np.empty(cells.z.shape, np.float32)
    look(ground.view, k, cells, ground.obstacles, wanted[part], centres_for(ground.obstacles), column, row)
    seen = ~np.isnan(column)
    if not seen.any():
        return
    colours = _sampled(sources, k, column, row, seen, c.cell)
    np.copyto(out[part], colours, where=seen[:, :, None])
    np.copyto(number[part], np.int32(k), where=seen)


def _sampled(
    sources: Sources, k: int, column: np.ndarray, row: np.ndarray, seen: np.ndarray, cell: float
) -> np.ndarray:
    """(r, c, bands) colours of photograph k at places, balanced; anything where it is not seen."""
    import cv2

    methods = {"nearest": cv2.INTER_NEAREST, "bilinear": cv2.INTER_LINEAR, "bicubic": cv2.INTER_CUBIC}
    p = sources.photographs
    size = (2.0 * p.sensor[k, :2]).round().astype(int)
    times = int(cell / p.gsd[k]) if cell >= SMALLER * p.gsd[k] else 1
    low = [int(np.min(v, where=seen, initial=np.inf)) // times - MARGIN_PX for v in (column, row)]
    high = [int(np.max(v, where=seen, initial=0.0)) // times + MARGIN_PX + 1 for v in (column, row)]
    first = [max(v, 0) * times for v in low]
    last = [min(v * times, int(side) // times * times) for v, side in zip(high, size, strict=True)]
    window = sources.pixels.window(k, first[1], first[0], last[1], last[0])
    if times > 1:
        small = (window.shape[1] // times, window.shape[0] // times)
        window = cv2.resize(window, small, interpolation=cv2.INTER_AREA).reshape(small[1], small[0], -1)
    x = column / np.float32(times) - np.float32(first[0] / times + 0.5)
    y = row / np.float32(times) - np.float32(first[1] / times + 0.5)
    x[~seen], y[~seen] = 0.0, 0.0
    parts = [
        cv2.remap(
            np.ascontiguousarray(window[:, :, b : b + 4]), x, y, methods[sources.resampling],
            borderMode=cv2.BORDER_REPLICATE,
        ).reshape(*x.shape, -1)
        for b in range(0, window.shape[2], 4)
    ]  # fmt: skip
    found = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=2)
    return _in_balance(found, sources.balance, k, sources.pixels.white)


def _in_balance(colours: np.ndarray, balance: Balance, k: int, white: float) -> np.ndarray:
    """gain·c + offset, rounded, within the range of the pixels."""
    gain, offset = balance.gain[k].astype(np.float32), balance.offset[k].astype(np.float32) * np.float32(white)
    if (gain == 1.0).all() and (offset == 0.0).all():
        return colours
    if colours.dtype == np.uint8:
        import cv2

        table = np.clip(np.rint(np.arange(256, dtype=np.float32)[:, None] * gain + offset), 0.0, white)
        parts = [cv2.LUT(colours[:, :, b], table[:, b].astype(np.uint8)) for b in range(colours.shape[2])]
        return np.stack(parts, axis=-1)
    return np.clip(np.rint(colours * gain + offset), 0.0, white).astype(colours.dtype)
