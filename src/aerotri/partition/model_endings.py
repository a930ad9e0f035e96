"""What groups of photographs do to all unknowns of a part, and the model part of their σ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.point_sides import expand_sides, reduced_sides
from aerotri.partition.model_tasks import MIX, Labelled, Standing, apart, observed_rows
from aerotri.partition.part_results import MEASURED, MODEL
from aerotri.partition.part_tasks import At, PartTask
from aerotri.partition.side_tasks import Sides, followed, keep_reduced
from aerotri.statistics.cluster_fields import columns_of_points, field_sums, nodes_of, of_patterns
from aerotri.statistics.cluster_influence import LOWERED, PLAIN_SHARE, plain_changes, plain_sides
from aerotri.statistics.covariance import Cofactors, orientation_cofactors
from aerotri.statistics.lowered_weights import (
    Lengths,
    Turn,
    first_turn,
    lowered_sides,
    next_turn,
    products,
    with_points,
)
from aerotri.statistics.model_part import freedom_of, growth_of, of_few, positive_part

KNOWN, SCORES, PLAIN, TURN = "known", "scores", "plain", "turn"
"""Files of a part: what control gives of its cofactors; scores of the clusters; what they do to first order; where the
solutions with lowered weights stand."""


@dataclass(frozen=True, eq=False)
class Descending:
    """A turn of the solutions with lowered weights.

    Parameters
    ----------
    labelled : clusters, and the right sides to be left. number : of the turn. before : right sides that were solved.
    lengths : how far to go; None before the first.
    """

    labelled: Labelled
    number: int
    before: Sides | None = None
    lengths: Lengths | None = None


@dataclass(frozen=True, eq=False)
class Patterns:
    """The fields of all parts of clusters that are divided by camera.

    Parameters
    ----------
    root : (m, nodes, k) of the field of every one.
    """

    labelled: Labelled
    root: np.ndarray


@dataclass(frozen=True, eq=False)
class Grouped:
    """A model part that is to be computed: of clusters whose solutions are those of turn `number`."""

    labelled: Labelled
    number: int
    sigma0: float


@dataclass(frozen=True, eq=False)
class Grown:
    """What a part tells of its model part.

    Parameters
    ----------
    growth : (P, 3) total σ over σ of its points. shared : (s', m) what the clusters do to its shared parameters.
    """

    growth: np.ndarray
    shared: np.ndarray


def hold_part(sides_at: tuple[At, Sides], task: PartTask) -> None:
    """Leave the random sums over the observed coordinates of points."""
    at, sides = sides_at
    s = Standing.of(at, task)
    keep_reduced(s.factor, sides, reduced_sides(s.system, s.state, _held_sides(s, task), s.estimator), task)


def held_part(sides_at: tuple[At, Sides], task: PartTask) -> None:
    """Q·N_0·Q of photographs and points of a part."""
    at, sides = sides_at
    s = Standing.of(at, task)
    images, shared = apart(s.system, followed(s.factor, sides, task))
    points = expand_sides(s.system, s.state, images, shared, _held_sides(s, task), s.estimator)
    task.files.keep_object(KNOWN, tuple(part @ np.swapaxes(part, 1, 2) for part in (images, points)))


def pull_part(d: Descending, task: PartTask) -> None:
    """Leave the scores of the clusters, with the points eliminated with all and with lowered weights."""
    s, own = Standing.of(d.labelled.at, task), d.labelled.own(task)
    scores = lowered_sides(s.system, s, own.label, len(own), LOWERED)
    task.files.keep_array(SCORES, scores)
    keep_reduced(s.factor, d.labelled.sides, np.hstack([plain_sides(s.system, s, own), scores]), task)


def turn_part(d: Descending, task: PartTask) -> np.ndarray:
    """Go a turn further and leave the right sides of the next; the products (2, m) of the part."""
    s, own, files = Standing.of(d.labelled.at, task), d.labelled.own(task), task.files
    assert d.before is not None
    x = followed(s.factor, d.before, task)
    if d.lengths is None:
        plain, back = np.hsplit(x, 2)
        files.keep_array(PLAIN, plain)
        turn = first_turn(files.array(SCORES), back, back)
    else:
        turn = next_turn(Turn(*files.array(f"{TURN}_{d.number - 1}")), x, d.lengths)
    pulled = lowered_sides(s.system, s, own.label, len(own), LOWERED, np.ascontiguousarray(turn.z))
    turn = turn.with_pulled(pulled)
    files.keep_array(f"{TURN}_{d.number}", turn.stacked())
    keep_reduced(s.factor, d.labelled.sides, pulled, task)
    return products(turn)


def group_part(grouped: Grouped, task: PartTask) -> Grown:
    """The model part of photographs and points from the clusters, as `excess_of_clusters` has it."""
    labelled, files = grouped.labelled, task.files
    s, own = Standing.of(labelled.at, task), labelled.own(task)
    x = Turn(*files.array(f"{TURN}_{grouped.number}")).x
    plain = plain_changes(s.system, s, own, files.array(PLAIN))
    lowered = with_points(s.system, s, own.label, LOWERED, x)
    images, shared, points = (
        PLAIN_SHARE * one + (1.0 - PLAIN_SHARE) * other for one, other in zip(plain, lowered, strict=True)
    )
    q: Cofactors = files.object(MEASURED)[1]
    noise, freedom = of_few(len(own)) * grouped.sigma0**2, freedom_of(len(own))
    of_images, of_points = (
        positive_part(freedom * part @ np.swapaxes(part, 1, 2), noise * (of_all - known))
        for part, of_all, known in zip((images, points), (q.images, q.points), files.object(KNOWN), strict=True)
    )
    files.keep_object(MODEL, (orientation_cofactors(s.system.unknowns, s.state, of_images), of_points))
    return Grown(growth_of(grouped.sigma0**2 * q.points, of_points), shared)


def pattern_part(patterns: Patterns, task: PartTask) -> None:
    """Leave the sides of the patterns of chosen fields."""
    labelled = patterns.labelled
    s, clusters = Standing.of(labelled.at, task), labelled.own(task)
    assert labelled.camera is not None
    sides, _, _ = field_sums(s.system, s, nodes_of(s.system, clusters.label), labelled.camera)
    keep_reduced(s.factor, labelled.sides, of_patterns(sides, patterns.root), task)


def patterned_part(patterns_sigma0: tuple[Patterns, float], task: PartTask) -> Grown:
    """The model part of photographs and points from the chosen fields, as `excess_of_root` has it."""
    patterns, sigma0 = patterns_sigma0
    labelled = patterns.labelled
    s, clusters = Standing.of(labelled.at, task), labelled.own(task)
    u, x = s.system.unknowns, followed(s.factor, labelled.sides, task)
    points = np.zeros((len(u.points), 3, 3))
    for _, columns in columns_of_points(s.system, s, nodes_of(s.system, clusters.label), patterns.root, x):
        points += columns @ np.swapaxes(columns, 1, 2)
    images, shared = apart(s.system, x)
    of_images = orientation_cofactors(u, s.state, images @ np.swapaxes(images, 1, 2))
    q: Cofactors = task.files.object(MEASURED)[1]
    task.files.keep_object(MODEL, (of_images, points))
    return Grown(growth_of(sigma0**2 * q.points, points), shared)


def _held_sides(s: Standing, task: PartTask) -> np.ndarray:
    """(P, 3, k) random sums over the roots of the weights of observed coordinates."""
    u, (rows, axes), mix = s.system.unknowns, observed_rows(s.system), task.files.array(MIX)
    sides = np.zeros((len(u.points), 3, mix.shape[1]))
    sides[rows, axes] = np.sqrt(u.prior_weight[rows, axes])[:, None] * mix
    return sides
