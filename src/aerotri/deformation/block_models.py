"""The deformation of a whole block: what every cell suffers from the model it lies in, and the steps between models.

A cell belongs to the model nearest to it, by the middle of its base [C]. Where two models meet, the cells on either
side are computed in both: the difference is the step that DEMs of the two models show at their seam.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.track import along_strip
from aerotri.conventions import InputError
from aerotri.deformation.model_geometry import ModelGeometry, geometry_of
from aerotri.deformation.model_grid import (
    Ground,
    Places,
    deform_places,
    grid_points,
    nodes_between,
    places_of,
)
from aerotri.deformation.restitution import Restitution
from aerotri.deformation.stereo_model import StereoModel, deform_points, pair_model, seen_by_both
from aerotri.results.adjustment import Adjustment

SMALLEST_END_LAP = 0.2
"""Of two photographs following one another that are taken for a model: less is a gap or a turn."""


@dataclass(frozen=True, eq=False)
class BlockModel:
    """One model of a block: its photographs, where the middle of its base is (2,) m in the CRS, and its numbers."""

    model: StereoModel
    middle: np.ndarray
    geometry: ModelGeometry

    @property
    def name(self) -> str:
        return f"{self.model.names[0]}, {self.model.names[1]}"


@dataclass(frozen=True)
class Seam:
    """The step in height where two models meet.

    Parameters
    ----------
    first, second : numbers of the models.
    count : nodes on it, on both sides.
    mean, rms, max : m, of dZ of the first less dZ of the second; max without sign.
    """

    first: int
    second: int
    count: int
    mean: float
    rms: float
    max: float


@dataclass(frozen=True, eq=False)
class BlockDeformation:
    """The deformation of a block over nodes.

    Parameters
    ----------
    variant, crs, ground, x, y, z, d, sigma : as in `Deformation`.
    models : the models. number : (ny, nx) which of them each node lies in, −1 where none sees it.
    seams : steps between neighbouring models, the largest RMS first. change : as of `Restitution`.
    """

    variant: str
    crs: str
    ground: str
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    d: np.ndarray
    sigma: np.ndarray
    models: tuple[BlockModel, ...]
    number: np.ndarray
    seams: tuple[Seam, ...]
    change: str = ""

    @property
    def spacing(self) -> float:
        """m between nodes."""
        return float(self.x[1] - self.x[0])

    @property
    def step_rms(self) -> float:
        """m, over all nodes on seams; NaN without seams."""
        count = sum(seam.count for seam in self.seams)
        return float(np.sqrt(sum(seam.count * seam.rms**2 for seam in self.seams) / count)) if count else np.nan


def strip_pairs(calibration: Adjustment, restitution: Restitution, step: int = 1) -> list[tuple[int, int]]:
    """Rows of the photographs of every model: along each strip every photograph with the `step`-th after it.

    Photographs without a named strip follow one another as in the table. Pairs that overlap by less than a fifth along
    the base are left out.
    """
    if step < 1:
        raise InputError(f"a step of {step} pairs no photographs", "give 1 or more")
    strips, centre = calibration.local.block.images.strip, restitution.true.centre
    known = restitution.true.known & restitution.used.known
    ground = float(np.nanmedian(calibration.local.points.xyz[:, 2]))
    pairs = []
    for strip in dict.fromkeys(strips[known].tolist()):
        members = np.flatnonzero(known & (strips == strip))
        if strip and len(members) > 1:
            members = members[along_strip(centre[members])]
        for left, right in zip(members[:-step].tolist(), members[step:].tolist(), strict=True):
            model = pair_model(restitution, ("", ""), (left, right))
            if geometry_of(model, ground).end_lap >= SMALLEST_END_LAP:
                pairs.append((left, right))
    return pairs


def block_models(
    calibration: Adjustment, restitution: Restitution, pairs: list[tuple[int, int]]
) -> tuple[BlockModel, ...]:
    """The models of pairs of photographs."""
    places, names = places_of(calibration), calibration.local.block.images.names
    ground = float(np.nanmedian(calibration.local.points.xyz[:, 2]))
    models = []
    for left, right in pairs:
        model = pair_model(restitution, (str(names[left]), str(names[right])), (left, right))
        middle = places.from_local(model.true.centre).mean(axis=0)[:2]
        models.append(BlockModel(model, middle, geometry_of(model, ground)))
    return tuple(models)


def deform_block(
    calibration: Adjustment,
    restitution: Restitution,
    ground: Ground,
    spacing: float | None = None,
    step: int = 1,
    report: Callable[[int, int], None] | None = None,
) -> BlockDeformation:
    """The deformation of a block, every node in the model nearest to it.

    Parameters
    ----------
    ground : heights in the CRS of the block. spacing : m between nodes.
    step : photographs from one of a model to the other along the strip; 2 for the 60 % models of an 80 % flight.
    report : called with the models done and their number.

    Raises
    ------
    InputError
        When there is no model.
    """
    places = places_of(calibration)
    models = block_models(calibration, restitution, strip_pairs(calibration, restitution, step))
    if not models:
        raise InputError("no two photographs that follow one another overlap", "name a pair, or give --end-lap")
    points = calibration.result.points.xyz
    points = points[np.isfinite(points).all(axis=1)]
    x, y = nodes_between(points[:, :2].min(axis=0), points[:, :2].max(axis=0), spacing)
    z = np.stack([ground.heights(x, np.full(len(x), value)) for value in y])
    xyz = grid_points(x, y, z)
    number = nearest_models(models, places, xyz)
    d, sigma = np.full(xyz.shape, np.nan), np.full(xyz.shape, np.nan)
    for k, one in enumerate(models):
        own = np.flatnonzero(number == k)
        if len(own):
            d[own], sigma[own], _ = deform_places(one.model, places, xyz[own])
        if report is not None:
            report(k + 1, len(models))
    shape = z.shape
    number = number.reshape(shape)
    seams = _seams(models, places, xyz, d[:, 2], number)
    return BlockDeformation(
        restitution.variant, calibration.result.block.crs, ground.text, x, y, z, d.reshape(*shape, 3),
        sigma.reshape(*shape, 3),
        models, number, seams, restitution.change,
    )  # fmt: skip


def nearest_models(models: tuple[BlockModel, ...], places: Places, xyz: np.ndarray) -> np.ndarray:
    """(n,) number of the model with the nearest base among those that see a place (n, 3) in the CRS; −1 for none."""
    number, nearest = np.full(len(xyz), -1), np.full(len(xyz), np.inf)
    local = places.to_local(xyz)
    known = np.isfinite(local).all(axis=1)
    for k, one in enumerate(models):
        distance = np.hypot(*(xyz[:, :2] - one.middle).T)
        near = np.flatnonzero(known & (distance < nearest))
        near = near[seen_by_both(one.model, local[near])]
        number[near], nearest[near] = k, distance[near]
    return number


def _seams(
    models: tuple[BlockModel, ...], places: Places, xyz: np.ndarray, dz: np.ndarray, number: np.ndarray
) -> tuple[Seam, ...]:
    """Steps at the nodes that have a neighbour in another model, in the one model less the other."""
    node = np.arange(number.size).reshape(number.shape)
    sides = []
    for here, there in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        a, b = number[here], number[there]
        meet = (a != b) & (a >= 0) & (b >= 0)
        sides += [(node[here][meet], b[meet]), (node[there][meet], a[meet])]
    at, other = (np.concatenate([side[k] for side in sides]) for k in range(2))
    own = number.ravel()[at]
    # a node in a corner has the same neighbour twice
    (at, other, own) = np.unique(np.column_stack([at, other, own]), axis=0).T if len(at) else (at, other, own)
    step = np.full(len(at), np.nan)
    for k in np.unique(other):
        rows = np.flatnonzero(other == k)
        local = places.to_local(xyz[at[rows]])
        found = deform_points(models[k].model, local)
        z = places.from_local(local + found.d)[:, 2] - places.from_local(local)[:, 2]
        step[rows] = dz[at[rows]] - z
    first, second = np.minimum(own, other), np.maximum(own, other)
    step = np.where(own < other, step, -step)
    return _summarised(first, second, step)


def _summarised(first: np.ndarray, second: np.ndarray, step: np.ndarray) -> tuple[Seam, ...]:
    known = np.isfinite(step)
    seams = []
    for a, b in np.unique(np.column_stack([first[known], second[known]]), axis=0).tolist():
        s = step[known & (first == a) & (second == b)]
        seams.append(Seam(a, b, len(s), float(s.mean()), float(np.sqrt(np.mean(s**2))), float(np.abs(s).max())))
    return tuple(sorted(seams, key=lambda seam: -seam.rms))
