"""Where the pixels of an ideal photograph lie in the measured one.

[D] An ideal position is found at m = ideal + d(m), the fixed point within one tile. Which tile records an ideal
position follows from where m lies: in an overlap, where two do, the tile of the ideal position; in a gap, where none
does, the nearer one. The displacement is sampled on a grid inside each tile (see `tile_grid`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from aerotri.conventions import mm_from_px, px_from_mm
from aerotri.image_errors import _kernels
from aerotri.image_errors.error_function import Bounds
from aerotri.image_errors.tile_grid import TileGrid, sample, seams_px, tiles_of
from aerotri.observations import Camera

REACH_NODES = 9
"""Places along either side of a tile at which its displacement is looked up."""
SWITCH_ITERATIONS = 12
"""Steps to the place where a tile ends: each shrinks by the slope of the displacement; a slope of 0.1 leaves 10⁻¹² of
it [D]."""


@dataclass(frozen=True, eq=False)
class IdealMap:
    """Where the pixels of an ideal photograph lie in the measured one.

    Parameters
    ----------
    camera : its size_px is that of both photographs.
    tiles : by tile row and column, the displacement (column, row) in px, source less ideal position.
    columns : (tile columns + 1, rows) first column of every tile, and the end of the last one, by row.
    rows : (tile rows + 1, columns) first row of every tile, and the end of the last one, by column.
    is_identity : whether nothing moves.
    """

    camera: Camera
    tiles: tuple[tuple[TileGrid, ...], ...]
    columns: np.ndarray
    rows: np.ndarray
    is_identity: bool

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.camera.size_px[1], self.camera.size_px[0]

    def source_rows(self, first: int, last: int) -> tuple[int, int]:
        """Rows of the source, first and one after the last, that the output rows first … last − 1 may touch.

        They reach beyond the image where the kernel does.
        """
        least, most = 0.0, 0.0
        for row in self.tiles:
            for grid in row:
                low, high = grid.bounds((first, last), (0, self.size[1]))
                least, most = min(least, float(low[1])), max(most, float(high[1]))
        low = min(max(int(np.floor(first + least)), -1), self.size[0])
        high = max(min(int(np.floor(last - 1 + most)), self.size[0] - 1), -1)
        return low - _kernels.PAD + 1, max(high, low) + _kernels.PAD + 1


class Errors(Protocol):
    """Image errors of a group of photographs, or of one."""

    @property
    def camera(self) -> Camera: ...
    @property
    def is_zero(self) -> bool: ...
    def measured(self, ideal: np.ndarray, within: Bounds | None = None) -> np.ndarray: ...


def ideal_map(errors: Errors) -> IdealMap:
    """The map of a group of photographs, or of one photograph of a rolling shutter.

    Raises
    ------
    InputError
        When the image errors fold the image over.
    """
    camera = errors.camera
    tiles = tiles_of(camera)
    seam_columns, seam_rows = (seams - 0.5 for seams in seams_px(camera))
    margin = _margin(errors)
    column_ranges = _ranges(seam_columns, camera.size_px[0], margin)
    row_ranges = _ranges(seam_rows, camera.size_px[1], margin)
    grids = []
    for tile_row, rows in zip(tiles, row_ranges, strict=True):
        line = []
        for tile, columns in zip(tile_row, column_ranges, strict=True):
            line.append(sample(_displacement(errors, tile.bounds_mm(camera)), rows, columns))
        grids.append(tuple(line))
    turned = tuple(zip(*grids, strict=True))
    columns, rows = camera.size_px
    return IdealMap(
        camera=camera,
        tiles=tuple(grids),
        columns=_switches(grids, seam_columns, seam_rows, rows, columns, 0),
        rows=_switches(turned, seam_rows, seam_columns, columns, rows, 1),
        is_identity=errors.is_zero,
    )


def _margin(errors: Errors) -> int:
    """Pixels by which a tile may record what ideally lies beyond its seams."""
    camera, farthest = errors.camera, 0.0
    half = np.array(camera.half_format_mm)
    for tile in (tile for line in tiles_of(camera) for tile in line):
        low, high = tile.bounds_mm(camera)
        x, y = (
            np.linspace(a, b, REACH_NODES) for a, b in zip(np.maximum(low, -half), np.minimum(high, half), strict=True)
        )
        nodes = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        farthest = max(farthest, float(np.abs(errors.measured(nodes, (low, high)) - nodes).max()))
    return int(np.ceil(1.5 * farthest / camera.pixel_mm)) + 2


def _ranges(seams: np.ndarray, count: int, margin: int) -> list[tuple[int, int]]:
    """First and last pixel of the tiles between seams, and the margin beyond them, within the format."""
    edges = [-np.inf, *seams.tolist(), np.inf]
    return [(int(max(low - margin, 0)), int(min(high + margin, count - 1))) for low, high in pairwise(edges)]


def _displacement(errors: Errors, within: tuple[np.ndarray, np.ndarray]):
    size, pixel = errors.camera.size_px, errors.camera.pixel_mm

    def of_pixels(column_row: np.ndarray) -> np.ndarray:
        measured = errors.measured(mm_from_px(column_row, size, pixel), within)
        return px_from_mm(measured, size, pixel) - column_row

    return of_pixels


def _switches(
    grids: Sequence[Sequence[TileGrid]], seams: np.ndarray, cross_seams: np.ndarray, count: int, last: int, axis: int
) -> np.ndarray:
    """(tiles + 1, count) where one tile ends and the next begins, for every row (axis 0: columns) or column (axis 1).

    Parameters
    ----------
    grids : [tile across the seams' direction][tile along]. last : end of the last tile.
    """
    position = np.arange(count)
    across = np.searchsorted(cross_seams, position, side="right")
    places = np.zeros((len(seams) + 2, count), dtype=np.int64)
    places[-1] = last
    for k, seam in enumerate(seams, start=1):
        for line in np.unique(across):
            own = across == line
            place = _switch(grids[line][k - 1], grids[line][k], seam, position[own], axis)
            places[k, own] = np.clip(np.ceil(place), 0, last)
    return np.maximum.accumulate(places, axis=0)


def _switch(one: TileGrid, other: TileGrid, seam: float, position: np.ndarray, axis: int) -> np.ndarray:
    """(n,) ideal place at which the source passes from one tile to the other."""
    reached = []
    for grid in (one, other):
        place = np.full(len(position), seam)
        for _ in range(SWITCH_ITERATIONS):
            at = (position, place) if axis == 0 else (place, position)
            place = seam - grid.at(*at)[:, axis]
        reached.append(place)
    ends, begins = reached
    return np.where(begins <= ends, np.clip(seam, begins, ends), (begins + ends) / 2.0)
