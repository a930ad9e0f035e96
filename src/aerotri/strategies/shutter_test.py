"""Whether a block needs a rolling shutter, or an affinity of the camera explains the image points as well.

[L: Bruno and Forlani 2023] In straight level flight v·T is to first order an affinity and shear of the image, b1 and b2
of Brown, and the block has a hard time to tell them apart. So it is adjusted four times with the same rays: without a
rolling shutter, with b1 and b2 instead, with the rolling shutter, with both. BIC of the image points judges, and the
readout time over its σ beside b1 and b2; control points predicted without themselves and check points stand beside. The
total σ of the readout time tells whether errors that groups of photographs share could be the cause.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri import of_known
from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.carry_over import start_values_at, with_shared
from aerotri.adjustment.defects import checked_factor
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.scanning import KIND, READOUT
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import State, Unknowns
from aerotri.conventions import InputError
from aerotri.observations import Block
from aerotri.results.adjustment import Adjustment
from aerotri.results.parameter_comparison import Accuracy
from aerotri.results.rolling_shutter import NEEDED, NOT_NEEDED, NOT_TOLD_APART, SHARED_ERRORS, ShutterTest, Variant
from aerotri.statistics.summarise import count_observations, effective_redundancy, weighted_sum
from aerotri.strategies.control_prediction import predict_control
from aerotri.strategies.parameter_choice import reduction

NONE, AFFINITY, ROLLING, BOTH = "none", "affinity", "rolling shutter", "both"
SIGNIFICANT_T = 3.29
"""|T|/σ from which a readout time counts as significant: 99.9 % of the normal distribution, two-sided [L]."""
BIC_MARGIN = 10.0
"""Difference of BIC that counts as very strong evidence [L: Kass and Raftery 1995]."""
FOLDS = 10
FEWEST_POINTS = 4
"""Control points below which their prediction says nothing [C]."""
BROWN = "brown"
TERMS = ("b1", "b2")


@dataclass(frozen=True, eq=False)
class _Outcome:
    """A variant with what is compared further: differences (k, 3) m at points that took no part, heights (P,) m."""

    variant: Variant
    difference: np.ndarray
    height: np.ndarray


def asks_for_test(block: Block) -> bool:
    """Whether a camera has a readout time to be estimated and tested."""
    shutters = [camera.rolling_shutter for camera in block.cameras]
    return any(s is not None and s.test == "on" and not s.readout_ms.fixed for s in shutters)


def tested_shutter(found: Adjustment, options: SolveOptions) -> ShutterTest | None:
    """The four variants, each from where the adjustment stands; None where it has no readout time as an unknown."""
    u = found.system.unknowns
    if u.scanning is None or READOUT not in u.shared.names:
        return None
    variants = (NONE, AFFINITY, ROLLING, BOTH)
    outcomes = {name: _adjusted(found, _as_variant(u.block, name), name, options) for name in variants}
    plain, rolling = outcomes[NONE], outcomes[ROLLING]
    sigma = of_known.median(found.local.points.sigma[:, 2])
    gain, error = _gain(rolling, plain)
    parameters = found.local.parameters
    own = parameters.names == READOUT
    total_t = float(np.max(np.abs(parameters.value[own]) / parameters.total_sigma[own]))
    return ShutterTest(
        verdict=_verdict({name: one.variant for name, one in outcomes.items()}, total_t),
        variants=tuple(one.variant for one in outcomes.values()),
        height_change_m=_beside_a_plane(found.local.points.xyz[u.points], rolling.height - plain.height),
        height_sigma_m=sigma,
        gain=gain,
        gain_error=error,
        total_t=total_t,
    )


def _gain(outcome: _Outcome, against: _Outcome) -> tuple[float, float]:
    """How much smaller errors at points that took no part are, 1 − ratio, and its standard error."""
    if min(len(outcome.difference), len(against.difference)) < FEWEST_POINTS:
        return float("nan"), float("nan")
    return reduction(outcome.difference, against.difference)


def _verdict(variants: dict[str, Variant], total_t: float) -> str:
    """What speaks for the rolling shutter: its readout time over σ and total σ, and BIC against an affinity."""
    rolling, both, affinity = variants[ROLLING], variants[BOTH], variants[AFFINITY]
    if not rolling.readout_t > SIGNIFICANT_T:
        return NOT_NEEDED
    if not total_t > SIGNIFICANT_T:
        return SHARED_ERRORS
    if affinity.status != "converged":
        return NEEDED
    beside = both.status == "converged" and both.readout_t > SIGNIFICANT_T and both.bic < affinity.bic - BIC_MARGIN
    return NEEDED if beside or rolling.bic < affinity.bic - BIC_MARGIN else NOT_TOLD_APART


def _as_variant(block: Block, name: str) -> Block:
    """The block with the parameters of a variant."""
    adjustment = block.settings.adjustment
    cameras = block.cameras
    if name in (NONE, AFFINITY):
        cameras = tuple(replace(camera, rolling_shutter=None) for camera in cameras)
    if name in (AFFINITY, BOTH):
        chosen = dict(adjustment.additional_parameters)
        terms = chosen.get(BROWN, ())
        chosen[BROWN] = (*terms, *(term for term in TERMS if term not in terms))
        adjustment = replace(adjustment, additional_parameters=tuple(chosen.items()))
    return replace(block, cameras=cameras, settings=replace(block.settings, adjustment=adjustment))


def _adjusted(found: Adjustment, block: Block, name: str, options: SolveOptions) -> _Outcome:
    """A variant adjusted."""
    old, state = found.system.unknowns, found.solution.state
    row, axis = np.nonzero(old.point_held)
    held = list(zip(old.points[row].tolist(), axis.tolist(), strict=True)) if len(row) else None
    try:
        system, start = build_system(block, start_values_at(old, state), found.local.rays.status, held)
    except InputError as error:
        return _failed(name, error.message, len(old.points))
    begin = with_shared(system.unknowns, old, start, state)
    system, solution = minimise_at_adjusted(system, begin, count_observations(system).redundancy, options)
    if solution.defects or solution.status != "converged":
        return _failed(name, solution.status, len(old.points))
    factor, defects = checked_factor(system, solution.state, solution.equations, solution.estimator)
    if factor is None or defects:
        return _failed(name, "rank deficient", len(old.points))
    return _judged(name, system, solution, factor)


def _failed(name: str, status: str, points: int) -> _Outcome:
    nan = float("nan")
    nothing = (nan, nan, nan)
    return _Outcome(Variant(name, status, nan, nan, nan, nothing, nothing), np.zeros((0, 3)), np.full(points, nan))


def _judged(name: str, system: NormalSystem, solution: Solution, factor: Factor) -> _Outcome:
    u, state = system.unknowns, solution.state
    freedom = effective_redundancy(system, solution)
    sigma0 = float(np.sqrt(weighted_sum(system, solution) / freedom)) if freedom > 0.0 else float("nan")
    inverse = factor.border_inverse()
    own = [k for k, label in enumerate(u.shared.names) if label == READOUT]
    t = [abs(state.shared[k]) / (sigma0 * np.sqrt(inverse[k, k])) for k in own]
    predicted = predict_control(system, solution, factor, sigma0, FOLDS).difference
    check = _check_differences(u, state)
    variant = Variant(
        name=name,
        status="converged",
        sigma0=sigma0,
        bic=_bic(system, solution, inverse),
        readout_t=float(max(t, default=float("nan"))),
        control_rms=_rms(predicted),
        check_rms=_rms(check),
    )
    return _Outcome(variant, np.concatenate([predicted, check]), state.points[:, 2])


def _bic(system: NormalSystem, solution: Solution, inverse: np.ndarray) -> float:
    """r·ln(Ω/r) + k·ln r over image errors and motions, as `parameter_comparison` has it.

    An unknown that is observed beforehand counts by the share that the block determines, 1 − Q·W; Ω is without what
    these observations add.
    """
    u, state = system.unknowns, solution.state
    own = np.array([k for k, kind in enumerate(u.shared.kinds) if kind in ("additional", KIND)], dtype=np.int64)
    weight = system.priors.weight[own]
    counted = float(np.sum(1.0 - np.diagonal(inverse)[own] * weight))
    pull = weight * (system.priors.value[own] - state.shared[own]) ** 2
    r = count_observations(system).redundancy + len(own) - int((weight > 0.0).sum())
    omega = solution.equations.cost - float(pull.sum())
    if r <= 0 or omega <= 0.0:
        return float("nan")
    return r * float(np.log(omega / r)) + counted * float(np.log(r))


def _check_differences(unknowns: Unknowns, state: State) -> np.ndarray:
    """(k, 3) m, adjusted − given at check points."""
    block = unknowns.block
    row = np.full(len(block.points), -1)
    row[unknowns.points] = np.arange(len(unknowns.points))
    given = np.flatnonzero(block.control.is_check & (row[block.control.point] >= 0))
    return state.points[row[block.control.point[given]]] + unknowns.origin - block.control.xyz[given]


def _rms(difference: np.ndarray) -> tuple[float, float, float]:
    x, y, z = Accuracy.of(difference).rms.tolist()
    return x, y, z


def _beside_a_plane(xyz: np.ndarray, change: np.ndarray) -> float:
    """Root mean square of changes of height (P,) m at points (P, 3) m, less the plane that fits them best."""
    known = np.isfinite(change) & np.isfinite(xyz).all(axis=1)
    if int(known.sum()) < 4:
        return float("nan")
    at = xyz[known, :2] - xyz[known, :2].mean(axis=0)
    design = np.column_stack([np.ones(len(at)), at / max(float(np.abs(at).max()), 1e-12)])
    left = change[known] - design @ np.linalg.lstsq(design, change[known], rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))
