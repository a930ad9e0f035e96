"""The model part of σ, put into an adjustment."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.diagnosis.moving_errors import control_in_words, model_part_in_words
from aerotri.diagnosis.other_set import other_set_in_words
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.adjustment import Adjustment
from aerotri.results.in_crs import with_model_of
from aerotri.results.model_part import FIELD, GROUPS, ControlEvidence, ModelPart, OtherSet, SetDifference
from aerotri.statistics.cluster_fields import fitted_field, root_of_field
from aerotri.statistics.cluster_test import LEVEL
from aerotri.statistics.clusters import cluster_schemes
from aerotri.statistics.common_modes import common_parts
from aerotri.statistics.control_evidence import (
    FREEDOM_OF_FIELDS,
    ControlEquations,
    along_model,
    control_equations,
    evidence,
    model_of_control,
    scale_of_model,
)
from aerotri.statistics.covariance import cofactors, inner_datum
from aerotri.statistics.model_part import (
    Excess,
    chosen_scheme,
    compare_few,
    compare_schemes,
    excess_of_clusters,
    excess_of_root,
    growth_of,
    of_few,
    spread_over_block,
    squares_by,
    why_none,
    why_not,
    with_ratios,
)


@dataclass(frozen=True, eq=False)
class _Stage:
    """An adjustment and its factor, and what its control points say (None where there are none)."""

    found: Adjustment
    factor: Factor
    control: ControlEquations | None

    @property
    def equations(self) -> tuple[NormalSystem, Solution, Factor]:
        return self.found.system, self.found.solution, self.factor

    @property
    def sigma0(self) -> float:
        return self.found.local.outcome.sigma0

    def again(self) -> _Stage:
        """The same with a new factor, where another took its place."""
        return replace(self, factor=self.found.system.factorise(self.found.solution.equations))


def with_model_part(found: Adjustment) -> Adjustment:
    """The adjustment with the model part of σ where groups of photographs share errors; else why there is none."""
    begun = time.perf_counter()
    system, solution, sigma0 = found.system, found.solution, found.local.outcome.sigma0
    u = system.unknowns
    settings = u.block.settings.adjustment
    reason = why_not(settings.model_part, len(u.images), solution.status, sigma0)
    if reason and not _counts(found.other):
        return _with(found, replace(found.local, model_part=ModelPart(reason=reason, other_set=_told(found))), begun)
    factor = system.factorise(solution.equations)
    says = not reason and not settings.is_free
    stage = _Stage(found, factor, control_equations(system, solution, factor) if says else None)
    part, excess = (ModelPart(reason=reason), None) if reason else _of_clusters(stage)
    stage = stage if excess is None else stage.again()
    excess = _beside(excess, found)
    part = replace(part, control=_control_says(stage, part, excess), other_set=_told(found))
    covariance = found.local.points.covariance[u.points]
    if says:
        model = None if excess is None else (excess.root, excess.points)
        part = replace(part, common=common_parts(*stage.equations, covariance, sigma0, model))
    if excess is None:
        return _with(found, replace(found.local, model_part=part), begun)
    part = with_ratios(part, growth_of(covariance, excess.points))
    local = replace(spread_over_block(u, found.local, excess.images, excess.shared, excess.points), model_part=part)
    return replace(_with(found, local, begun), model=excess.root)


def _told(found: Adjustment) -> OtherSet | None:
    return None if found.other is None else found.other.other


def _counts(difference: SetDifference | None) -> bool:
    """Whether another set of parameters makes σ larger."""
    return difference is not None and difference.other.share > 0.0


def _beside(excess: Excess | None, found: Adjustment) -> Excess | None:
    """The model part with what another set of additional parameters would change."""
    difference = found.other
    if difference is None or not _counts(difference):
        return excess
    root = difference.root
    columns = root.points.astype(float)
    own = excess_of_root(found.system, found.solution, root, columns @ np.swapaxes(columns, 1, 2))
    if excess is None:
        return own
    return Excess(
        excess.images + own.images, excess.shared + own.shared, excess.points + own.points,
        replace(excess.root, beside=root),
    )  # fmt: skip


def _of_clusters(stage: _Stage) -> tuple[ModelPart, Excess | None]:
    """The model part that groups of photographs show."""
    system, solution, factor = stage.equations
    u, sigma0, centre = system.unknowns, stage.sigma0, solution.state.centre
    schemes = cluster_schemes(u.block, u.images, centre)
    tests = compare_schemes(schemes, centre, sigma0, partial(squares_by, system, solution, factor))
    tests, fields = compare_few(schemes, tests, centre, partial(fitted_field, system, solution, factor, sigma0))
    part, chosen = ModelPart(level=LEVEL, tests=tests), chosen_scheme(tests)
    if chosen is None:
        return replace(part, reason=why_none(tests)), None
    clusters = schemes[chosen]
    part = replace(part, scheme=clusters.scheme, clusters=len(clusters), method=FIELD if chosen in fields else GROUPS)
    inner = None
    if u.block.settings.adjustment.datum == "inner" and u.motions.count:
        inner = inner_datum(system, solution.state, factor, solution.estimator)
    if chosen in fields:
        root, squares = root_of_field(system, solution, factor, clusters, fields[chosen], inner)
        return part, excess_of_root(system, solution, root, squares)
    if inner is not None:
        of_all = cofactors(system, solution.state, factor, solution.estimator)
        q = of_all.images, of_all.shared, of_all.points
    else:
        of_images = factor.inverse_on_pattern().blocks[: len(u.images)].copy()
        q = of_images, factor.border_inverse(), stage.found.local.points.covariance[u.points] / sigma0**2
    return part, excess_of_clusters(system, solution, factor, clusters, sigma0, q, inner)


def _control_says(stage: _Stage, part: ModelPart, excess: Excess | None) -> ControlEvidence | None:
    """What control points say of σ and of the model part; neither is changed by it, as in an adjustment in parts."""
    if stage.control is None:
        return None
    of_groups = part.method == GROUPS
    widening, scale = of_few(part.clusters) if of_groups else 1.0, 1.0
    root = None if excess is None else excess.root
    of_photographs, of_sets = (
        (replace(root, beside=None), root.beside) if root is not None and part.counts else (None, root)
    )
    of_model = model_of_control(stage.control, of_photographs, widening, stage.sigma0)
    power, squares = along_model(stage.control, of_model, stage.sigma0)
    if of_photographs is not None and len(squares):
        scale = scale_of_model(power, squares, part.clusters - 1 if of_groups else FREEDOM_OF_FIELDS)
    whole = widening * of_model + model_of_control(stage.control, of_sets, 1.0, stage.sigma0)
    return replace(evidence(stage.control, whole, stage.sigma0), scale=scale)


def _with(found: Adjustment, local: AdjustedBlock, begun: float) -> Adjustment:
    """The adjustment with the model part of `local` in both frames, told among the warnings, its time counted."""
    part = local.model_part or ModelPart()
    words = model_part_in_words(part), other_set_in_words(part), control_in_words(part.control)
    said = [text for text in words if text]

    def told(result: AdjustedBlock) -> AdjustedBlock:
        o = result.outcome
        timings = dict(o.timings_s)
        if "statistics" in timings:
            timings["statistics"] += time.perf_counter() - begun
        warnings = (*o.warnings, *(text for text in said if text not in o.warnings))
        return replace(result, outcome=replace(o, warnings=warnings, timings_s=timings))

    local = told(with_model_of(local, local, None))
    result = local if found.frame is None else told(with_model_of(found.result, local, found.frame))
    return replace(found, local=local, result=result)
