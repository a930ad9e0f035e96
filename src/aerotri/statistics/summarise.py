"""From a solution to the result record: σ, redundancy numbers, tests, groups, control and check points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerotri.adjustment import photograph_fields, position_errors
from aerotri.adjustment.joint_prior import JointPrior
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.robust import weights_and_costs
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.functional_model.additional_parameters import Parameter
from aerotri.functional_model.observed_unknowns import Rows
from aerotri.functional_model.rotation import angles_from_rotation
from aerotri.results.adjusted_block import (
    AdjustedBlock,
    GroundPointResults,
    ImageResults,
    ObservationGroup,
    ObservationResults,
    Outcome,
    PointResults,
    RayResults,
    SharedParameters,
)
from aerotri.results.normalised import normalised_residuals
from aerotri.statistics.covariance import Cofactors, cofactors, correlations, orientation_cofactors, total_correlations
from aerotri.statistics.external_reliability import ray_effects, row_effects
from aerotri.statistics.held_control import HeldTests, held_tests
from aerotri.statistics.ray_correlation import ray_correlation
from aerotri.statistics.reliability import detectable_share, suspected_blunders
from aerotri.statistics.rig_movements import movement_groups, rig_movements
from aerotri.statistics.rig_results import mounted_cameras
from aerotri.statistics.rolling_results import rolling_shutters
from aerotri.statistics.stated_sigma import sigma0_um

OF_POINTS = ("point", "constraint", position_errors.KIND, photograph_fields.KIND)
"""Kinds of shared parameters that belong to object points or single exposures and not to cameras or flights."""

INSEPARABLE = 0.999
"""Correlation beyond which two parameters are reported as one."""


@dataclass(frozen=True)
class Counts:
    """Observations, unknowns and conditions of an adjustment."""

    observations: int
    unknowns: int
    conditions: int

    @property
    def redundancy(self) -> int:
        return self.observations - self.unknowns + self.conditions


def count_observations(system: NormalSystem) -> Counts:
    """Counts of the adjustment that `system` stands for; an inner datum has a condition for all that is free."""
    u = system.unknowns
    held_observed = int(((u.prior_weight > 0.0) & ~u.point_held).sum())
    extras = sum(extra.count for extra in system.extras) + (0 if u.ties is None else u.ties.count)
    observations = 2 * len(u.rays.image) + held_observed + extras + system.priors.count
    conditions = u.motions.count if u.block.settings.adjustment.datum == "inner" else 0
    return Counts(observations, u.count + conditions, conditions)


def summarise(
    system: NormalSystem, solution: Solution, factor: Factor, ray_status: np.ndarray, warnings: tuple[str, ...]
) -> AdjustedBlock:
    """The result record of a solution.

    Parameters
    ----------
    factor : undamped, at the solution.
    ray_status : (m,) status of every ray, an index into `adjusted_block.RAY_STATUS`.
    """
    block, counts = system.unknowns.block, count_observations(system)
    q = cofactors(system, solution.state, factor, solution.estimator)
    vtpv, freedom = weighted_sum(system, solution), float(counts.redundancy) - turned_down(solution, q)
    sigma0 = float(np.sqrt(vtpv / freedom)) if freedom > 0.0 else np.nan
    outcome = Outcome(
        status=solution.status,
        message="" if solution.status == "converged" else _message(solution, sigma0),
        iterations=solution.iterations,
        sigma0=sigma0,
        sigma0_um=sigma0_um(sigma0, block, system.unknowns.rays.source),
        vtpv=vtpv,
        observations=counts.observations,
        unknowns=counts.unknowns,
        conditions=counts.conditions,
        redundancy=counts.redundancy,
        warnings=warnings,
    )
    return record_of(system, solution, q, outcome, held_tests(system, solution, factor), ray_status)


def record_of(
    system: NormalSystem, solution: Solution, q: Cofactors, outcome: Outcome, tests: HeldTests, ray_status: np.ndarray
) -> AdjustedBlock:
    """The result record of a solution whose cofactors and outcome are known.

    Parameters
    ----------
    tests : of held coordinates. ray_status : (m,) status of every ray.
    """
    block, sigma0 = system.unknowns.block, outcome.sigma0
    rays = _rays(system, solution, q, ray_status)
    points = _points(system, solution, q, rays, sigma0)
    control, check = _ground_points(system, q, points, tests)
    extra_groups, observations = _extra_results(system, solution, q)
    return AdjustedBlock(
        block=block,
        outcome=outcome,
        images=_images(system, solution, q, sigma0),
        points=points,
        rays=rays,
        parameters=shared_parameters(system, solution, q, sigma0),
        control=control,
        check=check,
        groups=tuple(_groups(system, solution, q, rays, control) + extra_groups),
        observations=observations,
        blunders=suspected_blunders(block, rays, control),
        effects=ray_effects(system, solution, q),
        rigs=mounted_cameras(system, solution, q, sigma0),
        rolling_shutters=rolling_shutters(system, solution, q, sigma0),
        rig_movements=rig_movements(system, solution, q.inverse, sigma0),
        ray_correlation=ray_correlation(block, rays),
    )


def _message(solution: Solution, sigma0: float) -> str:
    return f"no convergence within {solution.iterations} iterations, σ0 is {sigma0:.4g}"


def weighted_sum(system: NormalSystem, solution: Solution) -> float:
    """vᵀPv with the final weights: what the cost of a robust estimator is not."""
    if not solution.estimator.is_robust:
        return solution.equations.cost
    rays, equations = system.unknowns.rays, solution.equations
    squares = np.sum((equations.residual * rays.inv_sigma) ** 2, axis=1)
    robust_cost = weights_and_costs(solution.estimator, np.sqrt(squares))[1]
    return float(equations.cost - robust_cost.sum() + np.sum(equations.weight * squares))


def turned_down(solution: Solution, q: Cofactors) -> float:
    """Σ(1 − weight)·r, the share of the redundancy that robust weights take away.

    [D] vᵀPv over the rest, Σ weight·r, gives σ̂0 of the good observations: a ray switched off counts in neither sum, and
    of normal errors Huber, Danish, Cauchy and adaptive weights leave σ of the unknowns right within 4 %. Over the whole
    redundancy Cauchy's would be 10 % too small.
    """
    if not solution.estimator.is_robust:
        return 0.0
    return float(np.sum((1.0 - solution.equations.weight) * q.ray_redundancy.sum(axis=1)))


def effective_redundancy(system: NormalSystem, solution: Solution) -> float:
    """The redundancy less what robust weights take away, as if all rays had the same redundancy numbers."""
    counts, turned_down = count_observations(system), float(np.sum(1.0 - solution.equations.weight))
    return counts.redundancy - 2.0 * turned_down * counts.redundancy / max(counts.observations, 1)


def _images(system: NormalSystem, solution: Solution, q: Cofactors, sigma0: float) -> ImageResults:
    u, state, n = system.unknowns, solution.state, len(system.unknowns.block.images)
    centre, angles, covariance = np.full((n, 3), np.nan), np.full((n, 3), np.nan), np.full((n, 6, 6), np.nan)
    centre[u.images] = state.centre + u.origin
    angles[u.images] = angles_from_rotation(state.rotation, u.block.rotation)
    covariance[u.images] = sigma0**2 * orientation_cofactors(u, state, q.images)
    rays = np.zeros(n, dtype=np.int64)
    rays[u.images] = np.bincount(u.rays.image, minlength=len(u.images))
    return ImageResults(centre, angles, covariance, rays)


def _points(system: NormalSystem, solution: Solution, q: Cofactors, rays: RayResults, sigma0: float) -> PointResults:
    u = system.unknowns
    count = len(u.block.points)
    xyz, covariance = np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan)
    xyz[u.points] = solution.state.points + u.origin
    covariance[u.points] = sigma0**2 * q.points
    n_rays = np.zeros(count, dtype=np.int64)
    n_rays[u.points] = np.diff(u.rays.start)
    w = np.zeros(len(u.block.image_points))
    w[u.rays.source] = np.nan_to_num(np.abs(rays.w[u.rays.source])).max(axis=1)
    largest = np.zeros(count)
    np.maximum.at(largest, u.block.image_points.point, w)
    return PointResults(xyz, covariance, n_rays, np.where(n_rays > 0, largest, np.nan))


def _rays(system: NormalSystem, solution: Solution, q: Cofactors, status: np.ndarray) -> RayResults:
    u, equations = system.unknowns, solution.equations
    m = len(u.block.image_points)
    v, r, w = np.full((m, 2), np.nan), np.full((m, 2), np.nan), np.full((m, 2), np.nan)
    weight = np.full(m, np.nan)
    source = u.rays.source
    v[source] = -equations.residual
    r[source] = q.ray_redundancy
    w[source] = normalised_residuals(v[source], u.block.image_points.sigma[source], r[source])
    weight[source] = equations.weight
    return RayResults(v, r, w, weight, status)


def shared_parameters(system: NormalSystem, solution: Solution, q: Cofactors, sigma0: float) -> SharedParameters:
    """The shared parameters but for the coordinates of points and what conditions brought along."""
    shared = system.unknowns.shared
    weighted = np.isfinite(np.array(shared.sigma).reshape(-1))
    for field in shared.fields:
        weighted[field.columns] = True
    for deviation in system.priors.deviations:
        weighted[deviation.columns] = True
    labels = tuple(zip(shared.names, shared.groups, shared.kinds, shared.marks, strict=True))
    return parameters_of(labels, solution.state.shared, q.shared, weighted, sigma0)


def parameters_of(
    labels: Sequence[tuple[str, str, str, str]], value: np.ndarray, cofactor: np.ndarray, weighted: np.ndarray,
    sigma0: float,
) -> SharedParameters:  # fmt: skip
    """Shared parameters with σ and correlations, without those of points.

    Parameters
    ----------
    labels : (name, group, kind, mark) of each of the s parameters. value : (s,). cofactor : (s, s).
    weighted : (s,) bool, whether something is known of it beforehand.
    """
    columns = np.array(labels, dtype=object).reshape(len(labels), 4)
    rows = np.flatnonzero(~np.isin(columns[:, 2].astype(str), OF_POINTS))
    s, cofactor = len(rows), cofactor[np.ix_(rows, rows)]
    r = correlations(cofactor)
    off = np.abs(r - np.diag(np.diagonal(r))) if s else np.zeros((0, 0))
    partner = off.argmax(axis=1) if s > 1 else np.zeros(s, dtype=int)
    names, groups, kinds, marks = columns[rows].T
    lens = np.isin(kinds.astype(str), ("interior", "additional"))
    total = np.full(s, np.nan)
    total[lens] = total_correlations(cofactor[np.ix_(lens, lens)])
    one_group = len(set(groups.tolist())) <= 1
    shown = np.array([n if one_group else f"{n} ({g})" for n, g in zip(names, groups, strict=True)], dtype=object)
    return SharedParameters(
        names=names,
        groups=groups,
        kinds=kinds,
        marks=marks,
        value=value[rows],
        covariance=sigma0**2 * cofactor,
        max_correlation=r[np.arange(s), partner] if s > 1 else np.full(s, np.nan),
        max_correlation_with=shown[partner] if s > 1 else np.full(s, "", dtype=object),
        total_correlation=total,
        status=np.where(weighted[rows], "weighted", "estimated").astype(object),
        reason=np.full(s, "", dtype=object),
    )


def inseparable(parameters: SharedParameters) -> tuple[str, ...]:
    """Sentences about shared parameters that the block cannot tell apart: pairs, and the nodes of a grid together."""
    p, nodes = parameters, parameters.is_node
    pairs: dict[frozenset[str], float] = {}
    grids: dict[tuple[str, str], list[float]] = {}
    beyond = np.abs(np.nan_to_num(p.max_correlation)) > INSEPARABLE
    for k in np.flatnonzero(beyond & (p.status != "removed")):
        if nodes[k]:
            node = Parameter.of(p.names[k])
            size = node.item.partition("_")[0]
            grids.setdefault((f"{node.family}:{size}", str(p.groups[k])), []).append(float(p.max_correlation[k]))
        else:
            pair = frozenset((str(p.names[k]), str(p.max_correlation_with[k])))
            pairs.setdefault(pair, float(p.max_correlation[k]))
    said = [
        f"{' and '.join(sorted(pair))} cannot be told apart (correlation {_percent(r)})" for pair, r in pairs.items()
    ]
    for (grid, group), r in grids.items():
        said.append(
            f"{len(r)} values of {grid} ({group}) cannot be told from a neighbour (correlations up to "
            f"{_percent(max(r, key=abs))})"
        )
    return tuple(said)


def _percent(r: float) -> str:
    return f"{100.0 * r:.2f} %"


def _ground_points(
    system: NormalSystem, q: Cofactors, points: PointResults, tests: HeldTests
) -> list[GroundPointResults]:
    """Control and check points that were adjusted."""
    block, u = system.unknowns.block, system.unknowns
    row = np.full(len(block.points), -1)
    row[u.points] = np.arange(len(u.points))
    out = []
    for is_check in (False, True):
        k = np.flatnonzero((block.control.is_check == is_check) & (row[block.control.point] >= 0))
        point = block.control.point[k]
        difference = points.xyz[point] - block.control.xyz[k]
        known = np.isfinite(block.control.xyz[k])
        sigma_given = block.control.sigma[k]
        adjusted = np.where(known, points.sigma[point], np.nan)
        lone_sigma = None
        if is_check:
            r = np.full((len(k), 3), np.nan)
            w = difference / np.sqrt(adjusted**2 + sigma_given**2)
        else:
            held, lone_sigma = u.control_held[row[point]], tests.sigma[row[point]]
            weight = np.where(known, u.prior_weight[row[point]], np.nan)
            r = 1.0 - weight * np.diagonal(q.points[row[point]], axis1=1, axis2=2)
            r = np.where(held, 0.0, r)
            w = np.where(held, tests.w[row[point]], normalised_residuals(difference, sigma_given, r))
        out.append(GroundPointResults(point, difference, adjusted, r, w, points.rays[point], lone_sigma))
    return out


def _groups(
    system: NormalSystem, solution: Solution, q: Cofactors, rays: RayResults, control: GroundPointResults
) -> list[ObservationGroup]:
    """Image points by camera, control in plan and height, projection centres: redundancy and fit of each."""
    u, block = system.unknowns, system.unknowns.block
    groups = []
    source = u.rays.source
    camera = block.images.camera[block.image_points.image[source]]
    sigma = block.image_points.sigma[source]
    for index, cam in enumerate(block.cameras):
        own = camera == index
        if own.any():
            name = "image points" if len(block.cameras) == 1 else f"image points {cam.name}"
            v, weight = rays.v[source[own]], rays.weight[source[own]]
            pvv = float(np.sum(weight[:, None] * (v / sigma[own]) ** 2))
            apriori = 1e3 * float(np.median(sigma[own]))
            rms = 1e3 * float(np.sqrt(np.mean(v**2)))
            groups.append(_group(name, 2 * int(own.sum()), apriori, rms, float(q.ray_redundancy[own].sum()), pvv))
    if block.settings.adjustment.datum == "control" and len(control):
        given = {int(p): k for k, p in enumerate(block.control.point)}
        sigma_control = block.control.sigma[[given[int(p)] for p in control.point]]
        for name, axes in (("control plan", [0, 1]), ("control height", [2])):
            d, s, r = control.difference[:, axes], sigma_control[:, axes], control.r[:, axes]
            known = np.isfinite(d) & (s > 0.0)
            if known.any():
                pvv = float(np.sum((d[known] / s[known]) ** 2))
                rms = float(np.sqrt(np.mean(d[known] ** 2)))
                apriori = float(np.median(s[known]))
                groups.append(_group(name, int(known.sum()), apriori, rms, float(r[known].sum()), pvv))
    return groups + _prior_group(system, solution, q) + movement_groups(system, solution.state, q.inverse)


def _group(name: str, count: int, apriori: float, rms: float, redundancy: float, pvv: float) -> ObservationGroup:
    posteriori = apriori * float(np.sqrt(pvv / redundancy)) if redundancy > 1e-9 else np.nan
    return ObservationGroup(name, count, apriori, rms, redundancy, posteriori)


def _extra_results(
    system: NormalSystem, solution: Solution, q: Cofactors
) -> tuple[list[ObservationGroup], ObservationResults | None]:
    """Groups of the observations beside the image points, and their residuals one by one."""
    groups, parts = [], []
    for rows in system.whitened_rows(solution.state):
        cofactor = row_cofactors(rows, q)
        known = rows.inv_sigma > 0.0
        sigma = np.where(known, 1.0 / np.where(known, rows.inv_sigma, 1.0), np.nan)
        v, r = -rows.gap * sigma, np.where(known, 1.0 - cofactor, np.nan)
        groups.append(
            _group(
                rows.name, rows.count, float(np.median(sigma[known])), float(np.sqrt(np.mean(v[known] ** 2))),
                float(r[known].sum()), float(np.sum(rows.gap[known] ** 2)),
            )
        )  # fmt: skip
        labels = np.repeat(rows.labels[:, None], known.shape[1], axis=1)[known]
        components = np.broadcast_to(np.array(rows.components, dtype=object), known.shape)[known]
        names = np.full(len(labels), rows.name, dtype=object)
        size, on = row_effects(system, solution, q, rows)
        parts.append((names, labels, components, v[known], sigma[known], r[known], size[known], on[known]))
    if not parts:
        return groups, None
    names, labels, components, v, sigma, r, size, on = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    settings, w = system.unknowns.block.settings.adjustment, normalised_residuals(v, sigma, r)
    size = size * detectable_share(r, settings.alpha, settings.power)
    return groups, ObservationResults(names, labels, components, v, sigma, r, w, size, on)


def row_cofactors(rows: Rows, q: Cofactors) -> np.ndarray:
    """(g, k) cofactors of the whitened predictions."""
    cofactor = np.zeros(rows.gap.shape)
    own = rows.image >= 0
    image, e = rows.image[own], rows.by_image[own]
    cofactor[own] += np.einsum("gka,gab,gkb->gk", e, q.images[image], e)
    if len(q.shared):
        columns, s = np.where(rows.columns >= 0, rows.columns, 0), rows.by_shared
        cofactor += np.einsum("gkc,gcd,gkd->gk", s, q.shared[columns[:, :, None], columns[:, None, :]], s)
        mixed = np.swapaxes(q.image_shared, 1, 2)[image[:, None], columns[own]]
        cofactor[own] += 2.0 * np.einsum("gka,gca,gkc->gk", e, mixed, s[own])
    return cofactor


def _prior_group(system: NormalSystem, solution: Solution, q: Cofactors) -> list[ObservationGroup]:
    """Weighted interior elements and additional parameters; residuals in units of σ, for want of a common unit."""
    shared = system.unknowns.shared
    sigma = np.array(shared.sigma).reshape(-1)
    known = np.isfinite(sigma) & (np.array(shared.kinds, dtype=object) != "point").reshape(-1)
    fields = [_joint_group("collocation field", [field], solution, q) for field in system.priors.fields]
    if system.priors.deviations:
        fields.append(_joint_group("deviations of groups", system.priors.deviation_priors, solution, q))
    fields += [
        _joint_group("position errors in time", [prior], solution, q)
        for prior in system.unknowns.shared.position_errors
    ]
    if system.priors.photograph_fields:
        fields.append(_joint_group("errors of photographs", system.priors.photograph_fields, solution, q))
    if not known.any():
        return fields
    normed = ((solution.state.shared - np.array(shared.observed)) / sigma)[known]
    redundancy = float((1.0 - np.diagonal(q.shared)[known] / sigma[known] ** 2).sum())
    pvv = float(np.sum(normed**2))
    rms = float(np.sqrt(pvv / known.sum()))
    return [_group("weighted parameters", int(known.sum()), 1.0, rms, redundancy, pvv), *fields]


def _joint_group(name: str, priors: Sequence[JointPrior], solution: Solution, q: Cofactors) -> ObservationGroup:
    """Observations of shared parameters together, whitened; their redundancy is the effective number of parameters."""
    count, pvv, redundancy = sum(prior.rank for prior in priors), 0.0, 0.0
    for prior in priors:
        values, own = solution.state.shared[prior.columns], np.ix_(prior.columns, prior.columns)
        pvv += float(values @ prior.weight @ values)
        redundancy += prior.rank - float(np.sum(q.shared[own] * prior.weight))
    return _group(name, count, 1.0, float(np.sqrt(pvv / count)), redundancy, pvv)
