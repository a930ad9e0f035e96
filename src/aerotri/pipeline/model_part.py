"""The model part of σ, put into an adjustment."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

from aerotri.diagnosis.moving_errors import model_part_in_words
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.adjustment import Adjustment
from aerotri.results.in_crs import with_model_of
from aerotri.results.model_part import FIELD, GROUPS, ModelPart
from aerotri.statistics.cluster_fields import fitted_field, root_of_field
from aerotri.statistics.cluster_test import LEVEL
from aerotri.statistics.clusters import cluster_schemes
from aerotri.statistics.covariance import cofactors, inner_datum
from aerotri.statistics.model_part import (
    chosen_scheme,
    compare_few,
    compare_schemes,
    excess_of_clusters,
    excess_of_root,
    growth_of,
    spread_over_block,
    squares_by,
    why_none,
    why_not,
    with_ratios,
)


def with_model_part(found: Adjustment) -> Adjustment:
    """The adjustment with the model part of σ where groups of photographs share errors; else why there is none."""
    begun = time.perf_counter()
    system, solution, sigma0 = found.system, found.solution, found.local.outcome.sigma0
    u = system.unknowns
    reason = why_not(u.block.settings.adjustment.model_part, len(u.images), solution.status, sigma0)
    if reason:
        return _with(found, replace(found.local, model_part=ModelPart(reason=reason)), begun)
    factor = system.factorise(solution.equations)
    centre = solution.state.centre
    schemes = cluster_schemes(u.block, u.images, centre)
    tests = compare_schemes(schemes, centre, sigma0, partial(squares_by, system, solution, factor))
    tests, fields = compare_few(schemes, tests, centre, partial(fitted_field, system, solution, factor, sigma0))
    part = ModelPart(level=LEVEL, tests=tests)
    chosen = chosen_scheme(tests)
    if chosen is None:
        return _with(found, replace(found.local, model_part=replace(part, reason=why_none(tests))), begun)
    clusters = schemes[chosen]
    part = replace(part, scheme=clusters.scheme, clusters=len(clusters), method=FIELD if chosen in fields else GROUPS)
    inner = None
    if u.block.settings.adjustment.datum == "inner" and u.motions.count:
        inner = inner_datum(system, solution.state, factor, solution.estimator)
    if chosen in fields:
        root, squares = root_of_field(system, solution, factor, clusters, fields[chosen], inner)
        excess = excess_of_root(system, solution, root, squares)
    elif inner is not None:
        q = cofactors(system, solution.state, factor, solution.estimator)
        excess = excess_of_clusters(system, solution, factor, clusters, sigma0, (q.images, q.shared, q.points), inner)
    else:
        of_images = factor.inverse_on_pattern().blocks[: len(u.images)].copy()
        q = of_images, factor.border_inverse(), found.local.points.covariance[u.points] / sigma0**2
        excess = excess_of_clusters(system, solution, factor, clusters, sigma0, q)
    part = with_ratios(part, growth_of(found.local.points.covariance[u.points], excess.points))
    local = replace(spread_over_block(u, found.local, excess.images, excess.shared, excess.points), model_part=part)
    return replace(_with(found, local, begun), model=excess.root)


def _with(found: Adjustment, local: AdjustedBlock, begun: float) -> Adjustment:
    """The adjustment with the model part of `local` in both frames, told among the warnings, its time counted."""
    said = model_part_in_words(local.model_part) if local.model_part is not None else ""

    def told(result: AdjustedBlock) -> AdjustedBlock:
        o = result.outcome
        timings = dict(o.timings_s)
        if "statistics" in timings:
            timings["statistics"] += time.perf_counter() - begun
        warnings = o.warnings if not said or said in o.warnings else (*o.warnings, said)
        return replace(result, outcome=replace(o, warnings=warnings, timings_s=timings))

    local = told(with_model_of(local, local, None))
    result = local if found.frame is None else told(with_model_of(found.result, local, found.frame))
    return replace(found, local=local, result=result)
