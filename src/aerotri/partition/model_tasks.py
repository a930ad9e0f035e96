"""What is done to a part for the model part of σ: its photographs, tests, and what groups do to its unknowns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.kernel_records import Directions
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.partial_factor import PartialFactor, restored
from aerotri.adjustment.point_sides import expand_sides, reduced_sides
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.unknowns import State
from aerotri.observations import GnssIns, Images
from aerotri.partition.part_tasks import At, PartTask
from aerotri.partition.side_tasks import Sides, followed, keep_reduced, keep_sums
from aerotri.statistics.cluster_fields import field_sums, nodes_of
from aerotri.statistics.cluster_test import (
    FEWEST_RAYS,
    Modes,
    candidates,
    keys,
    scores_along,
    sides_of_clusters,
    sums_of_clusters,
    thinned,
)
from aerotri.statistics.clusters import Clusters

PHOTOGRAPHS, PROBED, MODES, MIX = "photographs", "probed", "modes", "mix"
"""Files of a part: numbers of its photographs among all; solutions of unit sides at points; along the weakest
deformations; the random sums over its control."""


@dataclass(frozen=True, eq=False)
class Described:
    """What a part tells of itself.

    Parameters
    ----------
    images, positions : its photographs and their observed positions. rows : (n,) those of its system.
    centre : (n, 3) m, adjusted.
    names, xy, rays, keys : of points that may stand for the shape of the block. most_rays : of a point.
    candidates : how many there are; fewer are told where they are many.
    observed : (k, 3) m, places of the observed coordinates of points.
    sigma, count : mm, σ of image coordinates that occur, and how often.
    """

    images: Images
    positions: GnssIns | None
    rows: np.ndarray
    centre: np.ndarray
    names: np.ndarray
    xy: np.ndarray
    rays: np.ndarray
    keys: np.ndarray
    most_rays: int
    candidates: int
    observed: np.ndarray
    sigma: np.ndarray
    count: np.ndarray


@dataclass(frozen=True, eq=False)
class Standing:
    """A part where the adjustment ended, with the factor of its own unknowns."""

    system: NormalSystem
    state: State
    estimator: Estimator
    factor: PartialFactor

    @classmethod
    def of(cls, at: At, task: PartTask) -> Standing:
        """As the files say."""
        system = task.files.system(at.positions).system
        numbers, _ = task.files.eliminated(at.tag)
        state = task.files.state(at.state, at.shared[task.shared])
        return cls(system, state, at.estimator, restored(system.symbolic, numbers))


@dataclass(frozen=True, eq=False)
class Probing:
    """Unit sides at object points, three columns each.

    Parameters
    ----------
    points : (k,) str. sides : the right sides. chosen : (3·k, f) directions that are made of them.
    """

    at: At
    points: np.ndarray
    sides: Sides
    chosen: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Labelled:
    """Clusters of all photographs.

    Parameters
    ----------
    clusters : label (N,) of all photographs. camera : (m,) of the parts where the clusters are divided by camera.
    sides : right sides to be left.
    """

    at: At
    clusters: Clusters
    sides: Sides
    camera: np.ndarray | None = None

    def own(self, task: PartTask) -> Clusters:
        """Those of the photographs of a part."""
        return replace(self.clusters, label=self.clusters.label[task.files.array(PHOTOGRAPHS)])


def describe_part(at: At, task: PartTask) -> Described:
    """Photographs, and points to choose from."""
    system = task.files.system(at.positions).system
    u, state = system.unknowns, task.files.state(at.state, at.shared[task.shared])
    rays = np.diff(u.rays.start)
    most = int(rays.max(initial=0))
    rows = candidates(u)
    rows = rows[rays[rows] >= min(FEWEST_RAYS, most)]
    names = u.block.points[u.points[rows]]
    kept = thinned(names)
    sigma, count = np.unique(1.0 / u.rays.inv_sigma, return_counts=True)
    points, _ = observed_rows(system)
    return Described(
        u.block.images, u.block.gnss_ins, u.images, state.centre, names[kept], state.points[rows[kept], :2],
        rays[rows[kept]], keys(names[kept]), most, len(rows), state.points[points], sigma, count,
    )  # fmt: skip


def probe_part(probing: Probing, task: PartTask) -> None:
    """Leave unit sides at the points of the sample that are its own."""
    s = Standing.of(probing.at, task)
    rows, _, sides = _unit_sides(s.system, probing)
    keep_reduced(s.factor, probing.sides, reduced_sides(s.system, s.state, sides, s.estimator, rows), task)


def probed_part(probing: Probing, task: PartTask) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Its points of the sample, (j,); solutions there (j, 3, k); what its control holds of them (k, k)."""
    s = Standing.of(probing.at, task)
    rows, own, sides = _unit_sides(s.system, probing)
    x = followed(s.factor, probing.sides, task)
    task.files.keep_array(PROBED, x)
    images, shared = apart(s.system, x)
    weight = s.system.unknowns.prior_weight
    observed = np.flatnonzero((weight > 0.0).any(axis=1))
    points = expand_sides(
        s.system, s.state, images, shared, sides, s.estimator, np.union1d(rows, observed).astype(np.int64)
    )
    held = np.einsum("pia,pi,pib->ab", points[observed], weight[observed], points[observed])
    return own, points[rows], held


def score_part(probing: Probing, task: PartTask) -> None:
    """Keep the weakest deformations in all its unknowns, and what its photographs do along them."""
    s = Standing.of(probing.at, task)
    assert probing.chosen is not None
    images, shared = apart(s.system, task.files.array(PROBED) @ probing.chosen)
    sides = np.ascontiguousarray(_unit_sides(s.system, probing)[2] @ probing.chosen)
    y = Directions(images, shared, expand_sides(s.system, s.state, images, shared, sides, s.estimator))
    task.files.keep_object(MODES, Modes(y, *scores_along(s.system, s, y)))


def compare_part(labelled: Labelled, task: PartTask) -> None:
    """Leave the sides of clusters along the deformations, and what its rays say of K and of the pulls."""
    s, clusters = Standing.of(labelled.at, task), labelled.own(task)
    modes: Modes = task.files.object(MODES)
    sides, taken = sides_of_clusters(s.system, s, clusters, modes.y)
    own, pulls = sums_of_clusters(modes, clusters)
    gram = keep_reduced(s.factor, labelled.sides, sides, task)
    keep_sums(np.column_stack([own - taken - gram, pulls]), labelled.sides, task)


def field_part(labelled: Labelled, task: PartTask) -> None:
    """Leave the sides of the nodes of random fields, and what its rays say of their normals and scores."""
    s, clusters = Standing.of(labelled.at, task), labelled.own(task)
    assert labelled.camera is not None
    sides, own, scores = field_sums(s.system, s, nodes_of(s.system, clusters.label), labelled.camera)
    gram = keep_reduced(s.factor, labelled.sides, sides, task)
    keep_sums(np.column_stack([own - gram, scores]), labelled.sides, task)


def observed_rows(system: NormalSystem) -> tuple[np.ndarray, np.ndarray]:
    """Rows and axes of the coordinates of points that are observed."""
    u = system.unknowns
    rows, axes = np.nonzero((u.prior_weight > 0.0) & (u.kept < 0)[:, None])
    return rows, axes


def _unit_sides(system: NormalSystem, probing: Probing) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of the points of the sample in a part, which of the sample they are, and the sides (P, 3, k)."""
    u = system.unknowns
    place = {name: k for k, name in enumerate(probing.points.tolist())}
    rows = np.flatnonzero(np.isin(u.block.points[u.points], probing.points))
    own = np.array([place[name] for name in u.block.points[u.points[rows]].tolist()], dtype=np.int64)
    sides = np.zeros((len(u.points), 3, 3 * len(place)))
    for row, k in zip(rows.tolist(), own.tolist(), strict=True):
        sides[row, :, 3 * k : 3 * k + 3] = np.eye(3)
    return rows, own, sides


def apart(system: NormalSystem, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(6·n + s, k) of photographs (n, 6, k) and shared parameters (s, k)."""
    n = 6 * len(system.unknowns.images)
    return np.ascontiguousarray(x[:n]).reshape(n // 6, 6, -1), np.ascontiguousarray(x[n:])
