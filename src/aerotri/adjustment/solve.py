"""The adjustment: Gauss-Newton on whitened observations, damped only when a step fails.

`minimise` reads as the algorithm; it knows normal equations and steps, not photographs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.datum import without_motion
from aerotri.adjustment.defects import checked_factor, is_suspect
from aerotri.adjustment.normal_equations import NormalEquations, NormalSystem, RightSide
from aerotri.adjustment.robust import LEAST_SQUARES, STAGES, Estimator, estimator_for, normalised_lengths
from aerotri.adjustment.secants import Secants
from aerotri.adjustment.sparse_cholesky import Factor, NotPositiveDefiniteError
from aerotri.adjustment.unknowns import State, Step

COST_TOLERANCE = 1e-9
STEP_TOLERANCE = 1e-5
SURE_CONTRACTION = 1e-2
ROBUST_COST_TOLERANCE, ROBUST_STEP_TOLERANCE, EARLY_STEP_TOLERANCE = 1e-4, 1e-2, 0.3
BENT_STEP_TOLERANCE = 0.03
"""Share of σ within which robust estimation ends where whole steps led uphill: points that their rays hardly fix go on
moving there, and what they leave in the right side hides less."""
FIRST_DAMPING, LAST_DAMPING, NO_DAMPING, SLIGHT_DAMPING = 1e-5, 1e12, 1e-11, 5e-8
MAX_SCALE_CHANGES = 20
LEAST_RATIO, LONGEST_STRETCH = 0.5, 5.0
SLOWEST_CONTRACTION = 1e-2
LEAST_GAIN, FAR_OFF = 0.25, -3.0
"""Gain over promise below which an undamped step is not trusted, and below which it tells nothing of the curvature."""
SUSPECT_PIVOT = 1e-11
"""Pivot (relative to a unit diagonal) below which a factor serves for one step only."""

Report = Callable[[int, float, float], None]
Inspect = Callable[[NormalSystem, State, NormalEquations, Estimator, int, bool], bool]
"""Asked before the first step (iteration 0) and after every one, whether to stop; the last argument tells that a pivot
has nearly vanished."""
INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class SolveOptions:
    """When to stop: after `max_iterations`, or when the next step changes no unknown by STEP_TOLERANCE of its σ.

    robust : a key of `robust.STAGES`; each of its stages has `max_iterations`.
    report : called after every iteration with (iteration, cost, damping), for progress.
    inspect : may stop the adjustment, whose status is `INTERRUPTED` then.
    """

    max_iterations: int = 30
    robust: str = "off"
    report: Report | None = None
    inspect: Inspect | None = None


@dataclass(frozen=True, eq=False)
class Solution:
    """Where `minimise` ended: values, equations and estimator there, and how it went.

    status : 'converged', 'not converged', 'rank deficient', or 'interrupted' where `SolveOptions.inspect` wanted it.
    costs : Σρ at the start and after every iteration of the last stage.
    defects : sentences naming what the observations leave free, when rank deficient.
    """

    status: str
    state: State
    equations: NormalEquations
    estimator: Estimator
    iterations: int
    costs: tuple[float, ...] = ()
    defects: tuple[str, ...] = ()


@dataclass(frozen=True)
class Stage:
    """One estimator on the way: its name, the iterations before it, and how still it has to stand at its end."""

    name: str
    done: int = 0
    step_tolerance: float = ROBUST_STEP_TOLERANCE

    @property
    def is_robust(self) -> bool:
        return self.name != "off"


def minimise(system: NormalSystem, state: State, redundancy: int, options: SolveOptions) -> Solution:
    """Minimise Σρ over all unknowns, through the stages of the robust estimator.

    Parameters
    ----------
    system : assembles and solves. state : start values.
    redundancy : of the adjustment, for σ̂0 in the stopping rule.

    Returns
    -------
    Solution
        Its equations are assembled, undamped, at its state.
    """
    *early, last = STAGES[options.robust]
    done = 0
    for name in early:
        solution = _descend(system, state, redundancy, options, Stage(name, done, EARLY_STEP_TOLERANCE))
        if solution.defects or solution.status == INTERRUPTED:
            return solution
        state, done = solution.state, solution.iterations
    return _descend(system, state, redundancy, options, Stage(last, done))


def _descend(system: NormalSystem, state: State, redundancy: int, options: SolveOptions, stage: Stage) -> Solution:
    """Gauss-Newton with the estimator of one stage."""
    equations = system.assemble(state, 0.0, LEAST_SQUARES)
    estimator, equations = _estimated(system, state, equations, LEAST_SQUARES, stage.name, redundancy)
    costs = [equations.cost]
    damping, scale_changes, last_decrement = Damping(), 0, np.inf
    secants: Secants | None = None
    iteration, last_iteration = stage.done, stage.done + options.max_iterations
    while iteration < last_iteration:
        iteration += 1
        step = _step(system, state, equations, estimator, damping.value, secants)
        if iteration == 1:
            refused, factor = _refused(system, state, equations, estimator, options, step)
            if refused is not None:
                return replace(refused, costs=tuple(costs))
            step = replace(step, factor=factor) if step and factor else step
        step, damping = _until_better(system, state, equations, estimator, step, damping, secants)
        if step is None:
            return Solution("not converged", state, equations, estimator, iteration, tuple(costs))
        plain = damping.value == 0.0 and (secants is not None or not step.points_settled)
        secants, stage = _heeding(secants, stage, step, equations, damping)
        if stage.is_robust and plain and secants is None:
            step = _stretched(system, state, step, estimator, last_decrement)
        settled = plain and _settled(equations, step, redundancy, stage, last_decrement)
        last_decrement = step.decrement if plain else np.inf
        damping = damping.lowered(step.gain_ratio(equations), secants is not None)
        within_scatter = abs(step.decrement) <= step.equations.cost and not step.is_suspect
        state, equations = step.state, step.equations
        costs.append(equations.cost)
        if options.report:
            options.report(iteration, equations.cost, damping.value)
        if estimator.is_robust and scale_changes < MAX_SCALE_CHANGES:
            fresh, again = _estimated(system, state, equations, estimator, stage.name, redundancy)
            if fresh is not estimator:
                estimator, equations, settled, last_decrement = fresh, again, False, np.inf
                secants = Secants() if secants is not None else None
                scale_changes += 1
        if settled:
            return Solution("converged", state, equations, estimator, iteration, tuple(costs))
        if options.inspect is not None and options.inspect(
            system, state, equations, estimator, iteration - stage.done, False
        ):
            return Solution(INTERRUPTED, state, equations, estimator, iteration, tuple(costs))
        if plain and not stage.is_robust and within_scatter:
            followed = _followed(system, step, redundancy, range(iteration + 1, last_iteration + 1), options.report)
            state, equations, last_decrement = followed.state, followed.equations, followed.decrement
            iteration += len(followed.costs)
            costs += followed.costs
            if followed.settled:
                return Solution("converged", state, equations, estimator, iteration, tuple(costs))
    return Solution("not converged", state, equations, estimator, last_iteration, tuple(costs))


def _heeding(
    secants: Secants | None, stage: Stage, step: _Trial, before: NormalEquations, damping: Damping
) -> tuple[Secants | None, Stage]:
    """What the steps told about the curvature, this one included: from when a robust step had to be damped."""
    if secants is not None:
        secants.learn(step.reduced, before.right, step.equations.right)
        return secants, stage
    if not (stage.is_robust and damping.value > 0.0):
        return None, stage
    # before this step the right side was not that of points at their minimum: nothing to learn from yet
    return Secants(), replace(stage, step_tolerance=max(stage.step_tolerance, BENT_STEP_TOLERANCE))


def _refused(
    system: NormalSystem, state: State, equations: NormalEquations, estimator: Estimator, options: SolveOptions,
    step: _Trial | None,
) -> tuple[Solution | None, Factor | None]:  # fmt: skip
    """What ends an adjustment before its first step: what it was asked for, or a rank defect; None where nothing.

    Returns
    -------
    The solution that ends it, and the factor of the equations, valid until the next one.
    """
    factor = step.factor if step is not None else None
    suspect = factor is None or is_suspect(factor, equations)
    if options.inspect is not None and options.inspect(system, state, equations, estimator, 0, suspect):
        return Solution(INTERRUPTED, state, equations, estimator, 0), None
    # who inspects something suspect factorises
    known = None if suspect else factor
    factor, defects = checked_factor(system, state, equations, estimator, known, suspect)
    if defects:
        return Solution("rank deficient", state, equations, estimator, 0, (), tuple(defects)), None
    return None, factor


@dataclass(frozen=True)
class Damping:
    """Levenberg's λ: none until a step fails, then led by how well the steps keep their promise.

    [L: Nielsen, Damping parameter in Marquardt's method, 1999]
    """

    value: float = 0.0
    growth: float = 10.0
    first: float = FIRST_DAMPING

    def raised(self) -> Damping:
        """After a step that failed."""
        value = max(self.first, self.value * self.growth)
        return Damping(value, 2.0 * self.growth if self.value else 10.0, self.first)

    def lowered(self, gain_ratio: float, heeds_curvature: bool) -> Damping:
        """After a step that improved; gain_ratio is the gain over the gain promised.

        Where the curvature is heeded, slight damping is none, and the one that was enough is the first to be tried
        should the next step fail.
        """
        value = self.value * max(0.1, 1.0 - (2.0 * gain_ratio - 1.0) ** 3)
        if heeds_curvature and 0.0 < value <= SLIGHT_DAMPING:
            return Damping(first=max(10.0 * value, SLIGHT_DAMPING))
        return Damping(value if value > NO_DAMPING else 0.0, first=self.first)


@dataclass(frozen=True, eq=False)
class _Trial:
    """A step that was tried: the state it leads to, the equations there, and the decrement it promised."""

    state: State
    equations: NormalEquations
    decrement: float
    factor: Factor
    move: Step
    points_settled: bool = False

    @property
    def is_suspect(self) -> bool:
        return self.factor.smallest_pivot < SUSPECT_PIVOT

    @property
    def reduced(self) -> np.ndarray:
        """(6·n + s,) the step of photographs and shared parameters."""
        return np.concatenate([self.move.images.ravel(), self.move.shared])

    def improves(self, before: NormalEquations) -> bool:
        # at the minimum the cost stands still within rounding
        return bool(np.isfinite(self.equations.cost)) and self.equations.cost <= before.cost * (1.0 + COST_TOLERANCE)

    def keeps_promise(self, before: NormalEquations) -> bool:
        """Whether it gains at least a share of what photographs and shared parameters promised, within rounding."""
        gain, promised = before.cost - self.equations.cost, float(self.reduced @ before.right)
        return self.improves(before) and gain >= LEAST_GAIN * promised - COST_TOLERANCE * before.cost

    def gain_ratio(self, before: NormalEquations) -> float:
        return min((before.cost - self.equations.cost) / max(self.decrement, 1e-300), 1.0)


def _until_better(
    system: NormalSystem, state: State, equations: NormalEquations, estimator: Estimator, step: _Trial | None,
    damping: Damping, secants: Secants | None,
) -> tuple[_Trial | None, Damping]:  # fmt: skip
    """The step, damped more and more until it improves; None where none does."""
    if step is not None and secants is not None and damping.value == 0.0:
        step = _trustworthy(system, state, equations, estimator, step, secants)
    while step is None or not step.improves(equations):
        if step is not None and secants is None:
            step = _with_settled_points(system, step, estimator)
            if step.improves(equations):
                break
        damping = damping.raised()
        if damping.value > LAST_DAMPING:
            return None, damping
        step = _step(system, state, equations, estimator, damping.value, secants)
    return step, damping


def _trustworthy(
    system: NormalSystem, state: State, equations: NormalEquations, estimator: Estimator, step: _Trial,
    secants: Secants,
) -> _Trial | None:  # fmt: skip
    """An undamped step that keeps enough of its promise; None where it has to be damped.

    One that does not is taken anew, first with what it told itself about the curvature, then with the normal matrix
    alone.
    """
    tried: _Trial | None = step
    learns = len(secants) > 0 and step.gain_ratio(equations) > FAR_OFF
    if not step.keeps_promise(equations) and learns:
        secants.learn(step.reduced, equations.right, step.equations.right)
        tried = _trial(system, state, equations, step.factor, estimator, 0.0, secants)
    if (tried is None or not tried.keeps_promise(equations)) and len(secants):
        secants.forget()
        tried = _trial(system, state, equations, step.factor, estimator, 0.0, secants)
    return tried if tried is not None and tried.keeps_promise(equations) else None


def _step(
    system: NormalSystem, state: State, equations: NormalEquations, estimator: Estimator, damping: float,
    secants: Secants | None,
) -> _Trial | None:  # fmt: skip
    """Solve for a step and go there; None where the equations are singular."""
    damped = equations if damping == 0.0 else system.assemble(state, damping, estimator)
    try:
        factor = system.factorise(damped)
    except NotPositiveDefiniteError:
        return None
    return _trial(system, state, damped, factor, estimator, damping, secants)


def _trial(
    system: NormalSystem, state: State, damped: NormalEquations, factor: Factor, estimator: Estimator, damping: float,
    secants: Secants | None,
) -> _Trial | None:  # fmt: skip
    """The step by this factor; with secants an undamped one heeds them, and the points are led to their minimum."""
    x = secants.solve(factor, damped.right) if secants is not None and damping == 0.0 else factor.solve(damped.right)
    decrement = float(x @ damped.right) + damped.point_decrement
    move = _whole_step(system, state, x, estimator, damping)
    if move is None:
        return None
    there = system.unknowns.advance(state, move)
    if secants is not None:
        there = system.settle_points(there, estimator)
    return _Trial(there, system.assemble(there, 0.0, estimator), decrement, factor, move, secants is not None)


def _whole_step(
    system: NormalSystem, state: State, x: np.ndarray, estimator: Estimator, damping: float
) -> Step | None:
    """The step of all unknowns from the solution x of the reduced equations; None where it is not a number."""
    move = system.back_substitute(state, x, damping, estimator)
    free = system.unknowns.block.settings.adjustment.is_free
    if free and system.unknowns.motions.count:
        move = without_motion(system.unknowns, state, move)
    finite = all(np.isfinite(part).all() for part in (move.images, move.shared, move.points))
    return move if finite else None


@dataclass(frozen=True, eq=False)
class _Followed:
    """Where the steps with an old factor led: equations there, decrement of the last, cost after each."""

    state: State
    equations: NormalEquations
    decrement: float
    costs: tuple[float, ...] = ()
    settled: bool = False


def _followed(
    system: NormalSystem, first: _Trial, redundancy: int, numbers: range, report: Report | None
) -> _Followed:
    """Steps of least squares with the factor of the step before, as long as each is a tenth of the last or less.

    After a step within the scatter of the unknowns the matrix hardly changes any more [L: the chord method, Kelley,
    Iterative methods for linear and nonlinear equations, 1995, 5.4]; right side and back substitution are a third of
    the work of a step with a factor of its own.
    """
    state, decrement, costs, settled = first.state, first.decrement, [], False
    side: RightSide = first.equations
    for iteration in numbers:
        x = first.factor.solve(side.right)
        next_decrement = abs(float(x @ side.right) + side.point_decrement)
        contraction = next_decrement / max(abs(decrement), 1e-300)
        move = _whole_step(system, state, x, LEAST_SQUARES, 0.0) if contraction <= SLOWEST_CONTRACTION else None
        if move is None:
            break
        settled = _is_negligible(next_decrement * SLOWEST_CONTRACTION, side.cost, redundancy)
        there = system.unknowns.advance(state, move)
        side = system.assemble(there, 0.0, LEAST_SQUARES) if settled else system.right_side(there, LEAST_SQUARES)
        if not side.cost <= (costs[-1] if costs else first.equations.cost) * (1.0 + COST_TOLERANCE):
            settled = False
            break
        state, decrement = there, next_decrement
        costs.append(side.cost)
        if report:
            report(iteration, side.cost, 0.0)
        if settled:
            break
    if not costs:
        return _Followed(first.state, first.equations, first.decrement)
    equations = side if settled and isinstance(side, NormalEquations) else system.assemble(state, 0.0, LEAST_SQUARES)
    return _Followed(state, equations, decrement, tuple(costs), settled)


def _stretched(system: NormalSystem, state: State, step: _Trial, estimator: Estimator, last_decrement: float) -> _Trial:
    """A step of re-weighting, lengthened to where its slow contraction would lead it, if that is further down.

    Steps that shrink by a factor ρ each sum up to 1/(1 − ρ) of the first (Aitken).
    """
    ratio = np.sqrt(abs(step.decrement) / last_decrement) if 0.0 < last_decrement < np.inf else 0.0
    if not LEAST_RATIO < ratio < 1.0:
        return step
    factor = min(1.0 / (1.0 - ratio), LONGEST_STRETCH)
    move = Step(factor * step.move.images, factor * step.move.shared, factor * step.move.points)
    there = system.unknowns.advance(state, move)
    equations = system.assemble(there, 0.0, estimator)
    return replace(step, state=there, equations=equations) if equations.cost < step.equations.cost else step


def _with_settled_points(system: NormalSystem, step: _Trial, estimator: Estimator) -> _Trial:
    """A step too long for some points (weak rays, gross errors), with these led back to their own minimum."""
    state = system.settle_points(step.state, estimator)
    return replace(step, state=state, equations=system.assemble(state, 0.0, estimator), points_settled=True)


def _settled(equations, step: _Trial, redundancy: int, stage: Stage, last_decrement: float) -> bool:
    """The next step would change no unknown by STEP_TOLERANCE of its σ: |dx_i|/σ_i ≤ √(dxᵀN dx)/σ̂0 for all i.

    The decrement dxᵀN dx of the next step is foretold from how the last pair of undamped steps contracted, by no more
    than SURE_CONTRACTION: the first steps contract faster than the last.

    Re-weighting converges linearly, and a point whose two rays contradict each other creeps along a flat valley for
    ever: robust, the orientations and shared parameters have to stand within the stage's tolerance, and the cost.
    """
    if stage.is_robust:
        variance = max(step.equations.cost, 1e-30) / max(redundancy, 1)
        still = abs(equations.cost - step.equations.cost) <= ROBUST_COST_TOLERANCE * equations.cost
        return still and step.decrement - equations.point_decrement <= stage.step_tolerance**2 * variance
    contraction = min(1.0, max(SURE_CONTRACTION, abs(step.decrement) / last_decrement))
    if not np.isfinite(last_decrement):
        contraction = 1.0
    return _is_negligible(abs(step.decrement) * contraction, step.equations.cost, redundancy)


def _is_negligible(decrement: float, cost: float, redundancy: int) -> bool:
    """Whether a step of this decrement changes no unknown by STEP_TOLERANCE of its σ, or drowns in rounding."""
    return decrement <= STEP_TOLERANCE**2 * max(cost, 1e-30) / max(redundancy, 1) or decrement <= 1e-13 * cost


def _estimated(
    system: NormalSystem, state: State, equations: NormalEquations, estimator: Estimator, name: str, redundancy: int
) -> tuple[Estimator, NormalEquations]:
    """The estimator for the residuals at `state`, and the equations with its weights; the same ones if it stands."""
    rays = system.unknowns.rays
    share = redundancy / max(redundancy + system.unknowns.count, 1)
    fresh = estimator_for(name, normalised_lengths(equations.residual, rays.inv_sigma), share)
    if fresh.is_near(estimator):
        return estimator, equations
    return fresh, system.assemble(state, 0.0, fresh)
