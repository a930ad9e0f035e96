"""The adjustment: Gauss-Newton on whitened observations, damped only when a step fails.

`minimise` reads as the algorithm; it knows normal equations and steps, not photographs. Its parts: `steps` solves for a
step and makes it lead downhill, `damping` says how much, `secants` learn the curvature that the normal matrix misses,
`stopping` says when to end, `chord_steps` takes the last steps with an old factor, `single_precision` the first with
one of fewer digits, `robust` gives the weights.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from aerotri.adjustment.chord_steps import follow
from aerotri.adjustment.damping import Damping
from aerotri.adjustment.defects import checked_factor, is_suspect, without_digits
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.panels import DOUBLE, SINGLE
from aerotri.adjustment.parallel import blas_threads
from aerotri.adjustment.reduced_equations import NormalEquations
from aerotri.adjustment.robust import LEAST_SQUARES, STAGES, Estimator, estimator_for
from aerotri.adjustment.secants import Secants
from aerotri.adjustment.settled_points import needs_settling, settled_points
from aerotri.adjustment.single_precision import first_precision, precise_enough
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.steps import (
    Place,
    Trial,
    assembled,
    lengthened,
    place_at,
    stretched,
    until_better,
)
from aerotri.adjustment.stopping import (
    BENT_STEP_TOLERANCE,
    EARLY_STEP_TOLERANCE,
    ROBUST_STEP_TOLERANCE,
    is_settled,
)
from aerotri.adjustment.unknowns import State

MAX_SCALE_CHANGES = 20
"""Times that the robust scale follows the residuals within one stage: two scales that call for one another would
otherwise alternate for ever."""

Report = Callable[[int, float, float], None]
Inspect = Callable[[NormalSystem, State, NormalEquations, Estimator, int, bool], bool]
"""Asked before the first step (iteration 0) and after every one whose equations are assembled, whether to stop; the
last argument tells that a pivot has nearly vanished."""
INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class SolveOptions:
    """When to stop: after `max_iterations`, or when the next step changes no unknown by STEP_TOLERANCE of its σ.

    Parameters
    ----------
    robust : a key of `robust.STAGES`; each of its stages has `max_iterations`.
    report : called after every iteration with (iteration, σ0, damping), for progress.
    inspect : may stop the adjustment, whose status is `INTERRUPTED` then.
    step_tolerance : share of σ within which the last robust stage ends.
    bent : whether whole steps led uphill before, here or nearby: the curvature is then heeded from the first step.
    is_near : whether the start is near the minimum: the last stage alone is gone through.
    """

    max_iterations: int = 30
    robust: str = "off"
    report: Report | None = None
    inspect: Inspect | None = None
    step_tolerance: float = ROBUST_STEP_TOLERANCE
    bent: bool = False
    is_near: bool = False

    def after(self, done: int) -> SolveOptions:
        """The same, with the iterations reported counted on from those done."""
        report = self.report
        if report is None:
            return self

        def counted(iteration: int, sigma0: float, damping: float) -> None:
            report(done + iteration, sigma0, damping)

        return replace(self, report=counted)

    def going_on(self, solution: Solution) -> SolveOptions:
        """The same, for equations that differ a little from those of a solution, from where that ended."""
        return replace(self.after(solution.iterations), bent=solution.bent, is_near=True)


@dataclass(frozen=True, eq=False)
class Solution:
    """Where `minimise` ended: values, equations and estimator there, and how it went.

    Parameters
    ----------
    status : 'converged', 'not converged', 'rank deficient', or 'interrupted' where `SolveOptions.inspect` wanted it.
    costs : Σρ at the start and after every iteration of the last stage.
    defects : sentences naming what the observations leave free, when rank deficient, or why nothing can be computed.
    step_tolerance : share of σ within which a robust adjustment converged.
    bent : whether a whole step of the last stage led uphill.
    """

    status: str
    state: State
    equations: NormalEquations
    estimator: Estimator
    iterations: int
    costs: tuple[float, ...] = ()
    defects: tuple[str, ...] = ()
    step_tolerance: float = ROBUST_STEP_TOLERANCE
    bent: bool = False


@dataclass(frozen=True)
class Stage:
    """One estimator on the way: its name, the iterations before it, and how still it has to stand at its end.

    bent : whether the curvature is heeded from the first step.
    """

    name: str
    done: int = 0
    step_tolerance: float = ROBUST_STEP_TOLERANCE
    bent: bool = False

    @property
    def is_robust(self) -> bool:
        return self.name != "off"

    @property
    def robust_tolerance(self) -> float | None:
        return self.step_tolerance if self.is_robust else None

    def heeding(self) -> Stage:
        """The stage that heeds the curvature."""
        return replace(self, bent=True, step_tolerance=max(self.step_tolerance, BENT_STEP_TOLERANCE))


@dataclass(eq=False)
class _Course:
    """The iterations of a stage so far, told to whoever asked."""

    iteration: int
    report: Report | None
    redundancy: int
    costs: list[float] = field(default_factory=list)
    bent: bool = False

    def add(self, cost: float, damping: float) -> None:
        """Keep the cost after an iteration, and tell of it."""
        self.costs.append(cost)
        if self.report:
            self.report(self.iteration, math.sqrt(cost / max(self.redundancy, 1)), damping)

    def ended(self, status: str, at: Place) -> Solution:
        """The solution at a place."""
        return Solution(status, at.state, at.equations, at.estimator, self.iteration, tuple(self.costs), bent=self.bent)


def minimise(system: NormalSystem, state: State, redundancy: int, options: SolveOptions) -> Solution:
    """Minimise Σρ over all unknowns, through the stages of the robust estimator.

    Parameters
    ----------
    system : assembles and solves.
    state : start values.
    redundancy : of the adjustment, for σ̂0 in the stopping rule.

    Returns
    -------
    Solution
        Its equations are assembled, undamped, at its state.
    """
    *early, last = STAGES[options.robust]
    early, done = [] if options.is_near else early, 0
    # threads of BLAS wait for work in a loop, after every scalar product: they would take a processor from the kernels
    with blas_threads(0.0):
        for name in early:
            solution = _descend(system, state, redundancy, options, Stage(name, done, EARLY_STEP_TOLERANCE))
            if solution.defects or solution.status == INTERRUPTED:
                return solution
            state, done = solution.state, solution.iterations
        stage = Stage(last, done, options.step_tolerance, options.bent and last != "off")
        return _descend(system, state, redundancy, options, stage)


def _descend(system: NormalSystem, state: State, redundancy: int, options: SolveOptions, stage: Stage) -> Solution:
    """Gauss-Newton with the estimator of one stage."""
    at, secants, stage = _begun(system, state, redundancy, stage)
    course = _Course(stage.done, options.report, redundancy, [at.equations.cost], stage.bent)
    if not at.equations.are_numbers:
        return replace(course.ended("not converged", at), defects=(without_digits(system, at.equations),))
    last_iteration, precision = stage.done + options.max_iterations, first_precision(system, stage.is_robust)
    damping, scale_changes, last_decrement = Damping(), 0, np.inf
    while course.iteration < last_iteration:
        course.iteration += 1
        is_first = course.iteration == 1
        step, precision = precise_enough(system, at, damping.value, secants, precision, is_first)
        if is_first:
            step, refused = _checked(system, at, step, options, precision)
            if refused is not None:
                return replace(refused, costs=tuple(course.costs), bent=stage.bent)
        step, damping = until_better(system, at, step, damping, secants)
        if step is None:
            return course.ended("not converged", at)
        is_plain = damping.value == 0.0 and (secants is not None or not step.points_settled)
        if is_plain and secants is not None:
            step = lengthened(system, at, step)
        secants, stage = _heeding(secants, stage, step, at, damping)
        course.bent = stage.bent
        if stage.is_robust and is_plain and secants is None:
            step = stretched(system, at, step, last_decrement)
        is_rounding = damping.value == 0.0 and step.decrement <= at.equations.rounding
        ends = is_plain or is_rounding
        settled = ends and is_settled(at, step, redundancy, stage.robust_tolerance, last_decrement)
        last_decrement = step.decrement if is_plain else np.inf
        damping = damping.lowered(step.gain_ratio(at.equations), secants is not None)
        course.add(step.equations.cost, damping.value)
        if is_plain and not (stage.is_robust or settled) and step.is_within_scatter:
            at, last_decrement, settled = _followed(system, step, redundancy, last_iteration, course)
            precision = DOUBLE
        else:
            at = assembled(system, step.place)
        # residuals that are rounding tell no scale
        has_scale = at.estimator.is_robust and at.equations.cost > at.equations.rounding
        may_change = has_scale and scale_changes < MAX_SCALE_CHANGES
        fresh = _reweighted(system, at, stage.name, redundancy) if may_change else at
        if fresh is not at:
            at, settled, last_decrement, scale_changes = fresh, False, np.inf, scale_changes + 1
            secants = Secants() if secants is not None else None
        if settled:
            at = _with_settled_points(system, at, redundancy)
            return replace(course.ended("converged", at), step_tolerance=stage.step_tolerance)
        if _is_stopped(system, at, options, course.iteration - stage.done):
            return course.ended(INTERRUPTED, at)
    return course.ended("not converged", at)


def _begun(system: NormalSystem, state: State, redundancy: int, stage: Stage) -> tuple[Place, Secants | None, Stage]:
    """The place where a stage begins; with points at their minimum where the curvature is heeded from the start."""
    at = _reweighted(system, place_at(system, state, LEAST_SQUARES), stage.name, redundancy)
    if not stage.bent:
        return at, None, stage
    settled = place_at(system, system.settle_points(at.state, at.estimator), at.estimator)
    return settled, Secants(), stage.heeding()


def _followed(
    system: NormalSystem, step: Trial, redundancy: int, last_iteration: int, course: _Course
) -> tuple[Place, float, bool]:
    """Where steps with the factor of this one lead: the place, the last decrement, whether it is the end."""

    def say(cost: float) -> None:
        course.iteration += 1
        course.add(cost, 0.0)

    found = follow(system, step, redundancy, last_iteration - course.iteration, say)
    return found.place, found.decrement, found.settled


def _heeding(
    secants: Secants | None, stage: Stage, step: Trial, before: Place, damping: Damping
) -> tuple[Secants | None, Stage]:
    """What the steps told about the curvature, this one included: from when a robust step had to be damped."""
    if secants is not None:
        secants.learn(step.reduced, before.equations.right, step.equations.right)
        return secants, stage
    if not (stage.is_robust and damping.value > 0.0):
        return None, stage
    # before this step the right side was not that of points at their minimum: nothing to learn from yet
    return Secants(), stage.heeding()


def _checked(
    system: NormalSystem, at: Place, step: Trial | None, options: SolveOptions, precision: np.dtype[Any]
) -> tuple[Trial | None, Solution | None]:
    """The first step with a factor that is valid, or what ends the adjustment before it: a rank defect, or a wish.

    A factor in single precision that serves shows that nothing is free.
    """
    is_sure = precision == SINGLE
    suspect = step is None or (not is_sure and is_suspect(step.factor, at.equations))
    if _is_stopped(system, at, options, 0, suspect):
        return None, Solution(INTERRUPTED, at.state, at.equations, at.estimator, 0)
    # who inspects something suspect factorises
    known: Factor | None = None if suspect or step is None else step.factor
    factor, defects = checked_factor(system, at.state, at.equations, at.estimator, known, suspect, is_sure)
    if defects:
        return None, Solution("rank deficient", at.state, at.equations, at.estimator, 0, (), tuple(defects))
    return (replace(step, factor=factor) if step and factor else step), None


def _with_settled_points(system: NormalSystem, at: Place, redundancy: int) -> Place:
    """The place with all points at their minimum, where its estimator leaves some behind."""
    if not needs_settling(at.estimator):
        return at
    variance = max(at.equations.cost, 1e-30) / max(redundancy, 1)
    return place_at(system, settled_points(system, at.state, at.estimator, variance), at.estimator)


def _is_stopped(system: NormalSystem, at: Place, options: SolveOptions, iteration: int, suspect: bool = False) -> bool:
    asked = options.inspect
    return asked is not None and asked(system, at.state, at.equations, at.estimator, iteration, suspect)


def _reweighted(system: NormalSystem, at: Place, name: str, redundancy: int) -> Place:
    """The place with the estimator that its residuals ask for; itself where the estimator stands."""
    if name == "off" and not at.estimator.is_robust:
        return at
    share = redundancy / max(redundancy + system.unknowns.count, 1)
    fresh = estimator_for(name, system.residual_lengths(at.equations), share)
    return at if fresh.is_near(at.estimator) else place_at(system, at.state, fresh)
