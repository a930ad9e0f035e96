"""The adjustment of a block in parts: Gauss-Newton as in one piece, its equations gathered from the parts.

In every iteration each part is one task: it follows the solution of what is shared to its own photographs and points,
and eliminates them again at the new state. What parts share is solved for by the joints of their tree.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.adjustment.adjusted_positions import MOST_ROUNDS, STANDING
from aerotri.adjustment.damping import LAST_DAMPING, Damping
from aerotri.adjustment.robust import LEAST_SQUARES, STAGES, Estimator, estimator_for
from aerotri.adjustment.settled_points import needs_settling
from aerotri.adjustment.sparse_cholesky import NotPositiveDefiniteError
from aerotri.adjustment.steps import COST_TOLERANCE
from aerotri.adjustment.stopping import (
    EARLY_STEP_TOLERANCE,
    ROBUST_COST_TOLERANCE,
    ROBUST_STEP_TOLERANCE,
    is_negligible,
)
from aerotri.conventions import InputError
from aerotri.execution.work import Executor, Work
from aerotri.partition.common import Common
from aerotri.partition.joints import Corner, Joints
from aerotri.partition.part_tasks import (
    At,
    Move,
    PartTask,
    Reduced,
    evaluate_part,
    move_part,
    reduce_part,
    refuse_fault,
    settle_part,
)
from aerotri.partition.telling import Told

MOST_SCALES = 20
"""Times that the robust scale follows the residuals within one stage, as in one piece."""
Report = Callable[[int, float], None]


@dataclass(frozen=True, eq=False)
class Place:
    """Where the adjustment stands: the parts have their equations in files.

    Parameters
    ----------
    cost : Σρ of all observations. decrement : of what the parts eliminated; of_points : of the points among it.
    rounding : what the cost is uncertain by.
    is_bare : whether there are no equations: where a step that changes nothing led.
    """

    at: At
    cost: float
    decrement: float
    of_points: float
    rounding: float = 0.0
    is_bare: bool = False


@dataclass(frozen=True, eq=False)
class Ended:
    """How it ended.

    Parameters
    ----------
    status : 'converged' or 'not converged'.
    """

    status: str
    place: Place
    iterations: int


class Course:
    """Iterations over the parts of a block.

    Parameters
    ----------
    joints : over the parts. common : what they share. executor : where tasks run. folder : for what tasks share.
    redundancy : of the whole. unknowns : how many there are. bytes_each : memory of a task.
    report : called after every iteration with its number and σ0.
    """

    def __init__(
        self, joints: Joints, common: Common, executor: Executor, folder: Path, redundancy: int, unknowns: int,
        bytes_each: int, report: Report | None = None,
    ):  # fmt: skip
        self.joints, self.tasks, self.common, self.redundancy = joints, joints.parts, common, redundancy
        self._executor, self._folder, self._bytes = executor, folder, bytes_each
        self._share = redundancy / max(redundancy + unknowns, 1)
        self._report, self._tags, self._states, self._iteration = report, 0, 0, 0

    def run(self, function: Callable[[Any, PartTask], Any], shared: Any) -> list[Any]:
        """A task for every part."""
        names = [f"part {task.name}" for task in self.tasks]
        return self._executor.run(
            Work(function, shared, self.tasks, names, "parts", self._folder, bytes_each=self._bytes)
        )

    def begin(self, stage: str) -> None:
        """Say what the tasks that follow belong to."""
        if isinstance(self._executor, Told):
            self._executor.stage = stage

    def minimise(self, robust: str, max_iterations: int) -> Ended:
        """From the start values through the stages of the estimator, then with parameters at adjusted image points."""
        start = At(0, 0, self.common.start, LEAST_SQUARES, 0.0, self._next_tag())
        ended = self._through_stages(start, robust, max_iterations)
        for round_ in range(MOST_ROUNDS):
            if ended.status != "converged":
                break
            at, moved = self._evaluated(ended.place.at)
            self._drop(ended.place.at)
            if round_ == MOST_ROUNDS - 1 or moved < STANDING:
                return replace(ended, place=self._reduced(at))
            ended = self._through_stages(replace(at, estimator=LEAST_SQUARES), robust, max_iterations)
        return ended

    def solved(self, place: Place) -> Corner:
        """The solution of the shared parameters at a place.

        Raises
        ------
        InputError
            When the observations do not determine it.
        """
        try:
            return self.joints.solved(place.at.tag, place.at.shared, place.at.damping)
        except NotPositiveDefiniteError as error:
            raise InputError(
                "the observations do not determine the block",
                "add control or positions of projection centres; adjust a part alone to see what it lacks",
            ) from error

    def _through_stages(self, start: At, robust: str, max_iterations: int) -> Ended:
        *early, last = STAGES[robust]
        ended = None
        for name in early:
            ended = self._descend(start, name, EARLY_STEP_TOLERANCE, max_iterations)
            start = ended.place.at
        return self._descend(start, last, ROBUST_STEP_TOLERANCE, max_iterations)

    def _descend(self, start: At, name: str, tolerance: float, max_iterations: int) -> Ended:
        """Gauss-Newton with the estimator of one stage."""
        place = self._reweighted(self._reduced(replace(start, tag=self._next_tag())), name)
        last_decrement, damping, scales = np.inf, Damping(), 0
        for _ in range(max_iterations):
            self._iteration += 1
            before = place
            place, decrement, damping = self._improved(place, damping, last_decrement, name)
            if place is before:
                return Ended("not converged", place, self._iteration)
            if self._report is not None:
                self._report(self._iteration, math.sqrt(place.cost / max(self.redundancy, 1)))
            settled = damping.value == 0.0 and self._settled(before, place, decrement, last_decrement, name, tolerance)
            last_decrement = decrement if damping.value == 0.0 else np.inf
            fresh = self._reweighted(place, name) if scales < MOST_SCALES else place
            if fresh is not place:
                place, settled, scales = fresh, False, scales + 1
            if settled:
                return Ended("converged", self._with_settled_points(place), self._iteration)
            if place.is_bare:
                place = self._reduced(place.at)
        return Ended("not converged", place, self._iteration)

    def _improved(
        self, place: Place, damping: Damping, last_decrement: float, name: str
    ) -> tuple[Place, float, Damping]:
        """The place that a step leads to, damped until it improves; the place itself where none does."""
        while True:
            damped = place if damping.value == 0.0 else self._reduced(self._again(place.at, damping.value))
            solved = self.solved(damped)
            decrement = solved.decrement + damped.decrement
            # the equations at the end are taken with parameters at adjusted image points, not here
            last = name == "off" and damping.value == 0.0 and self._is_negligible(decrement, last_decrement, place)
            there = self._moved(damped, solved, last)
            if damped is not place:
                self._drop(damped.at)
            if there.cost <= place.cost * (1.0 + COST_TOLERANCE) + place.rounding:
                self._drop(place.at)
                self._drop_state(place.at)
                ratio = min((place.cost - there.cost) / max(decrement, 1e-300), 1.0)
                return there, decrement, damping.lowered(ratio, heeds_curvature=False)
            self._drop(there.at)
            damping = damping.raised()
            if damping.value > LAST_DAMPING:
                return place, decrement, damping

    def _settled(
        self, before: Place, after: Place, decrement: float, last_decrement: float, name: str, tolerance: float
    ) -> bool:
        """As `stopping.is_settled` says it of a block in one piece."""
        if name != "off":
            variance = max(after.cost, 1e-30) / max(self.redundancy, 1)
            still = abs(before.cost - after.cost) <= ROBUST_COST_TOLERANCE * before.cost + before.rounding
            return still and decrement - before.of_points <= tolerance**2 * variance + before.rounding
        return self._is_negligible(decrement, last_decrement, after)

    def _is_negligible(self, decrement: float, last_decrement: float, at: Place) -> bool:
        contraction = min(1.0, max(1e-2, abs(decrement) / last_decrement)) if np.isfinite(last_decrement) else 1.0
        return is_negligible(abs(decrement) * contraction, at.cost, self.redundancy, at.rounding)

    def _reduced(self, at: At) -> Place:
        """The equations of all parts there."""
        return self._place(at, self.run(reduce_part, at))

    def _moved(self, place: Place, solved: Corner, last: bool) -> Place:
        """Where a solution leads all parts; without equations there where it is the last step."""
        self.joints.follow(place.at.tag)
        shared = place.at.shared + solved.step
        at = replace(place.at, state=self._next_state(), shared=shared, damping=0.0, tag=self._next_tag())
        there = self._place(at, self.run(move_part, Move(place.at, at, last)), may_fail=True)
        return replace(there, is_bare=last)

    def _place(self, at: At, found: list[Reduced], may_fail: bool = False) -> Place:
        if not may_fail:
            refuse_fault(self.tasks, found)
        of_priors = self.common.cost_of_priors(at.shared)
        cost = sum(part.cost for part in found) + of_priors
        decrement, of_points = sum(part.decrement for part in found), sum(part.of_points for part in found)
        return Place(at, cost, decrement, of_points, sum(part.rounding for part in found))

    def _with_settled_points(self, place: Place) -> Place:
        """The place with all points at their minimum, where its estimator leaves some behind."""
        if not needs_settling(place.at.estimator):
            return place
        at = replace(place.at, state=self._next_state(), tag=self._next_tag())
        variance = max(place.cost, 1e-30) / max(self.redundancy, 1)
        there = self._place(at, self.run(settle_part, Move(place.at, at, variance=variance)))
        self._drop(place.at)
        self._drop_state(place.at)
        return there

    def _reweighted(self, place: Place, name: str) -> Place:
        """The place with the estimator that the residuals of all parts ask for; itself where the estimator stands."""
        fresh = LEAST_SQUARES if name == "off" else self._estimator(place, name)
        if fresh.is_near(place.at.estimator):
            return place
        self._drop(place.at)
        return self._reduced(replace(place.at, estimator=fresh, tag=self._next_tag()))

    def _estimator(self, place: Place, name: str) -> Estimator:
        lengths = [task.files.array(f"lengths_{place.at.tag}") for task in self.tasks]
        return estimator_for(name, np.concatenate(lengths), self._share)

    def _evaluated(self, at: At) -> tuple[At, float]:
        """Parameters evaluated at the adjusted image points, and how far these moved (root mean square, in units of the
        residuals)."""
        end = replace(at, positions=at.positions + 1, tag=self._next_tag())
        found = self.run(evaluate_part, Move(at, end))
        count = sum(number for _, number in found)
        for task in self.tasks:
            task.files.drop(f"system_{at.positions}")
        return end, math.sqrt(sum(square for square, _ in found) / max(count, 1))

    def _again(self, at: At, damping: float) -> At:
        return replace(at, damping=damping, tag=self._next_tag())

    def _drop(self, at: At) -> None:
        self.joints.drop(at.tag)
        for task in self.tasks:
            task.files.drop_place(at.tag)

    def _drop_state(self, at: At) -> None:
        for task in self.tasks:
            task.files.drop(f"state_{at.state}")

    def _next_state(self) -> int:
        self._states += 1
        return self._states

    def _next_tag(self) -> str:
        self._tags += 1
        return str(self._tags)
