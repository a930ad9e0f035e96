"""A block cut into parts that share photographs and no points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.dissection import bisect
from aerotri.adjustment.photograph_pairs import photograph_pairs
from aerotri.conventions import InputError
from aerotri.observations import Block

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
    position = _positions(block)
    image, start = _rays_by_point(block)
    edges = _neighbours(image, start, len(block.images))
    whole, side_of = [(np.arange(len(block.images)), edges)], np.zeros(len(block.images), dtype=np.int8)
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
        raise InputError("the block cannot be cut into parts", "adjust it in one piece: aerotri adjust")
    of_image = np.full(len(block.images), SHARED)
    for number, members in enumerate(sorted(sets, key=lambda members: int(members.min()))):
        of_image[members] = number
    return _with_points(block, image, start, of_image, len(sets))


def part_of(block: Block, division: Division, number: int) -> Block:
    """A part as a block: its points with all their rays, the photographs that see them, its control and positions."""
    rays, gnss, control = block.image_points, block.gnss_ins, block.control
    own_rays = division.of_point[rays.point] == number
    here = (division.of_image == number) | (division.home == number)
    here[rays.image[own_rays]] = True
    images, points = np.flatnonzero(here), np.flatnonzero(division.of_point == number)
    row, point_row = _rows(images, len(here)), _rows(points, len(block.points))
    own_control = division.of_point[control.point] == number
    if gnss is not None:
        taken = (division.home[gnss.image] == number) & here[gnss.image]
        gnss = replace(
            gnss, image=row[gnss.image[taken]], xyz=gnss.xyz[taken], sigma=gnss.sigma[taken], time=gnss.time[taken],
            angles=gnss.angles[taken], angles_sigma=gnss.angles_sigma[taken],
        )  # fmt: skip
    return replace(
        block,
        name=f"{block.name} part {number}",
        images=block.images.take(images),
        points=block.points[points],
        image_points=replace(
            rays, image=row[rays.image[own_rays]], point=point_row[rays.point[own_rays]], xy=rays.xy[own_rays],
            sigma=rays.sigma[own_rays],
        ),
        control=replace(
            control, point=point_row[control.point[own_control]], xyz=control.xyz[own_control],
            sigma=control.sigma[own_control], is_check=control.is_check[own_control],
        ),
        gnss_ins=gnss,
    )  # fmt: skip


def _rows(chosen: np.ndarray, count: int) -> np.ndarray:
    row = np.full(count, -1)
    row[chosen] = np.arange(len(chosen))
    return row


def _positions(block: Block) -> np.ndarray:
    """(n, 2) m, where photographs were taken."""
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


def _rays_by_point(block: Block) -> tuple[np.ndarray, np.ndarray]:
    """(m,) photographs of the rays in the order of the points, and (N + 1,) where each point begins."""
    rays = block.image_points
    order = np.lexsort((rays.image, rays.point))
    counts = np.bincount(rays.point, minlength=len(block.points))
    return rays.image[order].astype(np.int64), np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def _neighbours(image: np.ndarray, start: np.ndarray, n: int) -> np.ndarray:
    """(e, 2) pairs of photographs that share a point, each once."""
    pairs = photograph_pairs(start, image, n)
    return np.column_stack([pairs.first, pairs.second])


def _with_points(block: Block, image: np.ndarray, start: np.ndarray, of_image: np.ndarray, count: int) -> Division:
    """The division with every point in the part of its photographs that are not shared, or in the home of the first."""
    point = np.repeat(np.arange(len(block.points)), np.diff(start))
    of_point = np.full(len(block.points), SHARED)
    inner = of_image[image] != SHARED
    of_point[point[inner]] = of_image[image[inner]]
    # a shared photograph is at home where most of its rays are
    known = (of_image[image] == SHARED) & (of_point[point] != SHARED)
    votes = np.bincount(image[known] * count + of_point[point[known]], minlength=len(of_image) * count)
    home = np.where(of_image == SHARED, votes.reshape(-1, count).argmax(axis=1), of_image)
    lonely = np.flatnonzero((of_point == SHARED) & (np.diff(start) > 0))
    of_point[lonely] = home[image[start[lonely]]]
    of_point[of_point == SHARED] = 0
    return Division(count, of_image, home, of_point)
