"""Nodes over the formats of cameras, between which what image errors do is taken as bilinear."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.deformation.photo_errors import PhotoErrors, seams_mm
from aerotri.image_errors.tile_grid import Tile, tiles_of
from aerotri.observations import Camera
from aerotri.volume import _response_kernels as _kernels

TILE_NODES, FRAME_NODES = 65, 193
"""Nodes a side of a tile, and of a format without tiles, over which additional parameters are taken as bilinear."""


@dataclass(frozen=True, eq=False)
class ErrorNodes:
    """Nodes over the tiles of every group of image errors; see `_response_kernels`.

    tiles : see there. xy : (·, 2) mm, just inside their tiles. of_group : nodes of every group.
    """

    tiles: _kernels.Tiles
    xy: np.ndarray
    of_group: list[slice]


def nodes_of(errors: tuple[PhotoErrors, ...]) -> ErrorNodes:
    """Nodes over every tile of every group."""
    edges, meta = np.full((len(errors), 2, 2), np.inf), np.zeros((len(errors), 3, 3, 7))
    parts: list[np.ndarray] = []
    of_group, count = [], 0
    for s, group in enumerate(errors):
        camera, begun = group.camera, count
        for axis, seams in enumerate(seams_mm(camera)):
            edges[s, axis, : len(seams)] = seams
        tiles = tiles_of(camera)
        nodes = TILE_NODES if len(tiles) > 1 else FRAME_NODES
        for i, row in enumerate(reversed(tiles)):
            for j, tile in enumerate(row):
                x, y = _nodes_over(tile, camera, nodes)
                meta[s, j, i] = count, nodes, nodes, x[0], y[0], 1.0 / (x[1] - x[0]), 1.0 / (y[1] - y[0])
                parts.append(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
                count += nodes * nodes
        of_group.append(slice(begun, count))
    return ErrorNodes(_kernels.Tiles(edges, meta), np.concatenate(parts), of_group)


def _nodes_over(tile: Tile, camera: Camera, count: int) -> tuple[np.ndarray, np.ndarray]:
    """x and y of evenly spaced nodes over a tile, mm."""
    half = np.array(camera.half_format_mm)
    low, high = tile.bounds_mm(camera)
    low, high = np.maximum(low, -half), np.minimum(high, half)
    return np.linspace(low[0], high[0], count), np.linspace(low[1], high[1], count)
