"""Data snooping: gross errors found one at a time, the largest first, with a new adjustment after each.

[L: Baarda 1968; Kok 1984] Every observation is tested by w at the level `alpha` of the block. What chooses among those
beyond the limit is the joint test T of the coordinates of a ray, of a control point, of a position or attitude: T² is
what vᵀPv loses when it is taken out.

**One at a time** is kept where removals influence one another, and shortened where they do not [C]. An error in an
observation shifts another's w by no more than their correlation times its own w. Within a point this is much, so a
point loses one ray a round, the one with the largest T. Rays of one photograph are correlated by a few tenths at most:
a round removes, beside the largest, those that are largest in their points and have at least half the T of the largest
in their photograph. Of control points, positions and attitudes, which act through the whole block, a round takes out a
single one, and only when it is the largest in all photographs that see it: a wrong control point is thus told apart
from wrong rays, and its rays, each tested on its own, stay.

**Nothing is final**: what is switched off is predicted by the others and tested like them (`switched_tests`). When no
test is beyond its limit any more, what has become inconspicuous is switched on again: a ray once, control for good.

**Not separable** [D]: when vᵀPv decides between two rays of a point by less than 3 (odds of 4.5 to 1), both go; in a
point of two rays it always is so. A point left without enough rays drops out, its last ray with the status 'one ray'.

**The limit** [C] is z(1 − α/2), times the spread of all w (from their median, so that gross errors do not count) where
this is above 1: a σ given too small does not make gross errors of good rays. Where the camera leaves systematic errors,
the spread is that of the cell of the format, if it is significantly larger still. What holds the datum (control,
positions, attitudes) is listed beyond the limit, but switched off only beyond δ0: when the error is larger than its own
∇0l. Control points between which vᵀPv does not decide all stay, and are named. A photograph with few rays keeps its
last six; one with more, of which no more than six are left, is left out.

Errors far beyond what is linear (T above 1000) would spoil the start: then a Huber adjustment goes first, and rays
beyond ten times its robust σ are switched off to begin with.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.carry_over import reference_state, with_shared
from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.robust import LIMITS, normalised_lengths
from aerotri.adjustment.solve import Solution, SolveOptions, minimise
from aerotri.adjustment.sparse_cholesky import NotPositiveDefiniteError
from aerotri.adjustment.unknowns import State
from aerotri.conventions import counted
from aerotri.results.adjusted_block import Blunder
from aerotri.statistics.summarise import count_observations
from aerotri.strategies.removal import Found, blunders_of, with_tests_of, without_removed
from aerotri.strategies.suspects import limits_of, to_remove, to_return
from aerotri.strategies.switched_tests import AllTests, Switches, participants, ray_points, switched_system, test_all

GROSS, GROSS_LIMIT = 1000.0, 10.0
"""Joint test T beyond which the start is taken to be spoilt, and robust σ beyond which rays then are off to begin with
[C]: below, steps stay linear and the tests find the errors; lower limits would take away good rays."""
MOST_ROUNDS = 200
"""Rounds of removal [C]: each takes one ray of a point and more, so that a block with so many is not mended by tests;
the bound ends an endless search."""
WORTH_SAYING = 1.25
"""Spread of w from which a message says that the σ are too small [C]: a quarter more changes what is rejected, less is
usual."""
WEAKENED = 0.01
"""Share of its smallest pivot that the factor may lose before something is taken to be no longer determined."""


@dataclass(frozen=True, eq=False)
class Snooped:
    """What data snooping led to.

    Parameters
    ----------
    prepared : the block without what was removed; its state has the points where they were before any adjustment.
    solution : the adjustment of it. blunders : what was removed, largest |w| first.
    """

    prepared: Prepared
    solution: Solution
    blunders: tuple[Blunder, ...]


@dataclass(frozen=True, eq=False)
class _Stand:
    """Where the search stands: switches, the state adjusted with them, the tests there, iterations so far.

    frozen : what must stay: without it something is not determined, or it was judged without itself and taken back.
    returned : what was switched on again.
    found : the last tests of what was taken out.
    """

    switches: Switches
    state: State
    tests: AllTests
    iterations: int
    frozen: Switches
    returned: Switches
    found: Found


def snoop(prepared: Prepared, solution: Solution, options: SolveOptions, one_at_a_time: bool = False) -> Snooped:
    """Remove gross errors from an adjustment.

    Parameters
    ----------
    solution : of `prepared`, without robust weights.
    options : of the adjustments; its report goes on counting.
    one_at_a_time : take out a single observation in every round, be the others ever so far away from it.
    """
    system = prepared.system
    try:
        stand = _start(prepared, solution, options)
    except NotPositiveDefiniteError:
        # what is not determined is named where the result is factorised
        return Snooped(prepared, solution, ())
    for _ in range(10 * len(system.unknowns.rays.image) if one_at_a_time else MOST_ROUNDS):
        off = to_remove(system, stand.tests, stand.switches, stand.frozen, one_at_a_time)
        if off.any():
            stand = _switched(prepared, stand, off, False, options)
            continue
        back = to_return(system, stand.tests, stand.switches, stand.returned)
        if not back.any():
            break
        stand = _switched(prepared, stand, back, True, options)
    if not stand.switches.off().any():
        return Snooped(prepared, solution, ())
    return _finished(prepared, stand, options)


def _start(prepared: Prepared, solution: Solution, options: SolveOptions) -> _Stand:
    """The first solution with its tests, or a robust one where errors are too gross for it."""
    system = prepared.system
    switches, none = Switches.all_on(system), Switches.none_of(system)
    tests = test_all(system, system, solution, switches)
    stand = _Stand(switches, solution.state, tests, solution.iterations, none, none, {})
    if solution.status == "converged" and tests.rays.joint.max(initial=0.0) <= GROSS:
        return stand
    redundancy = count_observations(system).redundancy
    robust = minimise(system, prepared.state, redundancy, replace(options.after(stand.iterations), robust="huber"))
    stand = replace(stand, state=robust.state, iterations=stand.iterations + robust.iterations)
    return _switched(prepared, stand, _far_off(prepared, robust), False, options, whole=True)


def _far_off(prepared: Prepared, robust: Solution) -> Switches:
    """Rays far beyond a robust solution; points that would keep too few to tell, and blamed control, are left to tests.

    Where most rays of a control point are far off, it is its coordinates that are switched off.
    """
    u = prepared.system.unknowns
    point, count = ray_points(u), len(u.points)
    length = normalised_lengths(robust.equations.residual, u.rays.inv_sigma)
    off = length > GROSS_LIMIT * robust.estimator.limit / LIMITS["huber"]
    left, all_rays = np.bincount(point[~off], minlength=count), np.bincount(point, minlength=count)
    blamed = (u.prior_weight > 0.0).any(axis=1) & (left < 0.5 * all_rays)
    off &= ~((left < 3) | blamed)[point]
    return replace(Switches.none_of(prepared.system), rays=off, control=blamed)


def _switched(
    prepared: Prepared, stand: _Stand, which: Switches, on: bool, options: SolveOptions, whole: bool = False
) -> _Stand:
    """Switched on or off, adjusted by one iteration (`whole`: to the end) and tested; what cannot go stays as it is."""
    system = prepared.system
    switches = stand.switches.with_again(which) if on else stand.switches.without(which)
    found, returned, frozen = stand.found, stand.returned, stand.frozen
    if on:
        returned = returned.with_again(which)
        frozen = frozen.with_again(replace(which, rays=np.zeros_like(which.rays)))
    else:
        found = with_tests_of(found, which, stand.tests)
    gone = 2 * int((~participants(system.unknowns, switches).rays).sum())
    redundancy = max(count_observations(system).redundancy - gone, 1)
    counting = replace(_unweighted(options, stand.iterations), max_iterations=options.max_iterations if whole else 1)
    switched = switched_system(system, switches)
    try:
        solution = minimise(switched, stand.state, redundancy, counting)
        if solution.defects:
            raise NotPositiveDefiniteError
        tests = test_all(system, switched, solution, switches)
        if tests.smallest_pivot < WEAKENED * stand.tests.smallest_pivot:
            raise NotPositiveDefiniteError
    except NotPositiveDefiniteError:
        return replace(stand, frozen=frozen.with_again(which), returned=returned)
    iterations = stand.iterations + solution.iterations
    return _Stand(switches, solution.state, tests, iterations, frozen, returned, found)


def _unweighted(options: SolveOptions, done: int) -> SolveOptions:
    """The options without robust weights, counting on from the iterations done."""
    return replace(options.after(done), robust="off")


def _finished(prepared: Prepared, stand: _Stand, options: SolveOptions) -> Snooped:
    """The block without what was removed, adjusted to the end."""
    old = prepared.system.unknowns
    gone = stand.switches.off()
    blunders = blunders_of(prepared.system, gone, with_tests_of(stand.found, gone, stand.tests))
    left = without_removed(prepared, stand.state, stand.switches)
    new = left.system.unknowns
    start = with_shared(new, old, left.state, stand.state)
    redundancy = count_observations(left.system).redundancy
    system, solution = minimise_at_adjusted(left.system, start, redundancy, _unweighted(options, stand.iterations))
    left = replace(left, system=system)
    solution = replace(solution, iterations=stand.iterations + solution.iterations)
    warnings = (*prepared.warnings, *_in_words(prepared, stand, blunders))
    state = reference_state(new, old, left.state, prepared.state)
    return Snooped(replace(left, state=state, warnings=warnings), solution, blunders)


def _in_words(prepared: Prepared, stand: _Stand, blunders: tuple[Blunder, ...]) -> list[str]:
    rays, said = sum(b.action == "removed" for b in blunders), []
    if rays:
        count = len(prepared.system.unknowns.rays.image)
        said.append(f"data snooping removed {rays} of {counted(count, 'ray')} as gross errors")
    for blunder in blunders:
        if blunder.action == "control removed":
            said.append(
                f"control point {blunder.point} contradicts the block (w {blunder.w:+.1f}, given value off by "
                f"{1e-3 * blunder.estimated_mm:+.3f} m) and was switched off as control; its rays stay"
            )
        elif blunder.action != "removed":
            what = blunder.action.removesuffix(" removed")
            said.append(f"the {what} of photograph {blunder.image} contradicts the block (w {blunder.w:+.1f}), removed")
    u = prepared.system.unknowns
    lost = u.images[~participants(u, stand.switches).images]
    for name in u.block.images.names[lost]:
        said.append(f"nearly all rays of photograph {name} contradict the block: it was left out")
    limits = limits_of(u, stand.tests, stand.switches)
    accused = u.points[stand.switches.control & (stand.tests.control.largest > limits.datum)]
    if len(accused):
        names = ", ".join(str(name) for name in u.block.points[accused])
        said.append(
            f"control contradicts the block at {names}, but there is too little control to tell which point is wrong: "
            "compare their coordinates and pointings with the field book"
        )
    if limits.spread > WORTH_SAYING:
        said.append(
            f"the residuals are {limits.spread:.2f} times as large as the a-priori σ: the limits of the tests were "
            "raised by that factor"
        )
    return said
