"""An order of photographs, points and rays that depends neither on the rows of tables nor on names.

What is drawn at random, or shared out, in the order of rows gives another result when rows are exchanged. Image
coordinates tell everything apart and stay what they are when points are renamed or the object frame is moved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.observations.block import Block, ImagePoints


@dataclass(frozen=True, eq=False)
class Ranks:
    """Places in the order: of the n photographs, the N points and the m rays of a block."""

    image: np.ndarray
    point: np.ndarray
    ray: np.ndarray


def ranks_of(block: Block) -> Ranks:
    """The order of a block: by image coordinates, of points without rays by their coordinates."""
    rays = block.image_points
    xyz = np.full((len(block.points), 3), np.inf)
    xyz[block.control.point] = np.nan_to_num(block.control.xyz, nan=np.inf)
    image = _ranks(rays, rays.image, np.nan_to_num(block.images.centre, nan=np.inf))
    point = _ranks(rays, rays.point, xyz)
    return Ranks(image, point, _places(np.lexsort((image[rays.image], rays.xy[:, 1], rays.xy[:, 0]))))


def _ranks(rays: ImagePoints, owner: np.ndarray, xyz: np.ndarray) -> np.ndarray:
    """Of photographs or points: by the smallest x and y of their rays and by how many there are."""
    least = np.full((len(xyz), 2), np.inf)
    order = np.lexsort((rays.xy[:, 1], rays.xy[:, 0]))
    owners, first = np.unique(owner[order], return_index=True)
    least[owners] = rays.xy[order][first]
    # sums in the order of the values are the same in any order of the rows
    total = np.bincount(owner[order], rays.xy[order, 1], len(xyz))
    count = np.bincount(owner, minlength=len(xyz))
    return _places(np.lexsort((*xyz.T[::-1], total, count, least[:, 1], least[:, 0])))


def _places(order: np.ndarray) -> np.ndarray:
    places = np.empty(len(order), dtype=np.int64)
    places[order] = np.arange(len(order))
    return places
