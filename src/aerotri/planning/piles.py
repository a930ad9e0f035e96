"""The σ to be expected of the volumes of single piles within the area of a plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from shapely.geometry.base import BaseGeometry

from aerotri.conventions import InputError
from aerotri.planning.area import Area
from aerotri.planning.ground import Ground

NODES = 25
"""Places of a pile whose heights tell the error of its mean height, about [C]: orientations bend a pile smoothly."""
FEWEST = 4
"""Of them that two photographs see, at least [C]."""

Pile = tuple[str, BaseGeometry]


@dataclass(frozen=True)
class PileSigma:
    """A pile.

    Parameters
    ----------
    name : of the polygon. area : m². points : names of its places in the block.
    sigma : m³, of its volume; the noise of single points averages out over a surface and is left out.
    measured : m³, were its volume the area times the mean height of its places, with their noise.
    """

    name: str
    area: float
    points: tuple[str, ...]
    sigma: float
    measured: float


def pile_places(piles: Sequence[Pile], ground: Ground) -> tuple[np.ndarray, np.ndarray]:
    """(m, 3) m, places on the ground of all piles, and (m,) the number of the pile of each."""
    found, owner = [np.zeros((0, 2))], [np.zeros(0, np.int64)]
    for number, (name, polygon) in enumerate(piles):
        step = float(np.sqrt(polygon.area / NODES))
        inside = Area(polygon, None, name).raster(step)
        if not len(inside):
            inside = np.array(polygon.representative_point().coords)[:, :2]
        found.append(inside)
        owner.append(np.full(len(inside), number))
    return ground.on(np.concatenate(found)), np.concatenate(owner)


def pile_sigmas(
    piles: Sequence[Pile], names: np.ndarray, owner: np.ndarray, covariance: np.ndarray, own: np.ndarray
) -> tuple[PileSigma, ...]:
    """σ of every pile: its size times the σ of the mean error of its heights.

    Parameters
    ----------
    names, owner : (m,) of the places that are seen. covariance : (3m, 3m) m², of these. own : (m, 3, 3) m², of their
        image coordinates alone.

    Raises
    ------
    InputError
        When too few places of a pile lie in two photographs.
    """
    heights, noise = covariance[2::3, 2::3], own[:, 2, 2]
    found: list[PileSigma] = []
    for number, (name, polygon) in enumerate(piles):
        rows = np.flatnonzero(owner == number)
        if len(rows) < FEWEST:
            raise InputError(
                f"{len(rows)} places of the pile '{name}' lie in two photographs or more",
                "leave it out, or plan an area that holds it",
            )
        factor = float(polygon.area) / len(rows)
        whole = float(heights[np.ix_(rows, rows)].sum())
        shared = max(whole - float(noise[rows].sum()), 0.0)
        points = tuple(str(one) for one in names[rows])
        found.append(
            PileSigma(name, float(polygon.area), points, factor * shared**0.5, factor * max(whole, 0.0) ** 0.5)
        )
    return tuple(found)
