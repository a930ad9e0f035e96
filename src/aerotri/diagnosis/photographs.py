"""A photograph whose measurements do not fit the others: what would make them fit.

The photograph is resected from the points that the others determine, once as it was measured and once for each usual
mistake; the median distance of its rays is compared.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.directions import directions_of
from aerotri.adjustment.start_values import resect
from aerotri.diagnosis import changes
from aerotri.diagnosis.free_model import FreeModel, sub_block
from aerotri.diagnosis.hypothesis import Hypothesis
from aerotri.functional_model.rotation import logarithm
from aerotri.observations import Block

FEWEST_RAYS = 6
"""Rays to points of the model from which a photograph is tried [C]: four determine a resection, two more say whether a
change helps."""
MOST_PHOTOGRAPHS = 8
"""Photographs tried one by one [C]: of more the block as a whole is wrong, and each costs a number of resections."""
TOLERANCES = (8.0, 60.0, 500.0, 5000.0)
"""Tolerances of a resection, in a-priori σ or pixels, one after the other until one finds a place [C]: the first is
the usual one, the last as large as an image."""
CLEARLY_BETTER = 5.0
"""Factor by which the rays have to fit better."""
AS_GOOD = 2.0
"""Factor up to which two changes fit the same."""
MOST_STEPS = 3
"""Rows by which the names of points are moved at most."""


@dataclass(frozen=True, eq=False)
class PhotographTrial:
    """What makes a photograph fit the others: hypotheses that fit as well as the best, the likeliest first.

    A photograph with x negated is one with y negated, turned by 180°: the one that lies like its neighbours comes
    first.
    """

    image: int
    hypotheses: tuple[Hypothesis, ...]


def unjoined(block: Block, model: FreeModel) -> np.ndarray:
    """Photographs with enough rays to points of the model that are not in it."""
    rays = block.image_points
    known = np.isfinite(model.points[rays.point, 0]) & np.isfinite(rays.xy).all(axis=1)
    count = np.bincount(rays.image[known], minlength=len(block.images))
    return np.flatnonzero(~model.joined & (count >= FEWEST_RAYS))


def try_photographs(block: Block, model: FreeModel) -> list[PhotographTrial]:
    """The best changes of each photograph that is not in the model, where one helps."""
    found = []
    for image in unjoined(block, model)[:MOST_PHOTOGRAPHS]:
        fits = [(_place(h.change(block), model, int(image)), h) for h in _of_photograph(block, int(image))]
        least = min(place.miss for place, _ in fits)
        if least * CLEARLY_BETTER > _as_measured(block, model, int(image)) or not np.isfinite(least):
            continue
        same = [(place, h) for place, h in fits if place.miss < AS_GOOD * least]
        same.sort(key=lambda pair: pair[0].turn)
        found.append(PhotographTrial(int(image), tuple(h for _, h in same)))
    return found


def _as_measured(block: Block, model: FreeModel, image: int) -> float:
    """Median distance of the rays as they were measured, in tolerances, at the best place that can be found."""
    for tolerance in TOLERANCES:
        place = _place(block, model, image, tolerance)
        if np.isfinite(place.miss):
            return place.miss
    return np.inf


def _of_photograph(block: Block, image: int) -> Iterator[Hypothesis]:
    name, only = str(block.images.names[image]), np.array([image])
    measured = f"photograph {name}: its measurements"
    for change, remedy in (
        (changes.negated(0), "x negated"),
        (changes.negated(1), "y negated"),
        (changes.x_and_y_exchanged, "x and y exchanged"),
        (changes.scaled(10.0), "10 times the values"),
        (changes.scaled(0.1), "a tenth of the values"),
    ):
        yield Hypothesis(measured, remedy, changes.on_image_points(change, only))
    half = np.array(block.cameras[block.images.camera[image]].half_format_mm)
    for sign, corner in ((1.0, "upper"), (-1.0, "lower")):
        moved = changes.plus(half * [-1.0, sign])
        remedy = f"the origin in the {corner} left corner"
        yield Hypothesis(measured, remedy, changes.on_image_points(moved, only))
    for steps in range(1, MOST_STEPS + 1):
        for step in (steps, -steps):
            rows = "one row" if steps == 1 else f"{steps} rows"
            yield Hypothesis(measured, f"the names of its points moved by {rows}", _names_moved(image, step))
    yield Hypothesis(measured, "the names of its points in reverse order", _names_reversed(image))


def _names_moved(image: int, step: int) -> changes.Change:
    def changed(block: Block) -> Block:
        own = np.flatnonzero(block.image_points.image == image)
        return _with_names(block, own, np.roll(own, step))

    return changed


def _names_reversed(image: int) -> changes.Change:
    def changed(block: Block) -> Block:
        own = np.flatnonzero(block.image_points.image == image)
        return _with_names(block, own, own[::-1])

    return changed


def _with_names(block: Block, rows: np.ndarray, source: np.ndarray) -> Block:
    point = block.image_points.point.copy()
    point[rows] = block.image_points.point[source]
    return replace(block, image_points=replace(block.image_points, point=point))


@dataclass(frozen=True)
class _Place:
    """Where a resection puts a photograph: median distance of its rays in tolerances, turn (rad) to a neighbour."""

    miss: float
    turn: float = np.inf


def _place(block: Block, model: FreeModel, image: int, tolerance: float = TOLERANCES[0]) -> _Place:
    """The photograph resected from the points of the model; miss inf where it finds no place above them."""
    alone, _ = sub_block(block, np.array([image]))
    directions, rays = directions_of(alone), alone.image_points
    known = np.isfinite(model.points[rays.point, 0]) & np.isfinite(directions.tangent).all(axis=1)
    if known.sum() < FEWEST_RAYS:
        return _Place(np.inf)
    points, tangent = model.points[rays.point[known]], directions.tangent[known]
    ray = float(np.median(directions.tolerance))
    pose = resect(points, tangent, tolerance * ray)
    if pose is None or pose[0][:, 2] @ model.looking > 0.0:
        return _Place(np.inf)
    rotation, centre = pose
    own = (points - centre) @ rotation
    miss = np.linalg.norm(-own[:, :2] / own[:, 2:] - tangent, axis=1) / ray
    neighbour = _neighbour(block, model, image, centre)
    turn = np.linalg.norm(logarithm(model.rotation[neighbour].T @ rotation))
    return _Place(float(np.median(miss)), float(turn))


def _neighbour(block: Block, model: FreeModel, image: int, centre: np.ndarray) -> int:
    """The nearest photograph of the model, of the same strip where there is one."""
    strip = np.asarray(block.images.strip)
    joined = np.flatnonzero(model.joined)
    same = joined[strip[joined] == strip[image]]
    own = same if len(same) else joined
    return int(own[np.argmin(np.linalg.norm(model.centre[own] - centre, axis=1))])
