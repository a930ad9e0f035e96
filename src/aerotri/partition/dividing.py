"""A block cut into parts that share photographs and no points.

What is cut are photographs; image points are looked at in groups that hold their points whole, one or many.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.dissection import bisect
from aerotri.adjustment.photograph_pairs import photograph_pairs
from aerotri.conventions import InputError
from aerotri.observations import Block, Control, ImagePoints

SHARED = -1


@dataclass(frozen=True, eq=False)
class Division:
    """Which part photographs and points belong to.

    Parameters
    ----------
    count : of parts. of_image : (n,) part of a photograph, SHARED where several see its points.
    home : (n,) part that holds the observed position of a photograph. of_point : (N,) part of a point.
    """

    count: int
    of_image: np.ndarray
    home: np.ndarray
    of_point: np.ndarray


@dataclass(frozen=True, eq=False)
class PointRays:
    """All rays of some points.

    Parameters
    ----------
    image : (m,) photographs in the order of the points, rising within a point.
    start : (P + 1,) where each point begins.
    """

    image: np.ndarray
    start: np.ndarray

    @classmethod
    def of(cls, image: np.ndarray, point: np.ndarray, count: int) -> PointRays:
        """From rays in any order, to `count` points."""
        order = np.lexsort((image, point))
        counts = np.bincount(point, minlength=count)
        return cls(image[order].astype(np.int64), np.concatenate([[0], np.cumsum(counts)]).astype(np.int64))

    @property
    def point(self) -> np.ndarray:
        """(m,) point of every ray."""
        return np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))

    def pairs(self, n: int) -> np.ndarray:
        """(e, 2) pairs of n photographs that share one of the points, each once, in order."""
        pairs = photograph_pairs(self.start, self.image, n)
        return np.column_stack([pairs.first, pairs.second])

    def homes(self, of_image: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Where rays of shared photographs belong: (v,) photograph · count + part, and how many rays do."""
        of_point = self._by_inner(of_image)
        known = (of_image[self.image] == SHARED) & (of_point[self.point] != SHARED)
        return np.unique(self.image[known] * count + of_point[self.point[known]], return_counts=True)

    def parts(self, of_image: np.ndarray, home: np.ndarray) -> np.ndarray:
        """(P,) the part of the photographs of a point that are not shared, or the home of the first; 0 without rays."""
        of_point = self._by_inner(of_image)
        lonely = np.flatnonzero((of_point == SHARED) & (np.diff(self.start) > 0))
        of_point[lonely] = home[self.image[self.start[lonely]]]
        of_point[of_point == SHARED] = 0
        return of_point

    def _by_inner(self, of_image: np.ndarray) -> np.ndarray:
        """(P,) the part of a point's photographs that are not shared, SHARED where all are."""
        of_point, inner = np.full(len(self.start) - 1, SHARED), of_image[self.image] != SHARED
        of_point[self.point[inner]] = of_image[self.image[inner]]
        return of_point


def divide(block: Block, parts: int) -> Division:
    """Cut a block into parts along lines across its projection centres, the largest part first.

    The photographs on one side of a cut that have points in common with the other side are shared.

    Parameters
    ----------
    parts : at most so many; a part that no line cuts into two stays.

    Raises
    ------
    InputError
        When photographs have no position, or nothing can be cut.
    """
    position, rays = positions_of(block), block.image_points
    of_points = PointRays.of(rays.image, rays.point, len(block.points))
    of_image, count = cut_photographs(position, of_points.pairs(len(position)), parts)
    home = homes_of(of_image, count, *of_points.homes(of_image, count))
    return Division(count, of_image, home, of_points.parts(of_image, home))


def cut_photographs(position: np.ndarray, edges: np.ndarray, parts: int) -> tuple[np.ndarray, int]:
    """(n,) part of every photograph, SHARED where several parts see its points, and how many parts there are.

    Parameters
    ----------
    position : (n, 2) m. edges : (e, 2) pairs of photographs that share a point, each once.

    Raises
    ------
    InputError
        When nothing can be cut.
    """
    whole, side_of = [(np.arange(len(position)), edges)], np.zeros(len(position), dtype=np.int8)
    done: list[np.ndarray] = []
    while whole and len(whole) + len(done) < parts:
        largest = max(range(len(whole)), key=lambda k: len(whole[k][0]))
        members, inner = whole.pop(largest)
        cut = bisect(members, inner, position, side_of) if len(members) > 1 else None
        if cut is None:
            done.append(members)
        else:
            whole += [cut[0], cut[1]]
    sets = [members for members, _ in whole] + done
    if len(sets) < 2:
        raise InputError(
            f"{len(position)} photographs cannot be divided into {parts} parts: wherever the block is cut, too many of "
            "them share points with the other side; only one part is possible",
            "adjust it in one piece: aerotri adjust",
        )
    of_image = np.full(len(position), SHARED)
    for number, members in enumerate(sorted(sets, key=lambda members: int(members.min()))):
        of_image[members] = number
    return of_image, len(sets)


def homes_of(of_image: np.ndarray, count: int, votes: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """(n,) the part of a photograph; of a shared one that with most of its rays.

    Parameters
    ----------
    votes, rays : of `PointRays.homes`, of one group or of several one after the other.
    """
    home = np.where(of_image == SHARED, 0, of_image)
    votes, at = np.unique(votes, return_inverse=True)
    total = np.bincount(at, rays, len(votes))
    image, part = votes // count, votes % count
    order = np.lexsort((part, -total, image))
    shared, first = np.unique(image[order], return_index=True)
    home[shared] = part[order][first]
    return home


def part_of(block: Block, division: Division, number: int) -> Block:
    """A part as a block: its points with all their rays, the photographs that see them, its control and positions."""
    rays = block.image_points
    own, points = division.of_point[rays.point] == number, np.flatnonzero(division.of_point == number)
    row = _rows(points, len(block.points))
    taken = ImagePoints(rays.image[own], row[rays.point[own]], rays.xy[own], rays.sigma[own])
    control = control_of(block, division, number)
    return part_with(
        block, division, number, taken, block.points[points], replace(control, point=row[control.point])
    )  # fmt: skip


def control_of(block: Block, division: Division, number: int) -> Control:
    """The control and check points of a part; `point` is the index into the points of the block."""
    control = block.control
    own = division.of_point[control.point] == number
    return Control(control.point[own], control.xyz[own], control.sigma[own], control.is_check[own])


def part_with(
    block: Block, division: Division, number: int, rays: ImagePoints, points: np.ndarray, control: Control
) -> Block:
    """A part with given image points, as a block.

    Parameters
    ----------
    rays : of the part; `image` is the index into the photographs of the block, `point` into those of the part.
    points : (P,) names of the points of the part. control : of the part, `point` is the index into them.
    """
    gnss, marks = block.gnss_ins, block.fiducials
    here = (division.of_image == number) | (division.home == number)
    here[rays.image] = True
    images = np.flatnonzero(here)
    row = _rows(images, len(here))
    if gnss is not None:
        taken = (division.home[gnss.image] == number) & here[gnss.image]
        gnss = replace(
            gnss, image=row[gnss.image[taken]], xyz=gnss.xyz[taken], sigma=gnss.sigma[taken], time=gnss.time[taken],
            angles=gnss.angles[taken], angles_sigma=gnss.angles_sigma[taken],
        )  # fmt: skip
    if marks is not None:
        taken = here[marks.image]
        marks = replace(
            marks, image=row[marks.image[taken]], name=marks.name[taken], column_row=marks.column_row[taken]
        )
    return replace(
        block,
        name=f"{block.name} part {number}",
        images=block.images.take(images),
        points=points,
        image_points=replace(rays, image=row[rays.image]),
        control=control,
        gnss_ins=gnss,
        fiducials=marks,
        interior_fits={int(row[k]): fit for k, fit in block.interior_fits.items() if here[k]},
    )  # fmt: skip


def positions_of(block: Block) -> np.ndarray:
    """(n, 2) m, where photographs were taken.

    Raises
    ------
    InputError
        When a photograph has no position.
    """
    position = block.images.centre[:, :2].copy()
    if block.gnss_ins is not None:
        missing = ~np.isfinite(position[block.gnss_ins.image]).all(axis=1)
        position[block.gnss_ins.image[missing]] = block.gnss_ins.xyz[missing, :2]
    lost = np.flatnonzero(~np.isfinite(position).all(axis=1))
    if len(lost):
        raise InputError(
            f"photograph '{block.images.names[lost[0]]}' has no position to divide the block by",
            "give X0, Y0 of every photograph in images.csv",
            file="images.csv",
        )
    return position


def _rows(chosen: np.ndarray, count: int) -> np.ndarray:
    row = np.full(count, -1)
    row[chosen] = np.arange(len(chosen))
    return row
