"""The model part of σ of a block in parts: the numbers of one piece, with the factors of the parts and joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from aerotri.conventions import InputError
from aerotri.observations import Block
from aerotri.partition.course import Course, Place
from aerotri.partition.model_endings import (
    TURN,
    Descending,
    Grouped,
    Grown,
    Patterns,
    group_part,
    held_part,
    hold_part,
    pattern_part,
    patterned_part,
    pull_part,
    turn_part,
)
from aerotri.partition.model_tasks import (
    MIX,
    PHOTOGRAPHS,
    PROBED,
    Described,
    Labelled,
    Probing,
    compare_part,
    describe_part,
    field_part,
    probe_part,
    probed_part,
    score_part,
)
from aerotri.partition.photographs import images_together, positions_together
from aerotri.partition.side_solver import SideSolver
from aerotri.partition.side_tasks import Sides
from aerotri.results.model_part import FIELD, GROUPS, ModelPart
from aerotri.statistics.cluster_fields import Field, by_camera, fit_field
from aerotri.statistics.cluster_influence import mixed_columns
from aerotri.statistics.cluster_test import (
    FEWEST_RAYS,
    LEVEL,
    SAMPLED_FROM,
    Squares,
    spread,
    squares_of,
    weakest,
)
from aerotri.statistics.clusters import Clusters, cluster_schemes, order_by_place
from aerotri.statistics.lowered_weights import MOST_TURNS, lengths
from aerotri.statistics.model_part import (
    chosen_scheme,
    compare_few,
    compare_schemes,
    freedom_of,
    of_few,
    positive_part,
    why_none,
    why_not,
    with_ratios,
)


@dataclass(frozen=True, eq=False)
class FoundModel:
    """The model part of the whole; that of photographs and points is in the files of the parts.

    Parameters
    ----------
    part : what it was derived from. shared : (s, s) of the shared parameters; None where there is none.
    """

    part: ModelPart
    shared: np.ndarray | None = None


def model_part_of(
    course: Course, place: Place, first: Block, status: str, sigma0: float, photographs: int
) -> FoundModel:
    """The model part of a block that was adjusted in parts, after its cofactors are in the files of the parts.

    Parameters
    ----------
    first : a part, for cameras and settings. status : of the adjustment. photographs : how many.
    """
    reason = why_not(first.settings.adjustment.model_part, photographs, status, sigma0)
    if reason:
        return FoundModel(ModelPart(reason=reason))
    return _PartsModel(course, place, first, sigma0).found()


class _PartsModel:
    """What all parts know together of the errors of groups of photographs."""

    def __init__(self, course: Course, place: Place, first: Block, sigma0: float):
        self._course, self._at, self._sigma0 = course, place.at, sigma0
        self._solver = SideSolver(course, place)
        self._described: list[Described] = course.run(describe_part, place.at)
        images, row_of = images_together([part.images for part in self._described])
        positions = positions_together([part.positions for part in self._described], row_of)
        self._block = replace(first, images=images, gnss_ins=positions)
        used = [own[part.rows] for own, part in zip(row_of, self._described, strict=True)]
        self._rows, self._centre = np.unique(np.concatenate(used)), np.empty((0, 3))
        centre = np.empty((len(images), 3))
        for task, own, part in zip(course.tasks, used, self._described, strict=True):
            centre[own] = part.centre
            task.files.keep_array(PHOTOGRAPHS, np.searchsorted(self._rows, own))
        self._centre = centre[self._rows]

    def found(self) -> FoundModel:
        """The tests, and where a scheme counts what it does to all unknowns."""
        self._course.begin("model part of σ, tests")
        schemes = cluster_schemes(self._block, self._rows, self._centre)
        tests = compare_schemes(schemes, self._centre, self._sigma0, self._squares)
        tests, fields = compare_few(schemes, tests, self._centre, self._fitted)
        part, chosen = ModelPart(level=LEVEL, tests=tests), chosen_scheme(tests)
        if chosen is None:
            return FoundModel(replace(part, reason=why_none(tests)))
        self._course.begin("model part of σ")
        clusters = schemes[chosen]
        part = replace(part, scheme=clusters.scheme, clusters=len(clusters))
        if chosen in fields:
            grown, shared = self._of_field(clusters, fields[chosen])
            return FoundModel(with_ratios(replace(part, method=FIELD), _growth(grown)), shared)
        grown, shared = self._of_groups(clusters)
        return FoundModel(with_ratios(replace(part, method=GROUPS), _growth(grown)), shared)

    def _squares(self) -> Squares:
        """The weakest deformations put into the files of the parts, and what computes the sums along them."""
        solver, common = self._solver, self._course.common
        probing = Probing(self._at, _sample(self._described), solver.next_sides())
        _, shared = solver.solve(probing.sides, probe_part, probing)
        size = 3 * len(probing.points)
        q, held = np.zeros((len(probing.points), 3, size)), common.priors.root().T @ shared
        held = held.T @ held
        for own, solutions, of_control in self._course.run(probed_part, probing):
            q[own] = solutions
            held += of_control
        solver.drop(probing.sides)
        q = q.reshape(size, size)
        chosen = weakest(0.5 * (q + q.T) - held)
        self._course.run(score_part, replace(probing, chosen=chosen))
        for task in self._course.tasks:
            task.files.drop(PROBED)
        return partial(self._sum_of_squares, chosen.shape[1])

    def _sum_of_squares(self, modes: int, clusters: Clusters) -> tuple[float, int]:
        sides = self._solver.next_sides(summed=True)
        sums = self._solver.sum_up(sides, compare_part, Labelled(self._at, clusters, sides))
        return squares_of(sums[:, : modes * len(clusters)], sums[:, -1])

    def _fitted(self, clusters: Clusters) -> Field:
        sides = self._solver.next_sides(summed=True)
        labelled = self._by_camera(clusters, sides)
        sums = self._solver.sum_up(sides, field_part, labelled)
        normals, scores, camera = sums[:, :-1], sums[:, -1], labelled.camera
        assert camera is not None
        return fit_field(
            0.5 * (normals + normals.T), scores, camera, len(clusters) > 1, self._block.cameras,
            _median([p.sigma for p in self._described], [p.count for p in self._described]), self._sigma0,
        )  # fmt: skip

    def _by_camera(self, clusters: Clusters, sides: Sides) -> Labelled:
        label, camera = by_camera(clusters, self._block.images.camera[self._rows])
        return Labelled(self._at, replace(clusters, label=label), sides, camera)

    def _of_field(self, clusters: Clusters, field: Field) -> tuple[list[Grown], np.ndarray]:
        sides = self._solver.next_sides()
        labelled = self._by_camera(clusters, sides)
        patterns = Patterns(labelled, field.root[labelled.camera])
        _, shared = self._solver.solve(sides, pattern_part, patterns)
        grown = self._course.run(patterned_part, (patterns, self._sigma0))
        self._solver.drop(sides)
        return grown, shared @ shared.T

    def _of_groups(self, clusters: Clusters) -> tuple[list[Grown], np.ndarray]:
        """What the clusters do less what noise explains of it, as `excess_of_clusters` has it."""
        known, m = self._known(), len(clusters)
        turning = self._descended(clusters)
        grouped = Grouped(turning.labelled, turning.number, self._sigma0)
        grown: list[Grown] = self._course.run(group_part, grouped)
        common = self._course.common
        change = np.zeros((len(common.labels), m))
        for own, part in zip(common.of_shared, grown, strict=True):
            change[own] = part.shared
        noise = of_few(m) * self._sigma0**2 * (self._solver.inverse - known)
        return grown, positive_part(freedom_of(m) * (change @ change.T)[None], noise[None])[0]

    def _known(self) -> np.ndarray:
        """Q·N_0·Q of the shared parameters (s, s); that of photographs and points in the files of the parts."""
        observed = [part.observed for part in self._described]
        root = self._course.common.priors.root()
        places = np.concatenate(observed)
        mix = mixed_columns(len(places) + root.shape[1])
        if not mix.shape[1]:  # nothing is known beforehand: one column of nothing
            mix = np.zeros((0, 1))
        # the random sums are to be the same for any order of the points
        of_places = np.empty((len(places), mix.shape[1]))
        of_places[order_by_place(places)] = mix[: len(places)]
        ends = np.cumsum([len(own) for own in observed])
        for task, own in zip(self._course.tasks, np.split(of_places, ends[:-1]), strict=True):
            task.files.keep_array(MIX, own)
        sides = self._solver.next_sides()
        _, shared = self._solver.solve(sides, hold_part, (self._at, sides), root @ mix[len(places) :])
        self._course.run(held_part, (self._at, sides))
        self._solver.drop(sides)
        return shared @ shared.T

    def _descended(self, clusters: Clusters) -> Descending:
        """The solutions with lowered weights put into the files of the parts; their last turn."""
        solver, before = self._solver, self._solver.next_sides()
        turning = Descending(Labelled(self._at, clusters, before), 0)
        solver.solve(before, pull_part, turning)
        for number in range(MOST_TURNS):
            self._course.begin(f"model part of σ, turn {number + 1}")
            sides = solver.next_sides()
            turning = replace(turning, labelled=replace(turning.labelled, sides=sides), number=number, before=before)
            found, _ = solver.solve(sides, turn_part, turning)
            solver.drop(before)
            for task in self._course.tasks:
                task.files.drop(f"{TURN}_{number - 1}")
            turning, before = replace(turning, lengths=lengths(np.sum(found, axis=0), turning.lengths)), sides
            if turning.lengths is not None and turning.lengths.arrived:
                break
        solver.drop(before)
        if turning.lengths is None or not turning.lengths.arrived:
            raise InputError(
                f"the search for errors that groups of photographs share did not end in {MOST_TURNS} steps",
                'set model_part = "off" in block.toml for σ without it',
            )
        return turning


def _sample(parts: Sequence[Described]) -> np.ndarray:
    """Names of points that stand for the shape of the block, as `weakest_modes` chooses them in one piece."""
    fewest = min(FEWEST_RAYS, max(part.most_rays for part in parts))
    names, xy, rays, keys = (
        np.concatenate([getattr(part, key) for part in parts]) for key in ("names", "xy", "rays", "keys")
    )
    enough = rays >= fewest
    names, xy, keys = names[enough], xy[enough], keys[enough]
    if sum(part.candidates for part in parts if part.most_rays >= fewest) > 2 * SAMPLED_FROM:
        first = np.lexsort((names, keys))[:SAMPLED_FROM]
        names, xy = names[first], xy[first]
    return names[spread(xy)]


def _growth(grown: Sequence[Grown]) -> np.ndarray:
    return np.concatenate([part.growth for part in grown])


def _median(values: Sequence[np.ndarray], counts: Sequence[np.ndarray]) -> float:
    """The median of values that occur so often."""
    value, count = np.concatenate(values), np.concatenate(counts)
    order = np.argsort(value)
    ends = np.cumsum(count[order])
    middle = ends[-1] - 1
    low, high = np.searchsorted(ends, [middle // 2 + 1, (middle + 1) // 2 + 1])
    return float(0.5 * (value[order][low] + value[order][high]))
