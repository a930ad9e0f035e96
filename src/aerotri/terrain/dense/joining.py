"""A tile goes over into its neighbours: other pairs measure them, whose orientations err otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from aerotri.terrain.dense.tile_surface import TileRim, TileSurface

SIDES = [(down, right) for down in (-1, 0, 1) for right in (-1, 0, 1) if down or right]
"""Where the eight neighbours of a tile lie, in tiles."""
ALIKE_PX = 1.0
"""Of parallax, within which two tiles measured one surface; chosen [C]: beyond, one of them has the roof and the other
the ground, or one of them errs, and no height between is right."""


def joined(tile: TileSurface, rims: Mapping[tuple[int, int], TileRim]) -> TileSurface:
    """The tile, whose heights go over linearly into those of its neighbours.

    Both measured a strip on either side of their edge; at the edge each counts a half. σ stays that of the tile: both
    have seen the same photographs there, or as good ones.

    Parameters
    ----------
    rims : of its neighbours, by where they lie.
    """
    z, spare = tile.z.copy(), tile.rim.spare
    shares = [
        _shares(count, spare, any(side[axis] < 0 for side in rims), any(side[axis] > 0 for side in rims))
        for axis, count in enumerate(z.shape)
    ]
    for side, rim in rims.items():
        if rim.spare == 0:  # of an empty tile
            continue
        other = _lying_over(rim, side, z.shape)
        at = tuple(_end(step, count, size) for step, count, size in zip(side, z.shape, other.shape, strict=True))
        share = np.outer(shares[0][side[0]][at[0]], shares[1][side[1]][at[1]])
        apart = other - tile.z[at]
        z[at] += share * np.where(np.abs(apart) < ALIKE_PX * tile.pixel, apart, 0.0)
    return replace(tile, z=z)


def _shares(count: int, spare: int, before: bool, behind: bool) -> dict[int, np.ndarray]:
    """(count,) of the neighbour before, of the tile itself, and of the neighbour behind, along a row or column."""
    ramp = np.maximum(0.5 - (np.arange(count) + 0.5) / (2.0 * max(spare, 1)), 0.0)
    first, last = ramp * before, ramp[::-1] * behind
    return {-1: first, 0: 1.0 - first - last, 1: last}


def _lying_over(rim: TileRim, side: tuple[int, int], shape: tuple[int, ...]) -> np.ndarray:
    """(r, c) m, what the neighbour on a side measured of a tile of this shape: the strip or corner next to it."""
    (down, right), spare = side, rim.spare
    if down:
        strip = rim.below if down < 0 else rim.above
        columns = {-1: slice(strip.shape[1] - spare, None), 0: slice(spare, -spare), 1: slice(0, spare)}
        found = strip[:, columns[right]]
    else:
        found = rim.behind if right < 0 else rim.before
    # a tile at the end of the grid may be narrower than the strip
    rows, columns = (min(own, count) for own, count in zip(found.shape, shape, strict=True))
    return found[_end(down, len(found), rows), _end(right, found.shape[1], columns)]


def _end(step: int, count: int, size: int) -> slice:
    """So many of the cells in a row, at its end if the neighbour lies behind, else at its beginning."""
    return slice(count - size, count) if step > 0 else slice(0, size)
