"""Image points of a file that are read piece by piece, and the sample of them that is held."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from aerotri.formats.assembly.parts import RayList, texts

SAMPLE_RAYS = 200_000
"""Image points of a sample, about [C]: some 40 000 points, of which `reprojection` looks at 20 000."""


@dataclass(frozen=True, eq=False)
class Bulk:
    """Image points of a file, never held whole.

    Parameters
    ----------
    heads : all photographs, and a sample of the points with all their rays.
    pieces : reads all image points, some at a time, in the order of the file; photographs are those of `heads`.
    """

    heads: RayList
    pieces: Callable[[], Iterator[RayList]]


class Sample:
    """Some of the points with all their rays, chosen by name alone, so that pieces can be looked at one by one.

    Parameters
    ----------
    rays : image points there are, about. always : names of points that belong to it.

    `rays` counts those that were looked at.
    """

    def __init__(self, rays: int, always: frozenset[str]):
        self._every, self._always = max(1, rays // SAMPLE_RAYS), always
        self.rays = 0
        self._place: dict[str, int] = {}
        self._image: list[np.ndarray] = []
        self._point: list[np.ndarray] = []
        self._xy: list[np.ndarray] = []

    def add(self, rays: RayList) -> None:
        """What belongs to the sample of a piece."""
        self.rays += len(rays.image)
        names = rays.points.tolist()
        taken = np.array([name in self._always or zlib.crc32(name.encode()) % self._every == 0 for name in names], bool)
        place = np.array(
            [self._place.setdefault(n, len(self._place)) if t else -1 for n, t in zip(names, taken, strict=True)],
            dtype=np.int64,
        )
        own = taken[rays.point]
        self._image.append(rays.image[own])
        self._point.append(place[rays.point[own]])
        self._xy.append(rays.xy[own])

    def of(self, heads: RayList) -> RayList:
        """Photographs with the image points of the sample."""
        if not self._image:
            return heads
        image, point = np.concatenate(self._image), np.concatenate(self._point)
        return replace(heads, points=texts(list(self._place)), image=image, point=point, xy=np.concatenate(self._xy))
