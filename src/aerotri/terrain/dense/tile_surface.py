"""The heights of one tile, their σ, and the photographs that measured every cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class TileRim:
    """Heights that a tile measured beyond its edges, m of the CRS; NaN where there is none.

    Parameters
    ----------
    above, below : (spare, columns + 2 spare), of its rows. before, behind : (rows, spare), of its columns.
    """

    above: np.ndarray
    below: np.ndarray
    before: np.ndarray
    behind: np.ndarray

    @property
    def spare(self) -> int:
        """Cells beyond an edge."""
        return len(self.above)


def rim_of(z: np.ndarray, spare: int) -> TileRim:
    """Of the heights of a tile with what lies beyond its edges, (rows + 2 spare, columns + 2 spare) m."""
    own = slice(spare, len(z) - spare)
    parts = z[:spare], z[len(z) - spare :], z[own, :spare], z[own, z.shape[1] - spare :]
    return TileRim(*(part.copy() for part in parts))


@dataclass(frozen=True, eq=False)
class TileSurface:
    """Heights of a tile, (rows, columns) m, NaN where there is none.

    Parameters
    ----------
    z : of the CRS. sigma : of matching.
    members : (rows, columns) whole numbers, bits of the photographs that measured a cell. photographs : (n,) which they
        are, from the lowest bit on, the most upright first.
    factor : by which agreement of pairs changed the σ. pairs : photographs, (n, 2).
    across : (n,) px, median shift across the base of each.
    shared_cells : cells along a side of the square whose noise is one, as neighbours share it; NaN where not known.
    pixel : m of height that a pixel of parallax is, of the median pair; NaN where nothing was matched.
    rim : what was measured beyond its edges.
    """

    z: np.ndarray
    sigma: np.ndarray
    members: np.ndarray
    photographs: np.ndarray
    factor: float
    pairs: np.ndarray
    across: np.ndarray
    shared_cells: float
    pixel: float
    rim: TileRim

    @property
    def count(self) -> np.ndarray:
        """(rows, columns) int16, photographs that measured a cell."""
        out = np.zeros(self.members.shape, np.int16)
        for n in range(len(self.photographs)):
            out += self._has(n)
        return out

    @property
    def shown_by(self) -> np.ndarray:
        """(rows, columns) int32, the most upright photograph of those that measured a cell, −1 none."""
        out = np.full(self.members.shape, -1, np.int32)
        for n in reversed(range(len(self.photographs))):
            out[self._has(n)] = self.photographs[n]
        return out

    def measured_by(self, row: int, column: int) -> np.ndarray:
        """(n,) the photographs that measured a cell, the most upright first."""
        bits = int(self.members[row, column])
        return self.photographs[[bits >> n & 1 == 1 for n in range(len(self.photographs))]]

    def _has(self, n: int) -> np.ndarray:
        return (self.members >> np.uint64(n)) & np.uint64(1) > 0


def empty_tile(shape: tuple[int, int]) -> TileSurface:
    """A tile in which nothing could be matched."""
    nothing = np.full(shape, np.nan)
    return TileSurface(
        nothing, nothing.copy(), np.zeros(shape, np.uint64), np.zeros(0, int), 1.0, np.zeros((0, 2), int), np.zeros(0),
        np.nan, np.nan, rim_of(nothing, 0),
    )  # fmt: skip
