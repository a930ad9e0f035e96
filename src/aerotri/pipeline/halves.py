"""Two halves of a block adjusted apart and compared: the stages from a result to its record."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from aerotri.adjustment.ray_status import some_names
from aerotri.execution.work import Work, Workplace
from aerotri.image_errors.half_fields import field_differences
from aerotri.results.adjusted_block import AdjustedBlock, SharedParameters
from aerotri.results.adjustment import Adjustment
from aerotri.results.halves import (
    DIVISIONS,
    HalfSummary,
    HalvesComparison,
    HalvesRecord,
    ParameterDifference,
    PointDifference,
)
from aerotri.statistics.summarise import shared_parameters
from aerotri.strategies.half_adjustment import Half, HalfFailedError, Hold, Whole, adjust_half
from aerotri.strategies.half_covariance import HalfPair, shared_rows
from aerotri.strategies.half_points import (
    FEWEST_CELLS,
    FEWEST_POINTS,
    CellMeans,
    ComparedPoints,
    cells_in_plan,
    compare_points,
    mean_functions,
)
from aerotri.strategies.half_tests import agreement
from aerotri.strategies.halves_division import Division, divide, flight_of
from aerotri.strategies.selection import with_removed

Tell = Callable[[str, float], None]
"""Told what is being done, and the share (0 to 1) that is done."""
FEWEST_COMMON = FEWEST_CELLS * FEWEST_POINTS
"""Points in common that a comparison needs."""
HOLDS = (Hold(), Hold(interior=True), Hold(free_datum=True), Hold(True, True))
"""What is tried in turn: the settings of the result, and what helps where a half alone is too weak."""
BYTES_OF_PROCESS, BYTES_OF_RAY = 300_000_000, 6_000
"""Memory of a process that adjusts halves, without and by rays of the block; 357 MB were measured with 13 590 rays, the
second is chosen [C] above it."""
COMPARED = ("interior", "additional")
"""Kinds of shared parameters that belong to the camera, whatever the photographs are."""


def compare_halves(
    found: Adjustment,
    divisions: Sequence[str] = tuple(DIVISIONS),
    alpha: float | None = None,
    tell: Tell | None = None,
    at: Workplace | None = None,
) -> HalvesRecord:
    """Divide the photographs of a result, adjust both halves with its settings and compare them.

    Parameters
    ----------
    divisions : keys of `DIVISIONS`. alpha : of every test; that of the block where None.
    at : where the halves are adjusted, a task a division; in this process where None.

    Raises
    ------
    TasksFailedError
        When a division could not be computed elsewhere.
    """
    unknowns, state = found.system.unknowns, found.solution.state
    rays = found.local.rays
    whole = Whole(unknowns, state, np.asarray(rays.status), np.asarray(rays.weight))
    flight = flight_of(unknowns.block, unknowns.images, state.centre, state.rotation)
    settings = found.result.block.settings.adjustment
    level = settings.alpha if alpha is None else alpha
    divided = {how: divide(unknowns.block, flight, how) for how in divisions}
    same_as = _same_as(divided)
    own = [how for how in divisions if how not in same_as]
    shared = _Shared(found, whole, level)
    tasks = [(how, divided[how]) for how in own]
    compared = dict(zip(own, _in_turn(shared, tasks, tell) if at is None else _apart(shared, tasks, tell, at),
                        strict=True))  # fmt: skip
    out = [
        HalvesComparison(how, divided[how].names, same_as=same_as[how]) if how in same_as else compared[how]
        for how in divisions
    ]
    return HalvesRecord(str(found.result.block.name), tuple(out), level, settings.robust)


def compare_division(shared: _Shared, task: tuple[str, Division]) -> HalvesComparison:
    """A division by its key: adjusted and compared."""
    how, division = task
    return _compared(shared.found, shared.whole, division, how, shared.alpha)


@dataclass(frozen=True, eq=False)
class _Shared:
    """What all divisions are made of."""

    found: Adjustment
    whole: Whole
    alpha: float


def _in_turn(shared: _Shared, tasks: Sequence[tuple[str, Division]], tell: Tell | None) -> list[HalvesComparison]:
    out: list[HalvesComparison] = []
    for task in tasks:
        if tell is not None:
            tell(f"adjusting halves, {DIVISIONS[task[0]]}", len(out) / len(tasks))
        out.append(compare_division(shared, task))
    return out


def _apart(
    shared: _Shared, tasks: Sequence[tuple[str, Division]], tell: Tell | None, at: Workplace
) -> list[HalvesComparison]:
    if tell is not None:
        tell("adjusting halves", 0.0)
    work = Work(
        compare_division, shared, tasks, [f"halves by {DIVISIONS[how]}" for how, _ in tasks], "comparisons", at.folder,
        BYTES_OF_PROCESS + BYTES_OF_RAY * len(shared.whole.ray_status),
    )  # fmt: skip
    return at.executor.run(work, None if tell is None else lambda share: tell("adjusting halves", share))


def _same_as(divided: dict[str, Division]) -> dict[str, str]:
    """The first division with the same halves, for those that have one."""
    out: dict[str, str] = {}
    done: dict[str, np.ndarray] = {}
    for how, division in divided.items():
        same = [name for name, half in done.items() if _same_halves(half, division.half)]
        if same and not division.reason:
            out[how] = same[0]
        else:
            done[how] = division.half
    return out


def _same_halves(one: np.ndarray, two: np.ndarray) -> bool:
    return bool((one == two).all() or (one == np.where(two < 0, two, 1 - two)).all())


def _compared(found: Adjustment, whole: Whole, division: Division, how: str, alpha: float) -> HalvesComparison:
    """One division: adjusted and compared, or why that is not possible.

    [D] Where a half alone determines the interior orientation too weakly, both take it from the whole. Their difference
    does not correlate with what the whole estimates (it is the best linear estimate, the difference estimates 0), so
    that its variance is smaller than with an interior orientation known without error: the tests then find less, never
    too much. Where control does not hold each half, both are adjusted without it and compared in their shape.
    """
    if division.reason:
        return HalvesComparison(how, division.names, division.reason)
    is_free = found.local.block.settings.adjustment.datum != "control"
    said = ""
    for hold in HOLDS:
        if is_free and not hold.free_datum:
            continue
        try:
            pair = _pair(*(adjust_half(whole, division.half == k, division.half == 1 - k, hold) for k in (0, 1)))
        except HalfFailedError as failure:
            said = said or str(failure)
            continue
        if pair.n_points < FEWEST_COMMON:
            few = f"the halves have {pair.n_points} points in common, {FEWEST_COMMON} are needed"
            return HalvesComparison(how, division.names, few)
        # the same digits in turn, in processes and by Dask
        with threadpool_limits(1, "blas"):
            return _comparison(found, division, pair, how, hold, alpha)
    return HalvesComparison(how, division.names, f"one half cannot be adjusted alone: {said}")


def _pair(one: Half, two: Half) -> HalfPair:
    """The halves with the points that two photographs or more of each see."""
    rays = [np.diff(half.unknowns.rays.start) for half in (one, two)]
    rows = [np.flatnonzero(count >= 2) for count in rays]
    points = [half.unknowns.points[own] for half, own in zip((one, two), rows, strict=True)]
    _, i, j = np.intersect1d(points[0], points[1], return_indices=True)
    return HalfPair((one, two), shared_rows(one, two), (rows[0][i], rows[1][j]))


def _comparison(
    found: Adjustment, division: Division, pair: HalfPair, how: str, hold: Hold, alpha: float
) -> HalvesComparison:
    redundancy = sum(half.redundancy for half in pair.halves)
    variance = sum(half.vtpv for half in pair.halves) / redundancy
    compared = compare_points(pair, hold.free_datum)
    names = found.result.block.images.names
    summaries = tuple(
        HalfSummary(
            len(half.unknowns.images), len(half.unknowns.points), float(np.sqrt(half.vtpv / half.redundancy)),
            half.redundancy, tuple(names[half.loose].astype(str).tolist()),
        )
        for half in pair.halves
    )  # fmt: skip
    parameters, fields = _camera_differences(found, compared, variance, redundancy, alpha)
    return HalvesComparison(
        division=how,
        halves=division.names,
        summaries=summaries,
        transformed=compared.transformed,
        sigma0=float(np.sqrt(variance)),
        fields=fields,
        parameters=parameters,
        points=_point_difference(found, compared, variance, redundancy, alpha),
        notes=(*division.notes, *_notes(found, division, compared, hold)),
    )


def _notes(found: Adjustment, division: Division, compared: ComparedPoints, hold: Hold) -> tuple[str, ...]:
    names = found.result.block.images.names
    said = [
        f"{some_names(names[half.loose], 'photograph')} of {name} not tied to the others, left out"
        for half, name in zip(compared.pair.halves, division.names, strict=True)
        if len(half.loose)
    ]
    if hold.free_datum and found.local.block.settings.adjustment.datum == "control":
        said.append("control does not hold each half alone: both are adjusted without it")
    if hold.interior:
        said.append(
            "one half alone does not determine the interior orientation: both keep that of the result, and the σ of "
            "the differences are upper bounds"
        )
    if compared.transformed:
        said.append("the ground points of one half are first transformed onto those of the other (seven parameters)")
    return tuple(said)


def _camera_differences(found: Adjustment, compared: ComparedPoints, variance: float, redundancy: float, alpha: float):
    """Interior orientation and additional parameters that both halves have, and what they make of the image."""
    pair = compared.pair
    lists = [half.unknowns.shared for half in pair.halves]
    keys = [list(zip(shared.names, shared.groups, strict=True)) for shared in lists]
    rows = [[k for k, kind in enumerate(shared.kinds) if kind in COMPARED] for shared in lists]
    place = {keys[1][k]: k for k in rows[1]}
    one = np.array([k for k in rows[0] if keys[0][k] in place], dtype=np.int64)
    two = np.array([place[keys[0][k]] for k in one], dtype=np.int64)
    cross = compared.cofactors.shared[np.ix_(one, two)]
    cofactors = [half.q.shared[np.ix_(k, k)] for half, k in zip(pair.halves, (one, two), strict=True)]
    covariance = variance * (cofactors[0] + cofactors[1] - cross - cross.T)
    records = tuple(_with_parameters(found, half, [keys[0][k] for k in one]) for half in pair.halves)
    first, second = (np.asarray(record.parameters.value, dtype=float)[: len(one)] for record in records)
    sigma = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    shared = lists[0]
    names, groups = (np.array([column[k] for k in one], dtype=object) for column in (shared.names, shared.groups))
    own = np.array([shared.kinds[k] == "interior" for k in one], dtype=bool)
    interior = None
    if own.any():
        interior = agreement((first - second)[own], covariance[np.ix_(own, own)], redundancy, alpha)
    parameters = ParameterDifference(names, groups, first, second, sigma, interior)
    total = np.zeros((len(records[0].parameters),) * 2)
    total[: len(one), : len(one)] = covariance
    return parameters, field_differences((records[0], records[1]), total, redundancy, alpha)


def _with_parameters(found: Adjustment, half: Half, keys: list[tuple[str, str]]) -> AdjustedBlock:
    """The result with the parameters of a half, in the order of `keys` (name, group)."""
    all_of_half = shared_parameters(half.system, half.solution, half.q, 1.0)
    row = {key: k for k, key in enumerate(zip(all_of_half.names, all_of_half.groups, strict=True))}
    wanted = np.array([row[key] for key in keys], dtype=np.int64)
    columns = {
        name: getattr(all_of_half, name)[wanted]
        for name in ("names", "groups", "kinds", "marks", "value", "max_correlation", "max_correlation_with",
                     "total_correlation", "status", "reason")
    }  # fmt: skip
    chosen = SharedParameters(covariance=all_of_half.covariance[np.ix_(wanted, wanted)], **columns)
    removals = found.local.removals
    block = replace(found.local.block, cameras=half.unknowns.block.cameras)
    return replace(found.local, block=block, parameters=with_removed(chosen, removals))


def _point_difference(
    found: Adjustment, compared: ComparedPoints, variance: float, redundancy: float, alpha: float
) -> PointDifference:
    one = compared.pair.halves[0].unknowns
    point = one.points[compared.pair.rows[0]]
    turn = np.broadcast_to(np.eye(3), (len(point), 3, 3))
    if found.frame is not None:
        turn = found.frame.crs_per_local(found.local.points.xyz[point])
    xyz = found.result.points.xyz[point]
    cell, centre, size = cells_in_plan(xyz[:, :2])
    functions = mean_functions(compared, cell, turn)
    covariance = variance * compared.pair.cofactors_of(functions)
    mean = _means(functions, compared.difference)
    by_axis = np.arange(len(mean)) % 3
    tests = []
    for own in (by_axis < 2, by_axis == 2):
        tests.append(agreement(mean[own], covariance[np.ix_(own, own)], redundancy, alpha))
    of_points = turn @ (variance * compared.of_points) @ np.swapaxes(turn, 1, 2)
    return PointDifference(
        point=point,
        xyz=xyz,
        d=np.einsum("pij,pj->pi", turn, compared.difference),
        sigma=np.sqrt(np.maximum(np.einsum("pii->pi", of_points), 0.0)),
        cell=cell,
        centre=centre,
        size=size,
        count=np.bincount(cell[cell >= 0], minlength=len(centre)),
        mean=mean.reshape(-1, 3),
        mean_sigma=np.sqrt(np.maximum(np.diagonal(covariance), 0.0)).reshape(-1, 3),
        plan=tests[0],
        height=tests[1],
    )


def _means(functions: CellMeans, difference: np.ndarray) -> np.ndarray:
    """(3·k,) the functions of differences that are transformed already."""
    return replace(functions, motions=None, solver=None).of(difference[:, :, None])[:, 0]
