"""How far another set of additional parameters, which the choice could not tell from the one taken, moves the object.

[L: Hoeting, Madigan, Raftery and Volinsky 1999, model averaging] Of two sets A and B, of which B is the better one with
the probability w, the unknowns x_A have the mean square error

    (1 − w)·Σ_A + w·(Σ_B + d·dᵀ),   d = x_B − x_A.

[D] Where A is right, d has the covariance Σ_B − Σ_A if A is contained in B: of the squares of d only what exceeds the
difference of the variances speaks of more than noise. So w·s·d·dᵀ counts beside the covariance of the set taken, s the
share that the variances leave unexplained, over all points, where d is larger than σ. d is a column of the model part:
whatever follows from the unknowns has its share of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.adjusted_positions import minimise_at_adjusted
from aerotri.adjustment.carry_over import start_values_at, with_shared
from aerotri.adjustment.defects import checked_factor
from aerotri.adjustment.error_transfer import with_image_errors
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.parallel import blas_threads
from aerotri.adjustment.solve import Solution, SolveOptions
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import State
from aerotri.conventions import InputError
from aerotri.functional_model.rotation import logarithm
from aerotri.observations import Block
from aerotri.results.adjustment import Adjustment
from aerotri.results.model_part import OtherSet, SetDifference
from aerotri.statistics.covariance import cofactors, inner_datum, is_inner
from aerotri.statistics.summarise import count_observations, effective_redundancy, weighted_sum
from aerotri.strategies.deviation_estimation import with_estimated_deviations
from aerotri.strategies.field_estimation import with_estimated_fields
from aerotri.strategies.parameter_comparison import Candidate, with_candidate


@dataclass(frozen=True, eq=False)
class _Solved:
    """An adjustment with a set, as far as it is compared.

    Parameters
    ----------
    variance : (P, 3) m² of the points.
    """

    system: NormalSystem
    solution: Solution
    variance: np.ndarray


def set_difference(
    found: Adjustment, candidate: Candidate, weight: float, bare: Block, strips: np.ndarray | None
) -> SetDifference | None:
    """The block adjusted with another set from where the adjustment ended, and what differs; None where that fails.

    Parameters
    ----------
    weight : probability that the other set is the better one. bare : the block before its parameters were chosen.
    strips : (n,) names of the strips, None where some photograph has none.
    """
    if found.solution.status != "converged" or not found.local.outcome.sigma0 > 0.0:
        return None
    with blas_threads(0.0):
        other = _adjusted(found, candidate, bare, strips)
        if other is None:
            return None
        images, shared, points = _differences(found, other)
    if not all(np.isfinite(part).all() for part in (images, shared, points)):
        return None
    u = found.system.unknowns
    own = np.diagonal(found.local.points.covariance[u.points], axis1=1, axis2=2)
    return SetDifference(_measured(candidate.name, weight, points, own, other.variance), images, shared, points)


def _adjusted(found: Adjustment, candidate: Candidate, bare: Block, strips: np.ndarray | None) -> _Solved | None:
    """The same rays with the other set, begun where the adjustment ended."""
    u, state = found.system.unknowns, found.solution.state
    settings = replace(u.block.settings, collocation=bare.settings.collocation, deviations=bare.settings.deviations)
    adjustment = replace(settings.adjustment, parameter_groups=bare.settings.adjustment.parameter_groups)
    block = replace(u.block, settings=replace(settings, adjustment=adjustment))
    row, axis = np.nonzero(u.point_held)
    held = list(zip(u.points[row].tolist(), axis.tolist(), strict=True)) if len(row) else None
    robust = adjustment.robust if adjustment.robust != "data-snooping" else "off"
    options = SolveOptions(adjustment.max_iterations, robust)
    try:
        start = start_values_at(u, state)
        system, begun = build_system(with_candidate(block, candidate, strips), start, found.local.rays.status, held)
    except InputError:
        return None
    begun = with_shared(system.unknowns, u, begun, state)
    begun = with_image_errors(system, begun, found.system, state)
    system, solution = minimise_at_adjusted(system, begun, count_observations(system).redundancy, options)
    if solution.defects:
        return None
    system, solution = with_estimated_fields(system, solution, options)
    system, solution, _ = with_estimated_deviations(system, solution, options)
    return _with_variances(system, solution)


def _with_variances(system: NormalSystem, solution: Solution) -> _Solved | None:
    factor, defects = checked_factor(system, solution.state, solution.equations, solution.estimator)
    freedom = effective_redundancy(system, solution)
    if factor is None or defects or solution.status != "converged" or not freedom > 0.0:
        return None
    q = cofactors(system, solution.state, factor, solution.estimator).points
    variance = weighted_sum(system, solution) / freedom * np.diagonal(q, axis1=1, axis2=2)
    return _Solved(system, solution, variance)


def _differences(found: Adjustment, other: _Solved) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unknowns of the other set less those of the adjustment: photographs (n, 6), shared (s,), points (P, 3).

    Its image errors are said by the parameters of the set taken, as well as these can.
    """
    system, s = found.system, found.solution.state
    u, t = system.unknowns, other.solution.state
    there = with_shared(u, other.system.unknowns, State(t.centre, t.rotation, t.points, s.shared), t)
    there = with_image_errors(system, there, other.system, t)
    turned = logarithm(t.rotation @ np.swapaxes(s.rotation, 1, 2))
    images = np.concatenate([t.centre - s.centre, np.linalg.solve(u.turn(s), turned[:, :, None])[:, :, 0]], axis=1)
    images, shared, points = images * u.eo_free, there.shared - s.shared, t.points - s.points
    if not is_inner(system):
        return images, shared, points
    factor = system.factorise(found.solution.equations)
    inner = inner_datum(system, s, factor, found.solution.estimator)
    moved = inner.moved(images[..., None], shared[:, None], points[..., None])
    return moved[0][..., 0], moved[1][..., 0], moved[2][..., 0]


def _measured(name: str, weight: float, moved: np.ndarray, own: np.ndarray, other: np.ndarray) -> OtherSet:
    """How large differences of points (P, 3) m are, beside the variances (P, 3) m² of the two sets."""
    known = (np.isfinite(moved) & np.isfinite(own) & np.isfinite(other) & (own > 0.0)).all(axis=1)
    if not known.any():
        return OtherSet(name, weight)
    square, own, other = moved[known] ** 2, own[known], other[known]
    # each point in units of its own variance: one that hardly anything determines counts like any other
    explained = np.sum(np.abs(other - own) / own) / max(float(np.sum(square / own)), 1e-300)
    of_plan, of_height = (np.sqrt(np.mean(np.sum(square[:, axes], axis=1))) for axes in ([0, 1], [2]))
    ratios = square / own
    return OtherSet(
        name, weight, float(of_plan), float(of_height), float(np.sqrt(np.mean(ratios[:, :2]))),
        float(np.sqrt(np.mean(ratios[:, 2]))), float(max(1.0 - explained, 0.0)),
    )  # fmt: skip
